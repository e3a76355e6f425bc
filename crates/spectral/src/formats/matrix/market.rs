//! Matrix Market: coordinates, or an array of one column for a diagonal; real, integer or pattern; general or
//! symmetric.

use super::{MatrixError, MatrixFile, MatrixLimits, from_triplets};

fn refuse(line: usize, reason: impl Into<String>) -> MatrixError {
    MatrixError::Line { line, reason: reason.into() }
}

/// What the first line says.
struct Banner {
    coordinate: bool,
    pattern: bool,
    symmetric: bool,
}

pub(super) fn read(bytes: &[u8], limits: &MatrixLimits) -> Result<MatrixFile, MatrixError> {
    let text = std::str::from_utf8(bytes).map_err(|_| refuse(1, "it is not text"))?;
    let mut lines = (1..).zip(text.lines());
    let banner = banner(lines.next().map_or("", |line| line.1))?;
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('%'));
    let (at, sizes) = lines.next().ok_or_else(|| refuse(1, "the sizes are missing"))?;
    let sizes: Vec<usize> = sizes
        .split_whitespace()
        .map(|word| word.parse().map_err(|_| refuse(at, format!("{} is not a size", shown(word)))))
        .collect::<Result<_, _>>()?;
    match (banner.coordinate, &sizes[..]) {
        (true, &[rows, columns, entries]) => coordinates(&banner, [rows, columns, entries], at, lines, limits),
        (false, &[rows, columns]) => array([rows, columns], at, lines, limits),
        (true, _) => Err(refuse(at, "rows, columns and the number of entries are needed")),
        (false, _) => Err(refuse(at, "rows and columns are needed")),
    }
}

fn banner(line: &str) -> Result<Banner, MatrixError> {
    let words: Vec<String> = line.split_whitespace().map(str::to_ascii_lowercase).collect();
    let [_, object, layout, field, symmetry] = &words[..] else {
        return Err(refuse(1, "`%%MatrixMarket matrix LAYOUT FIELD SYMMETRY` is needed"));
    };
    let one_of = |word: &str, known: &[&str]| {
        if known.contains(&word) {
            return Ok(());
        }
        Err(refuse(1, format!("{} is not supported; {} is", shown(word), known.join(", "))))
    };
    one_of(object, &["matrix"])?;
    one_of(layout, &["coordinate", "array"])?;
    one_of(field, &["real", "double", "integer", "pattern"])?;
    one_of(symmetry, &["general", "symmetric"])?;
    Ok(Banner { coordinate: layout == "coordinate", pattern: field == "pattern", symmetric: symmetry == "symmetric" })
}

fn coordinates<'a>(
    banner: &Banner,
    [rows, columns, entries]: [usize; 3],
    at: usize,
    lines: impl Iterator<Item = (usize, &'a str)>,
    limits: &MatrixLimits,
) -> Result<MatrixFile, MatrixError> {
    limits.check(rows, columns, entries)?;
    let (mut places, mut indices, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let (mut last, mut found) = (at, 0usize);
    for (line, text) in lines {
        found += 1;
        if found > entries {
            return Err(refuse(line, format!("there are more than {entries} entries")));
        }
        let mut words = text.split_whitespace();
        let mut place = |most: usize| {
            let word = words.next().unwrap_or("");
            let number: usize = word.parse().map_err(|_| refuse(line, format!("{} is not a position", shown(word))))?;
            // They are counted from 1.
            number
                .checked_sub(1)
                .filter(|&number| number < most)
                .map(|number| number as u32)
                .ok_or_else(|| refuse(line, format!("an entry lies in row or column {number} of {most}")))
        };
        let (row, column) = (place(rows)?, place(columns)?);
        let value = if banner.pattern { 1.0 } else { number(line, words.next().unwrap_or(""))? };
        if words.next().is_some() {
            return Err(refuse(line, "it has more than one entry"));
        }
        if banner.symmetric && column > row {
            return Err(refuse(line, "the entry lies above the diagonal of a symmetric matrix"));
        }
        places.push(row);
        indices.push(column);
        values.push(value);
        if banner.symmetric && row != column {
            places.push(column);
            indices.push(row);
            values.push(value);
        }
        limits.check(rows, columns, values.len())?;
        last = line;
    }
    if found < entries {
        return Err(refuse(last, format!("the text ends after {found} of {entries} entries")));
    }
    from_triplets(rows, columns, (&places, &indices, &values)).map(MatrixFile::Sparse)
}

fn array<'a>(
    [rows, columns]: [usize; 2],
    at: usize,
    lines: impl Iterator<Item = (usize, &'a str)>,
    limits: &MatrixLimits,
) -> Result<MatrixFile, MatrixError> {
    if columns != 1 && rows != 1 {
        return Err(refuse(at, format!("an array of {rows} × {columns} is not sparse; one column is a diagonal")));
    }
    let count = rows.max(columns);
    limits.check(count, 1, count)?;
    let mut values = Vec::new();
    let mut last = at;
    for (line, text) in lines {
        last = line;
        for word in text.split_whitespace() {
            values.push(number(line, word)?);
        }
        if values.len() > count {
            return Err(refuse(line, format!("there are more than {count} numbers")));
        }
    }
    if values.len() < count {
        return Err(refuse(last, format!("the text ends after {} of {count} numbers", values.len())));
    }
    Ok(MatrixFile::Vector(values))
}

fn number(line: usize, word: &str) -> Result<f64, MatrixError> {
    word.parse().map_err(|_| refuse(line, format!("{} is not a number", shown(word))))
}

/// A word as it can be shown.
fn shown(word: &str) -> String {
    format!("{:?}", word.chars().take(30).collect::<String>())
}
