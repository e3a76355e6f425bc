//! One eigenbasis in parts, as for several machines: each solves some slices of the spectrum, and whoever joins them
//! judges the whole by the counts that they bring along.

use std::num::NonZeroUsize;

use chladni_base::notes::FALLBACKS;
use chladni_base::{Monitor, StageClock};
use chladni_mesh::points::are_points;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::{Basis, EIGENBASIS_PART, Part, Product};
use chladni_spectral::operator::{LaplacianByRows, MassKind, MeshOperator, OperatorKind};
use chladni_spectral::spectrum::approximate_parts;
use chladni_spectral::spectrum::hsim::parts::{PartError, Parted};
use chladni_spectral::spectrum::hsim::{HsimParameters, Variant, Wanted};

use serde_json::{Value, json};

use super::approximation::dense_where_smaller;
use super::part_memory::{BESIDE, Division};
use super::{Approximate, EigenbasisParameters, Exact, Method, Parts, StorageKind, value};
use crate::{JobError, JobParameters, MeshSize, Outcome, ParameterError, SOLVER_VERSION, hash_of};

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
    /// The same job, divided.
    pub(super) fn in_parts(mut self, parts: Parts) -> Result<Self, ParameterError> {
        self.parts = match self.divisible()? {
            Divisible::Spectrum(exact) => parts.checked(match exact.solver.wanted {
                Wanted::Count(count) => Some(count),
                // How many there are is not known before they are counted.
                Wanted::Below { .. } | Wanted::Between { .. } => None,
            })?,
            // How many parts the surface makes is not known before it is there.
            Divisible::Surface(_) => parts.checked(None)?,
        };
        Ok(self)
    }

    /// The method, where it can be divided.
    fn divisible(&self) -> Result<Divisible<'_>, ParameterError> {
        let refused = |name: &'static str, reason: &str| Err(value(name, format!("{reason} is not solved in parts")));
        let method = match &self.method {
            Method::Exact(exact) if exact.solver.variant == Variant::Sliced => Divisible::Spectrum(exact),
            Method::Approximate(approximate) => Divisible::Surface(approximate),
            _ => {
                return refused(
                    "method",
                    "what is neither of the method \"approximate\" nor of \"hsim\", variant \"sliced\",",
                );
            }
        };
        if self.is_hodge() || self.is_nested() {
            return refused("operator", "an operator that is not of a surface");
        }
        match method {
            Divisible::Spectrum(exact) if exact.storage == StorageKind::Compact => {
                refused("storage", "what is stored compactly")
            }
            Divisible::Surface(approximate) if approximate.certify => refused("certify", "a count of eigenvalues"),
            Divisible::Surface(approximate) if approximate.refinement.is_some() => {
                refused("refinement", "a refinement")
            }
            Divisible::Surface(_) if self.operator.mass == MassKind::Consistent => {
                refused("mass", "an approximation with a consistent mass")
            }
            Divisible::Surface(_) if !is_of_triangles(&self.operator.operator) => {
                refused("operator", "an approximation of another operator than the Laplacian by cotangents")
            }
            method => Ok(method),
        }
    }

    /// Bytes that a job needs beside those of a whole one to join its parts: one as it was stored, and decoded.
    pub(super) fn joined_bytes(&self, vertices: usize) -> u64 {
        let Some(parts) = self.parts else { return 0 };
        if let Method::Approximate(_) = &self.method {
            // A part's rows of the subspace as they were stored, beside the same rows decoded.
            return 2 * 8 * 50 * vertices as u64;
        }
        let parts = parts.number().map_or(2, NonZeroUsize::get);
        let share = (self.most_pairs().div_ceil(parts) + BESIDE).min(vertices);
        2 * 8 * (vertices * share) as u64
    }

    /// Does some work with the operator.
    fn with_operator<T>(
        &self,
        mesh: &TriangleMesh,
        monitor: &dyn Monitor,
        work: impl FnOnce(&TriangleMesh, &MeshOperator) -> Result<T, JobError>,
    ) -> Result<T, JobError> {
        if are_points(mesh) {
            self.operator.check_points()?;
        }
        match self.points(mesh, monitor)? {
            Some((operator, triangles)) => work(&triangles, &operator),
            None => work(mesh, &self.assemble(mesh, None, monitor)?),
        }
    }

    /// Into how many parts the problem is divided, where so many are asked for or none, and `chosen` of as many as
    /// there would be by nature. The memory that one takes is told where the mesh says that it is less than that of
    /// any. `room` is asked for where it takes as much as one piece.
    fn planned(
        &self,
        mesh: &TriangleMesh,
        parts: Option<NonZeroUsize>,
        chosen: impl Fn(usize, &dyn Fn(NonZeroUsize) -> Option<u64>) -> Option<NonZeroUsize>,
        room: &dyn Fn() -> Result<(), JobError>,
        monitor: &dyn Monitor,
    ) -> Result<Option<(NonZeroUsize, Option<u64>)>, JobError> {
        let (method, parts) = (self.divisible()?, parts.map(NonZeroUsize::get));
        if let Divisible::Surface(approximate) = method
            && let Some(problem) = LaplacianByRows::new(mesh, &self.operator, monitor)?
        {
            let natural = approximate_parts::Parted::number(&problem, &approximate.parameters(self.seed), parts)?;
            let size = MeshSize::of_body(mesh, None);
            let is_by_pieces = self.is_by_pieces(approximate, &problem);
            let bytes = |parts| is_by_pieces.then(|| approximate.part_bytes(size, parts));
            return Ok(chosen(natural, &bytes).map(|parts| (parts, bytes(parts))));
        }
        // All rows of the matrix are made, as in one piece.
        room()?;
        let natural = self.with_operator(mesh, monitor, |mesh, operator| {
            let natural = match method {
                Divisible::Spectrum(exact) => {
                    let solver = HsimParameters { seed: self.seed, ..exact.solver };
                    Parted::new(mesh, &operator.problem, &solver, parts, SOLVER_VERSION, monitor)?.plan().parts
                }
                Divisible::Surface(approximate) => {
                    let parameters = approximate.parameters(self.seed);
                    let of =
                        approximate_parts::Parted::new(mesh, operator, &parameters, parts, SOLVER_VERSION, monitor);
                    of?.plan().parts
                }
            };
            Ok(natural)
        })?;
        Ok(chosen(natural, &|_| None).map(|parts| (parts, None)))
    }

    /// Solves one of so many parts, as by a version of the solver.
    fn part(
        &self,
        mesh: &TriangleMesh,
        (number, parts): (usize, NonZeroUsize),
        version: &str,
        monitor: &dyn Monitor,
    ) -> Result<Part, JobError> {
        let (method, parts) = (self.divisible()?, Some(parts.get()));
        if let Divisible::Surface(approximate) = method
            && let Some(problem) = LaplacianByRows::new(mesh, &self.operator, monitor)?
        {
            let parameters = approximate.parameters(self.seed);
            let parted = approximate_parts::Parted::by_rows(&problem, &parameters, parts, version, monitor)?;
            return Ok(parted.solve(number)?);
        }
        self.with_operator(mesh, monitor, |mesh, operator| {
            let part = match method {
                Divisible::Spectrum(exact) => {
                    let solver = HsimParameters { seed: self.seed, ..exact.solver };
                    Parted::new(mesh, &operator.problem, &solver, parts, version, monitor)?.solve(number)?
                }
                Divisible::Surface(approximate) => {
                    let parameters = approximate.parameters(self.seed);
                    approximate_parts::Parted::new(mesh, operator, &parameters, parts, version, monitor)?
                        .solve(number)?
                }
            };
            Ok(part)
        })
    }

    /// Joins parts of the problem.
    fn join(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        (parts, version): (NonZeroUsize, &str),
        part: &mut PartSource<'_>,
        room: &dyn Fn() -> Result<(), JobError>,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let (method, parts) = (self.divisible()?, Some(parts.get()));
        if let Divisible::Surface(approximate) = method
            && let Some(problem) = LaplacianByRows::new(mesh, &self.operator, monitor)?
        {
            let parameters = approximate.parameters(self.seed);
            let parted = approximate_parts::Parted::by_rows(&problem, &parameters, parts, version, monitor)?;
            let mut basis = dense_where_smaller(parted.join_within(part, room().is_ok())?, monitor)?;
            self.describe(&mut basis, &problem.without_rows(), self.method_name().name(), solid);
            return Ok(basis);
        }
        room()?;
        self.with_operator(mesh, monitor, |mesh, operator| {
            let mut basis = match method {
                Divisible::Spectrum(exact) => {
                    let solver = HsimParameters { seed: self.seed, ..exact.solver };
                    let parted = Parted::new(mesh, &operator.problem, &solver, parts, version, monitor)?;
                    exact.stored(parted.join(part)?, operator, monitor)?
                }
                Divisible::Surface(approximate) => {
                    let parameters = approximate.parameters(self.seed);
                    let parted = approximate_parts::Parted::new(mesh, operator, &parameters, parts, version, monitor)?;
                    dense_where_smaller(parted.join(part)?, monitor)?
                }
            };
            self.describe(&mut basis, operator, self.method_name().name(), solid);
            Ok(basis)
        })
    }
}

/// What is divided of a problem.
#[derive(Clone, Copy)]
enum Divisible<'a> {
    /// The pairs, by their index.
    Spectrum(&'a Exact),
    /// The vertices.
    Surface(&'a Approximate),
}

/// Whether an operator may turn out to be the Laplacian by cotangents.
pub(super) fn is_of_triangles(operator: &OperatorKind) -> bool {
    matches!(operator, OperatorKind::Auto | OperatorKind::Laplace | OperatorKind::Polygon)
}

impl JobParameters {
    /// Into how many parts the job asks to be divided; `None` where it stays whole.
    pub fn parts(&self) -> Option<Parts> {
        match self {
            Self::Eigenbasis(parameters) => parameters.parts,
            _ => None,
        }
    }

    /// Into how many parts a job is divided that asks for it, where `workers` may solve them at once; `None` where it
    /// is solved in one piece for want of workers, and in words why it is where a number of parts was asked for that
    /// the problem does not give. What it was divided into `before` it is divided into again, so that parts which are
    /// done are found. One that was promised less than one piece takes is divided for a single worker too.
    ///
    /// # Errors
    /// [`JobError`], as [`run`](Self::run); [`JobError::Memory`] where the job takes as much as one piece, and was
    /// promised less.
    pub fn plan_parts(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        workers: usize,
        before: Option<NonZeroUsize>,
        monitor: &dyn Monitor,
    ) -> Result<Result<Option<Division>, String>, JobError> {
        let Some(parts) = self.parts() else { return Ok(Ok(None)) };
        let asked = parts.number().or(before);
        let size = MeshSize::of_body(mesh, solid);
        let room = || self.has_room_for_one_piece(size, monitor);
        let may_be_whole = room().is_ok();
        if asked.is_none() && workers < 2 && may_be_whole {
            return Ok(Ok(None));
        }
        monitor.stage("plan");
        let parameters = self.divided(mesh, solid)?;
        let chosen = |natural: usize, bytes: &dyn Fn(NonZeroUsize) -> Option<u64>| {
            let by_workers = natural.min(workers).min(super::MOST_PARTS);
            // Where there is no room for one piece, a part is to fit where the job itself does.
            let fits = |&parts: &usize| {
                let taken = NonZeroUsize::new(parts).and_then(bytes);
                taken.zip(monitor.promised_bytes()).is_some_and(|(taken, promised)| taken <= promised)
            };
            let that_fit = || (by_workers.max(2)..=super::MOST_PARTS).find(fits).unwrap_or(by_workers);
            let of_itself = || if may_be_whole { by_workers } else { that_fit() };
            NonZeroUsize::new(asked.map_or_else(of_itself, NonZeroUsize::get)).filter(|parts| parts.get() > 1)
        };
        let planned = match parameters.planned(mesh, asked, chosen, &room, monitor) {
            Ok(Some((parts, bytes))) => {
                let most = self.part_memory_bytes(size, parts);
                let memory_bytes = bytes.map_or(most, |bytes| bytes.min(most));
                return Ok(Ok(Some(Division { parts, memory_bytes })));
            }
            Ok(None) => Ok(None),
            // Whoever leaves the number to the server leaves it to it to divide nothing.
            Err(JobError::Parts(PartError::Unsuited { .. })) if parts.number().is_none() => Ok(None),
            Err(JobError::Parts(error @ PartError::Unsuited { .. })) => Err(error.to_string()),
            Err(error) => return Err(error),
        };
        room()?;
        Ok(planned)
    }

    /// Runs a job in one piece that was to be divided, and notes why it was not.
    ///
    /// # Errors
    /// As [`run_body`](Self::run_body); [`JobError::Memory`] where it was promised less.
    pub fn run_whole(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        reason: &str,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        self.check_mesh(MeshSize::of_body(mesh, solid))?;
        self.has_room_for_one_piece(MeshSize::of_body(mesh, solid), monitor)?;
        self.outcome(mesh, monitor, |clock| {
            clock.note(FALLBACKS, &format!("in parts: {reason}"));
            self.work().run_body(mesh, solid, clock)
        })
    }

    /// The jobs that solve the parts.
    pub fn part_jobs(&self, parts: NonZeroUsize) -> impl Iterator<Item = PartJob> {
        let whole = match self {
            Self::Eigenbasis(parameters) => {
                Self::Eigenbasis(EigenbasisParameters { parts: None, ..parameters.clone() })
            }
            other => other.clone(),
        };
        (0..parts.get()).map(move |number| PartJob { whole: whole.clone(), number, parts })
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
        self.solve_part_as(mesh, solid, (number, parts), SOLVER_VERSION, monitor)
    }

    /// The same as by a version of the solver, for a join as by that one.
    ///
    /// # Errors
    /// As [`solve_part`](Self::solve_part).
    pub fn solve_part_as(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        (number, parts): (usize, NonZeroUsize),
        version: &str,
        monitor: &dyn Monitor,
    ) -> Result<MadePart, JobError> {
        let parameters = self.divided(mesh, solid)?;
        let clock = StageClock::new(monitor);
        let part = parameters.part(mesh, (number, parts), version, &clock)?;
        Ok(MadePart { part, seconds: clock.finish() })
    }

    /// Joins all parts of a problem: what comes out is what [`run_body`](Self::run_body) leaves behind.
    ///
    /// # Errors
    /// [`JobError`]; [`PartError`] names the part that is missing, damaged or of something else. [`JobError::Memory`]
    /// where one piece has to be made after all, and the job was promised less than that takes.
    pub fn join_parts(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        parts: NonZeroUsize,
        part: &mut PartSource<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        self.join_parts_as(mesh, solid, (parts, SOLVER_VERSION), part, monitor)
    }

    /// The same for parts that were made as by a version of the solver.
    ///
    /// # Errors
    /// As [`join_parts`](Self::join_parts).
    pub fn join_parts_as(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        of: (NonZeroUsize, &str),
        part: &mut PartSource<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        let parameters = self.divided(mesh, solid)?;
        let room = || self.has_room_for_one_piece(MeshSize::of_body(mesh, solid), monitor);
        self.outcome(mesh, monitor, |clock| parameters.join(mesh, solid, of, part, &room, clock).map(Product::from))
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

/// A job that solves one part of another.
#[derive(Debug, Clone, PartialEq)]
pub struct PartJob {
    /// What it is a part of, as it is solved in one piece.
    pub whole: JobParameters,
    /// Which part, from 0.
    pub number: usize,
    /// Of how many.
    pub parts: NonZeroUsize,
}

impl PartJob {
    /// Its parameters as JSON, in which parts are counted from 1; equal parts have equal ones.
    pub fn canonical(&self) -> Value {
        json!({ "part": self.number + 1, "of": self.parts, "parameters": self.whole.canonical() })
    }

    /// Reads what [`canonical`](Self::canonical) gives.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn read(parameters: &Value) -> Result<Self, ParameterError> {
        let number = |name: &str| parameters[name].as_u64().and_then(|number| usize::try_from(number).ok());
        let form = |reason: &str| ParameterError::Form { kind: EIGENBASIS_PART, reason: reason.to_owned() };
        let parts =
            number("of").and_then(NonZeroUsize::new).ok_or_else(|| form("\"of\" is not how many parts there are"))?;
        let part = number("part").filter(|part| (1..=parts.get()).contains(part));
        let part = part.ok_or_else(|| form("\"part\" is none of so many"))?;
        let whole = JobParameters::parse("eigenbasis", &parameters["parameters"])?;
        Ok(Self { whole, number: part - 1, parts })
    }

    /// The key of equal parts, as by a version of the solver.
    pub fn work_key(&self, mesh: &str, version: &str) -> String {
        hash_of(&(mesh, EIGENBASIS_PART, self.canonical(), version))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};
    use chladni_spectral::basis::Interval;

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
    fn parts_of_a_surface_are_joined_to_the_basis_of_the_job() {
        let mesh = generate(Shape::Genus(2), 3000).unwrap();
        let parameters = json!({"method": "approximate", "count": 45, "dimension": 46, "accuracy": {"goal": 0.5}});
        let job = job(parameters);
        let whole = job.run(&mesh, &Unwatched).unwrap().product.into_eigenbasis().unwrap();
        let made: Vec<Part> =
            (0..3).map(|number| job.solve_part(&mesh, None, (number, parts(3)), &Unwatched).unwrap().part).collect();
        let joined = job.join_parts(&mesh, None, parts(3), &mut |number| Ok(made[number].clone()), &Unwatched);
        let joined = joined.unwrap().product.into_eigenbasis().unwrap();
        for (k, (a, b)) in joined.eigenvalues.iter().zip(&whole.eigenvalues).enumerate() {
            assert!((a - b).abs() <= 1e-9 * b.abs(), "pair {k} is {a}, not {b}");
        }
        assert_eq!(joined.metadata, whole.metadata);
    }

    #[test]
    fn what_is_not_solved_in_parts_is_named() {
        let mesh = generate(Shape::Sphere, 1200).unwrap();
        for (parameters, name) in [
            (json!({"method": "approximate", "certify": true}), "\"certify\""),
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
    fn a_job_is_divided_by_its_pairs_and_by_who_may_solve_them() {
        let mesh = generate(Shape::Genus(2), 1200).unwrap();
        let planned = |parameters: Value, workers: usize, before: Option<usize>| {
            let before = before.and_then(NonZeroUsize::new);
            let plan = job(parameters).plan_parts(&mesh, None, workers, before, &Unwatched).unwrap();
            plan.map(|division| division.map_or(1, |division| division.parts.get()))
        };
        let auto = json!({"method": "hsim", "count": 400, "tolerance": 1e-4, "parts": "auto"});
        let many = [1, 2, 3, 8].map(|workers| planned(auto.clone(), workers, None));
        // Of some 250 pairs each, and not without a second worker.
        assert_eq!(many, [Ok(1), Ok(2), Ok(2), Ok(2)]);
        let few = |parts: Value| json!({"method": "hsim", "count": 130, "tolerance": 1e-6, "parts": parts});
        assert_eq!(planned(few(json!(2)), 1, None), Ok(2));
        assert_eq!(planned(few(json!("auto")), 4, None), Ok(1));
        assert_eq!(planned(few(json!("auto")), 1, Some(2)), Ok(2));
        let below = json!({"method": "hsim", "below": 10.0, "parts": 8});
        let reason = planned(below, 1, None).unwrap_err();
        assert!(reason.contains("not solved in parts"), "{reason}");
    }

    #[test]
    fn jobs_of_parts_are_read_back_and_equal_where_what_they_solve_is() {
        let divided = job(json!({"method": "hsim", "count": 300, "parts": 3}));
        let other = job(json!({"method": "hsim", "count": 300, "parts": "auto"}));
        let made: Vec<PartJob> = divided.part_jobs(parts(3)).collect();
        assert_eq!(made, other.part_jobs(parts(3)).collect::<Vec<_>>());
        let keys: std::collections::HashSet<String> = made.iter().map(|part| part.work_key("a mesh", "1")).collect();
        assert_eq!(keys.len(), 3);
        for part in made {
            assert_eq!(PartJob::read(&part.canonical()), Ok(part));
        }
        for wrong in [json!({}), json!({"of": 2, "part": 3}), json!({"of": 0, "part": 0})] {
            assert!(PartJob::read(&wrong).is_err(), "{wrong}");
        }
    }
}
