//! Slices against the dense solver and the hierarchy; and their judgement, with pairs that are right and wrong.

use chladni_algebra::{CpuSolver, PanelMatrix, SymmetricDefiniteSolver, restrict, rotate};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::Shape;

use super::super::judge::Candidates;
use super::super::judge_slices::certify_segments;
use super::super::ritz::ritz;
use super::super::segments::{Cuts, is_certain};
use super::super::tests::{copies, count, laplacian, level_of, rough, solved};
use super::super::{HsimError, HsimParameters, solve};
use super::*;
use crate::operator::{Boundary, EigenProblem, MassKind, OperatorKind, OperatorParameters, assemble};

fn problem(mesh: &TriangleMesh, mass: MassKind, boundary: Boundary) -> EigenProblem {
    let parameters = OperatorParameters { operator: OperatorKind::Laplace, mass, boundary };
    assemble(mesh, &parameters, &Unwatched).unwrap().problem
}

/// All eigenvalues of a level, ascending, on unit area.
fn exact(level: &Level) -> Vec<f64> {
    let n = level.size();
    CpuSolver.lowest(level.stiffness.to_dense(), level.mass.to_dense(), n, &Unwatched).unwrap().values
}

fn slices(level: &Level, pairs: usize, slice: usize, tolerance: f64) -> Option<Sliced> {
    let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass).unwrap();
    let kernel = Kernel::new(level);
    let wanted = KrylovRequest::lowest(level.size(), pairs, pairs, tolerance, 3);
    start(level, &symbolic, &kernel, wanted, slice, &Unwatched).unwrap()
}

/// The pairs with the kernel before them, and a count in the gap above.
fn with_kernel(level: &Level, found: &Sliced, truth: &[f64]) -> (PanelMatrix, Vec<f64>, Count) {
    let kernel = Kernel::new(level);
    let known = kernel.dimension();
    let mut vectors = found.vectors.clone();
    vectors.insert(0, &kernel.basis(known));
    let values: Vec<f64> = std::iter::repeat_n(0.0, known).chain(found.values.iter().copied()).collect();
    let k = values.len();
    let shift = 0.5 * (truth[k - 1] + truth[k]);
    (vectors, values, Count { shift, below: k, radius: 1e-9 * shift })
}

fn judged(
    level: &Level,
    vectors: &PanelMatrix,
    values: &[f64],
    count: Count,
    cuts: &Cuts,
) -> Result<super::super::judge::Verdict, HsimError> {
    let kernel = 0..Kernel::new(level).dimension();
    let found = Candidates {
        level,
        vectors,
        values,
        kernel: &kernel,
        count,
        floor: None,
        below_cluster: None,
        wanted: values.len(),
        tolerance: 1e-2,
        offset: 0.0,
    };
    certify_segments(&found, cuts, &Unwatched)
}

#[test]
fn slices_hold_the_pairs_of_the_dense_solver_and_enclose_them() {
    let torus = rough(Shape::Torus, 700);
    let parts = copies(&rough(Shape::Torus, 350), 2);
    let disk = rough(Shape::Disk, 700);
    for (what, mesh, boundary) in [
        ("a torus", &torus, Boundary::Neumann),
        ("two parts", &parts, Boundary::Neumann),
        ("a fixed boundary", &disk, Boundary::Dirichlet),
    ] {
        for mass in [MassKind::Barycentric, MassKind::Consistent] {
            let level = level_of(mesh, &problem(mesh, mass, boundary));
            let (truth, known) = (exact(&level), Kernel::new(&level).dimension());
            for (pairs, slice, tolerance) in [(70, 20, 1e-2), (90, 24, 1e-9), (42, 200, 1e-4)] {
                let what = format!("{what}, {mass:?}, {pairs} pairs in slices of {slice} to {tolerance:e}");
                let found = slices(&level, pairs, slice, tolerance).unwrap_or_else(|| panic!("{what}: nothing"));
                assert_eq!((found.values.len(), found.vectors.columns()), (pairs, pairs), "{what}");
                let counts = &found.cuts.counts;
                assert!((pairs / (2 * slice)..2 + 2 * pairs / slice).contains(&counts.len()), "{what}: {counts:?}");
                for count in counts {
                    assert_eq!(truth.partition_point(|&value| value < count.shift), count.below, "{what}");
                }
                let defect = super::super::columns::defect(&found.vectors, &level.mass, &Unwatched).unwrap();
                assert!(defect < 1e-9 * pairs as f64, "{what}: {defect:e} away from orthonormal");
                let (vectors, values, count) = with_kernel(&level, &found, &truth);
                let verdict = judged(&level, &vectors, &values, count, &found.cuts)
                    .unwrap_or_else(|error| panic!("{what}: {error}"));
                for (k, ((value, truth), bound)) in
                    values.iter().zip(&truth).zip(&verdict.bounds).enumerate().skip(known)
                {
                    assert!((value - truth).abs() <= *bound, "{what}: pair {k} is {value}, {truth}, within {bound:e}");
                    assert!(*bound < 1e-4 * truth, "{what}: pair {k} is within {bound:e} of {value}");
                }
            }
        }
    }
}

#[test]
fn a_wrong_pair_a_wrong_count_and_columns_that_are_not_orthogonal_are_refused() {
    let mesh = rough(Shape::Torus, 500);
    let level = level_of(&mesh, &problem(&mesh, MassKind::Barycentric, Boundary::Neumann));
    let truth = exact(&level);
    let found = slices(&level, 60, 20, 1e-9).unwrap();
    let (vectors, values, count) = with_kernel(&level, &found, &truth);
    let cuts = &found.cuts;
    judged(&level, &vectors, &values, count, cuts).unwrap();
    // A count too many or too few, at each cut.
    for at in 0..cuts.counts.len() {
        for below in [cuts.counts[at].below - 1, cuts.counts[at].below + 1] {
            let mut wrong = cuts.clone();
            wrong.counts[at].below = below;
            assert!(judged(&level, &vectors, &values, count, &wrong).is_err(), "{below} below cut {at}");
        }
        // A count that may be one of more or fewer.
        let mut wrong = cuts.clone();
        wrong.counts[at].radius = 0.1 * wrong.counts[at].shift;
        assert!(judged(&level, &vectors, &values, count, &wrong).is_err(), "an uncertain count at cut {at}");
    }
    // Pairs that are left out, and others that stand there twice.
    for k in [5, 25, 45, 60] {
        let all: Vec<usize> = (0..values.len()).filter(|&column| column != k).collect();
        let fewer: Vec<f64> = all.iter().map(|&column| values[column]).collect();
        assert!(judged(&level, &vectors.select(&all), &fewer, count, cuts).is_err(), "without pair {k}");
        let mut twice = vectors.clone();
        twice.assign(&[k], &vectors.select(&[k - 1]));
        assert!(judged(&level, &twice, &values, count, cuts).is_err(), "pair {k} is the one before");
    }
    // A column of one segment that has a part of one of another.
    let mut mixed = vectors.clone();
    let mut column = vectors.select(&[40]);
    let other = vectors.select(&[3]);
    column.panels_mut()[0].iter_mut().zip(&other.panels()[0]).for_each(|(x, y)| *x += 1e-5 * y);
    mixed.assign(&[40], &column);
    assert!(judged(&level, &mixed, &values, count, cuts).is_err(), "segments that are not orthogonal");
    // What spaces were said to leave between segments.
    let wrong = Cuts { defect: 1e-6, ..cuts.clone() };
    assert!(matches!(judged(&level, &vectors, &values, count, &wrong), Err(HsimError::Unproven { .. })));
}

#[test]
fn enclosures_of_a_segment_hold_however_rough_its_pairs_are() {
    let mesh = rough(Shape::Genus(2), 800);
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let level = level_of(&mesh, &problem(&mesh, mass, Boundary::Neumann));
        let truth = exact(&level);
        let found = slices(&level, 80, 27, 1e-9).unwrap();
        let mut random = SplitMix64::new(11);
        for size in [1e-9, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2] {
            let mut rough = found.vectors.clone();
            let mut values = found.values.clone();
            let mut start = 0;
            let ends: Vec<usize> = found.cuts.counts.iter().map(|count| count.below - 1).chain([80]).collect();
            for end in ends {
                let range: Vec<usize> = (start..end).collect();
                let mut columns = rough.select(&range);
                for panel in columns.panels_mut() {
                    panel.iter_mut().filter(|x| **x != 0.0).for_each(|x| *x *= 1.0 + size * random.signed_unit());
                }
                Kernel::new(&level).remove(&mut columns);
                let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &columns, &Unwatched).unwrap();
                let (ritz_values, rotation) = ritz(stiffness, gram, range.len(), &Unwatched).unwrap();
                rotate(&mut columns, &rotation, &Unwatched).unwrap();
                rough.assign(&range, &columns);
                values[start..end].copy_from_slice(&ritz_values);
                start = end;
            }
            let sliced = Sliced { values, vectors: rough, cuts: Cuts { defect: 0.0, ..found.cuts.clone() } };
            let (vectors, values, count) = with_kernel(&level, &sliced, &truth);
            // Segment by segment, whatever they are to each other.
            let (mut start, mut floor) = (0, None);
            for at in sliced.cuts.counts.iter().copied().chain([count]) {
                let segment = vectors.select(&(start..at.below).collect::<Vec<_>>());
                let part = Candidates {
                    level: &level,
                    vectors: &segment,
                    values: &values[start..at.below],
                    kernel: &(0..usize::from(start == 0)),
                    count: at,
                    floor,
                    below_cluster: None,
                    wanted: at.below - start,
                    tolerance: 0.5,
                    offset: 0.0,
                };
                if let Ok(verdict) = super::super::judge::certify(&part, &Unwatched) {
                    for (k, bound) in (start..).zip(&verdict.bounds) {
                        let error = (values[k] - truth[k]).abs();
                        assert!(error <= *bound, "{mass:?}, {size:e}: pair {k} is off by {error:e}, not {bound:e}");
                    }
                } else {
                    assert!(size > 1e-6, "{mass:?}, {size:e}: no proof from {start} on");
                }
                (start, floor) = (at.below, Some(at));
            }
        }
    }
}

#[test]
fn joints_do_not_cut_clusters() {
    for (number, pairs, slice) in [(7usize, 90, 30), (25, 120, 40)] {
        let mesh = copies(&rough(Shape::Torus, 100), number as u32);
        let level = level_of(&mesh, &laplacian(&mesh));
        let truth = exact(&level);
        // Where no gap is in reach, there is no answer; what there is, is right.
        if let Some(found) = slices(&level, pairs, slice, 1e-8) {
            for (k, value) in found.values.iter().enumerate() {
                assert!((value - truth[number + k]).abs() <= 1e-9 * truth[number + pairs], "{number} copies: pair {k}");
            }
        }
    }
}

#[test]
fn a_count_beside_a_value_is_not_relied_on() {
    let values = [3.0, 5.0, 8.0];
    let certain = |shift: f64, below: usize, radius: f64| is_certain(&Count { shift, below, radius }, &values, 1);
    assert!(certain(6.0, 3, 0.2) && certain(2.0, 1, 0.2) && certain(9.0, 4, 0.2));
    for (shift, below) in [(5.1, 3), (7.9, 3), (2.9, 1), (8.1, 4)] {
        assert!(!certain(shift, below, 0.03) && certain(shift, below, 0.02), "{shift}");
    }
}

#[test]
fn a_hierarchy_and_slices_agree() {
    let mesh = rough(Shape::Genus(2), 4500);
    let problem = laplacian(&mesh);
    let found = solved(&mesh, &problem, &count(640, 1e-3), "slices");
    assert!(found.inertia.len() >= 3, "{:?}", found.inertia);
    let by_levels = HsimParameters { levels: Some(2), ..count(640, 1e-7) };
    let levels = solve(&mesh, &problem, &by_levels, false, &Unwatched).unwrap();
    for (k, (a, b)) in found.values.iter().zip(&levels.values).enumerate() {
        assert!((a - b).abs() <= found.bounds[k] + levels.bounds[k], "pair {k}: {a} and {b}");
        assert!(found.bounds[k] <= 1e-3 * a.abs().max(found.values[1]), "pair {k} is within {:e}", found.bounds[k]);
    }
}
