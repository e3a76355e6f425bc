//! What a client may ask for, the operator that is made of it, and why.

use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;
use chladni_mesh::points::are_points;
use serde::{Deserialize, Serialize};

use super::assembly::{Triangles, assemble_on};
use super::points::{assemble_local, local_triangles};
use super::weighted::Parts;
use super::{EigenProblem, MassKind, OperatorError, boundary};

/// Which operator is wanted. In JSON: `"auto"`, `"laplace"`, `"polygon"`, `"robust"`, `"volume"`, `"graph"`, `"hodge"`,
/// `{"extrinsic": {"t": 0.5}}`, `{"hamiltonian": {"potential": {"curvature": {"t": 0.1}}}}`,
/// `{"hamiltonian": {"potential": {"values": [0.0, …]}}}`, `{"weighted": {"scalars": [1.0, …], "fixed": [0, …]}}`.
///
/// [`assemble`], which has a surface alone, refuses `volume` and `hodge`, which acts on no functions: see
/// [`super::volume`], [`super::hodge`] and, for `graph`, [`super::graph`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(description = "Which operator is wanted."))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum OperatorKind {
    /// Laplace–Beltrami: by cotangents, or of the polygons where the file has any of more than three corners, where the
    /// mesh is manifold, next to none of its triangles thin and none a needle; the robust one otherwise.
    #[default]
    Auto,
    /// Laplace–Beltrami by the cotangents of the triangles as they are.
    Laplace,
    /// Laplace–Beltrami of polygons that keep their shape (Bunge et al. 2020); on triangles that of cotangents.
    Polygon,
    /// The robust Laplacian (Sharp and Crane 2020).
    Robust,
    /// The extrinsic family (thesis, eq. 2.13): `(1 − t) S + t A`, on the Laplacian that `auto` chooses.
    Extrinsic {
        /// From 0, the Laplacian, to 1, the operator that also follows the normals.
        #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1, example = 0.5))]
        t: f64,
    },
    /// The Hamiltonian: the Laplacian that `auto` chooses, plus a potential.
    Hamiltonian {
        /// The potential.
        potential: Potential,
    },
    /// The Laplacian on the tetrahedra of a solid.
    Volume,
    /// The combinatorial Laplacian of the edges, from connectivity alone.
    Graph,
    /// The Hodge–Laplacian of tangential fields, two numbers for each face.
    Hodge,
    /// Laplace–Beltrami by cotangents in parts: with weights of the faces, numbers or tensors, and vertices that are
    /// held at zero.
    Weighted(Parts),
}

/// The potential of a Hamiltonian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Potential {
    /// `V = t (κ₁² + κ₂²)` (thesis, appendix 4.C), with the curvatures of the vertices.
    Curvature {
        /// The weight, without unit, at least 0.
        #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1e6, example = 0.1))]
        t: f64,
    },
    /// One value for each vertex, in 1/length² of the input.
    Values(Vec<f64>),
}

/// What holds at the boundary of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Boundary {
    /// Nothing is fixed; the normal derivative vanishes.
    #[default]
    Neumann,
    /// Functions vanish on the boundary: its vertices are no unknowns.
    Dirichlet,
    /// Of fields, the operator `hodge`: they run along the boundary. `neumann` is the same there.
    Tangential,
    /// Of fields, the operator `hodge`: they run across the boundary.
    Normal,
}

/// The eigenproblem that is wanted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OperatorParameters {
    /// The operator.
    pub operator: OperatorKind,
    /// The mass matrix.
    pub mass: MassKind,
    /// The boundary condition.
    pub boundary: Boundary,
}

impl OperatorParameters {
    /// Checks what can be checked without a mesh.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] names what is out of range.
    pub fn check(&self) -> Result<(), OperatorError> {
        let error = |name, reason| Err(OperatorError::Parameter { name, reason });
        match (self.boundary, &self.operator) {
            (Boundary::Dirichlet, OperatorKind::Hodge) => {
                let reason =
                    "fields of \"hodge\" run along the boundary, which is \"tangential\", or across it, \"normal\"";
                return error("boundary", reason.to_owned());
            }
            (Boundary::Neumann | Boundary::Dirichlet, _) | (_, OperatorKind::Hodge) => {}
            (Boundary::Tangential | Boundary::Normal, _) => {
                let reason = "\"tangential\" and \"normal\" apply to fields, the operator \"hodge\"; functions take \"neumann\" or \"dirichlet\"";
                return error("boundary", reason.to_owned());
            }
        }
        match &self.operator {
            OperatorKind::Extrinsic { t } if !(0.0..=1.0).contains(t) => {
                error("operator.extrinsic.t", format!("must be between 0 and 1, not {t}"))
            }
            OperatorKind::Hamiltonian { potential: Potential::Curvature { t } } if !(0.0..=1e6).contains(t) => {
                error("operator.hamiltonian.potential.curvature.t", format!("must be between 0 and 1e6, not {t}"))
            }
            OperatorKind::Hamiltonian { potential: Potential::Values(values) } => {
                match values.iter().position(|v| !v.is_finite()) {
                    Some(vertex) => error(
                        "operator.hamiltonian.potential.values",
                        format!("the value of vertex {vertex} is not a finite number"),
                    ),
                    None => Ok(()),
                }
            }
            OperatorKind::Weighted(parts) => parts.check(),
            _ => Ok(()),
        }
    }

    /// Checks the parameters against the number of vertices.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] where a potential has another number of values.
    pub fn check_mesh(&self, vertices: usize) -> Result<(), OperatorError> {
        match &self.operator {
            OperatorKind::Hamiltonian { potential: Potential::Values(values) } if values.len() != vertices => {
                Err(OperatorError::Parameter {
                    name: "operator.hamiltonian.potential.values",
                    reason: format!("{} values were sent for {vertices} vertices", values.len()),
                })
            }
            _ => Ok(()),
        }
    }
}

/// How the Laplacian is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Laplacian {
    /// From the cotangents of the triangles as they are.
    #[default]
    Cotangent,
    /// From the polygons of the file, each with a point in its middle that is no unknown (Bunge et al. 2020).
    Polygon,
    /// From an intrinsic Delaunay triangulation of the tufted cover (Sharp and Crane 2020).
    Robust,
    /// From linear functions on the tetrahedra of a solid.
    Volume,
    /// From the edges, each of weight 1.
    Graph,
}

/// Why the Laplacian is made so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The client asked for it.
    Requested,
    /// The mesh is manifold and its triangles are fair.
    #[default]
    FairMesh,
    /// The mesh is manifold and fair, and has polygons of more than three corners.
    Polygons,
    /// Some edges or vertices are not manifold.
    NonManifold,
    /// More than one face in a thousand is thin.
    ThinFaces,
    /// The mesh has only points: the triangles are those of local Delaunay triangulations, and fair.
    Points,
    /// Some face is so thin that by cotangents it would spoil the result by itself: its longest edge is over a million
    /// times its height.
    Needle,
}

/// What was chosen and come across when an operator was made.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct OperatorReport {
    /// How the Laplacian was made.
    pub laplacian: Laplacian,
    /// Why.
    pub reason: Reason,
    /// Edges with three or more faces.
    pub non_manifold_edges: usize,
    /// Vertices whose faces form several fans, though none of their edges has three or more faces.
    pub non_manifold_vertices: usize,
    /// Faces with an angle below 0.06 degrees or above 179.94, and those without area.
    pub thin_faces: usize,
    /// Faces without an area: by cotangents they contribute nothing.
    pub zero_area_faces: usize,
    /// Vertices on which nothing acts; their mass is negligible.
    pub massless_vertices: usize,
    /// What was added to the length of each edge before anything else, as a share of the mean length; 0 without the
    /// robust Laplacian.
    pub mollification: f64,
    /// Edges that were flipped on the tufted cover.
    pub flips: usize,
    /// Whether the flips came to an end, so that no weight of the stiffness is negative. Without the robust Laplacian
    /// nobody asked.
    pub delaunay: bool,
    /// Vertices that are no unknowns.
    pub removed_vertices: usize,
    /// Polygons of more than three corners that the operator is made of.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub polygons: usize,
    /// Tetrahedra too flat to have a volume: they contribute nothing.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub flat_tetrahedra: usize,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// An eigenproblem on a mesh, and the Laplacian it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshOperator {
    /// The eigenproblem.
    pub problem: EigenProblem,
    /// The Laplacian with all vertices as unknowns; `None` where `problem` is that.
    pub(super) base: Option<EigenProblem>,
    /// A lower bound on the eigenvalues of the problem, on unit area: the least value of a potential that is negative
    /// somewhere, else 0.
    pub floor: f64,
    /// What was chosen, and why.
    pub report: OperatorReport,
    /// What was asked for; `None` where it was made of something else than a mesh.
    pub asked: Option<OperatorRequest>,
}

/// What was asked for, as a basis carries it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OperatorRequest {
    /// The operator, but for values of a potential and weights of faces, which may be more than everything else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<OperatorKind>,
    /// The mass matrix.
    pub mass: MassKind,
    /// The boundary condition.
    pub boundary: Boundary,
}

impl From<&OperatorParameters> for OperatorRequest {
    fn from(parameters: &OperatorParameters) -> Self {
        let operator = match &parameters.operator {
            OperatorKind::Hamiltonian { potential: Potential::Values(_) } | OperatorKind::Weighted(_) => None,
            other => Some(other.clone()),
        };
        Self { operator, mass: parameters.mass, boundary: parameters.boundary }
    }
}

impl MeshOperator {
    /// An operator whose unknowns are all there are.
    pub(crate) fn whole(problem: EigenProblem) -> Self {
        Self { problem, base: None, floor: 0.0, report: OperatorReport::default(), asked: None }
    }

    /// An operator on all vertices, or what is left of it without those of a boundary.
    ///
    /// # Errors
    /// [`OperatorError::NoUnknowns`] where the boundary is everything.
    pub(crate) fn of_problem(
        whole: EigenProblem,
        boundary: Option<&[u32]>,
        mut report: OperatorReport,
        asked: Option<OperatorRequest>,
    ) -> Result<Self, OperatorError> {
        let Some(boundary) = boundary.filter(|boundary| !boundary.is_empty()) else {
            return Ok(Self { problem: whole, base: None, floor: 0.0, report, asked });
        };
        report.removed_vertices = boundary.len();
        let problem = boundary::without(&whole, boundary)?;
        Ok(Self { problem, base: Some(whole), floor: 0.0, report, asked })
    }

    /// The operator of a solid, brought to unit volume: `area` is the square of the length that is 1 there, so that
    /// eigenvalues of the problem over it are those of the input, as on surfaces.
    pub(crate) fn on_unit_volume(&self) -> Self {
        let length = self.laplacian().area.cbrt();
        let scaled = |problem: &EigenProblem| EigenProblem {
            stiffness: problem.stiffness.scaled(length.recip()),
            mass: problem.mass.clone(),
            area: length * length,
            unknowns: problem.unknowns.clone(),
        };
        Self {
            problem: scaled(&self.problem),
            base: self.base.as_ref().map(scaled),
            floor: self.floor / length,
            report: self.report.clone(),
            asked: self.asked.clone(),
        }
    }

    /// The same with another stiffness of no negative eigenvalues.
    pub(crate) fn with_stiffness(&self, stiffness: SparseMatrix) -> Self {
        let problem = EigenProblem { stiffness, ..self.problem.clone() };
        let (report, asked) = (self.report.clone(), self.asked.clone());
        Self { problem, base: self.base.clone(), floor: 0.0, report, asked }
    }

    /// Whether the problem is that of the Laplacian on all vertices.
    pub fn is_laplacian(&self) -> bool {
        self.base.is_none()
    }

    /// Whether the stiffness is that of the Laplacian, but for vertices that are held at zero.
    pub fn is_laplacian_but_for_the_held(&self) -> bool {
        let (Some(base), Some(unknowns)) = (&self.base, &self.problem.unknowns) else { return self.base.is_none() };
        let mut row_of = vec![u32::MAX; base.size()];
        unknowns.iter().zip(0..).for_each(|(&vertex, row)| row_of[vertex as usize] = row);
        unknowns.par_iter().enumerate().all(|(row, &vertex)| {
            let (columns, values) = base.stiffness.row(vertex as usize);
            let (own, entries) = self.problem.stiffness.row(row);
            let left = columns.iter().zip(values).map(|(&column, value)| (row_of[column as usize], value));
            left.filter(|(column, _)| *column != u32::MAX).eq(own.iter().copied().zip(entries))
        })
    }

    /// The Laplacian on all vertices, without boundary condition: what local functions are diffused with.
    pub fn laplacian(&self) -> &EigenProblem {
        self.base.as_ref().unwrap_or(&self.problem)
    }
}

/// Makes the operator that is asked for; that of points without faces by
/// [`assemble_local`](super::points::assemble_local). Announces the stage `operator`.
///
/// # Errors
/// [`OperatorError`]: parameters out of range, a mesh without area or unknowns, an operator that needs faces where
/// there are none, cancellation.
pub fn assemble(
    mesh: &TriangleMesh,
    parameters: &OperatorParameters,
    monitor: &dyn Monitor,
) -> Result<MeshOperator, OperatorError> {
    if are_points(mesh) {
        parameters.check_points()?;
        return assemble_local(&local_triangles(mesh, monitor)?, parameters, monitor);
    }
    assemble_on(mesh, Triangles::Surface, parameters, monitor)
}
