//! Operators on a mesh: one public operator per file. Solvers take an [`EigenProblem`].

use crate::algebra::SparseMatrix;

pub use crate::algebra::MassMatrix;

/// Which mass matrix the hat functions get (`numerics`: per face of area A).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
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
/// `S` is `n × n`, symmetric positive semi-definite, both triangles stored. Eigenvalues in the units of the input are those of
/// this problem divided by `area`; eigenvectors that are orthonormal for the mass of the input are these divided by `√area`.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenProblem {
    /// The stiffness matrix; in two dimensions it does not depend on scale.
    pub stiffness: SparseMatrix,
    /// The mass matrix of the mesh scaled to unit area: its entries sum to 1.
    pub mass: MassMatrix,
    /// The area of the mesh in the units of the input.
    pub area: f64,
}
