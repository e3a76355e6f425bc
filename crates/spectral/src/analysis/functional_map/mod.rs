//! Functional maps (Ovsjanikov et al. 2012): correspondences between two surfaces as small matrices, refined by ZoomOut
//! (Melzi et al. 2019).
//!
//! Both surfaces are scaled to unit area: eigenfunctions `φ √A`, eigenvalues `λ A`. `C`, `k × k`, takes the
//! coefficients of a function on the source to those of its image on the target. It follows from functions that are
//! known on both, by least squares with a preference for maps that commute with the Laplacians; then the points of the
//! target look for their nearest neighbours among the images of those of the source, a larger `C` follows from them,
//! and so on.

pub(super) mod matching;
pub(super) mod side;
mod transfer;

use chladni_algebra::{DenseMatrix, solve_definite};

use self::matching::{Images, Match, Standing, transposed, zoom_out};
use self::side::Side;
use super::error::{self, AnalysisError};
use super::spectrum::{kernel_size, log_spaced};
use crate::basis::Basis;

pub use self::transfer::Transfer;

/// The largest map.
pub const MOST_PAIRS: usize = 300;

/// The most landmarks.
pub const MOST_LANDMARKS: usize = 256;

/// The most vertices that stand for a surface while a map is refined.
pub const MOST_SAMPLES: usize = 20_000;

/// Times of the heat that starts at a landmark, and of heat kernel signatures.
const TIMES: usize = 12;

/// What a map is made of, and how large it is.
#[derive(Debug, Clone, PartialEq)]
pub struct MapRequest {
    /// Pairs of a vertex of the source and the one of the target that it corresponds to.
    pub landmarks: Vec<[u32; 2]>,
    /// Functions that are known on both, as coefficients in the whole bases: `m_source × q` and `m_target × q`.
    pub descriptors: Option<(DenseMatrix, DenseMatrix)>,
    /// Whether heat kernel signatures are such functions. They cannot tell the sides of a symmetric shape apart.
    pub signatures: bool,
    /// The size of the first map.
    pub start: usize,
    /// The size of the refined map.
    pub pairs: usize,
    /// By how much it grows at once.
    pub step: usize,
    /// Vertices of each surface that stand for it while the map is refined.
    pub samples: usize,
    /// The weight of the preference for maps that commute with the Laplacians.
    pub commutativity: f64,
    /// Whether every vertex of the target is matched at the end, or only those that stood for it.
    pub all_points: bool,
    /// Whether vertices of the source are matched with some of the target as well, by a map of their own.
    pub both_ways: bool,
}

/// A correspondence: for vertices of one surface, vertices of the other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointMap {
    /// The vertices that were matched, ascending; `None`: all of them.
    pub matched: Option<Vec<u32>>,
    /// For each of them the vertex of the other surface that corresponds to it.
    pub points: Vec<u32>,
    /// For each of them how well its embedding `x` agrees with the image `y` of what it is matched with,
    /// `1 − ‖x − y‖² / (‖x‖² + ‖y‖²)`: 1 where they are equal, 0 where they have nothing in common.
    pub confidences: Vec<f32>,
}

impl PointMap {
    /// Of all vertices of a surface, in order.
    pub(super) fn of_all(found: &[Match]) -> Self {
        Self {
            matched: None,
            points: found.iter().map(|one| one.point).collect(),
            confidences: found.iter().map(|one| one.confidence).collect(),
        }
    }
}

/// A map between two surfaces, and what tells how good it is.
#[derive(Debug, Clone, PartialEq)]
pub struct FunctionalMap {
    /// `C`, `k × k`: column `j` is the image of mode `j` of the source. In coefficients of the stored bases it is
    /// `√(A_target / A_source) C`.
    pub matrix: DenseMatrix,
    /// For vertices of the target the vertices of the source.
    pub to_source: PointMap,
    /// For vertices of the source those of the target, where both ways were asked for.
    pub to_target: Option<PointMap>,
    /// `‖C A − B‖ / ‖B‖` of the first map: how well it takes the known functions to each other.
    pub descriptor_residual: f64,
    /// `‖CᵀC − I‖ / √k`: 0 for a map that preserves areas.
    pub orthogonality_defect: f64,
    /// `‖C Λ_source − Λ_target C‖ / ‖C Λ_source‖`: 0 for an isometry.
    pub commutativity_defect: f64,
    /// The root mean square of the distances, in the spectral embedding of the target, of its vertices to the images of
    /// those that they are matched with, relative to the size of the embedding.
    pub embedding_error: f64,
    /// The share of the source's area whose vertices are matched with some vertex.
    pub coverage: f64,
}

/// Finds the map from one surface to another.
///
/// # Errors
/// [`AnalysisError`] names a landmark that is no vertex, a size out of its range, or says that nothing is known of the
/// map.
pub fn functional_map(source: &Basis, target: &Basis, request: &MapRequest) -> Result<FunctionalMap, AnalysisError> {
    check(source, target, request)?;
    let [sources, targets] = [0, 1].map(|end| request.landmarks.iter().map(|pair| pair[end]).collect::<Vec<u32>>());
    let (from, to) = (Side::new(source, sources)?, Side::new(target, targets)?);
    let times = known_times(&from.eigenvalues[..request.start.max(2).min(source.count())])?;
    let descriptors = request.descriptors.as_ref();
    let a = from.known(request, descriptors.map(|d| &d.0), &times)?;
    let b = to.known(request, descriptors.map(|d| &d.1), &times)?;
    error::count("known functions", a.len(), 1, usize::MAX)?;
    let (a, b) = normalised(a, b, request.start);
    let there = Refined::new(&from, &to, &a, &b, request)?;
    let to_target = match request.both_ways {
        true => Some(Refined::new(&to, &from, &b, &a, request)?.points),
        false => None,
    };
    let mut hit = vec![false; from.masses.len()];
    there.points.points.iter().for_each(|&point| hit[point as usize] = true);
    let covered: f64 = hit.iter().zip(&from.masses).filter(|(hit, _)| **hit).map(|(_, mass)| mass).sum();
    let (orthogonality_defect, commutativity_defect) = defects(&from, &to, &there.map)?;
    Ok(FunctionalMap {
        to_source: there.points,
        to_target,
        descriptor_residual: there.descriptor_residual,
        orthogonality_defect,
        commutativity_defect,
        embedding_error: there.embedding_error,
        coverage: covered / from.area,
        matrix: there.map,
    })
}

fn check(source: &Basis, target: &Basis, request: &MapRequest) -> Result<(), AnalysisError> {
    let most = source.count().min(target.count()).min(MOST_PAIRS);
    error::count("pairs", request.pairs, 1, most)?;
    error::count("start", request.start, 1, request.pairs)?;
    error::count("step", request.step, 1, MOST_PAIRS)?;
    error::count("landmarks", request.landmarks.len(), 0, MOST_LANDMARKS)?;
    // Fewer would leave the larger maps undetermined.
    error::count("samples", request.samples, (2 * request.pairs).min(MOST_SAMPLES), MOST_SAMPLES)?;
    if !(0.0..=MOST_COMMUTATIVITY).contains(&request.commutativity) {
        let expected = "a number from 0 to 1e12";
        return Err(AnalysisError::Parameter { parameter: "commutativity", value: request.commutativity, expected });
    }
    Ok(())
}

/// Times of heat that tell of all the first modes: at the earliest the last of them has hardly decayed, at the latest
/// even the first above zero is gone.
fn known_times(eigenvalues: &[f64]) -> Result<Vec<f64>, AnalysisError> {
    let first = kernel_size(eigenvalues)?;
    let last = eigenvalues.last().copied().unwrap_or(1.0);
    Ok(log_spaced(0.2 / last, 4.0 / eigenvalues[first], TIMES))
}

/// A map of the size that is wanted, and its points.
struct Refined {
    map: DenseMatrix,
    points: PointMap,
    descriptor_residual: f64,
    embedding_error: f64,
}

impl Refined {
    /// The first map takes `a` to `b`; ZoomOut makes it larger.
    fn new(
        from: &Side,
        to: &Side,
        a: &DenseMatrix,
        b: &DenseMatrix,
        request: &MapRequest,
    ) -> Result<Self, AnalysisError> {
        let map = first_map(from, to, a, b, request)?;
        let descriptor_residual = residual(&map, a, b)?;
        let (samples, stand) = (from.samples(request.samples), to.samples(request.samples));
        let standing = |side: &Side, chosen: &[u32]| Standing::new(side.at(chosen, request.pairs, "sample")?);
        let (there, here) = (standing(from, &samples)?, standing(to, &stand)?);
        let (map, mut matches) = zoom_out(&there, &here, map, request.pairs, request.step)?;
        let images = Images::of_all(from, &map)?;
        matches.iter_mut().for_each(|one| one.point = samples[one.point as usize]);
        let (matched, found) = if request.all_points {
            let before = if stand.len() == to.masses.len() { &matches[..] } else { &[] };
            (None, images.nearest_of_all(to, before)?)
        } else {
            let found = images.nearest(&here.modes, &matches);
            (Some(stand), found)
        };
        let squares: f64 = found.iter().map(|one| f64::from(one.square)).sum();
        let points = PointMap {
            matched,
            points: found.iter().map(|one| one.point).collect(),
            confidences: found.iter().map(|one| one.confidence).collect(),
        };
        // At unit area each mode has mean square 1.
        let embedding_error = (squares / found.len().max(1) as f64 / map.rows() as f64).sqrt();
        Ok(Self { map, points, descriptor_residual, embedding_error })
    }
}

/// How far a map is from preserving areas, and from commuting with the Laplacians.
fn defects(from: &Side, to: &Side, map: &DenseMatrix) -> Result<(f64, f64), AnalysisError> {
    let k = map.columns();
    let (mut defect, mut wrong, mut whole) = (0.0, 0.0, 0.0);
    let gram = map.transposed_times(map);
    for column in 0..k {
        for row in 0..k {
            let one = if row == column { 1.0 } else { 0.0 };
            defect += (gram.column(column)[row] - one).powi(2);
            let entry = map.column(column)[row];
            wrong += (entry * (from.eigenvalues[column] - to.eigenvalues[row])).powi(2);
            whole += (entry * from.eigenvalues[column]).powi(2);
        }
    }
    Ok(((defect / k as f64).sqrt(), if whole > 0.0 { (wrong / whole).sqrt() } else { 0.0 }))
}

/// Known functions side by side, each pair scaled to size 1.
fn normalised(a: Vec<Vec<f64>>, b: Vec<Vec<f64>>, k: usize) -> (DenseMatrix, DenseMatrix) {
    let (mut left, mut right) = (DenseMatrix::zeros(k, a.len()), DenseMatrix::zeros(k, a.len()));
    for (column, (a, b)) in a.into_iter().zip(b).enumerate() {
        let square: f64 = a.iter().chain(&b).map(|x| x * x).sum();
        let factor = if square > 0.0 { (2.0 / square).sqrt() } else { 0.0 };
        left.column_mut(column).iter_mut().zip(a).for_each(|(slot, x)| *slot = factor * x);
        right.column_mut(column).iter_mut().zip(b).for_each(|(slot, x)| *slot = factor * x);
    }
    (left, right)
}

/// `argmin ‖C A − B‖² + α ‖C Λ_source − Λ_target C‖²`, row by row.
fn first_map(
    from: &Side,
    to: &Side,
    a: &DenseMatrix,
    b: &DenseMatrix,
    request: &MapRequest,
) -> Result<DenseMatrix, AnalysisError> {
    let k = request.start;
    let (at, bt) = (transposed(a), transposed(b));
    let gram = at.transposed_times(&at);
    let sides = at.transposed_times(&bt);
    let mean = (0..k).map(|i| gram.column(i)[i]).sum::<f64>() / k as f64;
    let largest = from.eigenvalues[k - 1].max(to.eigenvalues[k - 1]).max(f64::MIN_POSITIVE);
    let mut map = DenseMatrix::zeros(k, k);
    for row in 0..k {
        let mut system = gram.clone();
        for column in 0..k {
            let gap = (to.eigenvalues[row] - from.eigenvalues[column]) / largest;
            system.column_mut(column)[column] += mean * (request.commutativity * gap * gap + 1e-11);
        }
        let mut solution = sides.slice_columns(row..row + 1);
        solve_definite(system, &mut solution)?;
        solution.column(0).iter().enumerate().for_each(|(column, &value)| map.column_mut(column)[row] = value);
    }
    Ok(map)
}

/// The largest weight of commutativity: maps are diagonal long before, and sums of squares finite.
const MOST_COMMUTATIVITY: f64 = 1e12;

fn residual(map: &DenseMatrix, a: &DenseMatrix, b: &DenseMatrix) -> Result<f64, AnalysisError> {
    let image = map.times(a);
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let lost = square(&mut image.values().iter().zip(b.values()).map(|(x, y)| x - y));
    let whole = square(&mut b.values().iter().copied());
    Ok(if whole > 0.0 { (lost / whole).sqrt() } else { 0.0 })
}

#[cfg(test)]
mod tests;
