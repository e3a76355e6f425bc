//! One of the two surfaces of a map, scaled to unit area.

use chladni_algebra::DenseMatrix;

use super::MapRequest;
use crate::analysis::error::{self, AnalysisError};
use crate::analysis::signature::Signature;
use crate::basis::Basis;

/// A surface at unit area: eigenfunctions `φ √A`, eigenvalues `λ A`.
pub(in crate::analysis) struct Side<'a> {
    pub basis: &'a Basis,
    pub area: f64,
    /// `λ A`.
    pub eigenvalues: Vec<f64>,
    /// The lumped mass of each vertex, in the units of the input.
    pub masses: Vec<f64>,
    /// Which end of each landmark lies on it.
    pub landmarks: Vec<u32>,
}

impl<'a> Side<'a> {
    pub fn new(basis: &'a Basis, landmarks: Vec<u32>) -> Result<Self, AnalysisError> {
        error::lowest(basis)?;
        let masses = basis.mass.lumped();
        let area: f64 = masses.iter().sum();
        error::positive("area", area)?;
        let eigenvalues = basis.eigenvalues.iter().map(|value| value * area).collect();
        Ok(Self { basis, area, eigenvalues, masses, landmarks })
    }

    /// The first `k` modes at some vertices, `p × k`.
    pub fn at(&self, vertices: &[u32], k: usize, what: &'static str) -> Result<DenseMatrix, AnalysisError> {
        let mut values = self.basis.first_at_vertices(vertices, k).map_err(AnalysisError::vertices(what))?;
        values.values_mut().iter_mut().for_each(|value| *value *= self.area.sqrt());
        Ok(values)
    }

    /// Coefficients at unit area of known functions, a column each, `k × q`: heat that starts at each landmark,
    /// signatures, descriptors.
    pub fn known(
        &self,
        request: &MapRequest,
        descriptors: Option<&DenseMatrix>,
        times: &[f64],
    ) -> Result<Vec<Vec<f64>>, AnalysisError> {
        let k = request.start;
        let mut columns = Vec::new();
        let at = self.at(&self.landmarks, k, "landmark")?;
        for landmark in 0..self.landmarks.len() {
            for time in times {
                let value = |mode: usize| (-self.eigenvalues[mode] * time).exp() * at.column(mode)[landmark];
                columns.push((0..k).map(value).collect());
            }
        }
        let mut take = |coefficients: &DenseMatrix, factor: f64| {
            let scaled = |c: usize| coefficients.column(c)[..k].iter().map(|x| factor * x).collect();
            columns.extend((0..coefficients.columns()).map(scaled));
        };
        // `⟨f, φ⟩_M` is `√A` times the coefficient at unit area; heat kernels have the unit 1/A besides.
        let root = self.area.sqrt();
        if request.signatures {
            let times = times.iter().map(|time| time * self.area).collect();
            let values = Signature::HeatKernel { times, normalised: true }.everywhere(self.basis)?;
            take(&self.basis.project(&values)?, root);
        }
        if let Some(given) = descriptors {
            take(given, 1.0 / root);
        }
        Ok(columns)
    }

    /// Vertices that stand for the surface: evenly by area in the order of the mesh, the landmarks among them.
    pub fn samples(&self, count: usize) -> Vec<u32> {
        let n = self.masses.len();
        let mut chosen = self.landmarks.clone();
        if count >= n {
            chosen = (0..n as u32).collect();
        } else {
            let (mut sum, mut taken) = (0.0, 0.0);
            let share = self.area / count as f64;
            for (vertex, mass) in self.masses.iter().enumerate() {
                sum += mass;
                // One for each share of the area, from its middle.
                let due = (sum / share + 0.5).floor();
                if due > taken {
                    chosen.push(vertex as u32);
                    taken = due;
                }
            }
        }
        chosen.sort_unstable();
        chosen.dedup();
        chosen
    }
}
