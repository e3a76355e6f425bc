//! What every reader, every request and every job promises about every input.

#[cfg(feature = "server")]
mod bodies;
mod job;
mod patience;
mod problem;

#[cfg(feature = "server")]
pub use bodies::{seeds, send_body};
pub use job::run_job;
pub use problem::{matrices, run_problem};

use chladni_spectral::basis::{Product, ProductKind};
use chladni_work::design::{DesignRequest, FurRequest, HatchingRequest};
use chladni_work::{JobParameters, KINDS};

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

/// Reads stored products of every kind.
pub fn products(bytes: &[u8]) {
    for kind in ProductKind::ALL {
        match Product::read_npz(kind, bytes) {
            // What is read can be told of, and written again.
            Ok(product) => {
                let summary = product.summary();
                assert_eq!(summary.count, summary.eigenvalues.len());
                let mut out = std::io::Cursor::new(Vec::new());
                product.write_npz(&mut out).expect("memory takes all that is written to it");
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}

/// Reads the parameters of jobs of every kind: what is accepted has a canonical form that means the same.
pub fn parameters(bytes: &[u8]) {
    let Ok(value) = serde_json::from_slice(bytes) else { return };
    let packed = serde_json::from_slice::<chladni_work::packed::Packed>(bytes);
    let problem = chladni_work::ProblemSize { rows: 1000, entries: 5000, ..Default::default() };
    let shape = chladni_work::StoredShape { basis_bytes: 1 << 20, ..Default::default() };
    let shapes = [shape; 3];
    for kind in KINDS {
        // As a server reads them: it accepts what the tree is accepted for, unless it holds too much that is no list of
        // numbers.
        if let Ok(packed) = &packed {
            let read = JobParameters::read(kind, packed).ok();
            assert_eq!(read, JobParameters::parse(kind, &value).ok());
        }
        match JobParameters::parse(kind, &value) {
            Ok(parameters) => {
                let canonical = parameters.canonical();
                let again = JobParameters::parse(kind, &canonical).expect("canonical parameters are parameters");
                assert_eq!(again.canonical(), canonical);
                let size = chladni_work::MeshSize { vertices: 1000, faces: 2000, ..Default::default() };
                let promised = match &parameters {
                    JobParameters::PencilBasis(parameters) => parameters.problem_memory_bytes(problem),
                    JobParameters::MapCollection(parameters) => parameters.shapes_memory_bytes(&shapes, 2),
                    other => other.memory_bytes(size),
                };
                assert!(promised > 0);
                let _fits = parameters.check_mesh(size);
                chladni_work::abbreviate(&mut canonical.clone());
            }
            Err(error) => assert!(!error.to_string().is_empty() && error.to_string().len() < 4000),
        }
    }
}

/// Reads the bodies of synchronous requests.
pub fn requests(bytes: &[u8]) {
    if let Ok(request) = serde_json::from_slice::<DesignRequest>(bytes) {
        let _refused = request.check();
    }
    let _fur = serde_json::from_slice::<FurRequest>(bytes);
    let _hatching = serde_json::from_slice::<HatchingRequest>(bytes);
    let _table = serde_json::from_slice::<chladni_work::table::Table>(bytes);
}
