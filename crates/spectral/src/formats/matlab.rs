//! Eigenbases as MAT files of level 5, which MATLAB, Octave and SciPy open.
//!
//! Variables: `eigenvalues`, `residuals`, `bounds` (m × 1), `functions` (n × m), `mass` (n × 1, or sparse n × n),
//! `vertices` (n × 3), `faces` (f × 3, counted from 1), and the numbering of the file: `vertex_map` (for each vertex of
//! the file the row of `functions`, counted from 1, or 0 where it was dropped) and `face_map` (for each row of `faces`
//! the face of the file, counted from 1). All numbers are double.

use std::io::Write;

use chladni_algebra::{MassMatrix, WeightedMass};
use chladni_mesh::TriangleMesh;
use chladni_mesh::numbering::Numbering;

use super::npz::FormatError;
use crate::basis::Basis;

// Types of data and classes of arrays (MathWorks, "MAT-File Format").
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
const CLASS_SPARSE: u32 = 5;
const CLASS_DOUBLE: u32 = 6;

/// The most bytes of one variable: readers take its size for a signed number.
const MOST_BYTES: u64 = i32::MAX as u64;

/// Columns that are lifted at once.
const PANEL: usize = 16;

/// Writes an eigenbasis with its mesh. Of a solid, `functions` has the rows of its inner vertices behind those of
/// `vertices`.
///
/// # Errors
/// [`FormatError::TooLarge`] where a variable has 2 GiB or more, which this format cannot hold; [`FormatError::Write`]
/// where the destination fails, [`FormatError::Functions`] where columns cannot be read.
pub fn write<W: Write>(
    basis: &Basis,
    mesh: &TriangleMesh,
    numbering: &Numbering,
    mut out: W,
) -> Result<(), FormatError> {
    let mut head = [b' '; 128];
    let text = b"MATLAB 5.0 MAT-file, written by chladni";
    head[..text.len()].copy_from_slice(text);
    head[116..124].fill(0);
    head[124..].copy_from_slice(&[0x00, 0x01, b'I', b'M']);
    out.write_all(&head)?;
    let (n, m) = (basis.vertices(), basis.count());
    column(&mut out, "eigenvalues", &basis.eigenvalues)?;
    column(&mut out, "residuals", &basis.certificate.residuals)?;
    column(&mut out, "bounds", &basis.certificate.bounds)?;
    begin(&mut out, "functions", [n, m])?;
    for from in (0..m).step_by(PANEL) {
        let values: Vec<f64> = basis.lift(from..m.min(from + PANEL))?;
        out.write_all(bytemuck::cast_slice(&values))?;
    }
    match &basis.mass {
        MassMatrix::Diagonal(diagonal) => column(&mut out, "mass", diagonal)?,
        // A symmetric matrix is the same by rows and by columns.
        MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => {
            sparse(&mut out, "mass", matrix)?
        }
    }
    let axis = |axis: usize| mesh.positions.iter().map(move |position| position[axis]);
    begin(&mut out, "vertices", [mesh.positions.len(), 3])?;
    for value in (0..3).flat_map(axis) {
        out.write_all(&value.to_le_bytes())?;
    }
    begin(&mut out, "faces", [mesh.faces.len(), 3])?;
    for corner in (0..3).flat_map(|corner| mesh.faces.iter().map(move |face| face[corner])) {
        out.write_all(&(f64::from(corner) + 1.0).to_le_bytes())?;
    }
    begin(&mut out, "vertex_map", [numbering.file_vertices(), 1])?;
    for kept in numbering.vertex_map() {
        out.write_all(&kept.map_or(0.0, |kept| f64::from(kept) + 1.0).to_le_bytes())?;
    }
    begin(&mut out, "face_map", [numbering.kept_faces(), 1])?;
    for face in numbering.face_map() {
        out.write_all(&(f64::from(face) + 1.0).to_le_bytes())?;
    }
    Ok(out.flush()?)
}

fn column<W: Write>(out: &mut W, name: &'static str, values: &[f64]) -> Result<(), FormatError> {
    begin(out, name, [values.len(), 1])?;
    Ok(out.write_all(bytemuck::cast_slice(values))?)
}

/// Begins a variable of doubles, whose values follow, column after column.
fn begin<W: Write>(out: &mut W, name: &'static str, [rows, columns]: [usize; 2]) -> Result<(), FormatError> {
    let data = (rows as u64).saturating_mul(columns as u64).saturating_mul(8);
    let name_bytes = name.len().next_multiple_of(8) as u64;
    array(out, name, CLASS_DOUBLE, 0, [rows, columns], 16 + 16 + 8 + name_bytes + 8 + data)?;
    tag(out, DOUBLE, data as u32)
}

/// The head of an array: flags, dimensions and name.
fn array<W: Write>(
    out: &mut W,
    name: &'static str,
    class: u32,
    entries: u32,
    [rows, columns]: [usize; 2],
    bytes: u64,
) -> Result<(), FormatError> {
    let too_large = || FormatError::TooLarge { what: name };
    if bytes > MOST_BYTES {
        return Err(too_large());
    }
    tag(out, MATRIX, bytes as u32)?;
    tag(out, UINT32, 8)?;
    out.write_all(&[class.to_le_bytes(), entries.to_le_bytes()].concat())?;
    tag(out, INT32, 8)?;
    for count in [rows, columns] {
        out.write_all(&i32::try_from(count).map_err(|_| too_large())?.to_le_bytes())?;
    }
    tag(out, INT8, name.len() as u32)?;
    let mut padded = name.as_bytes().to_vec();
    padded.resize(name.len().next_multiple_of(8), 0);
    Ok(out.write_all(&padded)?)
}

fn sparse<W: Write>(
    out: &mut W,
    name: &'static str,
    matrix: &chladni_algebra::SparseMatrix<f64>,
) -> Result<(), FormatError> {
    let (n, entries) = (matrix.rows(), matrix.entries());
    let padded = |count: usize| (4 * count).next_multiple_of(8) as u64;
    let name_bytes = name.len().next_multiple_of(8) as u64;
    let bytes = 16 + 16 + 8 + name_bytes + 8 + padded(entries) + 8 + padded(n + 1) + 8 + 8 * entries as u64;
    array(out, name, CLASS_SPARSE, entries as u32, [n, matrix.columns()], bytes)?;
    let mut integers = |count: usize, numbers: &mut dyn Iterator<Item = u32>| -> Result<(), FormatError> {
        tag(out, INT32, 4 * count as u32)?;
        for number in numbers {
            out.write_all(&number.to_le_bytes())?;
        }
        // Every element ends at a multiple of eight bytes.
        if count % 2 == 1 {
            out.write_all(&[0; 4])?;
        }
        Ok(())
    };
    integers(entries, &mut matrix.indices().iter().copied())?;
    integers(n + 1, &mut matrix.offsets().iter().map(|&offset| offset as u32))?;
    tag(out, DOUBLE, 8 * entries as u32)?;
    Ok(out.write_all(bytemuck::cast_slice(matrix.values()))?)
}

fn tag<W: Write>(out: &mut W, kind: u32, bytes: u32) -> Result<(), FormatError> {
    Ok(out.write_all(&[kind.to_le_bytes(), bytes.to_le_bytes()].concat())?)
}
