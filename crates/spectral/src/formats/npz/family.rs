//! A family of operators as an NPZ file: `functions` (`n × d` in single precision, columns first), `extrinsic` and
//! `curvature` (`d × d`, columns first), `eigenvalues`, the diagonal `mass`, and the JSON text `metadata`. Files
//! written before the space was dense, with a sparse `U` and `coefficients`, are read too.

use std::io::{Seek, Write};

use chladni_algebra::{MassMatrix, space_times_single};
use chladni_mesh::numbering::Numbering;
use zip::ZipWriter;

use super::read::{Archive, FAMILY};
use super::{FormatError, Members, wrong};
use crate::basis::family::FamilyBasis;

/// Writes a family.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_family<W: Write + Seek>(
    family: &FamilyBasis,
    numbering: Option<&Numbering>,
    out: W,
) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    let shape = [family.vertices(), family.dimension()];
    members.add("functions", "<f4", true, &shape, bytemuck::cast_slice(&family.functions))?;
    members.columns("extrinsic", &family.extrinsic)?;
    members.columns("curvature", &family.curvature)?;
    members.floats("eigenvalues", &family.eigenvalues)?;
    members.floats("mass", &family.mass.lumped())?;
    members.text("metadata", &family.metadata.json().to_string())?;
    members.maps(numbering)?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Reads a family from the bytes of an NPZ file that [`write_family`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_family(bytes: &[u8]) -> Result<FamilyBasis, FormatError> {
    let mut archive = Archive::of(bytes, FAMILY)?;
    let extrinsic = archive.member("extrinsic")?;
    let d = extrinsic.shape.first().copied().unwrap_or(0);
    let mass = archive.member("mass")?;
    let n = mass.shape.first().copied().unwrap_or(0);
    let mass = MassMatrix::Diagonal(mass.vector("<f8", n)?);
    let functions = if archive.has("functions") {
        let functions = archive.member("functions")?;
        if functions.shape != [n, d] || !functions.fortran {
            return Err(wrong("functions", format!("its shape is {:?}, not ({n}, {d})", functions.shape)));
        }
        functions.values("<f4")?
    } else {
        sparse_functions(&mut archive, n, d)?
    };
    Ok(FamilyBasis {
        functions,
        eigenvalues: archive.member("eigenvalues")?.vector("<f8", d)?,
        extrinsic: archive.dense("extrinsic", Some(d), d)?,
        curvature: archive.dense("curvature", Some(d), d)?,
        mass,
        metadata: archive.member("metadata")?.json()?.into(),
    })
}

/// The functions of a file of the first form: `U` in CSR members, times `coefficients`.
fn sparse_functions(archive: &mut Archive<'_>, n: usize, d: usize) -> Result<Vec<f32>, FormatError> {
    let shape: Vec<i64> = archive.member("shape")?.vector("<i8", 2)?;
    if shape != [n as i64, d as i64] || d >= u32::MAX as usize {
        return Err(wrong("shape", "it does not fit the other members"));
    }
    let space = archive.sparse(["data", "indices", "indptr"], n, d, "<f4")?;
    let coefficients = archive.dense("coefficients", Some(d), d)?;
    Ok(space_times_single(&space, &coefficients))
}
