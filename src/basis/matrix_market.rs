//! A basis as MatrixMarket files in one archive.

use std::io::{Cursor, Write};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::{Basis, npz::FormatError};
use crate::algebra::{MassMatrix, SparseMatrix};

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

/// A basis as the bytes of a ZIP archive of MatrixMarket files: `space.mtx` (`n × d`, coordinate), `coefficients.mtx` (`d × m`,
/// array), `eigenvalues.mtx`, `residuals.mtx`, `bounds.mtx` (`m × 1`), `mass.mtx` (`n × n`, coordinate) and `metadata.json`.
/// Numbers are the shortest decimals that read back to the same bits.
///
/// # Errors
/// [`FormatError`] where the archive cannot be written.
pub fn to_bytes(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    let mut member = |name: &str, fill: &dyn Fn(&mut Vec<u8>) -> std::io::Result<()>| -> Result<(), FormatError> {
        let mut text = Vec::new();
        fill(&mut text)?;
        archive.start_file(name, options)?;
        archive.write_all(&text)?;
        Ok(())
    };
    let m = basis.eigenvalues.len();
    member("space.mtx", &|out| coordinates(&basis.space, out))?;
    member("coefficients.mtx", &|out| {
        array(basis.coefficients.rows(), basis.coefficients.columns(), basis.coefficients.values(), out)
    })?;
    member("eigenvalues.mtx", &|out| array(m, 1, &basis.eigenvalues, out))?;
    member("residuals.mtx", &|out| array(basis.certificate.residuals.len(), 1, &basis.certificate.residuals, out))?;
    member("bounds.mtx", &|out| array(basis.certificate.bounds.len(), 1, &basis.certificate.bounds, out))?;
    member("mass.mtx", &|out| match &basis.mass {
        MassMatrix::Sparse(matrix) => coordinates(matrix, out),
        MassMatrix::Diagonal(diagonal) => {
            writeln!(out, "%%MatrixMarket matrix coordinate real general")?;
            writeln!(out, "{0} {0} {0}", diagonal.len())?;
            (1..).zip(diagonal).try_for_each(|(i, value)| writeln!(out, "{i} {i} {value}"))
        }
    })?;
    let certificate: serde_json::Value =
        serde_json::from_str(&super::npz::certificate_text(&basis.certificate)).unwrap_or_default();
    let about = serde_json::json!({"certificate": certificate, "metadata": basis.metadata});
    member("metadata.json", &|out| out.write_all(about.to_string().as_bytes()))?;
    Ok(archive.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::tests::small_basis;
    use std::io::Read;

    #[test]
    fn every_entry_is_written_with_one_based_indices() {
        let basis = small_basis(false);
        let bytes = to_bytes(&basis).unwrap();
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let mut text = String::new();
        archive.by_name("space.mtx").unwrap().read_to_string(&mut text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2 + basis.space.entries());
        let (columns, values) = basis.space.row(0);
        assert_eq!(lines[2], format!("1 {} {}", columns[0] + 1, values[0]));
    }
}
