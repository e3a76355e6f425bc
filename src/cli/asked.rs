//! A job as the command line asks for it, before the mesh is known, and numbers that stand in files.

use std::ops::Deref;
use std::path::Path;

use chladni_mesh::npy::NpyHeader;
use chladni_work::JobParameters;
use chladni_work::packed::Packed;
use serde_json::{Value, json};

use super::{CliError, read_bytes};

/// A job whose functions are still in the numbering of the file, where dropped vertices and faces need no value.
///
/// As parameters it has some value there, so that all else can be told before the mesh is read.
#[derive(Debug, Clone)]
pub struct Asked {
    job: JobParameters,
    /// What was given, where it has gaps.
    given: Option<Packed>,
}

impl Asked {
    /// Reads parameters.
    ///
    /// # Errors
    /// [`CliError::Parameters`] names what does not fit, whatever the mesh is.
    pub fn parse(kind: &str, given: &Value) -> Result<Self, CliError> {
        let filled = without_gaps(given);
        let job = JobParameters::parse(kind, filled.as_ref().unwrap_or(given))?.undivided()?;
        Ok(Self { job, given: filled.map(|_| Packed::from(given)) })
    }

    /// What was given, in which NaN stands where nothing was.
    pub fn given(&self) -> Packed {
        self.given.clone().unwrap_or_else(|| Packed::from(&self.job.canonical()))
    }
}

/// Where parameters name vertices or faces.
const NAMES: [&[&str]; 3] = [&["clamped"], &["operator", "weighted", "fixed"], &["examples"]];

impl Asked {
    /// Whether anything in the parameters depends on how vertices and faces are numbered.
    pub fn is_numbered(&self) -> bool {
        let mut given = self.given();
        let mut paths = FUNCTIONS.iter().map(|(path, _)| *path).chain(NAMES);
        paths.any(|path| match given.at_mut(path) {
            Some(Packed::Whole(_) | Packed::Real(_)) => true,
            Some(Packed::List(list)) => !list.is_empty(),
            _ => false,
        })
    }
}

impl From<JobParameters> for Asked {
    fn from(job: JobParameters) -> Self {
        Self { job, given: None }
    }
}

impl Deref for Asked {
    type Target = JobParameters;

    fn deref(&self) -> &JobParameters {
        &self.job
    }
}

/// Functions on vertices and faces among the parameters of jobs, with what may stand where a file has no value.
const FUNCTIONS: [(&[&str], &[f64]); 4] = [
    (&["operator", "hamiltonian", "potential", "values"], &[0.0]),
    (&["operator", "weighted", "scalars"], &[1.0]),
    (&["operator", "weighted", "tensors"], &[1.0, 0.0, 1.0]),
    (&["weights"], &[1.0]),
];

/// The same parameters with some value in place of each `null` in a function; nothing where there is none.
pub fn without_gaps(given: &Value) -> Option<Value> {
    let mut filled = given.clone();
    let mut found = false;
    let mut fill = |list: Option<&mut Value>, with: &[f64]| {
        for (at, entry) in list.and_then(Value::as_array_mut).into_iter().flatten().enumerate() {
            if entry.is_null() {
                *entry = json!(with[at % with.len()]);
                found = true;
            }
        }
    };
    for (path, with) in FUNCTIONS {
        fill(path.iter().try_fold(&mut filled, |place, name| place.get_mut(name)), with);
    }
    for example in filled.get_mut("examples").and_then(Value::as_array_mut).into_iter().flatten() {
        fill(Some(example), &[0.0]);
    }
    found.then_some(filled)
}

/// Numbers of a file: those of a text, with spaces or line breaks between them, or of an NPY array, as floats of either
/// precision, of n or n × 1. NaN stands for none.
///
/// # Errors
/// [`CliError::File`] where it cannot be read, [`CliError::Usage`] where it holds something else.
pub fn numbers_of(path: &Path) -> Result<Vec<f64>, CliError> {
    let refused = |reason: String| CliError::Usage(format!("{}: {reason}", path.display()));
    let (bytes, _) = read_bytes(path)?;
    if bytes.starts_with(b"\x93NUMPY") {
        let (NpyHeader { descriptor, shape, .. }, data) =
            NpyHeader::parse(&bytes).map_err(|error| refused(error.to_string()))?;
        let count = match shape[..] {
            [count] | [count, 1] => count,
            _ => return Err(refused(format!("the array has the shape {shape:?}; n or n × 1 is needed"))),
        };
        let numbers: Vec<f64> = match descriptor.as_str() {
            "<f8" => data.as_chunks::<8>().0.iter().map(|&number| f64::from_le_bytes(number)).collect(),
            "<f4" => data.as_chunks::<4>().0.iter().map(|&number| f32::from_le_bytes(number).into()).collect(),
            other => return Err(refused(format!("numbers of the type {other} are not read; <f4 and <f8 are"))),
        };
        let width = if descriptor == "<f8" { 8 } else { 4 };
        return match count.checked_mul(width) == Some(data.len()) {
            true => Ok(numbers),
            false => Err(refused(format!("{} bytes do not fill its shape", data.len()))),
        };
    }
    let text = std::str::from_utf8(&bytes)
        .map_err(|_| refused("this is neither a text of numbers nor an NPY array".to_owned()))?;
    let number = |word: &str| word.parse().map_err(|_| refused(format!("\"{word}\" is not a number")));
    text.split_whitespace().map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_stay_gaps_and_what_else_does_not_fit_is_told_at_once() {
        let potential = json!({"operator": {"hamiltonian": {"potential": {"values": [1.0, null, 2.0]}}}, "count": 2});
        let asked = Asked::parse("eigenbasis", &potential).unwrap();
        assert_eq!(asked.kind(), "eigenbasis");
        let mut given = asked.given();
        let values = given.at_mut(&["operator", "hamiltonian", "potential", "values"]).unwrap().numbers().unwrap();
        assert!(values[0] == 1.0 && values[1].is_nan() && values[2] == 2.0);
        for (kind, gaps) in [
            ("eigenbasis", json!({"operator": {"weighted": {"scalars": [null, 2.0]}}, "method": "hsim"})),
            ("eigenbasis", json!({"operator": {"weighted": {"tensors": [null, null, null]}}, "method": "hsim"})),
            ("field_basis", json!({"weights": [1.0, null]})),
            ("field_basis", json!({"examples": [[1.0, null]]})),
        ] {
            assert!(Asked::parse(kind, &gaps).is_ok_and(|asked| asked.given.is_some()), "{gaps}");
        }
        for wrong in [
            json!({"operator": {"hamiltonian": {"potential": {"values": [null]}}}, "count": 0}),
            json!({"operator": {"weighted": {"scalars": [null, -1.0]}}, "method": "hsim"}),
            json!({"operator": {"weighted": {"scalars": [null, "a"]}}, "method": "hsim"}),
            json!({"count": null, "colour": 1}),
        ] {
            assert!(Asked::parse("eigenbasis", &wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_depends_on_the_numbering_is_known() {
        for (kind, parameters, numbered) in [
            ("eigenbasis", json!({"count": 5}), false),
            ("eigenbasis", json!({"operator": {"weighted": {"fixed": [3]}}, "method": "hsim"}), true),
            ("eigenbasis", json!({"operator": {"hamiltonian": {"potential": {"values": [0.5, null]}}}}), true),
            ("eigenbasis", json!({"operator": {"hamiltonian": {"potential": {"curvature": {"t": 1.0}}}}}), false),
            ("vibration_basis", json!({"thickness": 0.1, "clamped": []}), false),
            ("vibration_basis", json!({"thickness": 0.1, "clamped": [2]}), true),
            ("field_basis", json!({"weights": [1.0]}), true),
        ] {
            assert_eq!(Asked::parse(kind, &parameters).unwrap().is_numbered(), numbered, "{parameters}");
        }
    }

    #[test]
    fn numbers_come_as_text_or_as_an_array_and_others_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("numbers");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            numbers_of(&path).map_err(|error| error.to_string())
        };
        let npy = |descriptor: &str, shape: &[usize], data: &[u8]| {
            chladni_spectral::formats::npz::npy(descriptor, false, shape, data)
        };
        let doubles: Vec<u8> = [0.5f64, -2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let singles: Vec<u8> = [0.5f32, -2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let expected = Ok(vec![0.5, -2.0]);
        for bytes in [
            b"0.5\n -2e0\n".to_vec(),
            npy("<f8", &[2], &doubles),
            npy("<f8", &[2, 1], &doubles),
            npy("<f4", &[2], &singles),
        ] {
            assert_eq!(read(&bytes), expected);
        }
        assert!(read(b"nan 1").unwrap()[0].is_nan());
        for (bytes, told) in [
            (npy("<f8", &[1, 2], &doubles), "n × 1 is needed"),
            (npy("<f8", &[3], &doubles), "16 bytes do not fill"),
            (npy("<i8", &[2], &doubles), "<f4 and <f8"),
            (vec![0xff, 0x00], "neither a text"),
            (b"1 x".to_vec(), "\"x\" is not a number"),
        ] {
            let refused = read(&bytes).unwrap_err();
            assert!(refused.contains(told) && refused.contains("numbers: "), "{refused}");
        }
    }
}
