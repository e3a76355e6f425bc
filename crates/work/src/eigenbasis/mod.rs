//! The job `eigenbasis`: the lowest eigenpairs of an operator, approximated in a compact basis or computed to a
//! tolerance.

mod approximation;
mod auto;
mod compact;
mod division;
mod duration;
mod exact;
mod hodge;
mod nested;
mod part_memory;
mod parts;
mod request;

use chladni_base::Monitor;
use chladni_mesh::points::{are_points, once_each};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::{Basis, Product, Provenance};
use chladni_spectral::operator::hodge::FieldBoundary;
use chladni_spectral::operator::{
    self, Boundary, MassKind, MeshOperator, OperatorError, OperatorKind, OperatorParameters, Potential, points,
};
use chladni_spectral::spectrum::heat::HeatParameters;
use serde_json::Value;

pub use approximation::{Accuracy, Approximate, Construction};
pub use auto::Auto;
pub use division::{Automatic, MOST_PARTS, Parts};
pub(crate) use exact::{AT_MOST, within};
pub use exact::{Exact, Start, StorageKind};
pub(crate) use nested::no_solid;
pub use part_memory::Division;
pub use parts::{MadePart, PartJob, PartSource};
pub use request::{HsimVariant, MethodName};

pub(crate) use request::Request;
#[cfg(feature = "schema")]
pub(crate) use request::takes;

use super::{JobError, MeshSize, ParameterError, Work};
use crate::packed::Packed;

/// The most eigenpairs that one job may ask for.
pub const LARGEST_COUNT: usize = 20_000;

/// The largest subspace that one job may ask for; its restricted problem is dense.
pub const LARGEST_DIMENSION: usize = 40_000;

/// The most values of a potential that come with a job.
pub const LARGEST_POTENTIAL: usize = 500_000;

/// The most numbers of weights of faces that come with a job.
pub const LARGEST_WEIGHTS: usize = 3_000_000;

/// The pairs of a job that does not say how many.
const COUNT: usize = 100;

/// What is to be computed, checked, every default filled in.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenbasisParameters {
    /// The operator.
    pub operator: OperatorParameters,
    /// How its eigenpairs are computed.
    pub method: Method,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
    /// Into how many parts a server divides the job; `None` where it stays whole.
    pub parts: Option<Parts>,
}

/// How eigenpairs are computed.
#[derive(Debug, Clone, PartialEq)]
pub enum Method {
    /// Whichever of the others the mesh calls for.
    Auto(Auto),
    /// The fast approximation.
    Approximate(Approximate),
    /// Subspace iteration to a tolerance, on a hierarchy or plain.
    Exact(Exact),
}

/// Bytes that the local triangulation of a point takes while the operator is made.
pub(crate) const POINT_BYTES: u64 = 2500;

fn value(name: &'static str, reason: String) -> ParameterError {
    ParameterError::Value { name, reason }
}

impl From<OperatorError> for ParameterError {
    fn from(error: OperatorError) -> Self {
        match error {
            OperatorError::Parameter { name, reason } => Self::Value { name, reason },
            other => Self::Value { name: "operator", reason: other.to_string() },
        }
    }
}

impl EigenbasisParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit: an unknown member, one out of its range, one that belongs to another
    /// method.
    pub fn parse(parameters: &Value) -> Result<Self, ParameterError> {
        Self::read(&Packed::from(parameters))
    }

    /// The same from packed JSON.
    ///
    /// # Errors
    /// As for [`parse`](Self::parse).
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let request = Request::read(parameters)?;
        let count = request.count.unwrap_or(COUNT);
        if !(1..=LARGEST_COUNT).contains(&count) {
            return Err(value("count", format!("must be between 1 and {LARGEST_COUNT}, not {count}")));
        }
        let method = match request.method {
            MethodName::Auto => Method::Auto(Auto::from_request(&request, count)?),
            MethodName::Approximate => Method::Approximate(Approximate::from_request(&request, count)?),
            MethodName::Hsim | MethodName::Sim => Method::Exact(Exact::from_request(&request, count)?),
        };
        let mut operator = OperatorParameters {
            operator: request.operator.unwrap_or_default(),
            mass: request.mass.unwrap_or_default(),
            boundary: request.boundary.unwrap_or_default(),
        };
        operator.check()?;
        if operator.operator == OperatorKind::Hodge {
            hodge::check(&method, &operator)?;
            // Two words for one condition; equal work has equal parameters.
            if operator.boundary == Boundary::Tangential {
                operator.boundary = Boundary::Neumann;
            }
        }
        if nested::is_nested(&operator.operator) {
            nested::check(&method, &operator)?;
        }
        if let OperatorKind::Hamiltonian { potential: Potential::Values(values) } = &operator.operator
            && values.len() > LARGEST_POTENTIAL
        {
            let reason = format!("{} values exceed the limit of {LARGEST_POTENTIAL}", values.len());
            return Err(value("operator.hamiltonian.potential.values", reason));
        }
        if let OperatorKind::Weighted(parts) = &mut operator.operator {
            for (name, numbers) in [
                ("operator.weighted.scalars", parts.scalars.len()),
                ("operator.weighted.tensors", parts.tensors.len()),
                ("operator.weighted.fixed", parts.fixed.len()),
            ] {
                if numbers > LARGEST_WEIGHTS {
                    return Err(value(name, format!("{numbers} numbers exceed the limit of {LARGEST_WEIGHTS}")));
                }
            }
            // Equal work has equal parameters.
            parts.fixed.sort_unstable();
            parts.fixed.dedup();
        }
        let read = Self { operator, method, seed: request.seed.unwrap_or(0), parts: None };
        match request.parts {
            Some(parts) => read.in_parts(parts),
            None => Ok(read),
        }
    }

    /// The parameters with every default filled in; [`parse`](Self::parse) reads them back.
    pub fn canonical(&self) -> Value {
        let mut request = Request {
            operator: Some(self.operator.operator.clone()),
            mass: Some(self.operator.mass),
            boundary: Some(self.operator.boundary),
            seed: Some(self.seed),
            method: self.method_name(),
            parts: self.parts,
            ..Request::default()
        };
        match &self.method {
            Method::Auto(auto) => request.count = Some(auto.approximate.count),
            Method::Approximate(approximate) => approximate.fill(&mut request),
            Method::Exact(exact) => exact.fill(&mut request),
        }
        if self.operator.operator == OperatorKind::Volume {
            request.heat = request.heat.map(HeatParameters::in_solid);
        }
        // Serialising a struct of numbers, strings and options cannot fail; null would only make equal work look
        // different.
        serde_json::to_value(request).unwrap_or_default()
    }

    fn method_name(&self) -> MethodName {
        use chladni_spectral::spectrum::hsim::Variant;
        match &self.method {
            Method::Auto(_) => MethodName::Auto,
            Method::Approximate(_) => MethodName::Approximate,
            Method::Exact(exact) => match exact.solver.variant {
                Variant::Sliced | Variant::Published => MethodName::Hsim,
                Variant::Random | Variant::Bathe => MethodName::Sim,
            },
        }
    }

    /// The parameters as a basis carries them. Values of a potential and weights of faces, which may be more than
    /// everything else, stay out, and the operator with them; and what is no matter of the result.
    fn to_be_recorded(&self) -> Value {
        let mut parameters = crate::of_result(self.canonical());
        let long = matches!(
            &self.operator.operator,
            OperatorKind::Hamiltonian { potential: Potential::Values(_) } | OperatorKind::Weighted(_)
        );
        if let (true, Value::Object(members)) = (long, &mut parameters) {
            members.remove("operator");
        }
        parameters
    }

    /// The most pairs that may come out.
    pub fn most_pairs(&self) -> usize {
        match &self.method {
            Method::Auto(auto) => auto.approximate.count,
            Method::Approximate(approximate) => approximate.count,
            Method::Exact(exact) => exact.most_pairs(),
        }
    }

    /// Checks the parameters against the size of a mesh.
    ///
    /// # Errors
    /// [`ParameterError::Value`] where more pairs are asked for than the mesh has vertices, or a potential has another
    /// number of values.
    pub fn check_mesh(&self, vertices: usize) -> Result<(), ParameterError> {
        self.operator.check_mesh(vertices)?;
        let bounded = match &self.method {
            Method::Auto(_) | Method::Approximate(_) => false,
            Method::Exact(exact) => {
                !matches!(exact.solver.selection, chladni_spectral::spectrum::hsim::Selection::Count(_))
            }
        };
        let count = self.most_pairs();
        if self.is_hodge() {
            return Ok(());
        }
        if count > vertices && !bounded {
            let reason = format!("{count} eigenpairs were requested, but the mesh has {vertices} vertices");
            return Err(value("count", reason));
        }
        Ok(())
    }

    /// Whether eigenfields are wanted: `2F` numbers each.
    pub fn is_hodge(&self) -> bool {
        self.operator.operator == OperatorKind::Hodge
    }

    /// What eigenfields do at a boundary.
    pub(crate) fn field_boundary(&self) -> FieldBoundary {
        if self.operator.boundary == Boundary::Normal { FieldBoundary::Normal } else { FieldBoundary::Tangential }
    }

    /// The same for operators that act on something else than a surface: the vertices of a solid, or of a graph.
    fn is_nested(&self) -> bool {
        nested::is_nested(&self.operator.operator)
    }

    /// An estimate of the memory that the job needs, in bytes: mesh and operator, what the method takes, and the
    /// program.
    pub fn memory_bytes(&self, vertices: usize, faces: usize) -> u64 {
        let (n, f) = (vertices as u64, faces as u64);
        let mesh = 24 * n + 12 * f;
        let operator = n * (7 * 12 + 8 + 8) + n * (6 * 12 + 8) + f * 12;
        // What does not fall apart into triangles is measured in one piece.
        let falls_apart = self.operator.mass != MassKind::Consistent && parts::is_of_triangles(&self.operator.operator);
        let approximated = |approximate: &Approximate| {
            approximate.memory_bytes(n) + if falls_apart { 0 } else { approximate.bytes_of_one_piece(n) }
        };
        let method = match &self.method {
            // What misses its goal is computed exactly after all.
            Method::Auto(auto) if auto.is_exact(vertices) => operator + auto.exact.memory_bytes(n),
            Method::Auto(auto) if Auto::may_become_exact(auto.exact.memory_bytes(n)) => {
                approximated(&auto.approximate).max(operator + auto.exact.memory_bytes(n))
            }
            Method::Auto(Auto { approximate, .. }) => approximated(approximate),
            Method::Approximate(approximate) => approximated(approximate),
            Method::Exact(exact) if self.is_hodge() => hodge::memory_bytes(exact, n, f),
            // The problem is kept a second time, renumbered.
            Method::Exact(exact) => operator + exact.memory_bytes(n),
        };
        // The triangles around every point, thrice as many as the surface has, each with a second sheet.
        let local = if f == 0 { n * POINT_BYTES } else { 0 };
        mesh + operator + local + method + (64 << 20)
    }

    /// About how many seconds of one core the job takes, where that is known: for a number of pairs of a surface, by
    /// the methods but `sim`.
    pub fn seconds(&self, vertices: usize) -> Option<f64> {
        let pairs = self.most_pairs().min(vertices);
        match &self.method {
            _ if self.is_nested() || self.is_hodge() => None,
            Method::Auto(auto) if auto.is_exact(vertices) => auto.exact.seconds(vertices, pairs),
            Method::Auto(Auto { approximate, .. }) | Method::Approximate(approximate) => {
                Some(approximate.seconds(vertices))
            }
            Method::Exact(exact) => exact.seconds(vertices, pairs),
        }
    }

    /// Whether the operator acts inside a solid.
    pub fn is_of_volume(&self) -> bool {
        self.operator.operator == OperatorKind::Volume
    }

    /// Makes the operator of a mesh, or of the solid whose surface it is.
    ///
    /// # Errors
    /// [`JobError`]: no solid where one is needed, an operator that cannot be made, cancellation.
    pub fn assemble(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        monitor: &dyn Monitor,
    ) -> Result<MeshOperator, JobError> {
        if self.operator.operator != OperatorKind::Volume {
            return Ok(operator::assemble(mesh, &self.operator, monitor)?);
        }
        let solid = solid.ok_or_else(no_solid)?;
        Ok(operator::volume::assemble(solid, self.operator.mass, self.operator.boundary, monitor)?)
    }

    /// Computes the basis. Its metadata hold the report of the operator.
    ///
    /// # Errors
    /// [`JobError`]: parameters that do not fit the mesh, a numerical failure, or cancellation.
    pub fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Basis, JobError> {
        self.basis(mesh, None, monitor)
    }

    fn basis(&self, mesh: &TriangleMesh, solid: Option<&TetMesh>, monitor: &dyn Monitor) -> Result<Basis, JobError> {
        if are_points(mesh) {
            self.operator.check_points()?;
        }
        if let (true, Method::Exact(exact)) = (self.is_hodge(), &self.method) {
            let mut basis = hodge::run(exact, mesh, self.field_boundary(), self.seed, monitor)?;
            basis.metadata.set("parameters", self.to_be_recorded());
            if solid.is_some() {
                basis.metadata.set_domain("surface_of_solid");
            }
            return Ok(basis);
        }
        let local;
        let (operator, mesh) = match self.points(mesh, monitor)? {
            Some((operator, triangles)) => {
                local = triangles;
                (operator, &local)
            }
            None => (self.assemble(mesh, solid, monitor)?, mesh),
        };
        let (mut basis, method) = match &self.method {
            Method::Auto(auto) => {
                let exact = self.exactly(&auto.exact, mesh, solid, &operator, monitor);
                auto.run(nested::domain(&self.operator.operator, mesh, solid), &operator, exact, self.seed, monitor)?
            }
            Method::Approximate(approximate) => (
                approximate.run(nested::domain(&self.operator.operator, mesh, solid), &operator, self.seed, monitor)?,
                self.method_name().name(),
            ),
            Method::Exact(exact) if self.is_nested() => {
                (nested::run(exact, &operator, mesh, solid, self.seed, monitor)?, self.method_name().name())
            }
            Method::Exact(exact) => (exact.run(mesh, &operator, self.seed, monitor)?, self.method_name().name()),
        };
        self.describe(&mut basis, &operator, method, solid);
        Ok(basis)
    }

    /// The operator of points without faces, and the triangles around all of them: the spaces of a solver ask who is
    /// beside whom. `None` for a mesh that has faces.
    fn points(
        &self,
        mesh: &TriangleMesh,
        monitor: &dyn Monitor,
    ) -> Result<Option<(MeshOperator, TriangleMesh)>, JobError> {
        if !are_points(mesh) {
            return Ok(None);
        }
        let triangles = points::local_triangles(mesh, monitor)?;
        let operator = points::assemble_local(&triangles, &self.operator, monitor)?;
        Ok(Some((operator, once_each(&triangles))))
    }

    /// How the exact method computes the basis, and how many bytes that takes.
    fn exactly<'a>(
        &self,
        exact: &'a Exact,
        mesh: &'a TriangleMesh,
        solid: Option<&'a TetMesh>,
        operator: &'a MeshOperator,
        monitor: &'a dyn Monitor,
    ) -> (u64, impl FnOnce() -> Result<Basis, JobError> + use<'a>) {
        let (nested, seed) = (self.is_nested(), self.seed);
        let bytes = if nested {
            nested::memory_bytes(&self.operator.operator, exact, MeshSize::of_body(mesh, solid))
        } else {
            exact.memory_bytes(mesh.positions.len() as u64)
        };
        let run = move || {
            if nested {
                nested::run(exact, operator, mesh, solid, seed, monitor)
            } else {
                exact.run(mesh, operator, seed, monitor)
            }
        };
        (bytes, run)
    }

    /// Lets a basis say what it is of. What was asked for by bounds is known to the run alone.
    fn describe(&self, basis: &mut Basis, operator: &MeshOperator, method: &str, solid: Option<&TetMesh>) {
        let interval = basis.metadata.json().get("interval").cloned();
        basis.metadata = Provenance::of_operator(operator);
        basis.metadata.set("method", method.into());
        basis.metadata.set("parameters", self.to_be_recorded());
        // That of a solid says whether it is of its inside or of its skin.
        if solid.is_some() {
            let inside = self.operator.operator == OperatorKind::Volume;
            basis.metadata.set_domain(if inside { "solid" } else { "surface_of_solid" });
        }
        if let Some(interval) = interval {
            basis.metadata.set("interval", interval);
        }
    }
}

impl Work for EigenbasisParameters {
    fn canonical(&self) -> Value {
        self.canonical()
    }

    fn check_mesh(&self, mesh: MeshSize) -> Result<(), ParameterError> {
        if mesh.are_points() {
            self.operator.check_points()?;
        }
        if self.is_nested() {
            return self.check_mesh(nested::vertices(&self.operator.operator, mesh)?);
        }
        if let OperatorKind::Weighted(parts) = &self.operator.operator {
            parts.check_mesh(mesh.vertices, mesh.faces)?;
        }
        let (count, most) = (self.most_pairs(), 2 * mesh.faces);
        if self.is_hodge() && count > most {
            let reason = format!("{count} eigenfields were requested, but {} faces have {most} numbers", mesh.faces);
            return Err(value("count", reason));
        }
        self.check_mesh(mesh.vertices)
    }

    fn memory_bytes(&self, mesh: MeshSize) -> u64 {
        if self.is_nested() {
            let surface = 24 * mesh.vertices as u64 + 12 * mesh.faces as u64;
            return surface + nested::bytes_of(&self.operator.operator, &self.method, mesh) + (64 << 20);
        }
        let most = self.bytes_in_one_piece(mesh);
        // Whether one that leaves it to the server is divided is seen when it is planned.
        match self.parts.and_then(Parts::number).and_then(|_| self.bytes_in_parts(mesh)) {
            Some(bytes) => bytes.min(most),
            None => most,
        }
    }

    fn seconds(&self, mesh: MeshSize) -> Option<f64> {
        self.seconds(mesh.vertices)
    }

    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError> {
        self.run(mesh, monitor).map(Product::from)
    }

    fn run_body(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        monitor: &dyn Monitor,
    ) -> Result<Product, JobError> {
        self.basis(mesh, solid, monitor).map(Product::from)
    }
}

#[cfg(test)]
mod points_tests;
#[cfg(test)]
mod tests;
