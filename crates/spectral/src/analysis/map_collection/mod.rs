//! Maps between all shapes of a collection at once, without landmarks.
//!
//! For every pair a first map follows from wave kernel signatures: it takes them to each other, commutes with the
//! Laplacians, with products by the signatures (Nogneng and Ovsjanikov 2017) and with their oriented derivatives (Ren
//! et al. 2018), which tell the left side of a symmetric shape from the right. ZoomOut makes it larger. Single pairs
//! fail even so; together they need not: a common latent basis in which all maps are nearly the identity (Wang et al.
//! 2013; Huang et al. 2020, Consistent ZoomOut) follows mostly the maps that agree with each other. All shapes are then
//! embedded in the latent space, neighbours in it make new maps, these a larger latent basis, and so on. At the end
//! each pair is polished by itself: most shapes are nearer to each other than to what all have in common.

mod cost;
mod cycles;
mod first;
mod known;
mod latent;
mod polish;

use std::sync::atomic::{AtomicUsize, Ordering};

use chladni_algebra::DenseMatrix;
use chladni_base::Monitor;
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;

pub use self::cost::CollectionCost;
use self::known::ShapeSignatures;
use self::latent::Latent;
use super::error::{self, AnalysisError};
use super::functional_map::matching::{Embedded, Match, Standing, map_of_points, zoom_out};
use super::functional_map::side::Side;
use super::functional_map::{MOST_PAIRS, MOST_SAMPLES, PointMap};
use crate::basis::{Basis, ordered_pairs};

pub use crate::basis::CycleErrors;

/// The most shapes of a collection.
pub const MOST_SHAPES: usize = 32;

/// The most vertices that are matched, over all pairs.
pub const MOST_MATCHES: usize = 100_000_000;

/// The largest latent eigenproblem: shapes times pairs.
pub const MOST_UNKNOWNS: usize = 4096;

/// The share of a map's size that its latent space has. What shapes do not have in common needs room beside it.
const LATENT_SHARE: f64 = 0.9;

/// Up to which size maps are refined pair by pair before they are made consistent.
const ALONE: usize = 50;

/// A shape: a basis, and the surface that it belongs to.
#[derive(Debug, Clone, Copy)]
pub struct CollectionShape<'a> {
    /// The basis.
    pub basis: &'a Basis,
    /// The mesh of it: oriented derivatives need its faces, and cycles its positions.
    pub mesh: &'a TriangleMesh,
}

/// What of a shape tells whether it can be mapped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ShapeSize {
    /// Vertices of the surface.
    pub vertices: usize,
    /// Its faces; 0 where there are only points.
    pub faces: usize,
    /// Eigenpairs of the basis.
    pub pairs: usize,
}

/// How the maps of a collection are made.
#[derive(Debug, Clone, PartialEq)]
pub struct CollectionRequest {
    /// The size of the first maps.
    pub start: usize,
    /// The size of the refined maps.
    pub pairs: usize,
    /// By how much they grow at once.
    pub step: usize,
    /// Vertices of each surface that stand for it while maps are refined.
    pub samples: usize,
    /// Whether maps keep the orientation that the faces of the meshes give. Without it nothing tells the sides of a
    /// symmetric shape apart.
    pub oriented: bool,
    /// Whether each pair is refined by itself at the end, from the consistent map on. That is nearer to the truth, and
    /// a little less consistent.
    pub polish: bool,
}

impl Default for CollectionRequest {
    fn default() -> Self {
        Self { start: 30, pairs: 100, step: 5, samples: 2000, oriented: true, polish: true }
    }
}

/// The map from one shape of a collection to another.
#[derive(Debug, Clone, PartialEq)]
pub struct CollectionMap {
    /// The shape where functions come from.
    pub source: usize,
    /// The shape where they go to.
    pub target: usize,
    /// `C`, `k × k`, at unit area: as the maps of the latent basis make it, or polished.
    pub matrix: DenseMatrix,
    /// For every vertex of the target the vertex of the source that corresponds to it.
    pub to_source: PointMap,
    /// `‖C Y_source − Y_target‖ / √m` of the last map that points alone made: how far the pair was from what the
    /// collection agrees on.
    pub disagreement: f64,
}

/// The maps between all shapes of a collection, both ways.
#[derive(Debug, Clone, PartialEq)]
pub struct MapCollection {
    /// A map for each ordered pair of shapes: by source, then by target.
    pub maps: Vec<CollectionMap>,
    /// How far points are from where they started after a walk around.
    pub cycles: CycleErrors,
}

/// Maps by ordered pair.
type Maps = Vec<((usize, usize), DenseMatrix)>;

/// Finds the maps between all shapes of a collection. Announces the stages `descriptors`, `first_maps`, `consistency`
/// and `points`.
///
/// # Errors
/// [`AnalysisError`] names a size out of its range, or a shape whose mesh does not fit or whose spectrum tells nothing.
pub fn map_collection(
    shapes: &[CollectionShape<'_>],
    request: &CollectionRequest,
    monitor: &dyn Monitor,
) -> Result<MapCollection, AnalysisError> {
    check(shapes, request)?;
    monitor.stage("descriptors");
    let places: Vec<usize> = (0..shapes.len()).collect();
    let known = each(&places, monitor, |&place| ShapeSignatures::new(place, shapes[place], request))?;
    let standing = each(&known, monitor, |known| known.standing(request))?;
    monitor.stage("first_maps");
    let pairs: Vec<(usize, usize)> = ordered_pairs(shapes.len()).collect();
    let alone = request.pairs.min(ALONE.max(request.start));
    let mut maps: Maps = each_with_progress(&pairs, monitor, |&(source, target)| {
        let map = first::map(&known[source], &known[target], request.oriented)?;
        let (map, _) = zoom_out(&standing[source].all, &standing[target].all, map, alone, request.step)?;
        Ok(((source, target), map))
    })?;
    monitor.stage("consistency");
    let mut size = alone;
    let mut latent = Latent::new(shapes.len(), size, &maps, None, monitor)?;
    let mut matches: Vec<Vec<Match>> = vec![Vec::new(); pairs.len()];
    let order: Vec<usize> = (0..pairs.len()).collect();
    while size < request.pairs {
        let next = request.pairs.min(size + request.step);
        let embedded = each(&standing, monitor, |own| Embedded::new(&own.all.modes, &latent.embedding(own.shape)?))?;
        let found = each(&order, monitor, |&place| {
            let (source, target) = pairs[place];
            let found = embedded[source].nearest(&embedded[target], &matches[place]);
            let map = map_of_points(&standing[source].all, &standing[target].all, &found, next)?;
            Ok((found, (pairs[place], map)))
        })?;
        (matches, maps) = found.into_iter().unzip();
        size = next;
        latent = Latent::new(shapes.len(), size, &maps, Some(&latent), monitor)?;
        monitor.progress((size - alone) as f64 / (request.pairs - alone) as f64);
    }
    monitor.stage("points");
    let made = match request.polish {
        true => {
            let many = each(&known, monitor, |known| polish::standing(&known.side, request))?;
            each_with_progress(&pairs, monitor, |&(source, target)| {
                let end = |place: usize| (&known[place].side, &many[place]);
                polish::map(end(source), end(target), &latent.map(source, target)?, request)
            })?
        }
        false => {
            let embedded = each(&known, monitor, |known| known.embedded(&latent.embedding(known.place)?))?;
            each_with_progress(&pairs, monitor, |&(source, target)| {
                Ok((latent.map(source, target)?, embedded[source].nearest(&embedded[target], &[])))
            })?
        }
    };
    let finished = |(&(source, target), (matrix, found)): (&(usize, usize), (DenseMatrix, Vec<Match>))| CollectionMap {
        source,
        target,
        matrix,
        to_source: PointMap::of_all(&found),
        disagreement: latent.disagreement(source, target),
    };
    let maps: Vec<CollectionMap> = pairs.iter().zip(made).map(finished).collect();
    let cycles = CycleErrors::new(shapes, &standing, &maps);
    Ok(MapCollection { maps, cycles })
}

impl MapCollection {
    /// The map from one shape to another; `None` where there is none, as from a shape to itself.
    pub fn map(&self, source: usize, target: usize) -> Option<&CollectionMap> {
        self.maps.iter().find(|map| (map.source, map.target) == (source, target))
    }
}

/// What stands for a shape while maps are refined.
struct Samples {
    shape: usize,
    vertices: Vec<u32>,
    all: Standing,
}

/// One thing for each of many, on the threads of the pool; ends where that is asked for.
fn each<A: Sync, B: Send>(
    of: &[A],
    monitor: &dyn Monitor,
    make: impl Fn(&A) -> Result<B, AnalysisError> + Sync,
) -> Result<Vec<B>, AnalysisError> {
    let one = |item: &A| {
        monitor.checkpoint()?;
        make(item)
    };
    of.par_iter().map(one).collect()
}

/// The same, where they are all of a stage.
fn each_with_progress<A: Sync, B: Send>(
    of: &[A],
    monitor: &dyn Monitor,
    make: impl Fn(&A) -> Result<B, AnalysisError> + Sync,
) -> Result<Vec<B>, AnalysisError> {
    let done = AtomicUsize::new(0);
    each(of, monitor, |item| {
        let made = make(item)?;
        monitor.progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / of.len() as f64);
        Ok(made)
    })
}

fn check(shapes: &[CollectionShape<'_>], request: &CollectionRequest) -> Result<(), AnalysisError> {
    let mut sizes = Vec::with_capacity(shapes.len());
    for CollectionShape { basis, mesh } in shapes {
        if basis.vertices() != mesh.positions.len() {
            return Err(AnalysisError::Mesh { basis: basis.vertices(), mesh: mesh.positions.len() });
        }
        sizes.push(ShapeSize { vertices: basis.vertices(), faces: mesh.faces.len(), pairs: basis.count() });
    }
    check_sizes(&sizes, request)
}

/// Checks whether a request fits shapes of some sizes.
///
/// # Errors
/// [`AnalysisError`] names a number out of its range, or tells that a shape has no faces to be oriented by.
pub fn check_sizes(shapes: &[ShapeSize], request: &CollectionRequest) -> Result<(), AnalysisError> {
    error::count("shapes", shapes.len(), 2, MOST_SHAPES)?;
    let most = shapes.iter().map(|shape| shape.pairs).min().unwrap_or(0);
    error::count("pairs", request.pairs, 5, most.min(MOST_PAIRS).min(MOST_UNKNOWNS / shapes.len()))?;
    // A first map has the square of its size of unknowns.
    error::count("start", request.start, 5, request.pairs.min(ALONE))?;
    error::count("step", request.step, 1, MOST_PAIRS)?;
    error::count("samples", request.samples, (2 * request.pairs).min(MOST_SAMPLES), MOST_SAMPLES)?;
    if request.oriented && shapes.iter().any(|shape| shape.faces == 0) {
        return Err(AnalysisError::NoFaces);
    }
    let vertices = shapes.iter().fold(0_usize, |sum, shape| sum.saturating_add(shape.vertices));
    error::count("matches", vertices.saturating_mul(shapes.len() - 1), 1, MOST_MATCHES)
}

impl<'a> ShapeSignatures<'a> {
    fn standing(&self, request: &CollectionRequest) -> Result<Samples, AnalysisError> {
        let vertices = self.side.samples(request.samples);
        let all = Standing::new(self.side.at(&vertices, request.pairs, "sample")?)?;
        Ok(Samples { shape: self.place, vertices, all })
    }

    fn embedded(&self, embedding: &DenseMatrix) -> Result<Embedded, AnalysisError> {
        Embedded::of_all(&self.side, embedding)
    }
}

#[cfg(test)]
mod tests;
