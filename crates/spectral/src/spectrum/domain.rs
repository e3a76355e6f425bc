//! What the functions of an approximation live on.

use std::sync::atomic::{AtomicU64, Ordering};

use chladni_base::parallel::*;

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
        const ELEMENTS: usize = 1 << 12;
        // Of numbers that are not negative, the bits are in their order.
        let longest: Vec<AtomicU64> = self.positions().par_iter().map(|_| AtomicU64::new(0)).collect();
        let edge = |a: u32, b: u32| {
            let [p, q] = [a, b].map(|v| self.positions()[v as usize]);
            let square: f64 = p.iter().zip(&q).map(|(p, q)| (p - q) * (p - q)).sum();
            for v in [a, b] {
                let longest = &longest[v as usize];
                if square > f64::from_bits(longest.load(Ordering::Relaxed)) {
                    longest.fetch_max(square.to_bits(), Ordering::Relaxed);
                }
            }
        };
        match self {
            Self::Surface(mesh) => mesh.faces.par_iter().with_min_len(ELEMENTS).for_each(|&[a, b, c]| {
                [(a, b), (b, c), (c, a)].into_iter().for_each(|(a, b)| edge(a, b));
            }),
            Self::Solid(solid) => solid.tetrahedra.par_iter().with_min_len(ELEMENTS).for_each(|&[a, b, c, d]| {
                [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)].into_iter().for_each(|(a, b)| edge(a, b));
            }),
        }
        longest.into_iter().map(|bits| f64::from_bits(bits.into_inner())).collect()
    }
}
