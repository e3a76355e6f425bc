//! Arrays of numbers from files, in the place of tables and lists of a request.

use std::path::Path;

use chladni_mesh::npy::NpyHeader;
use chladni_work::table::Table;
use serde_json::{Number, Value, json};

use super::{CliError, read_bytes};

/// Members of requests that are tables; a file in any other place is a list, or a list of rows.
const TABLES: &[&str] =
    &["functions", "carry.functions", "descriptors.source", "descriptors.target", "field", "alignment.to"];

/// Numbers of a file, row after row.
#[derive(Debug, PartialEq)]
pub struct Array {
    /// The length of each axis.
    shape: Vec<usize>,
    values: Vec<f64>,
}

impl Array {
    /// Reads an NPY array of one or two axes, or numbers separated by commas (`.csv`), a row in each line.
    ///
    /// # Errors
    /// [`CliError::Mesh`] names the file, and what does not fit.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let (bytes, name) = read_bytes(path)?;
        let refused = |reason: String| CliError::mesh(path, reason);
        match name.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
            true => of_lines(&bytes).map_err(refused),
            false => of_npy(&bytes).map_err(refused),
        }
    }

    /// As a table: one axis is one column.
    pub fn into_table(self) -> Table {
        Table { columns: self.shape.get(1).copied().unwrap_or(1), values: self.values }
    }

    /// As lists of JSON, whole numbers as such.
    fn into_lists(self) -> Value {
        let whole = self.values.iter().all(|x| x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(x));
        let number = |&x: &f64| match whole {
            true => Value::from(x as u32),
            false => Number::from_f64(x).map_or(Value::Null, Value::Number),
        };
        match self.shape[..] {
            [_, columns] => {
                let rows = self.values.chunks(columns.max(1));
                rows.map(|row| Value::Array(row.iter().map(number).collect())).collect()
            }
            _ => self.values.iter().map(number).collect(),
        }
    }
}

fn of_npy(bytes: &[u8]) -> Result<Array, String> {
    let (NpyHeader { descriptor, fortran, shape }, data) = NpyHeader::parse(bytes)
        .map_err(|error| format!("{error}; arrays are read from .npy, and from .csv with a row in each line"))?;
    let values: Option<Vec<f64>> = match descriptor.as_str() {
        "<f8" => numbers(data, f64::from_le_bytes),
        "<f4" => numbers(data, |bytes| f64::from(f32::from_le_bytes(bytes))),
        "<i4" => numbers(data, |bytes| f64::from(i32::from_le_bytes(bytes))),
        "<u4" => numbers(data, |bytes| f64::from(u32::from_le_bytes(bytes))),
        "<i8" => numbers(data, |bytes| i64::from_le_bytes(bytes) as f64),
        "<u8" => numbers(data, |bytes| u64::from_le_bytes(bytes) as f64),
        other => return Err(format!("numbers of the type {other} are not read; f4, f8, i4, i8, u4 and u8 are")),
    };
    let needed = shape.iter().try_fold(1usize, |all, &axis| all.checked_mul(axis));
    let values = values.filter(|values| Some(values.len()) == needed).ok_or("its bytes do not fill its shape")?;
    match shape[..] {
        [_] | [_, _] => {}
        _ => return Err(format!("it has {} axes; one or two are needed", shape.len())),
    }
    let values = match shape[..] {
        [rows, columns] if fortran => (0..rows * columns).map(|i| values[i % columns * rows + i / columns]).collect(),
        _ => values,
    };
    Ok(Array { shape, values })
}

/// Numbers of so many bytes each; nothing where some are left over.
fn numbers<const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> f64) -> Option<Vec<f64>> {
    let (whole, rest) = data.as_chunks::<N>();
    rest.is_empty().then(|| whole.iter().map(|&bytes| number(bytes)).collect())
}

fn of_lines(bytes: &[u8]) -> Result<Array, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
    let (mut values, mut columns, mut rows) = (Vec::new(), 0, 0);
    for (at, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let before = values.len();
        for entry in line.split(',') {
            let number = entry.trim().parse::<f64>();
            values.push(number.map_err(|_| format!("line {}: {:?} is no number", at + 1, entry.trim()))?);
        }
        let found = values.len() - before;
        if rows > 0 && found != columns {
            return Err(format!("line {}: it has {found} numbers, and those before {columns}", at + 1));
        }
        (columns, rows) = (found, rows + 1);
    }
    Ok(Array { shape: if columns == 1 { vec![rows] } else { vec![rows, columns] }, values })
}

/// Puts arrays into a request: a text `@FILE.npy` or `@FILE.csv`, in the place of a table or a list, stands for what
/// the file has.
///
/// # Errors
/// Those of [`Array::read`].
pub fn filled(request: Value) -> Result<Value, CliError> {
    within("", request)
}

fn within(place: &str, value: Value) -> Result<Value, CliError> {
    match value {
        Value::String(text) => match text.strip_prefix('@').filter(|name| is_array(name)) {
            None => Ok(Value::String(text)),
            Some(name) => {
                let array = Array::read(Path::new(name))?;
                if !TABLES.contains(&place) {
                    return Ok(array.into_lists());
                }
                let Table { columns, values } = array.into_table();
                Ok(json!({ "columns": columns, "values": values }))
            }
        },
        Value::Object(members) => {
            let inner = |name: &str| if place.is_empty() { name.to_owned() } else { format!("{place}.{name}") };
            members.into_iter().map(|(name, value)| Ok((name.clone(), within(&inner(&name), value)?))).collect()
        }
        other => Ok(other),
    }
}

fn is_array(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let bare = name.strip_suffix(".gz").unwrap_or(&name);
    bare.ends_with(".npy") || bare.ends_with(".csv")
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_spectral::formats::npz::npy;

    #[test]
    fn arrays_are_tables_or_lists_by_where_they_stand() {
        let folder = tempfile::tempdir().unwrap();
        let written = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            format!("@{}", path.display())
        };
        let by_columns: Vec<u8> = [1.5f64, 3.0, 5.0, 2.0, 4.0, 6.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let functions = written("f.npy", &npy("<f8", true, &[3, 2], &by_columns));
        let vertices: Vec<u8> = [7i64, 9].iter().flat_map(|x| x.to_le_bytes()).collect();
        let vertices = written("v.npy", &npy("<i8", false, &[2], &vertices));
        let pairs = written("p.csv", b"1, 2\n\n3,4\n");
        let found = filled(json!({
            "functions": functions, "vertices": vertices, "landmarks": pairs, "name": "@home", "carry": {"functions": functions}
        }));
        let table = json!({"columns": 2, "values": [1.5, 2.0, 3.0, 4.0, 5.0, 6.0]});
        let expected = json!({
            "functions": table, "vertices": [7, 9], "landmarks": [[1, 2], [3, 4]], "name": "@home", "carry": {"functions": table}
        });
        assert_eq!(found.unwrap(), expected);
    }

    #[test]
    fn what_is_no_array_is_told_by_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            Array::read(&path).unwrap_err().to_string()
        };
        for (name, bytes, expected) in [
            ("a.npy", b"PK\x03\x04 an archive".to_vec(), "a.npy: it is not an NPY array"),
            ("b.npy", npy("<c16", false, &[1], &[0; 16]), "<c16"),
            ("c.npy", npy("<f8", false, &[3], &[0; 16]), "do not fill its shape"),
            ("d.npy", npy("<f8", false, &[1, 1, 1], &[0; 8]), "3 axes"),
            ("e.csv", b"1,2\n3\n".to_vec(), "line 2: it has 1 numbers"),
            ("f.csv", b"x,y\n1,2\n".to_vec(), "line 1: \"x\" is no number"),
        ] {
            let told = refused(name, &bytes);
            assert!(told.contains(expected), "{told}");
        }
    }
}
