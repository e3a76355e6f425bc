//! Pairs that are right, and the same with one thing wrong.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::{Candidates, Count, certify};
use crate::operator::{MassKind, laplace};
use crate::spectrum::hsim::dense_pairs::dense_pairs;
use crate::spectrum::hsim::kernel::Kernel;
use crate::spectrum::hsim::level::Level;
use crate::spectrum::hsim::offset::components;
use crate::spectrum::hsim::{HsimError, HsimParameters, Selection, solve};

/// The lowest pairs of a small torus, the kernel first, and the next value.
fn pairs(mass: MassKind, count: usize) -> (Level, Vec<f64>, PanelMatrix, f64) {
    let mesh = noisy(&generate(Shape::Torus, 150).unwrap(), 0.1, 5).unwrap();
    let problem = laplace::assemble(&mesh, mass).unwrap();
    let component = components(&problem.stiffness, &problem.mass, 0.0);
    let level = Level { stiffness: problem.stiffness, mass: problem.mass, positions: mesh.positions, component };
    let (mut values, vectors) = dense_pairs(&level, count, &Unwatched).unwrap();
    let next = values.pop().unwrap();
    values.insert(0, 0.0);
    let mut all = Kernel::new(&level).basis(1);
    all.widen(count);
    all.assign(&(1..count).collect::<Vec<_>>(), &vectors.select(&(0..count - 1).collect::<Vec<_>>()));
    (level, values, all, next)
}

#[test]
fn pairs_are_certified_as_they_are_and_with_nothing_wrong() {
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let (level, values, vectors, next) = pairs(mass, 40);
        let count = Count { shift: 0.5 * (values[39] + next), below: 40, radius: 1e-9 };
        let judge = |vectors: &PanelMatrix, values: &[f64], count: Count, wanted: usize| {
            let (tolerance, offset) = (1e-6, 0.0);
            certify(
                &Candidates {
                    level: &level,
                    vectors,
                    values,
                    kernel: &(0..1),
                    count,
                    floor: None,
                    below_cluster: None,
                    wanted,
                    tolerance,
                    offset,
                },
                &Unwatched,
            )
        };
        let verdict = judge(&vectors, &values, count, 40).unwrap();
        assert!(verdict.defect < 1e-12 && verdict.residuals.iter().all(|&residual| residual < 1e-8));
        assert!(verdict.bounds.iter().all(|&bound| bound < 1e-6 * next), "{:?}", verdict.bounds);

        // One pair fewer, one more than is counted, more wanted than there are.
        let fewer = vectors.select(&(0..39).collect::<Vec<_>>());
        let incomplete = |result| matches!(result, Err(HsimError::Incomplete { .. }));
        assert!(incomplete(judge(&fewer, &values[..39], count, 30)));
        assert!(incomplete(judge(&vectors, &values, Count { below: 39, ..count }, 30)));
        assert!(incomplete(judge(&vectors, &values, count, 41)));

        // A pair twice; the constant twice; a column of another length; one that is no eigenvector.
        let unproven = |result| matches!(result, Err(HsimError::Unproven { .. } | HsimError::NotConverged { .. }));
        for (from, to) in [(7, 8), (0, 1)] {
            let mut wrong = vectors.clone();
            wrong.assign(&[to], &vectors.select(&[from]));
            assert!(unproven(judge(&wrong, &values, count, 40)), "{from} in the place of {to}");
        }
        let change = |column: usize, by: &dyn Fn(usize, f64) -> f64| {
            let mut wrong = vectors.clone();
            let rows = wrong.panels_mut()[column / PANEL_WIDTH].as_chunks_mut::<PANEL_WIDTH>().0;
            rows.iter_mut().enumerate().for_each(|(row, x)| x[column % PANEL_WIDTH] = by(row, x[column % PANEL_WIDTH]));
            wrong
        };
        assert!(unproven(judge(&change(20, &|_, x| 1.001 * x), &values, count, 40)));
        assert!(unproven(judge(&change(35, &|row, x| if row == 3 { x + 1e-3 } else { x }), &values, count, 40)));
        assert!(unproven(judge(&change(35, &|row, x| if row == 3 { f64::NAN } else { x }), &values, count, 40)));

        // Values that are no Rayleigh quotients, or not in order; a count that cannot tell.
        let mut wrong = values.clone();
        wrong[12] += 1e-4 * wrong[12];
        assert!(unproven(judge(&vectors, &wrong, count, 40)));
        wrong.clone_from(&values);
        wrong.swap(3, 20);
        assert!(unproven(judge(&vectors, &wrong, count, 40)));
        assert!(unproven(judge(&vectors, &values, Count { radius: next - values[39], ..count }, 40)));
    }
}

#[test]
fn a_count_below_a_cut_cluster_bounds_those_below_and_those_of_it() {
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let (level, values, vectors, next) = pairs(mass, 40);
        // As if the last ten belonged to a cluster of twenty.
        let count = Count { shift: 0.5 * (values[39] + next), below: 50, radius: 1e-9 };
        let low = Count { shift: values[30] - 0.1 * (values[30] - values[29]), below: 30, radius: 1e-9 };
        let judge = |low: Count, count: Count| {
            let (below_cluster, kernel) = (Some(low), &(0..1));
            let (values, vectors) = (&values, &vectors);
            let found = Candidates {
                level: &level,
                vectors,
                values,
                kernel,
                count,
                floor: None,
                below_cluster,
                wanted: 40,
                tolerance: 1e-6,
                offset: 0.0,
            };
            certify(&found, &Unwatched)
        };
        let verdict = judge(low, count).unwrap();
        let (first, rest) = verdict.bounds.split_at(30);
        assert!(first.iter().all(|&bound| bound < 1e-6 * next), "{first:?}");
        for (bound, value) in rest.iter().zip(&values[30..]) {
            let reach = value - low.shift + low.radius;
            assert!(*bound >= reach && *bound < reach + 1e-6 * next, "{bound} at {value}");
        }
        // One fewer below than was counted there, or one more; fewer above than there are.
        let incomplete = |result| matches!(result, Err(HsimError::Incomplete { .. }));
        assert!(incomplete(judge(Count { below: 29, ..low }, count)));
        assert!(incomplete(judge(Count { below: 31, ..low }, count)));
        assert!(incomplete(judge(low, Count { below: 39, ..count })));
    }
}

#[test]
fn a_bound_on_an_eigenvalue_or_beside_it_gives_a_whole_number_of_pairs() {
    // The icosahedron: a kernel, two triplets and a quintuplet.
    let mesh = generate(Shape::Sphere, 12).unwrap();
    for mass in [MassKind::Barycentric, MassKind::Voronoi, MassKind::Consistent] {
        let problem = laplace::assemble(&mesh, mass).unwrap();
        let ask = |selection| {
            let parameters = HsimParameters { selection, tolerance: 1e-8, ..HsimParameters::default() };
            solve(&mesh, &problem, &parameters, false, &Unwatched).unwrap().values
        };
        let values = ask(Selection::Count(12));
        for (k, value) in values.iter().enumerate().skip(1) {
            for (bound, least, most) in [
                (*value, 0, 12),
                (value.next_up(), 0, 12),
                (value * (1.0 - 1e-9), values.partition_point(|v| *v < value * (1.0 - 1e-12)), 0),
                (value * (1.0 + 1e-9), values.partition_point(|v| *v < value * (1.0 + 1e-12)), 0),
            ] {
                let found = ask(Selection::Below { bound, most: 12 });
                let (least, most) = if most == 0 { (least, least) } else { (least, most) };
                assert!((least..=most).contains(&found.len()), "{mass:?}, {k}: {} below {bound}", found.len());
                assert!(found.iter().zip(&values).all(|(a, b)| (a - b).abs() <= 1e-10 * b.abs().max(values[1])), "{k}");
            }
        }
    }
}
