//! The job `operator_family`: the Laplacian, its extrinsic kin and the curvature potential in one subspace.

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::Product;
use chladni_spectral::operator::family::family;
use chladni_spectral::spectrum::family::{ANCHORS, restrict_family};
use chladni_spectral::spectrum::hsim;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{JobError, MeshSize, ParameterError, Work};
use crate::packed::Packed;

/// The largest subspace of a family: every spectrum of it takes a dense matrix of that size.
pub const LARGEST_DIMENSION: usize = 4000;

/// What is to be computed, every default filled in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct OperatorFamilyParameters {
    /// The most functions of the subspace, 10 to 4000. An equal share of them are eigenfunctions of each anchor;
    /// spectra are accurate up to about three quarters of that many pairs.
    #[cfg_attr(feature = "schema", schema(minimum = 10, maximum = 4000, example = 780))]
    pub dimension: usize,
    /// Seeds everything that is drawn at random.
    #[cfg_attr(feature = "schema", schema(example = 0))]
    pub seed: u64,
}

impl Default for OperatorFamilyParameters {
    fn default() -> Self {
        Self { dimension: 780, seed: 0 }
    }
}

impl OperatorFamilyParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn parse(parameters: &Value) -> Result<Self, ParameterError> {
        Self::read(&Packed::from(parameters))
    }

    /// The same from packed JSON.
    ///
    /// # Errors
    /// As for [`parse`](Self::parse).
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let read: Self = super::read_parameters("operator_family", parameters)?;
        if !(10..=LARGEST_DIMENSION).contains(&read.dimension) {
            let reason = format!("must be between 10 and {LARGEST_DIMENSION}, not {}", read.dimension);
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
        let (n, most) = (mesh.vertices as u64, (self.dimension as u64 * 3 / 2).min(mesh.vertices as u64));
        let d = if n < 3 * self.dimension as u64 / 2 { most } else { self.dimension as u64 };
        let (stacked, pairs) = (d * 11 / 10 + 32, d / ANCHORS.len() as u64 + 64);
        // Mesh and operators; the columns of all anchors beside those of one solve with its factors, or their
        // selection; dense matrices.
        let solve = 24 * n * pairs + 16 * 60 * n * (n.max(2).ilog2() as u64);
        let columns = 8 * n * stacked + solve.max(8 * n * stacked).max(4 * n * d);
        24 * n + 12 * mesh.faces as u64 + 700 * n + columns + 56 * d * d + hsim::repair_bytes(n) + (64 << 20)
    }

    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError> {
        let operators = family(mesh, monitor)?;
        Ok(restrict_family(mesh, &operators, self.dimension, self.seed, monitor)?.into())
    }
}
