//! How consistent maps of points are: walks from shape to shape and back to the first.

use chladni_base::parallel::*;

use super::{CollectionMap, CollectionShape, Samples};
use crate::basis::CycleErrors;

impl CycleErrors {
    /// Walks that begin at the samples of each shape.
    pub(super) fn new(shapes: &[CollectionShape<'_>], standing: &[Samples], maps: &[CollectionMap]) -> Self {
        let n = shapes.len();
        let at = |source: usize, target: usize| {
            // By source, then by target, without those to itself.
            let place = source * (n - 1) + target - usize::from(target > source);
            &maps[place].to_source.points[..]
        };
        // A map of points goes from its target to its source.
        let walk = |stops: &[usize]| {
            let first = stops[0];
            let mut points = standing[first].vertices.clone();
            for (place, &here) in stops.iter().enumerate() {
                let next = stops[(place + 1) % stops.len()];
                let map = at(next, here);
                points.iter_mut().for_each(|point| *point = map[*point as usize]);
            }
            let positions = &shapes[first].mesh.positions;
            let gaps = standing[first].vertices.iter().zip(&points).map(|(a, b)| {
                let [a, b] = [a, b].map(|vertex| positions[*vertex as usize]);
                (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
            });
            let area: f64 = shapes[first].basis.mass.lumped().iter().sum();
            gaps.sum::<f64>() / points.len().max(1) as f64 / area.sqrt()
        };
        let pairs: Vec<[usize; 2]> = maps.iter().map(|map| [map.source, map.target]).collect();
        let triples: Vec<[usize; 3]> = pairs
            .iter()
            .flat_map(|&[a, b]| (0..n).filter(move |&c| c != a && c != b).map(move |c| [a, b, c]))
            .collect();
        let there: Vec<f64> = pairs.par_iter().map(|stops| walk(stops)).collect();
        let around: Vec<f64> = triples.par_iter().map(|stops| walk(stops)).collect();
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
        Self {
            pairs: mean(&there),
            triples: (!around.is_empty()).then(|| mean(&around)),
            largest: there.iter().chain(&around).copied().fold(0.0, f64::max),
        }
    }
}
