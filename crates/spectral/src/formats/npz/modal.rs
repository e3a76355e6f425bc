//! Vibration modes as an NPZ file.
//!
//! The scalar space `U` of a compact one lies in the CSR members that `scipy.sparse.load_npz` reads, beside
//! `coefficients` (`3d × m`, columns first); a dense one has `functions` (`3n × m`, columns first). Both have
//! `eigenvalues`, `bounds`, `masses`, `part`, `rest` (rows first), `affine` (columns first), `frame` (the number of
//! rigid modes and the unit of `rest`) and the JSON text `metadata`.

use std::io::{Seek, Write};

use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::Numbering;
use zip::ZipWriter;

use super::read::{Archive, MODES};
use super::{FormatError, Members, wrong};
use crate::basis::modal::{FIXED, ModalBasis, ModalFunctions};

/// Writes vibration modes.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_modes<W: Write + Seek>(
    modes: &ModalBasis,
    numbering: Option<&Numbering>,
    out: W,
) -> Result<(), FormatError> {
    let (n, m) = (modes.vertices(), modes.count());
    let mut members = Members { archive: ZipWriter::new(out) };
    match &modes.functions {
        ModalFunctions::Compact { space, coefficients } => {
            members.add("format", "|S3", false, &[], b"csr")?;
            let shape = [space.rows() as i64, space.columns() as i64];
            members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&shape))?;
            members.add("data", "<f4", false, &[space.entries()], bytemuck::cast_slice(space.values()))?;
            members.pattern("", space)?;
            members.columns("coefficients", coefficients)?;
        }
        ModalFunctions::Dense(values) => {
            members.add("functions", "<f4", true, &[3 * n, m], bytemuck::cast_slice(values))?;
        }
    }
    members.floats("eigenvalues", &modes.eigenvalues)?;
    members.floats("bounds", &modes.bounds)?;
    members.floats("masses", &modes.masses)?;
    members.add("part", "<u4", false, &[n], bytemuck::cast_slice(&modes.part))?;
    members.add("rest", "<f4", false, &[n, 3], bytemuck::cast_slice(modes.rest.as_flattened()))?;
    members.columns("affine", &modes.affine)?;
    members.floats("frame", &[modes.rigid as f64, modes.length])?;
    members.text("metadata", &modes.metadata.json().to_string())?;
    members.maps(numbering)?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Reads vibration modes from the bytes of an NPZ file that [`write_modes`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_modes(bytes: &[u8]) -> Result<ModalBasis, FormatError> {
    let mut archive = Archive::of(bytes, MODES)?;
    let masses = archive.member("masses")?;
    let n = masses.shape.first().copied().unwrap_or(0);
    let masses: Vec<f64> = masses.vector("<f8", n)?;
    let eigenvalues = archive.member("eigenvalues")?;
    let m = eigenvalues.shape.first().copied().unwrap_or(0);
    let eigenvalues: Vec<f64> = eigenvalues.vector("<f8", m)?;
    let affine = archive.dense("affine", None, m)?;
    let part: Vec<u32> = archive.member("part")?.vector("<u4", n)?;
    let parts = affine.rows() / 12;
    if !affine.rows().is_multiple_of(12) || part.iter().any(|&p| p != FIXED && p as usize >= parts) {
        return Err(wrong("part", "it names parts that \"affine\" does not have"));
    }
    let rest = archive.member("rest")?;
    if rest.shape != [n, 3] || rest.fortran {
        return Err(wrong("rest", format!("its shape is {:?}, not ({n}, 3)", rest.shape)));
    }
    let rest: Vec<f32> = rest.values("<f4")?;
    let frame: Vec<f64> = archive.member("frame")?.vector("<f8", 2)?;
    let rigid = frame[0] as usize;
    if rigid > m || !(frame[1] > 0.0 && frame[1].is_finite()) {
        return Err(wrong("frame", "it does not fit the modes"));
    }
    let functions = if archive.has("functions") {
        let functions = archive.member("functions")?;
        if functions.shape != [3 * n, m] || !functions.fortran {
            return Err(wrong("functions", format!("its shape is {:?}, not ({}, {m})", functions.shape, 3 * n)));
        }
        ModalFunctions::Dense(functions.values("<f4")?)
    } else {
        let shape: Vec<i64> = archive.member("shape")?.vector("<i8", 2)?;
        let d = usize::try_from(shape[1]).ok().filter(|&d| d < u32::MAX as usize / 3);
        let d = d.ok_or_else(|| wrong("shape", format!("{} is not a number of columns", shape[1])))?;
        let space = archive.sparse(["data", "indices", "indptr"], n, d, "<f4")?;
        ModalFunctions::Compact { space, coefficients: archive.dense("coefficients", Some(3 * d), m)? }
    };
    Ok(ModalBasis {
        eigenvalues,
        rigid,
        masses,
        part,
        rest: rest.as_chunks().0.to_vec(),
        length: frame[1],
        affine,
        functions,
        bounds: archive.member("bounds")?.vector("<f8", m)?,
        metadata: archive.member("metadata")?.json()?.into(),
    })
}

impl<W: Write + Seek> Members<W> {
    /// A dense matrix, columns first.
    pub(super) fn columns(&mut self, name: &str, matrix: &DenseMatrix) -> Result<(), FormatError> {
        let shape = [matrix.rows(), matrix.columns()];
        self.add(name, "<f8", true, &shape, bytemuck::cast_slice(matrix.values()))
    }
}

impl<'a> Archive<'a> {
    /// A dense matrix, columns first; with so many rows, if that is known.
    pub(super) fn dense(
        &mut self,
        name: &'a str,
        rows: Option<usize>,
        columns: usize,
    ) -> Result<DenseMatrix, FormatError> {
        let member = self.member(name)?;
        match member.shape[..] {
            [r, c] if member.fortran && c == columns && rows.is_none_or(|rows| rows == r) => {
                Ok(DenseMatrix::from_columns(r, c, member.values("<f8")?))
            }
            _ => Err(wrong(name, format!("its shape is {:?}, and it must have {columns} columns", member.shape))),
        }
    }
}
