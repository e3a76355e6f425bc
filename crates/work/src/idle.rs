//! The job `idle`: it waits, and leaves a function that is the same everywhere. For trials of what is around jobs:
//! queue, leases, storage. No list of kinds has it, and a server takes it only where it was started with the hidden
//! `--idle-jobs`.

use std::time::{Duration, Instant};

use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Basis, Certificate, Compact, Functions, Product};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{JobError, MeshSize, ParameterError, Work};
use crate::packed::Packed;

/// The name of the kind.
pub const IDLE: &str = "idle";

/// The longest that one waits, in seconds.
const LONGEST: f64 = 3600.0;
/// How often one that waits looks whether it is to stop.
const LOOK: Duration = Duration::from_millis(20);

/// What is to be waited for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdleParameters {
    /// Seconds, up to an hour.
    pub seconds: f64,
    /// Tells one job from another. It is the eigenvalue of the function, too.
    pub number: u32,
}

impl IdleParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let read: Self = super::read_parameters(IDLE, parameters)?;
        if !(0.0..=LONGEST).contains(&read.seconds) {
            let reason = format!("must be between 0 and {LONGEST}, not {}", read.seconds);
            return Err(ParameterError::Value { name: "seconds", reason });
        }
        Ok(read)
    }
}

impl Work for IdleParameters {
    fn canonical(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    fn check_mesh(&self, _mesh: MeshSize) -> Result<(), ParameterError> {
        Ok(())
    }

    fn memory_bytes(&self, mesh: MeshSize) -> u64 {
        (1 << 20) + 64 * mesh.vertices as u64
    }

    fn seconds(&self, _mesh: MeshSize) -> Option<f64> {
        Some(self.seconds)
    }

    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError> {
        monitor.stage("idle");
        let (begun, whole) = (Instant::now(), Duration::from_secs_f64(self.seconds));
        monitor.checkpoint()?;
        while let Some(left) = whole.checked_sub(begun.elapsed()).filter(|left| !left.is_zero()) {
            std::thread::sleep(left.min(LOOK));
            monitor.progress(begun.elapsed().as_secs_f64() / self.seconds);
            monitor.checkpoint()?;
        }
        let n = mesh.positions.len();
        let space = SparseMatrix::from_sorted_parts(n, 1, (0..=n).collect(), vec![0; n], vec![1.0; n]);
        let mut coefficients = DenseMatrix::zeros(1, 1);
        coefficients.column_mut(0)[0] = 1.0;
        let basis = Basis {
            functions: Functions::Compact(Compact::new(space, coefficients)),
            eigenvalues: vec![f64::from(self.number)],
            mass: MassMatrix::Diagonal(vec![1.0; n]),
            certificate: Certificate { residuals: vec![0.0], bounds: vec![0.0], ..Certificate::default() },
            metadata: json!({}).into(),
        };
        Ok(basis.into())
    }
}
