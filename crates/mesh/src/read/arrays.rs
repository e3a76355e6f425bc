//! Meshes as arrays: `vertices`, `faces` and, of solids, `tetrahedra`, counted from 0, as NPZ or JSON.

mod json;
mod npz;

pub(super) use json::read as read_json;
pub(super) use npz::read as read_npz;

use super::builder::Builder;
use super::error::ReadError;
use super::{MeshFormat, RawMesh};

fn wrong(format: MeshFormat, reason: impl Into<String>) -> ReadError {
    ReadError::Arrays { format, reason: reason.into() }
}

/// Ends a mesh. Members come in any order, so that indices are looked at last; polygons are cut only once they are
/// known to be in range.
fn finish(builder: Builder, format: MeshFormat) -> Result<RawMesh, ReadError> {
    let vertices = builder.mesh.positions.len();
    let stray = |corners: &[u32]| corners.iter().copied().find(|&v| v as usize >= vertices);
    let lists = [
        ("triangle", builder.mesh.faces.as_flattened(), 3),
        ("tetrahedron", builder.mesh.tetrahedra.as_flattened(), 4),
    ];
    for (element, corners, width) in lists {
        for (number, corners) in corners.chunks_exact(width).enumerate() {
            if let Some(vertex) = stray(corners) {
                return Err(wrong(
                    format,
                    format!("{element} {number} refers to vertex {vertex}; there are {vertices}, counted from 0"),
                ));
            }
        }
    }
    builder.finish()
}
