//! A family of operators as an NPZ file: `U` in the CSR members that `scipy.sparse.load_npz` reads, `coefficients`, `extrinsic` and
//! `curvature` (`d × d`, columns first), `eigenvalues`, the diagonal `mass`, and the JSON text `metadata`.

use std::io::{Seek, Write};

use zip::ZipWriter;

use super::read::{Archive, Frame};
use super::{FormatError, Members, wrong};
use crate::algebra::MassMatrix;
use crate::basis::family::FamilyBasis;

/// Writes a family.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_family<W: Write + Seek>(family: &FamilyBasis, out: W) -> Result<(), FormatError> {
    let space = &family.space;
    let mut members = Members { archive: ZipWriter::new(out) };
    members.add("format", "|S3", false, &[], b"csr")?;
    let shape = [space.rows() as i64, space.columns() as i64];
    members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&shape))?;
    members.add("data", "<f4", false, &[space.entries()], bytemuck::cast_slice(space.values()))?;
    members.pattern("", space)?;
    members.columns("coefficients", &family.coefficients)?;
    members.columns("extrinsic", &family.extrinsic)?;
    members.columns("curvature", &family.curvature)?;
    members.floats("eigenvalues", &family.eigenvalues)?;
    members.floats("mass", &family.mass.lumped())?;
    members.text("metadata", &family.metadata.to_string())?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Reads a family from the bytes of an NPZ file that [`write_family`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_family(bytes: &[u8]) -> Result<FamilyBasis, FormatError> {
    let mut archive = Archive::open(Frame::whole(bytes))?;
    let extrinsic = archive.member("extrinsic")?;
    let d = extrinsic.shape.first().copied().unwrap_or(0);
    let mass = archive.member("mass")?;
    let n = mass.shape.first().copied().unwrap_or(0);
    let mass = MassMatrix::Diagonal(mass.vector("<f8", n)?);
    let shape: Vec<i64> = archive.member("shape")?.vector("<i8", 2)?;
    if shape != [n as i64, d as i64] || d >= u32::MAX as usize {
        return Err(wrong("shape", "it does not fit the other members"));
    }
    Ok(FamilyBasis {
        space: archive.sparse(["data", "indices", "indptr"], n, d, "<f4")?,
        coefficients: archive.dense("coefficients", Some(d), d)?,
        eigenvalues: archive.member("eigenvalues")?.vector("<f8", d)?,
        extrinsic: archive.dense("extrinsic", Some(d), d)?,
        curvature: archive.dense("curvature", Some(d), d)?,
        mass,
        metadata: archive.member("metadata")?.json()?,
    })
}
