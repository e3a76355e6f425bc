//! Pairs that are asked for by bounds on their values, and tolerances that cannot be kept.

use std::sync::Mutex;

use chladni_base::{Cancelled, Monitor, Unwatched};
use chladni_mesh::shape::{Shape, generate};

use super::tests::{below, copies, count, exact, laplacian, rough, solved};
use super::{HsimError, HsimParameters, Selection, solve};
use crate::basis::completeness;

#[derive(Default)]
struct Stages(Mutex<Vec<&'static str>>);

impl Monitor for Stages {
    fn stage(&self, name: &'static str) {
        self.0.lock().unwrap().push(name);
    }
    fn progress(&self, _: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
}

#[test]
fn pairs_of_an_interval_come_with_the_index_of_the_first() {
    let mesh = copies(&rough(Shape::Genus(1), 550), 2);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 120);
    let middle = |k: usize| 0.5 * (truth[k - 1] + truth[k]);
    let ask = |from: f64, to: f64, most: usize| {
        let selection = Selection::Between { from, to, most };
        let parameters = HsimParameters { selection, tolerance: 1e-6, ..HsimParameters::default() };
        solve(&mesh, &problem, &parameters, false, &Unwatched)
    };
    // Below the kernel, behind it, in the middle, and where nothing is; the gaps are those of the pairs of equal
    // copies.
    for (first, last) in [(0, 20), (2, 20), (60, 102), (40, 40)] {
        let from = if first == 0 { -1.0 } else { middle(first) };
        let to = if first == last { from + 0.1 * (truth[last] - from) } else { middle(last) };
        let found = ask(from, to, 200).unwrap();
        assert_eq!((found.first, found.values.len()), (first, last - first), "{from} to {to}");
        assert_eq!(found.vectors.columns(), last - first);
        for (k, (value, bound)) in found.values.iter().zip(&found.bounds).enumerate() {
            assert!((value - truth[first + k]).abs() <= bound + 1e-9 * truth[119], "{k}");
        }
        assert_eq!(completeness(first, &found.values, &found.inertia), Some(true), "{:?}", found.inertia);
        assert!(found.on_bounds.is_empty(), "{:?}", found.on_bounds);
        let mass = problem.mass.scaled(problem.area);
        let columns: Vec<Vec<f64>> = (0..found.values.len()).map(|k| found.vectors.column(k)).collect();
        for (k, x) in columns.iter().enumerate().step_by(7) {
            let mx = mass.multiply(x);
            let (norm, next) = (columns[k].iter().zip(&mx), columns.get(k + 1));
            assert!((norm.map(|(a, b)| a * b).sum::<f64>() - 1.0).abs() < 1e-9);
            assert!(next.is_none_or(|y| y.iter().zip(&mx).map(|(a, b)| a * b).sum::<f64>().abs() < 1e-9));
        }
    }
    assert!(matches!(ask(middle(60), middle(102), 101), Err(HsimError::Count { wanted: 102, most: 101 })));
    for (from, to) in [(2.0, 1.0), (1.0, 1.0), (f64::NAN, 1.0), (f64::NEG_INFINITY, 1.0)] {
        assert!(matches!(ask(from, to, 10), Err(HsimError::Parameter { name: "between", .. })), "{from} {to}");
    }
}

#[test]
fn pairs_on_a_bound_are_named_with_the_side_that_they_count_on() {
    let mesh = rough(Shape::Torus, 200);
    let problem = laplacian(&mesh);
    let found = solved(&mesh, &problem, &count(12, 1e-8), "values");
    let bound = found.values[9];
    let again = solved(&mesh, &problem, &HsimParameters { tolerance: 1e-8, ..below(bound, 50) }, "on the tenth");
    assert!((9..=10).contains(&again.values.len()));
    let [on] = again.on_bounds[..] else { panic!("{:?}", again.on_bounds) };
    assert_eq!((on.index, on.bound, on.below), (9, bound, again.values.len() == 10));
    assert!((on.value - bound).abs() <= on.within && on.within < 1e-6 * bound);
}

#[test]
fn a_tolerance_that_double_precision_does_not_allow_is_refused_before_anything_is_iterated() {
    // A needle of relative height 1e-8 in one face.
    let mut mesh = generate(Shape::Sphere, 1500).unwrap();
    let [a, b, c] = mesh.faces[7];
    let [p, q, r] = [a, b, c].map(|v| mesh.positions[v as usize]);
    let new = mesh.positions.len() as u32;
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
    mesh.positions.push(std::array::from_fn(|k| middle[k] + 1e-8 * (r[k] - middle[k])));
    mesh.faces[7] = [a, b, new];
    mesh.faces.extend([[b, c, new], [c, a, new]]);
    let problem = laplacian(&mesh);
    let stages = Stages::default();
    let error = solve(&mesh, &problem, &count(20, 1e-10), false, &stages).unwrap_err();
    let HsimError::Floor { tolerance: 1e-10, floor } = error else { panic!("{error}") };
    assert!((1e-10..1e-2).contains(&floor), "{floor:e}");
    assert!(!stages.0.lock().unwrap().contains(&"certify"));
    // What it names is reached.
    solved(&mesh, &problem, &count(20, 1.01 * floor), "at the floor");
}
