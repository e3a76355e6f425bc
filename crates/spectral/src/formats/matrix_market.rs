//! A basis as MatrixMarket files in one archive.

use std::io::{BufWriter, Write};

use chladni_algebra::{MassMatrix, SparseMatrix, WeightedMass};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::npz::FormatError;
use crate::basis::{Basis, Compact, Functions, Real, Visit};

fn coordinates<T: std::fmt::Display>(matrix: &SparseMatrix<T>, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "%%MatrixMarket matrix coordinate real general")?;
    writeln!(out, "{} {} {}", matrix.rows(), matrix.columns(), matrix.entries())?;
    for row in 0..matrix.rows() {
        let (columns, values) = matrix.row(row);
        for (column, value) in columns.iter().zip(values) {
            writeln!(out, "{} {} {value}", row + 1, column + 1)?;
        }
    }
    Ok(())
}

fn array(rows: usize, columns: usize, values: &[f64], out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "%%MatrixMarket matrix array real general")?;
    writeln!(out, "{rows} {columns}")?;
    for value in values {
        writeln!(out, "{value}")?;
    }
    Ok(())
}

/// Writes a basis as a ZIP archive of MatrixMarket files, to where nothing can be changed afterwards: `space.mtx`
/// (`n × d`, coordinate) and `coefficients.mtx` (`d × m`, array) of a compact basis, `functions.mtx` (`n × m`, array)
/// of a dense one; `eigenvalues.mtx`, `residuals.mtx`, `bounds.mtx` (`m × 1`), `mass.mtx` (`n × n`, coordinate) and
/// `metadata.json`. Numbers are the shortest decimals that read back to the same bits.
///
/// # Errors
/// [`FormatError`] where the archive cannot be written, or columns of a dense basis cannot be read.
pub fn write<W: Write>(basis: &Basis, out: W) -> Result<(), FormatError> {
    let mut archive = ZipWriter::new_stream(BufWriter::with_capacity(64 << 10, out));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    let m = basis.eigenvalues.len();
    match &basis.functions {
        Functions::Compact(Compact { space, coefficients, .. }) => {
            archive.start_file("space.mtx", options)?;
            coordinates(space, &mut archive)?;
            archive.start_file("coefficients.mtx", options)?;
            array(coefficients.rows(), coefficients.columns(), coefficients.values(), &mut archive)?;
        }
        Functions::Dense(dense) => {
            archive.start_file("functions.mtx", options)?;
            array(dense.rows(), dense.columns(), &[], &mut archive)?;
            for index in 0..dense.chunk_count() {
                let chunk = dense.chunk(index)?;
                chunk.visit(Lines(&mut archive))?;
            }
        }
    }
    for (name, values) in [
        ("eigenvalues.mtx", &basis.eigenvalues),
        ("residuals.mtx", &basis.certificate.residuals),
        ("bounds.mtx", &basis.certificate.bounds),
        ("estimates.mtx", &basis.certificate.estimates),
    ] {
        archive.start_file(name, options)?;
        array(if name == "eigenvalues.mtx" { m } else { values.len() }, 1, values, &mut archive)?;
    }
    archive.start_file("mass.mtx", options)?;
    match &basis.mass {
        MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => {
            coordinates(matrix, &mut archive)?
        }
        MassMatrix::Diagonal(diagonal) => {
            writeln!(archive, "%%MatrixMarket matrix coordinate real general")?;
            writeln!(archive, "{0} {0} {0}", diagonal.len())?;
            (1..).zip(diagonal).try_for_each(|(i, value)| writeln!(archive, "{i} {i} {value}"))?;
        }
    }
    let certificate = super::npz::certificate_value(&basis.certificate)?;
    let about = serde_json::json!({"certificate": certificate, "metadata": basis.metadata.json()});
    archive.start_file("metadata.json", options)?;
    archive.write_all(about.to_string().as_bytes())?;
    archive.finish()?.into_inner().flush()?;
    Ok(())
}

/// Writes numbers of either type one to a line.
struct Lines<'a, W>(&'a mut W);

impl<W: Write> Visit for Lines<'_, W> {
    type Answer = std::io::Result<()>;
    fn visit<T: Real>(self, values: &[T], _rows: usize) -> Self::Answer {
        values.iter().try_for_each(|value| writeln!(self.0, "{value}"))
    }
}

/// The archive of [`write()`] in memory.
///
/// # Errors
/// As [`write()`].
pub fn to_bytes(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let mut bytes = Vec::new();
    write(basis, &mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Precision;
    use crate::basis::tests::{dense_basis, small_basis};
    use std::io::{Cursor, Read};

    #[test]
    fn every_entry_is_written_with_one_based_indices() {
        let basis = small_basis(false);
        let space = &basis.compact().unwrap().space;
        let bytes = to_bytes(&basis).unwrap();
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let mut text = String::new();
        archive.by_name("space.mtx").unwrap().read_to_string(&mut text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2 + space.entries());
        let (columns, values) = space.row(0);
        assert_eq!(lines[2], format!("1 {} {}", columns[0] + 1, values[0]));
    }

    #[test]
    fn columns_of_a_dense_basis_follow_each_other() {
        let basis = dense_basis(Precision::F32, 40);
        let mut archive = zip::ZipArchive::new(Cursor::new(to_bytes(&basis).unwrap())).unwrap();
        let mut text = String::new();
        archive.by_name("functions.mtx").unwrap().read_to_string(&mut text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "3 42");
        let values: Vec<f32> = lines[2..].iter().map(|line| line.parse().unwrap()).collect();
        assert_eq!(values, basis.lift::<f32>(0..42).unwrap());
    }
}
