//! About how long the methods take on one core: for the choice between them, and to warn before long work begins.
//! Fitted to meshes of 10,000 to 134,000 vertices on a processor with AVX-512. Eleven solves of three of them, 50 to
//! 1,000 pairs beside other work on the machine, took .7 to 2.1 times as long as told
//! (`chladni solve rocker-arm.off -n 500 --method hsim --threads 1`, likewise armadillo and igea, both methods).

use chladni_spectral::spectrum::hsim::{Selection, Variant};

use super::{Approximate, Exact};

/// Seconds that HSIM takes to its default tolerance.
pub(super) fn exact_seconds(vertices: usize, pairs: usize) -> f64 {
    let p = pairs as f64;
    vertices as f64 * (1e-5 + 1.7e-7 * p + 5.5e-10 * p * p)
}

/// The same in a solid, whose factor fills in further: 1.0, 5.5, 25 and 119 CPU seconds were measured for 100 pairs of
/// cubes of 8,000, 27,000, 64,000 and 125,000 vertices.
pub(super) fn exact_seconds_in_solid(vertices: usize, pairs: usize) -> f64 {
    7e-9 * (vertices as f64).powi(2) + exact_seconds(vertices, pairs)
}

impl Exact {
    /// Seconds for so many unknowns, of HSIM and a number of pairs. Two digits of the tolerance beyond the default cost
    /// about a quarter more.
    pub(super) fn seconds(&self, unknowns: usize, pairs: usize) -> Option<f64> {
        let is_hsim = matches!(self.solver.variant, Variant::Sliced | Variant::Published);
        if !is_hsim || !matches!(self.solver.selection, Selection::Count(_)) {
            return None;
        }
        let digits = (1e-2 / self.solver.tolerance).log10().max(0.0);
        Some(exact_seconds(unknowns, pairs) * (1.0 + 0.125 * digits))
    }
}

impl Approximate {
    /// Seconds for so many vertices: columns and bounds grow with the mesh, the dense eigenproblem with the cube of the
    /// dimension.
    pub(super) fn seconds(&self, vertices: usize) -> f64 {
        let d = self.dimension.min(vertices) as f64;
        2.1e-5 * vertices as f64 + 5e-7 * d * d + 5e-10 * d * d * d
    }
}
