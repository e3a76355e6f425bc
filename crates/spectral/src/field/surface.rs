//! What fields live on: a mesh with its dual graph and its frames.

use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::{DualError, DualGraph, OneSided};

use crate::operator::OperatorError;
use crate::operator::frames::FaceFrames;

/// Why fields do not live on a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// The mesh is no manifold.
    #[error(transparent)]
    Manifold(#[from] DualError),
    /// The surface has one side, or its faces do not agree about two.
    #[error("{what} {at}")]
    OneSided {
        /// What needs sides, and that it does.
        what: &'static str,
        /// Where they do not agree.
        at: OneSided,
    },
    /// The mesh has no frames.
    #[error(transparent)]
    Frames(#[from] OperatorError),
}

/// A surface that fields can live on: a mesh, its dual graph and its frames.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldSurface {
    mesh: TriangleMesh,
    dual: DualGraph,
    frames: FaceFrames,
}

impl FieldSurface {
    /// Builds graph and frames.
    ///
    /// # Errors
    /// [`SurfaceError`] names the edge or vertex where the mesh is no manifold, or what else is wrong with it.
    pub fn new(mesh: TriangleMesh) -> Result<Self, SurfaceError> {
        let dual = DualGraph::new(&mesh)?;
        let frames = FaceFrames::new(&mesh)?;
        Ok(Self { mesh, dual, frames })
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Who is next to whom.
    pub fn dual(&self) -> &DualGraph {
        &self.dual
    }

    /// A frame in every face.
    pub fn frames(&self) -> &FaceFrames {
        &self.frames
    }

    /// The number of faces.
    pub fn faces(&self) -> usize {
        self.mesh.faces.len()
    }

    /// Whether all faces agree about the sides of the surface, which `what` needs.
    ///
    /// # Errors
    /// [`SurfaceError::OneSided`] names the first edge where they do not.
    pub fn sides(&self, what: &'static str) -> Result<(), SurfaceError> {
        self.dual.oriented().map_err(|at| SurfaceError::OneSided { what, at })
    }
}
