//! Points without faces: a surface as scanners and Gaussian splats give it.
//!
//! Each point gets the triangles around it of the Delaunay triangulation of its neighbours, in the plane that fits them
//! best. All of these together cover the surface three times, where neighbours agree, and are what a Laplacian on the
//! points is made of (Sharp and Crane 2020, *A Laplacian for Nonmanifold Triangle Meshes*, section 5.7). A
//! [`TriangleMesh`] of points has positions alone.

mod plane;
mod quad;
mod star;
mod tree;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};

use super::TriangleMesh;

pub use tree::PointTree;

/// How many neighbours a point is triangulated with.
pub const NEIGHBOURS: usize = 30;

/// How often the triangles around all points cover the surface: a triangle belongs to each of its corners.
pub const COVERS: f64 = 3.0;

/// Where this share of the variance of a point's neighbours lies off their plane, they fill space: of a ball it is 1/3,
/// of half a ball .13, along the edge of a cube less than .1.
const OFF_PLANE: f64 = 0.2;

/// Points that are triangulated between two checkpoints, and by one task.
const AT_ONCE: usize = 1 << 16;
const PER_TASK: usize = 1 << 10;

/// Whether a mesh is a set of points.
pub fn are_points(mesh: &TriangleMesh) -> bool {
    mesh.faces.is_empty() && !mesh.positions.is_empty()
}

/// The points with the triangles around each of them, those of point 0 first; the first corner of a triangle is the
/// point that it is around. Most triangles occur three times, in any orientation.
///
/// Neighbours are the [`NEIGHBOURS`] nearest, of equally distant ones those of the lowest number. The result does not
/// depend on the number of threads. All coordinates must be finite.
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn with_local_triangles(positions: &[[f64; 3]], monitor: &dyn Monitor) -> Result<TriangleMesh, Cancelled> {
    Ok(local_triangles(positions, monitor)?.0)
}

/// The same, with the points, ascending, whose neighbours fill space rather than a piece of a surface.
///
/// # Errors
/// As for [`with_local_triangles`].
pub fn local_triangles(positions: &[[f64; 3]], monitor: &dyn Monitor) -> Result<(TriangleMesh, Vec<u32>), Cancelled> {
    let n = positions.len();
    let tree = PointTree::new(positions);
    monitor.checkpoint()?;
    let (mut faces, mut scattered) = (Vec::with_capacity(6 * n), Vec::new());
    for first in (0..n).step_by(AT_ONCE) {
        let block: Vec<u32> = (first as u32..n.min(first + AT_ONCE) as u32).collect();
        let parts: Vec<(Vec<[u32; 3]>, Vec<u32>)> = block
            .par_chunks(PER_TASK)
            .map(|points| {
                let mut scratch = star::Scratch::default();
                let mut found = Vec::with_capacity(6 * points.len());
                let mut off = |&point: &u32| scratch.triangulate(positions, &tree, point, &mut found) > OFF_PLANE;
                let scattered = points.iter().copied().filter(|point| off(point)).collect();
                (found, scattered)
            })
            .collect();
        for (own, off) in parts {
            faces.extend(own);
            scattered.extend(off);
        }
        monitor.checkpoint()?;
        monitor.progress((first + block.len()) as f64 / n as f64);
    }
    Ok((TriangleMesh { positions: positions.to_vec(), faces, ..Default::default() }, scattered))
}

/// Where more than this share of triangles is disputed, eigenvalues may be off by several per cent. Points at random on
/// smooth surfaces dispute up to .7 % of theirs, those on limbs as thin as their spacing several times as much
/// (`docs/decisions/0135`).
pub const MOST_DISPUTED: f64 = 0.01;

/// The points, ascending, around which there is a triangle that one of its other corners does not have, and the share
/// of such triangles in all [`local_triangles`]. Where all points agree, each triangle is found by its three corners.
pub fn disputed(local: &TriangleMesh) -> (Vec<u32>, f64) {
    let faces = &local.faces;
    let count = local.positions.len();
    // Triangles come by the point that they are around.
    let mut begins = vec![0; count + 1];
    faces.iter().for_each(|face| begins[face[0] as usize + 1] += 1);
    (0..count).for_each(|point| begins[point + 1] += begins[point]);
    let around = |point: u32| &faces[begins[point as usize]..begins[point as usize + 1]];
    let has = |point: u32, pair: [u32; 2]| around(point).iter().any(|&[_, a, b]| [a, b] == pair || [b, a] == pair);
    let disputes =
        |point: u32| around(point).iter().filter(|&&[_, a, b]| !(has(a, [point, b]) && has(b, [point, a]))).count();
    let counts: Vec<usize> = (0..count as u32).into_par_iter().map(disputes).collect();
    let triangles: usize = counts.iter().sum();
    let points = (0..count as u32).filter(|&point| counts[point as usize] > 0).collect();
    (points, triangles as f64 / faces.len().max(1) as f64)
}

/// Triangles around points that were made already, for whoever needs them next: they take longer than anything else
/// that a check does. They follow from the positions, so that meshes which differ in what is known are equal, and say
/// nothing once positions have changed.
#[derive(Debug, Clone, Default)]
pub struct Known(Option<(u64, Arc<Vec<[u32; 3]>>)>);

impl Known {
    /// What [`with_local_triangles`] made of these positions.
    pub fn new(local: TriangleMesh) -> (Vec<[f64; 3]>, Self) {
        let TriangleMesh { positions, faces, .. } = local;
        let known = Self(Some((mark(&positions), Arc::new(faces))));
        (positions, known)
    }

    /// The triangles, if they are those of these positions.
    pub fn of(&self, positions: &[[f64; 3]]) -> Option<&[[u32; 3]]> {
        let (of, faces) = self.0.as_ref()?;
        (*of == mark(positions)).then_some(faces.as_slice())
    }
}

impl PartialEq for Known {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What tells positions from others.
fn mark(positions: &[[f64; 3]]) -> u64 {
    let mut hasher = DefaultHasher::new();
    positions.len().hash(&mut hasher);
    positions.as_flattened().iter().for_each(|x| x.to_bits().hash(&mut hasher));
    hasher.finish()
}

/// The triangles of [`with_local_triangles`], those that are known where a check has left them.
///
/// # Errors
/// As for [`with_local_triangles`].
pub fn triangulated(points: &TriangleMesh, monitor: &dyn Monitor) -> Result<TriangleMesh, Cancelled> {
    match points.local.of(&points.positions) {
        Some(faces) => {
            Ok(TriangleMesh { positions: points.positions.clone(), faces: faces.to_vec(), ..Default::default() })
        }
        None => with_local_triangles(&points.positions, monitor),
    }
}

/// The same triangles, each of them once: whom a point has beside it. All of them stay known as the local ones, each
/// beside its copies, with corners by ascending number.
pub fn once_each(local: &TriangleMesh) -> TriangleMesh {
    let mut faces: Vec<[u32; 3]> = local
        .faces
        .par_iter()
        .map(|&face| {
            let mut sorted = face;
            sorted.sort_unstable();
            sorted
        })
        .collect();
    faces.par_sort_unstable();
    let mut once = faces.clone();
    once.dedup();
    let local = TriangleMesh { positions: local.positions.clone(), faces, ..Default::default() };
    let (positions, local) = Known::new(local);
    TriangleMesh { positions, faces: once, local, ..Default::default() }
}

#[cfg(test)]
mod tests;
