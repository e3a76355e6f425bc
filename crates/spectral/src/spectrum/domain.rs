//! What the functions of an approximation live on.

use chladni_mesh::{TetMesh, TriangleMesh};

use super::heat::HeatParameters;

/// A surface, or a solid with its inside.
#[derive(Debug, Clone, Copy)]
pub enum Domain<'a> {
    /// Triangles.
    Surface(&'a TriangleMesh),
    /// Tetrahedra.
    Solid(&'a TetMesh),
}

impl<'a> From<&'a TriangleMesh> for Domain<'a> {
    fn from(mesh: &'a TriangleMesh) -> Self {
        Self::Surface(mesh)
    }
}

impl<'a> From<&'a TetMesh> for Domain<'a> {
    fn from(solid: &'a TetMesh) -> Self {
        Self::Solid(solid)
    }
}

impl<'a> Domain<'a> {
    /// Where the vertices lie.
    pub fn positions(self) -> &'a [[f64; 3]] {
        match self {
            Self::Surface(mesh) => &mesh.positions,
            Self::Solid(solid) => &solid.positions,
        }
    }

    /// The square of the width of one of `d` cells, on unit size: what heat needs to cross it.
    pub(super) fn cell(self, d: usize) -> f64 {
        match self {
            Self::Surface(_) => 1.0 / d.max(1) as f64,
            Self::Solid(_) => (d.max(1) as f64).powf(-2.0 / 3.0),
        }
    }

    /// The parameters of the heat steps as they are taken here.
    pub(super) fn heat(self, heat: HeatParameters) -> HeatParameters {
        match self {
            Self::Surface(_) => heat,
            Self::Solid(_) => heat.in_solid(),
        }
    }

    /// The square of the longest edge at each vertex.
    pub(super) fn longest_edges(self) -> Vec<f64> {
        let mut longest = vec![0f64; self.positions().len()];
        let mut edge = |a: u32, b: u32| {
            let [p, q] = [a, b].map(|v| self.positions()[v as usize]);
            let square: f64 = p.iter().zip(&q).map(|(p, q)| (p - q) * (p - q)).sum();
            for v in [a, b] {
                longest[v as usize] = longest[v as usize].max(square);
            }
        };
        match self {
            Self::Surface(mesh) => mesh.faces.iter().for_each(|&[a, b, c]| {
                [(a, b), (b, c), (c, a)].into_iter().for_each(|(a, b)| edge(a, b));
            }),
            Self::Solid(solid) => solid.tetrahedra.iter().for_each(|&[a, b, c, d]| {
                [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)].into_iter().for_each(|(a, b)| edge(a, b));
            }),
        }
        longest
    }
}
