//! The job `operator_family`: the Laplacian, its extrinsic kin and the curvature potential in one subspace.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{JobError, MeshSize, ParameterError, Work};
use crate::basis::Product;
use crate::mesh::TriangleMesh;
use crate::monitor::Monitor;
use crate::operator::family::family;
use crate::spectrum::family::restrict_family;
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::{ApproximationParameters, Space};

/// The largest subspace of a family: every spectrum of it takes a dense matrix of that size.
pub const LARGEST_DIMENSION: usize = 4000;

/// What is to be computed, every default filled in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OperatorFamilyParameters {
    /// The dimension of the subspace, 10 to 4000.
    pub dimension: usize,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

impl Default for OperatorFamilyParameters {
    fn default() -> Self {
        Self { dimension: 1000, seed: 0 }
    }
}

impl OperatorFamilyParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn parse(parameters: &Value) -> Result<Self, ParameterError> {
        let read: Self = super::read_parameters("operator_family", parameters)?;
        if !(10..=LARGEST_DIMENSION).contains(&read.dimension) {
            let reason = format!("must lie between 10 and {LARGEST_DIMENSION}, not be {}", read.dimension);
            return Err(ParameterError::Value { name: "dimension", reason });
        }
        Ok(read)
    }
}

impl Work for OperatorFamilyParameters {
    fn canonical(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    fn check_mesh(&self, _mesh: MeshSize) -> Result<(), ParameterError> {
        Ok(())
    }

    fn memory_bytes(&self, mesh: MeshSize) -> u64 {
        let (n, d) = (mesh.vertices as u64, (self.dimension as u64 * 3 / 2).min(mesh.vertices as u64));
        // Mesh and operators, the space and what makes it, and seven dense matrices.
        24 * n + 12 * mesh.faces as u64 + 400 * n + 700 * n + 56 * d * d + (64 << 20)
    }

    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError> {
        let operators = family(mesh, monitor)?;
        let parameters = ApproximationParameters {
            count: self.dimension,
            dimension: self.dimension,
            space: Space::Heat(HeatParameters::default()),
            goal: None,
            seed: self.seed,
        };
        let mut family = restrict_family(mesh, &operators, &parameters, monitor)?;
        family.metadata["operator"] = serde_json::to_value(&operators.laplacian.report).unwrap_or_default();
        Ok(family.into())
    }
}
