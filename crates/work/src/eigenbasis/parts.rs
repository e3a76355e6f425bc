//! One eigenbasis in parts, as for several machines: each solves some slices of the spectrum, and whoever joins them judges the whole by the counts that they bring along.

use std::num::NonZeroUsize;

use chladni_base::{Monitor, StageClock};
use chladni_mesh::points::are_points;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::{Basis, Part, Product};
use chladni_spectral::spectrum::hsim::parts::{PartError, Parted};
use chladni_spectral::spectrum::hsim::{HsimParameters, Variant, Wanted};

use super::{EigenbasisParameters, Exact, Method, StorageKind, value};
use crate::{JobError, JobParameters, MeshSize, Outcome, ParameterError, SOLVER_VERSION};

/// Pairs that slices have beyond their share, those of their neighbours and guards.
const BESIDE: usize = 64;

/// A part that was made.
#[derive(Debug)]
pub struct MadePart {
    /// What is to be joined.
    pub part: Part,
    /// Seconds spent in each stage, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Where the parts of a problem come from: asked for one after the other, from 0.
pub type PartSource<'a> = dyn FnMut(usize) -> Result<Part, PartError> + 'a;

impl EigenbasisParameters {
    /// The method, where it can be divided.
    fn divisible(&self) -> Result<&Exact, ParameterError> {
        let refused = |name: &'static str, reason: &str| Err(value(name, format!("{reason} is not solved in parts")));
        let exact = match &self.method {
            Method::Exact(exact) if exact.solver.variant == Variant::Sliced => exact,
            _ => return refused("method", "what is not of the method \"hsim\", variant \"sliced\","),
        };
        if self.is_hodge() || self.is_nested() {
            return refused("operator", "an operator that is not of a surface");
        }
        if exact.storage == StorageKind::Compact {
            return refused("storage", "what is stored compactly");
        }
        Ok(exact)
    }

    /// Does some work with the problem divided.
    fn with_parts<T>(
        &self,
        mesh: &TriangleMesh,
        parts: NonZeroUsize,
        monitor: &dyn Monitor,
        work: impl FnOnce(&Exact, Parted<'_>, &super::MeshOperator) -> Result<T, JobError>,
    ) -> Result<T, JobError> {
        let exact = self.divisible()?;
        if are_points(mesh) {
            self.operator.check_points()?;
        }
        let local;
        let (operator, mesh) = match self.points(mesh, monitor)? {
            Some((operator, triangles)) => {
                local = triangles;
                (operator, &local)
            }
            None => (self.assemble(mesh, None, monitor)?, mesh),
        };
        let solver = HsimParameters { seed: self.seed, ..exact.solver };
        let parted = Parted::new(mesh, &operator.problem, &solver, Some(parts.get()), SOLVER_VERSION, monitor)?;
        work(exact, parted, &operator)
    }

    /// Joins parts of the problem.
    fn join(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        parts: NonZeroUsize,
        part: &mut PartSource<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        self.with_parts(mesh, parts, monitor, |exact, parted, operator| {
            let pairs = parted.join(part)?;
            let mut basis = exact.stored(pairs, operator, monitor)?;
            self.describe(&mut basis, operator, self.method_name().name(), solid);
            Ok(basis)
        })
    }
}

impl JobParameters {
    /// An estimate of the memory that one of so many parts needs, in bytes.
    pub fn part_memory_bytes(&self, mesh: MeshSize, parts: NonZeroUsize) -> u64 {
        let Self::Eigenbasis(parameters) = self else { return self.memory_bytes(mesh) };
        let Method::Exact(exact) = &parameters.method else { return self.memory_bytes(mesh) };
        let share = exact.most_pairs().div_ceil(parts.get()) + BESIDE;
        let solver = HsimParameters { wanted: Wanted::Count(share.min(exact.most_pairs())), ..exact.solver };
        let method = Method::Exact(Exact { solver, ..exact.clone() });
        Self::Eigenbasis(EigenbasisParameters { method, ..parameters.clone() }).memory_bytes(mesh)
    }

    /// Solves one part of a problem, counted from 0, on the rayon pool of the calling thread.
    ///
    /// # Errors
    /// [`JobError`]: what is not solved in parts, a part that there is not, cancellation.
    pub fn solve_part(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        (number, parts): (usize, NonZeroUsize),
        monitor: &dyn Monitor,
    ) -> Result<MadePart, JobError> {
        let parameters = self.divided(mesh, solid)?;
        let clock = StageClock::new(monitor);
        let part = parameters.with_parts(mesh, parts, &clock, |_, parted, _| Ok(parted.solve(number)?))?;
        Ok(MadePart { part, seconds: clock.finish() })
    }

    /// Joins all parts of a problem: what comes out is what [`run_body`](Self::run_body) leaves behind.
    ///
    /// # Errors
    /// [`JobError`]; [`PartError`] names the part that is missing, damaged or of something else.
    pub fn join_parts(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        parts: NonZeroUsize,
        part: &mut PartSource<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        let parameters = self.divided(mesh, solid)?;
        self.outcome(mesh, monitor, |clock| parameters.join(mesh, solid, parts, part, clock).map(Product::from))
    }

    /// The only kind that is solved in parts.
    fn divided(&self, mesh: &TriangleMesh, solid: Option<&TetMesh>) -> Result<&EigenbasisParameters, JobError> {
        self.check_mesh(MeshSize::of_body(mesh, solid))?;
        match self {
            Self::Eigenbasis(parameters) => Ok(parameters),
            _ => Err(value("parts", format!("a job of the kind \"{}\" is not solved in parts", self.kind())).into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};
    use chladni_spectral::basis::Interval;
    use serde_json::{Value, json};

    fn parts(number: usize) -> NonZeroUsize {
        NonZeroUsize::new(number).unwrap()
    }

    fn job(parameters: Value) -> JobParameters {
        JobParameters::parse("eigenbasis", &parameters).unwrap()
    }

    #[test]
    fn parts_are_joined_to_the_basis_of_the_job() {
        let mesh = generate(Shape::Genus(2), 1200).unwrap();
        for parameters in [
            json!({"method": "hsim", "count": 130, "tolerance": 1e-6}),
            json!({"method": "hsim", "count": 130, "precision": "f32", "seed": 5}),
            json!({"method": "hsim", "between": [0.0, 60.0], "at_most": 500}),
        ] {
            let job = job(parameters.clone());
            let whole = job.run(&mesh, &Unwatched).unwrap().product.into_eigenbasis().unwrap();
            let made: Vec<Part> = (0..2)
                .map(|number| job.solve_part(&mesh, None, (number, parts(2)), &Unwatched).unwrap().part)
                .collect();
            let joined = job.join_parts(&mesh, None, parts(2), &mut |number| Ok(made[number].clone()), &Unwatched);
            let joined = joined.unwrap().product.into_eigenbasis().unwrap();
            assert_eq!(joined.eigenvalues.len(), whole.eigenvalues.len(), "{parameters}");
            for (k, (a, b)) in joined.eigenvalues.iter().zip(&whole.eigenvalues).enumerate() {
                // The whole one may be as rough as was asked for; its bound says how rough.
                let allowed = 1e-10 * b + joined.certificate.bounds[k] + whole.certificate.bounds[k];
                assert!((a - b).abs() <= allowed, "{parameters}: pair {k} is {a}, not {b}");
            }
            assert_eq!(joined.certificate.complete, Some(true), "{parameters}");
            // Enclosures of pairs on a bound have their own last digits.
            let interval = |basis: &Basis| {
                let of = |interval: &Interval| {
                    let on_bounds: Vec<usize> = interval.on_bounds.iter().map(|pair| pair.index).collect();
                    (interval.from, interval.to, on_bounds)
                };
                basis.certificate.interval.as_ref().map(of)
            };
            assert_eq!(interval(&joined), interval(&whole), "{parameters}");
            for member in ["parameters", "method", "kind", "solver_version"] {
                assert_eq!(joined.metadata[member], whole.metadata[member], "{parameters}: {member}");
            }
        }
    }

    #[test]
    fn what_is_not_solved_in_parts_is_named() {
        let mesh = generate(Shape::Sphere, 1200).unwrap();
        for (parameters, name) in [
            (json!({"method": "approximate", "count": 130}), "\"method\""),
            (json!({"count": 130}), "\"method\""),
            (json!({"method": "sim", "count": 130}), "\"method\""),
            (json!({"method": "hsim", "variant": "published", "count": 130}), "\"method\""),
            (json!({"method": "hsim", "operator": "graph", "count": 130}), "\"operator\""),
            (json!({"method": "hsim", "operator": "hodge", "count": 130}), "\"operator\""),
            (json!({"method": "hsim", "storage": "compact", "count": 130}), "\"storage\""),
        ] {
            let error = job(parameters.clone()).solve_part(&mesh, None, (0, parts(2)), &Unwatched).unwrap_err();
            assert_eq!(error.kind(), "invalid-parameters", "{parameters}: {error}");
            assert!(error.to_string().contains(name), "{parameters}: {error}");
        }
        let fields = JobParameters::parse("field_basis", &json!({})).unwrap();
        let error = fields.solve_part(&mesh, None, (0, parts(2)), &Unwatched).unwrap_err();
        assert!(error.to_string().contains("field_basis"), "{error}");
    }

    #[test]
    fn a_part_is_promised_less_memory_than_the_whole_and_enough() {
        let job = job(json!({"method": "hsim", "count": 1000, "tolerance": 1e-6}));
        let size = MeshSize { vertices: 134_345, faces: 268_686, ..MeshSize::default() };
        let [one, four] = [1, 4].map(|number| job.part_memory_bytes(size, parts(number)));
        assert_eq!(one, job.memory_bytes(size));
        assert!(2 * four < one, "{four} of {one}");
    }
}
