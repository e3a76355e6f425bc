//! Small jobs of every kind, on meshes and with parameters that nobody would choose.

use chladni_mesh::TriangleMesh;
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_work::{JobError, JobParameters, KINDS, MeshSize};

use crate::patience::Patience;

/// Runs a job: a byte for its kind, parameters as JSON, a zero, a mesh as OFF. It gives a product or a typed error.
pub fn run_job(bytes: &[u8]) {
    let Some((&kind, rest)) = bytes.split_first() else { return };
    let Some(end) = rest.iter().position(|&byte| byte == 0) else { return };
    let (parameters, mesh) = (&rest[..end], &rest[end + 1..]);
    let limits = ReadLimits { vertices: 300, faces: 600, tetrahedra: 0, ..ReadLimits::default() };
    let Ok(mesh) = read(mesh, MeshFormat::Off, &limits) else { return };
    let mesh = TriangleMesh { positions: mesh.positions, faces: mesh.faces, ..Default::default() };
    let parameters = if parameters.is_empty() { b"null" } else { parameters };
    let Ok(parameters) = serde_json::from_slice(parameters) else { return };
    let Ok(job) = JobParameters::parse(KINDS[usize::from(kind) % KINDS.len()], &parameters) else { return };
    let promised = job.memory_bytes(MeshSize::from(&mesh));
    if promised > 1 << 30 {
        return;
    }
    match job.run(&mesh, &Patience::new(20_000, promised)) {
        Ok(outcome) => assert!(outcome.product.summary().eigenvalues.iter().all(|value| value.is_finite())),
        Err(JobError::Cancelled(_)) => {}
        Err(error) => assert!(!error.kind().is_empty() && !error.to_string().is_empty()),
    }
}
