//! The matrices of a pencil as an NPZ file.
//!
//! `S` lies in the CSR members `format, shape, data, indices, indptr`, which `scipy.sparse.load_npz` reads; a mass
//! beside it in `mass` where it is a diagonal, in `mass_data, mass_indices, mass_indptr` where it is not, and nowhere
//! where it is the identity.

use std::io::{Seek, Write};

use chladni_algebra::SparseMatrix;
use zip::ZipWriter;

use super::read::{Archive, Frame};
use super::{FormatError, Members, wrong};

/// `S`, and the mass where it is a diagonal, or where it is a matrix; neither where it is the identity.
pub type ProblemParts = (SparseMatrix, Option<Vec<f64>>, Option<SparseMatrix>);

/// Writes matrices. Equal ones give equal bytes.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_problem<W: Write + Seek>(
    (stiffness, diagonal, mass): (&SparseMatrix, Option<&[f64]>, Option<&SparseMatrix>),
    out: W,
) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    members.add("format", "|S3", false, &[], b"csr")?;
    let shape = [stiffness.rows() as i64, stiffness.columns() as i64];
    members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&shape))?;
    members.floats("data", stiffness.values())?;
    members.pattern("", stiffness)?;
    if let Some(diagonal) = diagonal {
        members.floats("mass", diagonal)?;
    }
    if let Some(mass) = mass {
        members.floats("mass_data", mass.values())?;
        members.pattern("mass_", mass)?;
    }
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Reads what [`write_problem`] wrote, of at most `most` rows. That the matrices are symmetric is not looked at.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_problem(bytes: &[u8], most: usize) -> Result<ProblemParts, FormatError> {
    let mut archive = Archive::open(Frame::whole(bytes))?;
    let shape: Vec<i64> = archive.member("shape")?.vector("<i8", 2)?;
    let n = usize::try_from(shape[0]).ok().filter(|&n| n < u32::MAX as usize && shape[0] == shape[1]);
    let n = n.ok_or_else(|| wrong("shape", format!("{shape:?} is not that of a square matrix")))?;
    if n > most {
        return Err(wrong("shape", format!("{n} rows exceed the limit of {most}")));
    }
    let stiffness = archive.sparse(["data", "indices", "indptr"], n, n, "<f8")?;
    let diagonal = if archive.has("mass") { Some(archive.member("mass")?.vector("<f8", n)?) } else { None };
    let mass = if archive.has("mass_data") {
        Some(archive.sparse(["mass_data", "mass_indices", "mass_indptr"], n, n, "<f8")?)
    } else {
        None
    };
    Ok((stiffness, diagonal, mass))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use chladni_algebra::SparseMatrix;

    use super::*;

    fn path(diagonal: [f64; 3]) -> SparseMatrix {
        let values = vec![diagonal[0], -1.0, -1.0, diagonal[1], -1.0, -1.0, diagonal[2]];
        SparseMatrix::new(3, 3, vec![0, 2, 5, 7], vec![0, 1, 0, 1, 2, 1, 2], values).unwrap()
    }

    #[test]
    fn matrices_are_read_back_to_the_bit_and_nothing_else_is() {
        let stiffness = path([1.0, 2.0, 1.0]);
        for (diagonal, mass) in [(None, None), (Some(vec![1.0, 2.0, 0.5]), None), (None, Some(path([3.0, 4.0, 5.0])))] {
            let write = || {
                let mut out = Cursor::new(Vec::new());
                write_problem((&stiffness, diagonal.as_deref(), mass.as_ref()), &mut out).unwrap();
                out.into_inner()
            };
            let bytes = write();
            assert_eq!(read_problem(&bytes, 3).unwrap(), (stiffness.clone(), diagonal.clone(), mass.clone()));
            assert!(read_problem(&bytes, 2).unwrap_err().to_string().contains("3 rows"));
            assert_eq!(bytes, write());
            for cut in (0..bytes.len()).step_by(61) {
                assert!(read_problem(&bytes[..cut], 3).is_err(), "{cut}");
            }
        }
    }
}
