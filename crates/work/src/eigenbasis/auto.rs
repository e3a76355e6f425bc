//! The method `auto`: which of the others a mesh and a count call for.

use chladni_base::Monitor;
use chladni_base::notes::FALLBACKS;
use chladni_spectral::basis::{AccuracyReport, Basis};
use chladni_spectral::operator::MeshOperator;
use chladni_spectral::spectrum::Domain;

use super::duration::{exact_seconds, exact_seconds_in_solid};
use super::request::Request;
use super::{Approximate, Exact};
use crate::{JobError, ParameterError};

/// The exact method is taken where it is expected to need at most so many seconds of one core.
const SECONDS: f64 = 1.0;

/// The same in solids, where columns cost more as well: up to here the exact method is the faster one.
const SECONDS_IN_SOLID: f64 = 15.0;

/// What misses its goal by the approximation is computed exactly where that needs no more memory than this: what an
/// ordinary machine has to spare. Beyond, the exact method is one to be asked for, and the approximation says by how
/// much it misses.
const MOST_BYTES: u64 = 8 << 30;

/// Both methods with their defaults; which one runs is decided by the size of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Auto {
    /// The fast approximation.
    pub approximate: Approximate,
    /// HSIM.
    pub exact: Exact,
}

impl Auto {
    /// Takes the members that both methods share, with defaults for what is absent.
    ///
    /// # Errors
    /// [`ParameterError::Value`] names the first that is out of its range.
    pub fn from_request(request: &Request, count: usize) -> Result<Self, ParameterError> {
        Ok(Self {
            approximate: Approximate::from_request(request, count)?,
            exact: Exact::from_request(request, count)?,
        })
    }

    /// Whether a mesh of so many vertices is solved exactly.
    pub fn is_exact(&self, vertices: usize) -> bool {
        let pairs = self.approximate.count.min(vertices);
        exact_seconds(vertices, pairs) <= SECONDS
    }

    /// Whether a solid of so many vertices is solved exactly.
    pub fn is_exact_in_solid(&self, vertices: usize) -> bool {
        let pairs = self.approximate.count.min(vertices);
        exact_seconds_in_solid(vertices, pairs) <= SECONDS_IN_SOLID
    }

    /// Whether what takes so many bytes to solve exactly is so where the approximation misses its goal.
    pub fn may_become_exact(bytes: u64) -> bool {
        bytes <= MOST_BYTES
    }

    /// Computes the basis, and by which method. `exact` does so by the exact method, and needs so many bytes: one that
    /// misses its goal by the approximation is computed exactly, unless that would need too much memory.
    ///
    /// # Errors
    /// [`JobError`]: as the methods.
    pub fn run(
        &self,
        domain: Domain<'_>,
        operator: &MeshOperator,
        (bytes, exact): (u64, impl FnOnce() -> Result<Basis, JobError>),
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<(Basis, &'static str), JobError> {
        let is_exact = match domain {
            Domain::Surface(_) => self.is_exact(operator.problem.size()),
            Domain::Solid(_) => self.is_exact_in_solid(operator.problem.size()),
        };
        if !is_exact {
            let basis = self.approximate.run(domain, operator, seed, monitor)?;
            let missed = basis.certificate.accuracy.filter(|accuracy| !accuracy.reached);
            let Some(AccuracyReport { largest_estimate, goal, .. }) = missed else {
                return Ok((basis, "approximate"));
            };
            let missed = format!(
                "approximation: an estimated error of {largest_estimate:.2e} where at most {goal:.2e} is asked for"
            );
            if !Self::may_become_exact(bytes) {
                let beside = format!("{missed}; not computed exactly, since that would need more than 8 GiB of memory");
                monitor.note(FALLBACKS, &beside);
                return Ok((basis, "approximate"));
            }
            monitor.note(FALLBACKS, &missed);
        }
        Ok((exact()?, "hsim"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eigenbasis::{Accuracy, Method};
    use crate::packed::Packed;
    use crate::{EigenbasisParameters, JobParameters};
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};
    use serde_json::json;

    fn auto(count: usize) -> Auto {
        Auto::from_request(&Request::read(&Packed::from(&json!({"count": count}))).unwrap(), count).unwrap()
    }

    #[test]
    fn small_meshes_and_counts_are_solved_exactly_and_large_ones_approximately() {
        for (vertices, count, exact) in
            [(5_000, 100, true), (40_000, 50, true), (10_000, 200, true), (134_000, 50, false), (10_000, 1_000, false)]
        {
            assert_eq!(auto(count).is_exact(vertices), exact, "{vertices} vertices, {count} pairs");
        }
    }

    #[test]
    fn a_basis_that_needed_a_surer_method_says_so() {
        let mesh = generate(Shape::Torus, 3_000).unwrap();
        // So many pairs are approximated at first, and no approximation meets this goal; fewer are exact from the
        // beginning.
        for (count, expected) in [(700, true), (60, false)] {
            let mut parameters = EigenbasisParameters::parse(&json!({"count": count})).unwrap();
            let Method::Auto(auto) = &mut parameters.method else { panic!("not the method auto") };
            auto.approximate.accuracy = Accuracy::Goal(1e-6);
            let product = JobParameters::Eigenbasis(parameters).run(&mesh, &Unwatched).unwrap().product;
            let details = product.summary().unwrap().details;
            match details[FALLBACKS].as_array().map(Vec::as_slice) {
                Some([missed]) if expected => {
                    let text = missed.as_str().unwrap();
                    assert!(text.starts_with("approximation: ") && text.contains("1.00e-6"), "{text}");
                }
                None if !expected => {}
                other => panic!("{count}: {other:?}"),
            }
            let basis = product.into_eigenbasis().unwrap();
            assert_eq!(basis.metadata.json()["method"], "hsim", "{count} pairs");
        }
    }

    #[test]
    fn a_mesh_too_large_to_be_solved_exactly_needs_what_its_approximation_does() {
        let may = |vertices| Auto::may_become_exact(auto(500).exact.memory_bytes(vertices));
        assert!(may(134_345) && !may(2_149_490));
        let needed = |method: &str| {
            let parameters = json!({"method": method, "count": 500});
            EigenbasisParameters::parse(&parameters).unwrap().memory_bytes(2_149_490, 4_298_976)
        };
        assert_eq!(needed("auto"), needed("approximate"));
    }
}
