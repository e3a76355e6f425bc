//! What every reader promises about every input.

use chladni_mesh::read::{MeshFormat, ReadLimits, read};

/// Reads under small limits, so that a slow input is a finding rather than a large mesh, and checks what comes out.
pub fn answer(bytes: &[u8], format: MeshFormat) {
    let _ = MeshFormat::sniff(bytes);
    let limits = ReadLimits { vertices: 1 << 16, faces: 1 << 16, tetrahedra: 1 << 16, ..ReadLimits::default() };
    match read(bytes, format, &limits) {
        Ok(mesh) => {
            let vertices = mesh.positions.len();
            assert!(vertices > 0 && vertices <= limits.vertices);
            assert!(mesh.faces.len() <= limits.faces && mesh.tetrahedra.len() <= limits.tetrahedra);
            assert!(mesh.faces.as_flattened().iter().all(|&vertex| (vertex as usize) < vertices));
            assert!(mesh.tetrahedra.as_flattened().iter().all(|&vertex| (vertex as usize) < vertices));
        }
        Err(error) => assert!(!error.kind().is_empty() && error.to_string().len() < 400),
    }
}
