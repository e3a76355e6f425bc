//! Functional maps between two surfaces.

use chladni_mesh::numbering::Translation;
use chladni_spectral::analysis::functional_map::{MapRequest, PointMap, functional_map as find};
use chladni_spectral::analysis::map_collection::{CollectionRequest, CollectionShape, map_collection as collect};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde::Deserialize;

use super::basis::NativeBasis;
use super::errors::Failure;
use super::mesh::parsed;
use super::{arrays, watch};

/// The numbers of a request; functions come beside it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FunctionalMapRequest {
    landmarks: Vec<[u32; 2]>,
    signatures: bool,
    start: Option<usize>,
    pairs: Option<usize>,
    step: usize,
    samples: usize,
    commutativity: f64,
    all_points: bool,
    both_ways: bool,
}

/// `matched`, `points` and `confidences`.
type Points<'py> = (Option<Bound<'py, PyArray1<i64>>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<f64>>);

/// Finds the map: `(matrix, to_source, to_target, qualities)`, vertices in the numbering of the arrays that the meshes
/// were made of.
#[pyfunction]
pub fn functional_map<'py>(
    py: Python<'py>,
    source: &NativeBasis,
    target: &NativeBasis,
    request: &str,
    descriptors: Option<(PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, f64>)>,
) -> PyResult<Bound<'py, PyTuple>> {
    let mut wanted: FunctionalMapRequest = parsed("functional map", request)?;
    let (from, onto) = (source.translation(false)?, target.translation(false)?);
    for [a, b] in &mut wanted.landmarks {
        *a = from.vertex(u64::from(*a), source.basis.vertices()).map_err(Failure::from)?;
        *b = onto.vertex(u64::from(*b), target.basis.vertices()).map_err(Failure::from)?;
    }
    let known = match descriptors {
        Some((a, b)) => Some((source.pulled(&a)?, target.pulled(&b)?)),
        None => None,
    };
    let most = source.basis.count().min(target.basis.count());
    let pairs = wanted.pairs.unwrap_or(100.min(most));
    let found = watch::run(py, None, |_| {
        let descriptors = match &known {
            Some((a, b)) => Some((source.basis.project(a)?, target.basis.project(b)?)),
            None => None,
        };
        let request = MapRequest {
            landmarks: wanted.landmarks,
            descriptors,
            signatures: wanted.signatures,
            start: wanted.start.unwrap_or(20.min(pairs)),
            pairs,
            step: wanted.step,
            samples: wanted.samples,
            commutativity: wanted.commutativity,
            all_points: wanted.all_points,
            both_ways: wanted.both_ways,
        };
        Ok(find(&source.basis, &target.basis, &request)?)
    })?;
    let qualities = vec![
        ("descriptor_residual", found.descriptor_residual),
        ("orthogonality_defect", found.orthogonality_defect),
        ("commutativity_defect", found.commutativity_defect),
        ("embedding_error", found.embedding_error),
        ("coverage", found.coverage),
    ];
    let matrix: Bound<'py, PyArray2<f64>> = arrays::table(py, found.matrix)?;
    let inverse = found.to_target.map(|points| numpy_points(py, points, &onto, &from));
    (matrix, numpy_points(py, found.to_source, &from, &onto), inverse, qualities).into_pyobject(py)
}

/// The numbers of a collection's request.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MapCollectionRequest {
    start: Option<usize>,
    pairs: Option<usize>,
    step: usize,
    samples: usize,
    oriented: bool,
    polish: bool,
}

/// Source, target, matrix, points and disagreement.
type MapOfCollection<'py> = (usize, usize, Bound<'py, PyArray2<f64>>, Points<'py>, f64);

/// Maps between all shapes: `(maps, there and back, around, largest)`.
#[pyfunction]
#[pyo3(signature = (bases, request, progress=None))]
pub fn map_collection<'py>(
    py: Python<'py>,
    bases: Vec<PyRef<'py, NativeBasis>>,
    request: &str,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let wanted: MapCollectionRequest = parsed("map collection", request)?;
    let mut shapes = Vec::new();
    for (place, basis) in bases.iter().enumerate() {
        let Some(mesh) = basis.surface() else {
            let message = format!("basis {place} has no mesh: give it one where it is loaded");
            return Err(Failure::parameter(message).into());
        };
        shapes.push(CollectionShape { basis: &basis.basis, mesh });
    }
    let defaults = CollectionRequest::default();
    let most = shapes.iter().map(|shape| shape.basis.count()).min().unwrap_or(0);
    let pairs = wanted.pairs.unwrap_or(defaults.pairs.min(most));
    let request = CollectionRequest {
        start: wanted.start.unwrap_or(defaults.start.min(pairs)),
        pairs,
        step: wanted.step,
        samples: wanted.samples,
        oriented: wanted.oriented,
        polish: wanted.polish,
    };
    let found = watch::run(py, progress, |monitor| Ok(collect(&shapes, &request, monitor)?))?;
    let numberings = bases.iter().map(|basis| basis.translation(false)).collect::<Result<Vec<Translation>, _>>()?;
    let mut maps: Vec<MapOfCollection<'py>> = Vec::with_capacity(found.maps.len());
    for map in found.maps {
        let points = numpy_points(py, map.to_source, &numberings[map.source], &numberings[map.target]);
        maps.push((map.source, map.target, arrays::table(py, map.matrix)?, points, map.disagreement));
    }
    (maps, found.cycles.pairs, found.cycles.triples, found.cycles.largest).into_pyobject(py)
}

/// A map of points as the arrays number them: from vertices of `from` to those of `onto`; −1 and NaN where a vertex was
/// dropped.
fn numpy_points<'py>(py: Python<'py>, map: PointMap, onto: &Translation, from: &Translation) -> Points<'py> {
    let points: Vec<f64> = map.points.into_iter().map(|point| f64::from(onto.file_vertex(point))).collect();
    let confidences: Vec<f64> = map.confidences.into_iter().map(f64::from).collect();
    let (matched, points, confidences) = match map.matched {
        Some(matched) => {
            let matched: Vec<i64> = matched.into_iter().map(|vertex| i64::from(from.file_vertex(vertex))).collect();
            (Some(arrays::vector(py, matched)), points, confidences)
        }
        None => (None, from.push(&points, 1), from.push(&confidences, 1)),
    };
    let points: Vec<i64> = points.into_iter().map(|point| if point.is_nan() { -1 } else { point as i64 }).collect();
    (matched, arrays::vector(py, points), arrays::vector(py, confidences))
}
