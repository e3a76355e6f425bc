//! What networks on surfaces keep of a mesh, as one archive in the layout of DiffusionNet's cache (Sharp, Attaiki,
//! Crane and Ovsjanikov 2022): sparse matrices by columns, everything but the arrays of the mesh in single precision.

use std::io::{Read, Seek, Write};

use chladni_algebra::SparseMatrix;
use zip::{ZipArchive, ZipWriter};

use super::{FormatError, Members};

/// What is written, all in the numbering of the positions and faces.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceOperators<'a> {
    pub positions: &'a [[f32; 3]],
    pub faces: &'a [[u32; 3]],
    /// At each vertex two tangents and the normal.
    pub frames: &'a [[[f64; 3]; 3]],
    /// The pattern of both gradient matrices by rows: where each begins, and its columns.
    pub pattern: (&'a [usize], &'a [u32]),
    /// Their entries, along the first and the second tangent.
    pub gradients: &'a [[f64; 2]],
    /// The mass of each vertex.
    pub mass: &'a [f64],
    /// The stiffness matrix: square and symmetric.
    pub stiffness: &'a SparseMatrix,
    pub eigenvalues: &'a [f64],
    /// Eigenfunctions, one after the other.
    pub functions: &'a [f64],
}

/// Writes the archive.
///
/// # Errors
/// [`FormatError::Write`] or [`FormatError::Archive`] where the destination fails, [`FormatError::TooLarge`] where a
/// matrix has 2³¹ entries.
pub fn write_operators<W: Write + Seek>(operators: &SurfaceOperators<'_>, out: W) -> Result<(), FormatError> {
    let SurfaceOperators { positions, faces, frames, pattern, gradients, mass, stiffness, eigenvalues, functions } =
        *operators;
    let (n, k) = (positions.len(), eigenvalues.len());
    let mut members = Members { archive: ZipWriter::new(out) };
    members.add("verts", "<f4", false, &[n, 3], bytemuck::cast_slice(positions))?;
    let frames: Vec<f32> = frames.as_flattened().as_flattened().iter().map(|&x| x as f32).collect();
    members.add("frames", "<f4", false, &[n, 3, 3], bytemuck::cast_slice(&frames))?;
    let corners: Vec<i64> = faces.as_flattened().iter().map(|&vertex| i64::from(vertex)).collect();
    members.add("faces", "<i8", false, &[faces.len(), 3], bytemuck::cast_slice(&corners))?;
    members.add("k_eig", "<i8", false, &[], &(k as i64).to_le_bytes())?;
    members.singles("mass", &[n], mass.iter().copied())?;
    // Symmetric: its rows are its columns.
    let values = stiffness.values().iter().copied();
    members.by_columns("L", n, stiffness.offsets(), stiffness.indices(), values)?;
    members.singles("evals", &[k], eigenvalues.iter().copied())?;
    let rows = (0..n * k).map(|at| functions[at % k * n + at / k]);
    members.singles("evecs", &[n, k], rows)?;
    let (offsets, indices, from) = transposed(n, pattern.0, pattern.1);
    for (axis, name) in ["gradX", "gradY"].into_iter().enumerate() {
        members.by_columns(name, n, &offsets, &indices, from.iter().map(|&at| gradients[at][axis]))?;
    }
    members.archive.finish()?.flush()?;
    Ok(())
}

/// How many eigenpairs an archive of operators has; `None` where it is no such archive, or not whole: every member is
/// compared with its checksum.
pub fn operators_within<R: Read + Seek>(archive: R) -> Option<usize> {
    let mut archive = ZipArchive::new(archive).ok()?;
    let mut bytes = Vec::new();
    archive.by_name("k_eig.npy").ok()?.take(4096).read_to_end(&mut bytes).ok()?;
    let count = usize::try_from(i64::from_le_bytes(*bytes.last_chunk::<8>()?)).ok()?;
    for index in 0..archive.len() {
        std::io::copy(&mut archive.by_index(index).ok()?, &mut std::io::sink()).ok()?;
    }
    Some(count)
}

/// The pattern of a square matrix by columns, and where each of its entries stands by rows.
fn transposed(n: usize, offsets: &[usize], indices: &[u32]) -> (Vec<usize>, Vec<u32>, Vec<usize>) {
    let places = (0..indices.len()).collect();
    SparseMatrix::from_sorted_parts(n, n, offsets.to_vec(), indices.to_vec(), places).transpose().into_parts()
}

impl<W: Write + Seek> Members<W> {
    fn singles(&mut self, name: &str, shape: &[usize], values: impl Iterator<Item = f64>) -> Result<(), FormatError> {
        let values: Vec<f32> = values.map(|x| x as f32).collect();
        self.add(name, "<f4", false, shape, bytemuck::cast_slice(&values))
    }

    /// A square matrix by columns, as SciPy's CSC has it.
    fn by_columns(
        &mut self,
        name: &str,
        n: usize,
        offsets: &[usize],
        indices: &[u32],
        values: impl Iterator<Item = f64>,
    ) -> Result<(), FormatError> {
        if i32::try_from(indices.len()).is_err() {
            return Err(FormatError::TooLarge { what: "a matrix" });
        }
        self.singles(&format!("{name}_data"), &[indices.len()], values)?;
        self.add(&format!("{name}_indices"), "<i4", false, &[indices.len()], bytemuck::cast_slice(indices))?;
        let offsets: Vec<i32> = offsets.iter().map(|&offset| offset as i32).collect();
        self.add(&format!("{name}_indptr"), "<i4", false, &[n + 1], bytemuck::cast_slice(&offsets))?;
        self.add(&format!("{name}_shape"), "<i8", false, &[2], bytemuck::cast_slice(&[n as i64; 2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_by_columns_is_that_of_the_transpose() {
        // Rows {0, 2}, {1}, {0, 1}.
        let (offsets, rows, from) = transposed(3, &[0, 2, 3, 5], &[0, 2, 1, 0, 1]);
        assert_eq!(offsets, [0, 2, 4, 5]);
        assert_eq!(rows, [0, 2, 1, 2, 0]);
        assert_eq!(from, [0, 3, 2, 4, 1]);
    }
}
