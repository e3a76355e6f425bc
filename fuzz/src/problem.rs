//! Problems of matrices: read as a server reads them, checked, and solved where they are small.

use chladni_spectral::formats::matrix::{MatrixFile, MatrixLimits};
use chladni_spectral::formats::npz;
use chladni_spectral::spectrum::pencil::{Mass, Matrices};
use chladni_work::{JobError, JobParameters, ProblemSize};

use crate::patience::Patience;

/// What stands between the two matrices of a problem.
const MASS: &[u8] = b"\0mass\0";

const LIMITS: MatrixLimits = MatrixLimits { rows: 1 << 16, entries: 1 << 16 };

/// Reads bytes as one matrix and as both.
pub fn matrices(bytes: &[u8]) {
    assert!(MatrixFile::memory_bytes(bytes) >= bytes.len() as u64);
    match MatrixFile::read(bytes, &LIMITS) {
        Ok(file) => {
            let matrix = file.into_matrix();
            assert!(matrix.rows() <= LIMITS.rows);
            if let Err(error) = Matrices::new(matrix, Mass::Identity) {
                assert!(!error.kind().is_empty() && error.to_string().len() < 400);
            }
        }
        Err(error) => assert!(error.to_string().len() < 400, "{error}"),
    }
    if let Ok((stiffness, diagonal, mass)) = npz::read_problem(bytes, LIMITS.rows) {
        let _refused = Matrices::of_parts(stiffness, diagonal, mass);
    }
}

fn read(bytes: &[u8]) -> Option<Matrices> {
    let middle = bytes.windows(MASS.len()).position(|window| window == MASS);
    let (stiffness, mass) = match middle {
        Some(at) => (&bytes[..at], Some(&bytes[at + MASS.len()..])),
        None => (bytes, None),
    };
    let limits = MatrixLimits { rows: 200, entries: 2000 };
    let stiffness = MatrixFile::read(stiffness, &limits).ok()?.into_matrix();
    let mass = match mass {
        None => Mass::Identity,
        Some(bytes) => match MatrixFile::read(bytes, &limits).ok()? {
            MatrixFile::Sparse(matrix) => Mass::Sparse(matrix),
            MatrixFile::Vector(diagonal) => Mass::Diagonal(diagonal),
        },
    };
    Matrices::new(stiffness, mass).ok()
}

/// Solves a problem: parameters as JSON, a zero, `S`, and the mass after [`MASS`]. It gives a product or a typed error.
pub fn run_problem(bytes: &[u8]) {
    let Some(end) = bytes.iter().position(|&byte| byte == 0) else { return };
    let Ok(parameters) = serde_json::from_slice(&bytes[..end]) else { return };
    let Ok(JobParameters::PencilBasis(job)) = JobParameters::parse("pencil_basis", &parameters) else { return };
    let Some(matrices) = read(&bytes[end + 1..]) else { return };
    let size = ProblemSize {
        rows: matrices.rows(),
        entries: matrices.stiffness().entries(),
        mass_entries: matrices.mass_entries(),
        factor_entries: None,
    };
    if job.check_problem(size).is_err() {
        return;
    }
    let promised = job.problem_memory_bytes(size);
    if promised > 1 << 30 {
        return;
    }
    match job.run_problem(&matrices, &Patience::new(20_000, promised)) {
        Ok(outcome) => assert!(outcome.product.summary().eigenvalues.iter().all(|value| value.is_finite())),
        Err(JobError::Cancelled(_)) => {}
        Err(error) => assert!(!error.kind().is_empty() && !error.to_string().is_empty()),
    }
}
