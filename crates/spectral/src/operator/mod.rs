//! Operators on a mesh: one public operator per file. Solvers take an [`EigenProblem`]; [`assemble`] makes the one that
//! a client describes by [`OperatorParameters`].

mod assembly;
pub(crate) mod boundary;
mod by_rows;
mod choice;
mod corners;
pub mod curvature;
pub mod derivative;
pub mod elastic;
pub mod extrinsic;
pub mod family;
pub mod frames;
pub mod graph;
pub mod hamiltonian;
pub mod hodge;
pub mod laplace;
mod manifold;
pub mod points;
mod polygon;
pub mod robust;
mod shapes;
pub mod tangential;
pub mod transport;
pub mod vertex_gradients;
pub mod volume;
pub mod weighted;

use chladni_algebra::{GalerkinError, SparseMatrix};
use chladni_base::{Cancelled, Monitor};

pub use by_rows::LaplacianByRows;
pub(crate) use by_rows::spread_rows;
pub use chladni_algebra::MassMatrix;
pub use choice::{
    Boundary, Laplacian, MeshOperator, OperatorKind, OperatorParameters, OperatorReport, OperatorRequest, Potential,
    Reason, assemble,
};
pub use family::FamilyOperators;

/// Why no operator can be made of a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OperatorError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A parameter is out of its range or does not fit the mesh.
    #[error("parameter \"{name}\": {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// Every vertex lies on the boundary, so that nothing is left to solve for.
    #[error("all {vertices} vertices lie on the boundary; the Dirichlet condition leaves no unknowns")]
    NoUnknowns {
        /// The number of vertices.
        vertices: usize,
    },
    /// A face refers to a vertex that is not there.
    #[error("face {face} refers to vertex {vertex} of {vertices}")]
    VertexOutOfRange {
        /// The face.
        face: usize,
        /// The vertex that it refers to.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// A tetrahedron refers to a vertex that is not there.
    #[error("tetrahedron {tetrahedron} refers to vertex {vertex} of {vertices}")]
    TetrahedronOutOfRange {
        /// The tetrahedron.
        tetrahedron: usize,
        /// The vertex that it refers to.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// A coordinate is infinite or not a number.
    #[error("vertex {vertex} has a coordinate that is not finite")]
    NotFinite {
        /// The first such vertex.
        vertex: usize,
    },
    /// There is no face with an area, or its extent is beyond what can be squared.
    #[error("the mesh has no area")]
    NoArea,
    /// There is no tetrahedron with a volume, or its extent is beyond what can be cubed.
    #[error("the tetrahedra have no volume")]
    NoVolume,
    /// Corners are counted in 32 bits.
    #[error("{faces} faces are more than the operator can count")]
    TooManyFaces {
        /// The number of faces.
        faces: usize,
    },
}

impl OperatorError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Parameter { .. } => "invalid-parameters",
            _ => "operator-failed",
        }
    }
}

/// Which mass matrix the hat functions get (`numerics`: per face of area A).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MassKind {
    /// A/6 on the diagonal and A/12 off it: the Galerkin mass.
    Consistent,
    /// A/3 to each corner, lumped.
    #[default]
    Barycentric,
    /// Mixed Voronoi areas (Meyer et al. 2003), lumped.
    Voronoi,
}

/// The generalised eigenproblem `S x = λ M x` on the mesh scaled to unit area.
///
/// `S` is `n × n`, symmetric, both triangles stored, and positive semi-definite but for potentials with negative
/// values. Eigenvalues in the units of the input are those of this problem divided by `area`; eigenvectors that are
/// orthonormal for the mass of the input are these divided by `√area`.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenProblem {
    /// The stiffness matrix; in two dimensions it does not depend on scale, and others have that of the input.
    pub stiffness: SparseMatrix,
    /// The mass matrix over `area`: its entries sum to 1.
    pub mass: MassMatrix,
    /// The area of the mesh in the units of the input; of a solid its volume, of a graph the number of its vertices:
    /// what the entries of the mass of the input sum to.
    pub area: f64,
    /// The vertex of each row, ascending, where boundary vertices are no unknowns; `None` where row `i` is vertex `i`.
    pub unknowns: Option<Vec<u32>>,
}

impl EigenProblem {
    /// The number `n` of unknowns.
    pub fn size(&self) -> usize {
        self.stiffness.rows()
    }

    /// The pencil restricted to the columns of `space`, `n × d`: `UᵀSU` and `UᵀMU`.
    ///
    /// # Errors
    /// [`GalerkinError`]: sizes that do not fit, or the work was cancelled.
    pub fn restrict(
        &self,
        space: &SparseMatrix<f32>,
        monitor: &dyn Monitor,
    ) -> Result<(SparseMatrix, SparseMatrix), GalerkinError> {
        chladni_algebra::galerkin(space, &self.stiffness, &self.mass, monitor)
    }
}

#[cfg(test)]
pub(crate) mod real_meshes;
#[cfg(test)]
mod tests;
