//! Functional maps (Ovsjanikov et al. 2012): correspondences between two surfaces as small matrices, refined by ZoomOut (Melzi et al. 2019).
//!
//! Both surfaces are scaled to unit area: eigenfunctions `φ √A`, eigenvalues `λ A`. `C`, `k × k`, takes the coefficients of a function on the source to
//! those of its image on the target. It follows from functions that are known on both, by least squares with a preference for maps that commute with the
//! Laplacians; then the points of the target look for their nearest neighbours in the spectral embedding of the source, a larger `C` follows from them,
//! and so on.

use chladni_algebra::{DenseMatrix, solve_definite};
use rayon::prelude::*;

use super::error::{self, AnalysisError};
use super::kd_tree::KdTree;
use super::signature::Signature;
use super::spectrum::{kernel_size, log_spaced};
use crate::basis::{Basis, BasisError};

/// The largest map.
pub const MOST_PAIRS: usize = 300;

/// The most landmarks.
pub const MOST_LANDMARKS: usize = 256;

/// The most vertices that stand for a surface while a map is refined.
pub const MOST_SAMPLES: usize = 20_000;

/// Times of the heat that starts at a landmark, and of heat kernel signatures.
const TIMES: usize = 12;

/// Rows that one task handles.
const ROWS_AT_ONCE: usize = 1024;

/// Vertices of the target whose modes are held at once.
const AT_ONCE: usize = 16 * ROWS_AT_ONCE;

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
}

/// A map between two surfaces, and what tells how good it is.
#[derive(Debug, Clone, PartialEq)]
pub struct FunctionalMap {
    /// `C`, `k × k`: column `j` is the image of mode `j` of the source.
    pub matrix: DenseMatrix,
    /// The vertices of the target that were matched; `None`: all of them.
    pub matched: Option<Vec<u32>>,
    /// For each of them the vertex of the source that corresponds to it.
    pub points: Vec<u32>,
    /// `‖C A − B‖ / ‖B‖` of the first map: how well it takes the known functions to each other.
    pub descriptor_residual: f64,
    /// `‖CᵀC − I‖ / √k`: 0 for a map that preserves areas.
    pub orthogonality_defect: f64,
    /// `‖C Λ_source − Λ_target C‖ / ‖C Λ_source‖`: 0 for an isometry.
    pub commutativity_defect: f64,
    /// The root mean square of the distances, in the spectral embedding, of vertices of the target to those of the source that they are matched with,
    /// relative to the size of the embedding.
    pub embedding_error: f64,
    /// The share of the source's area whose vertices are matched with some vertex.
    pub coverage: f64,
}

/// One of the two surfaces, at unit area.
struct Side<'a> {
    basis: &'a Basis,
    area: f64,
    /// `λ A`.
    eigenvalues: Vec<f64>,
    masses: Vec<f64>,
}

impl<'a> Side<'a> {
    fn new(basis: &'a Basis) -> Result<Self, AnalysisError> {
        let masses = basis.mass.lumped();
        let area: f64 = masses.iter().sum();
        error::positive("area", area)?;
        let eigenvalues = basis.eigenvalues.iter().map(|value| value * area).collect();
        Ok(Self { basis, area, eigenvalues, masses })
    }

    /// The first `k` modes at some vertices, `p × k`.
    fn at(&self, vertices: &[u32], k: usize, what: &'static str) -> Result<DenseMatrix, AnalysisError> {
        let mut values = self.basis.first_at_vertices(vertices, k).map_err(AnalysisError::vertices(what))?;
        values.values_mut().iter_mut().for_each(|value| *value *= self.area.sqrt());
        Ok(values)
    }

    /// Coefficients of known functions, a column each, `k × q`: heat that starts at each landmark, signatures, descriptors.
    fn known(
        &self,
        request: &MapRequest,
        landmarks: &[u32],
        descriptors: Option<&DenseMatrix>,
        times: &[f64],
    ) -> Result<Vec<Vec<f64>>, AnalysisError> {
        let k = request.start;
        let mut columns = Vec::new();
        let at = self.at(landmarks, k, "landmark")?;
        for landmark in 0..landmarks.len() {
            for time in times {
                let value = |mode: usize| (-self.eigenvalues[mode] * time).exp() * at.column(mode)[landmark];
                columns.push((0..k).map(value).collect());
            }
        }
        if request.signatures {
            let times = times.iter().map(|time| time * self.area).collect();
            let values = Signature::HeatKernel { times, normalised: true }.everywhere(self.basis)?;
            let coefficients = self.basis.project(&values)?;
            columns.extend((0..values.columns()).map(|c| coefficients.column(c)[..k].to_vec()));
        }
        if let Some(given) = descriptors {
            columns.extend((0..given.columns()).map(|c| given.column(c)[..k].to_vec()));
        }
        Ok(columns)
    }

    /// Vertices that stand for the surface: evenly by area in the order of the mesh, the landmarks among them.
    fn samples(&self, count: usize, landmarks: &[u32]) -> Vec<u32> {
        let n = self.masses.len();
        let mut chosen: Vec<u32> = landmarks.to_vec();
        if count >= n {
            chosen = (0..n as u32).collect();
        } else {
            let (mut sum, mut taken) = (0.0, 0.0);
            let share = self.area / count as f64;
            for (vertex, mass) in self.masses.iter().enumerate() {
                sum += mass;
                // One for each share of the area, from its middle.
                let due = (sum / share + 0.5).floor();
                if due > taken {
                    chosen.push(vertex as u32);
                    taken = due;
                }
            }
        }
        chosen.sort_unstable();
        chosen.dedup();
        chosen
    }
}

/// Finds the map from one surface to another.
///
/// # Errors
/// [`AnalysisError`] names a landmark that is no vertex, a size out of its range, or says that nothing is known of the map.
pub fn functional_map(source: &Basis, target: &Basis, request: &MapRequest) -> Result<FunctionalMap, AnalysisError> {
    let most = source.count().min(target.count()).min(MOST_PAIRS);
    error::count("pairs", request.pairs, 1, most)?;
    error::count("start", request.start, 1, request.pairs)?;
    error::count("step", request.step, 1, MOST_PAIRS)?;
    error::count("landmarks", request.landmarks.len(), 0, MOST_LANDMARKS)?;
    // Fewer would leave the larger maps undetermined.
    error::count("samples", request.samples, (2 * request.pairs).min(MOST_SAMPLES), MOST_SAMPLES)?;
    if !(request.commutativity.is_finite() && request.commutativity >= 0.0) {
        let expected = "a finite number that is not negative";
        return Err(AnalysisError::Parameter { parameter: "commutativity", value: request.commutativity, expected });
    }
    let (from, to) = (Side::new(source)?, Side::new(target)?);
    let [sources, targets] = [0, 1].map(|end| request.landmarks.iter().map(|pair| pair[end]).collect::<Vec<u32>>());
    let times = known_times(&from.eigenvalues[..request.start.max(2).min(source.count())])?;
    let descriptors = request.descriptors.as_ref();
    let a = from.known(request, &sources, descriptors.map(|d| &d.0), &times)?;
    let b = to.known(request, &targets, descriptors.map(|d| &d.1), &times)?;
    error::count("known functions", a.len(), 1, usize::MAX)?;
    let (a, b) = normalised(a, b, request.start);
    let mut map = first_map(&from, &to, &a, &b, request)?;
    let descriptor_residual = residual(&map, &a, &b)?;

    let (samples, stand) = (from.samples(request.samples, &sources), to.samples(request.samples, &targets));
    let (there, here) = (from.at(&samples, request.pairs, "sample")?, to.at(&stand, request.pairs, "sample")?);
    let mut size = request.start;
    let mut matches = Vec::new();
    while size < request.pairs {
        matches = nearest(&Embedding::of(&there, size), &here, &map, &matches)?;
        size = request.pairs.min(size + request.step);
        map = map_of_points(&there, &here, &matches, size)?;
    }
    matches.iter_mut().for_each(|(item, _)| *item = samples[*item as usize]);
    let samples = (!request.all_points).then_some(Samples { vertices: stand, modes: here, matches });
    finish(&from, &to, map, samples, descriptor_residual)
}

/// Times of heat that tell of all the first modes: at the earliest the last of them has hardly decayed, at the latest even the first above zero is gone.
fn known_times(eigenvalues: &[f64]) -> Result<Vec<f64>, AnalysisError> {
    let first = kernel_size(eigenvalues)?;
    let last = eigenvalues.last().copied().unwrap_or(1.0);
    Ok(log_spaced(0.2 / last, 4.0 / eigenvalues[first], TIMES))
}

/// Vertices of the target that are matched.
struct Samples {
    vertices: Vec<u32>,
    /// The modes of the target there.
    modes: DenseMatrix,
    /// The vertices of the source that they were matched with last, and the squared distances.
    matches: Vec<(u32, f32)>,
}

/// The last search for neighbours, for some samples or else for all vertices, and the figures.
fn finish(
    from: &Side,
    to: &Side,
    map: DenseMatrix,
    samples: Option<Samples>,
    descriptor_residual: f64,
) -> Result<FunctionalMap, AnalysisError> {
    let k = map.columns();
    let embedding = Embedding::of_all(from, k)?;
    let mut points = Vec::new();
    let mut squares = 0.0;
    let mut take = |found: Vec<(u32, f32)>| {
        squares += found.iter().map(|(_, square)| f64::from(*square)).sum::<f64>();
        points.extend(found.into_iter().map(|(point, _)| point));
    };
    let matched = match samples {
        Some(Samples { vertices, modes, matches }) => {
            take(nearest(&embedding, &modes, &map, &matches)?);
            Some(vertices)
        }
        None => {
            // Blocks bound what is held at once.
            let vertices: Vec<u32> = (0..to.basis.vertices() as u32).collect();
            for block in vertices.chunks(AT_ONCE) {
                take(nearest(&embedding, &to.at(block, k, "sample")?, &map, &[])?);
            }
            None
        }
    };
    let mut hit = vec![false; from.masses.len()];
    points.iter().for_each(|&point| hit[point as usize] = true);
    let covered: f64 = hit.iter().zip(&from.masses).filter(|(hit, _)| **hit).map(|(_, mass)| mass).sum();
    let (mut defect, mut wrong, mut whole) = (0.0, 0.0, 0.0);
    let gram = map.transposed_times(&map).ok_or(BasisError::Inconsistent)?;
    for column in 0..k {
        for row in 0..k {
            let one = if row == column { 1.0 } else { 0.0 };
            defect += (gram.column(column)[row] - one).powi(2);
            let entry = map.column(column)[row];
            wrong += (entry * (from.eigenvalues[column] - to.eigenvalues[row])).powi(2);
            whole += (entry * from.eigenvalues[column]).powi(2);
        }
    }
    Ok(FunctionalMap {
        matched,
        descriptor_residual,
        orthogonality_defect: (defect / k as f64).sqrt(),
        commutativity_defect: if whole > 0.0 { (wrong / whole).sqrt() } else { 0.0 },
        // At unit area each mode has mean square 1.
        embedding_error: (squares / points.len().max(1) as f64 / k as f64).sqrt(),
        coverage: covered / from.area,
        matrix: map,
        points,
    })
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
    let gram = at.transposed_times(&at).ok_or(BasisError::Inconsistent)?;
    let sides = at.transposed_times(&bt).ok_or(BasisError::Inconsistent)?;
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

fn residual(map: &DenseMatrix, a: &DenseMatrix, b: &DenseMatrix) -> Result<f64, AnalysisError> {
    let image = map.times(a).ok_or(BasisError::Inconsistent)?;
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
    let lost = square(&mut image.values().iter().zip(b.values()).map(|(x, y)| x - y));
    let whole = square(&mut b.values().iter().copied());
    Ok(if whole > 0.0 { (lost / whole).sqrt() } else { 0.0 })
}

fn transposed(matrix: &DenseMatrix) -> DenseMatrix {
    let mut turned = DenseMatrix::zeros(matrix.columns(), matrix.rows());
    for column in 0..matrix.columns() {
        matrix.column(column).iter().enumerate().for_each(|(row, &value)| turned.column_mut(row)[column] = value);
    }
    turned
}

/// The first modes of the source at some vertices, and a tree over them.
struct Embedding {
    points: Vec<f32>,
    dimensions: usize,
    tree: Option<KdTree>,
}

impl Embedding {
    fn of(modes: &DenseMatrix, k: usize) -> Self {
        Self::new(rows(modes, k), k)
    }

    fn of_all(side: &Side, k: usize) -> Result<Self, AnalysisError> {
        let mut points = side.basis.lift_rows::<f32>(0..k)?;
        let scale = side.area.sqrt() as f32;
        points.par_iter_mut().with_min_len(1 << 16).for_each(|value| *value *= scale);
        Ok(Self::new(points, k))
    }

    fn new(points: Vec<f32>, dimensions: usize) -> Self {
        let tree = KdTree::new(dimensions, &points);
        Self { points, dimensions, tree }
    }
}

/// The rows of the first `k` columns, one after the other.
fn rows(modes: &DenseMatrix, k: usize) -> Vec<f32> {
    let mut points = vec![0.0; modes.rows() * k];
    for column in 0..k {
        modes.column(column).iter().enumerate().for_each(|(row, &value)| points[row * k + column] = value as f32);
    }
    points
}

/// For each row of `here`, the modes of the target, the nearest point of the embedding to its image, and the squared distance. `before`: for the first
/// rows, what they were matched with by a map that was not much different.
fn nearest(
    there: &Embedding,
    here: &DenseMatrix,
    map: &DenseMatrix,
    before: &[(u32, f32)],
) -> Result<Vec<(u32, f32)>, AnalysisError> {
    let k = map.rows();
    let images = here.slice_columns(0..k).times(map).ok_or(BasisError::Inconsistent)?;
    let images = rows(&images, map.columns());
    let Some(tree) = &there.tree else { return Err(AnalysisError::Basis(BasisError::Inconsistent)) };
    let dimensions = there.dimensions;
    let search = |(task, images): (usize, &[f32])| {
        let mut last: Option<u32> = None;
        let mut found = Vec::with_capacity(images.len() / dimensions);
        for (row, query) in images.chunks_exact(dimensions).enumerate() {
            let measured = |item: u32| {
                let point = &there.points[item as usize * dimensions..][..dimensions];
                (item, point.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum::<f32>())
            };
            // Vertices with neighbouring numbers often lie next to each other, and so do their matches.
            let beside = last.map(measured);
            let before = before.get(task * ROWS_AT_ONCE + row).map(|(item, _)| measured(*item));
            let guess = beside.into_iter().chain(before).min_by(|a, b| a.1.total_cmp(&b.1));
            let nearest = tree.nearest(query, guess);
            last = Some(nearest.0);
            found.push(nearest);
        }
        found
    };
    Ok(images.par_chunks(ROWS_AT_ONCE * dimensions).enumerate().flat_map_iter(search).collect())
}

/// `argmin ‖Φ_target C − Φ_source‖` over matched samples: the map of size `k` that their matches make.
fn map_of_points(
    there: &DenseMatrix,
    here: &DenseMatrix,
    matches: &[(u32, f32)],
    k: usize,
) -> Result<DenseMatrix, AnalysisError> {
    let here = here.slice_columns(0..k);
    let mut pulled = DenseMatrix::zeros(here.rows(), k);
    for column in 0..k {
        let values = there.column(column);
        let slots = pulled.column_mut(column).iter_mut().zip(matches);
        slots.for_each(|(slot, (point, _))| *slot = values[*point as usize]);
    }
    let mut gram = here.transposed_times(&here).ok_or(BasisError::Inconsistent)?;
    let mean = (0..k).map(|i| gram.column(i)[i]).sum::<f64>() / k as f64;
    (0..k).for_each(|i| gram.column_mut(i)[i] += 1e-9 * mean);
    let mut map = here.transposed_times(&pulled).ok_or(BasisError::Inconsistent)?;
    solve_definite(gram, &mut map)?;
    Ok(map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fixtures::chain;

    fn request() -> MapRequest {
        MapRequest {
            landmarks: vec![[5, 5], [70, 70]],
            descriptors: None,
            signatures: false,
            start: 8,
            pairs: 20,
            step: 4,
            samples: 60,
            commutativity: 0.1,
            all_points: true,
        }
    }

    #[test]
    fn a_surface_is_mapped_to_itself() {
        let basis = chain(100, 30);
        let map = functional_map(&basis, &basis, &request()).unwrap();
        for column in 0..20 {
            for row in 0..20 {
                let one = if row == column { 1.0 } else { 0.0 };
                assert!((map.matrix.column(column)[row] - one).abs() < 0.05, "{row} {column}");
            }
        }
        assert!(map.points.iter().zip(0..).all(|(&point, vertex)| i64::from(point).abs_diff(vertex) <= 1));
        assert!(map.orthogonality_defect < 0.05 && map.commutativity_defect < 0.05 && map.coverage > 0.9);
        assert!(map.descriptor_residual < 1e-6 && map.embedding_error < 0.1);
        assert!(map.matched.is_none());
    }

    #[test]
    fn landmarks_decide_between_a_shape_and_its_mirror_image() {
        let basis = chain(100, 30);
        let mirrored = MapRequest { landmarks: vec![[5, 94], [70, 29]], all_points: false, ..request() };
        let map = functional_map(&basis, &basis, &mirrored).unwrap();
        let matched = map.matched.unwrap();
        assert!(matched.contains(&94) && matched.len() < 70);
        for (vertex, point) in matched.iter().zip(&map.points) {
            assert!((99 - *vertex).abs_diff(*point) <= 2, "{vertex} {point}");
        }
    }

    #[test]
    fn a_refined_chain_is_mapped_to_a_coarse_one() {
        let (coarse, mut fine) = (chain(50, 30), chain(150, 30));
        // Eigenvalues of a line go with the square of its length, those of a surface, as which it is treated, with the area.
        fine.eigenvalues.iter_mut().for_each(|value| *value *= 3.0);
        let request = MapRequest { landmarks: vec![[2, 7], [40, 121]], ..request() };
        let map = functional_map(&coarse, &fine, &request).unwrap();
        for (vertex, &point) in map.points.iter().enumerate() {
            assert!((vertex / 3).abs_diff(point as usize) <= 1, "{vertex} {point}");
        }
    }

    #[test]
    fn known_functions_serve_as_landmarks_do() {
        let basis = chain(100, 30);
        let x = DenseMatrix::from_columns(100, 2, (0..200).map(|i| (i as f64 * 0.037).sin()).collect()).unwrap();
        let known = basis.project(&x).unwrap();
        let request =
            MapRequest { landmarks: vec![], descriptors: Some((known.clone(), known)), signatures: true, ..request() };
        let map = functional_map(&basis, &basis, &request).unwrap();
        assert!(map.points.iter().zip(0..).all(|(&point, vertex)| i64::from(point).abs_diff(vertex) <= 1));
    }

    #[test]
    fn samples_are_spread_evenly_and_hold_the_landmarks() {
        let basis = chain(100, 3);
        let side = Side::new(&basis).unwrap();
        for count in [1, 7, 30, 99, 100, 500] {
            let samples = side.samples(count, &[3]);
            assert!(samples.contains(&3) && samples.is_sorted());
            assert!(samples.len().abs_diff(count.min(100)) <= 1, "{count}: {}", samples.len());
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let basis = chain(100, 30);
        let error = |request: MapRequest| functional_map(&basis, &basis, &request).unwrap_err().to_string();
        assert_eq!(
            error(MapRequest { landmarks: vec![[5, 5], [100, 0]], ..request() }),
            "landmark 1 is vertex 100 of 100"
        );
        assert_eq!(error(MapRequest { landmarks: vec![[5, 100]], ..request() }), "landmark 0 is vertex 100 of 100");
        assert!(error(MapRequest { landmarks: vec![], ..request() }).starts_with("known functions: 0"));
        assert!(error(MapRequest { pairs: 31, ..request() }).starts_with("pairs: 31, where 1 to 30"));
        assert!(error(MapRequest { start: 21, ..request() }).starts_with("start: 21"));
        assert!(error(MapRequest { step: 0, ..request() }).starts_with("step: 0"));
        assert!(error(MapRequest { samples: 10, ..request() }).starts_with("samples: 10, where 40"));
        assert!(error(MapRequest { commutativity: f64::NAN, ..request() }).starts_with("commutativity is NaN"));
    }
}
