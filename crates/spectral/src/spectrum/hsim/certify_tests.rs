//! Starts from which eigenvectors were taken away on purpose: what is missing is found again, or said to be missing.

use std::sync::Mutex;

use chladni_algebra::{
    CpuSolver, DenseMatrix, MassMatrix, Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, SymmetricDefiniteSolver,
};
use chladni_base::{Cancelled, Monitor, SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::HsimError;
use super::certify::{Goal, complete, places};
use super::dense_pairs::dense;
use super::iterate::{Iteration, Plan};
use super::kernel::Kernel;
use super::level::{Level, NO_KERNEL};
use super::offset::components;
use crate::operator::{MassKind, laplace};

fn level(mesh: &TriangleMesh, mass: MassKind) -> Level {
    let problem = laplace::assemble(mesh, mass).unwrap();
    let component = components(&problem.stiffness, &problem.mass, 0.0);
    let positions = mesh.positions.clone();
    let base = Level { stiffness: problem.stiffness, mass: problem.mass, positions, component };
    let order = base.factor_order(Ordering::Amd).unwrap();
    base.in_order(&order)
}

/// All eigenvalues, and the lowest vectors.
fn exact(level: &Level) -> (Vec<f64>, DenseMatrix) {
    let (stiffness, mass) = dense(level);
    let pairs = CpuSolver.lowest(stiffness, mass, 150, &Unwatched).unwrap();
    (pairs.values, pairs.vectors)
}

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

fn plan(wanted: usize, tolerance: f64) -> Plan {
    Plan { wanted, tolerance, panels_per_shift: 1, solves: 1, most_passes: 24 }
}

/// The shift, what was counted below it, the values ascending without the kernel, and whether something was repaired.
type Completed = (Result<(f64, usize), HsimError>, Vec<f64>, bool);

/// Completes from the eigenvectors 1 to `columns` without the `missing` ones (both count the kernel as 0).
fn completed(
    level: &Level,
    (values, vectors): &(Vec<f64>, DenseMatrix),
    columns: usize,
    missing: &[usize],
    goal: Goal,
    plan: &Plan,
) -> Completed {
    let kept: Vec<usize> = (1..=columns).filter(|column| !missing.contains(column)).collect();
    let start = PanelMatrix::from_dense(vectors).select(&kept);
    let estimates = kept.iter().map(|&column| values[column]).collect();
    let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass).unwrap();
    let kernel = Kernel::new(level);
    let stages = Stages::default();
    let mut iteration = Iteration::new(level, &symbolic, &kernel, start, estimates, &stages);
    let result = complete(&mut iteration, goal, plan, 1);
    let mut found = iteration.values.clone();
    found.sort_by(f64::total_cmp);
    let repaired = stages.0.lock().unwrap().contains(&"repair");
    (result.map(|proof| (proof.above.shift, proof.above.below)), found, repaired)
}

#[test]
fn missing_pairs_are_noticed_and_found_again() {
    let mesh = noisy(&generate(Shape::Genus(2), 1000).unwrap(), 0.15, 3).unwrap();
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let level = level(&mesh, mass);
        let truth = exact(&level);
        for tolerance in [1e-2, 1e-6] {
            for missing in [vec![], vec![1], vec![40], vec![41], vec![5, 20, 21], vec![1, 2, 3], (10..20).collect()] {
                let what = format!("{mass:?} to {tolerance} without {missing:?}");
                let (result, found, repaired) =
                    completed(&level, &truth, 64, &missing, Goal::Count(41), &plan(40, tolerance));
                let (shift, below) = result.unwrap_or_else(|error| panic!("{what}: {error}"));
                assert!(below >= 41, "{what}");
                assert_eq!(truth.0.partition_point(|&value| value < shift), below, "{what}");
                let below = below - 1;
                assert_eq!(found.partition_point(|&value| value < shift), below, "{what}");
                for k in 0..below {
                    assert!(
                        (found[k] / truth.0[k + 1] - 1.0).abs() < 1e-3,
                        "{what}: {k}: {} {}",
                        found[k],
                        truth.0[k + 1]
                    );
                }
                // Pair 41 may lie above the gap in which the pairs are counted.
                assert!(repaired != missing.is_empty() || missing == [41], "{what}");
            }
        }
    }
}

#[test]
fn missing_members_of_a_multiplet_are_found_again() {
    let level = level(&generate(Shape::Sphere, 1002).unwrap(), MassKind::Barycentric);
    let truth = exact(&level);
    // 1–3, 4–8, 9–15, 16–24, 25–35.
    for (wanted, missing) in [(15, vec![10, 11]), (12, vec![14, 15]), (30, vec![25, 28, 31]), (24, vec![1, 2, 3])] {
        let what = format!("{wanted} wanted, without {missing:?}");
        let (result, found, repaired) =
            completed(&level, &truth, 64, &missing, Goal::Count(wanted + 1), &plan(wanted, 1e-4));
        let (shift, below) = result.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(repaired && below > wanted, "{what}");
        assert_eq!(truth.0.partition_point(|&value| value < shift), below, "{what}");
        let below = below - 1;
        for k in 0..below {
            assert!((found[k] / truth.0[k + 1] - 1.0).abs() < 1e-6, "{what}: {k}: {} {}", found[k], truth.0[k + 1]);
        }
    }
}

#[test]
fn missing_pairs_below_a_bound_are_found_again() {
    let mesh = noisy(&generate(Shape::Genus(1), 900).unwrap(), 0.15, 4).unwrap();
    let level = level(&mesh, MassKind::Barycentric);
    let truth = exact(&level);
    let bound = 0.5 * (truth.0[50] + truth.0[51]);
    for missing in [vec![], vec![50], vec![7, 33, 34]] {
        let goal = Goal::Below(bound);
        let (result, found, repaired) = completed(&level, &truth, 60, &missing, goal, &plan(50, 1e-4));
        let (shift, below) = result.unwrap();
        assert!(below == 51 && shift >= bound && shift < truth.0[51], "{missing:?}");
        assert_eq!(found.partition_point(|&value| value < bound), 50, "{missing:?}");
        assert_eq!(repaired, !missing.is_empty());
    }
}

#[test]
fn what_cannot_be_repaired_is_never_called_complete() {
    let mesh = noisy(&generate(Shape::Genus(2), 1000).unwrap(), 0.15, 3).unwrap();
    let level = level(&mesh, MassKind::Barycentric);
    let truth = exact(&level);
    // More than a few searches can find: the truth or an error.
    let missing: Vec<usize> = (1..=110).filter(|k| k % 10 != 0).collect();
    let (result, found, ..) = completed(&level, &truth, 120, &missing, Goal::Count(19), &plan(18, 1e-4));
    match result {
        Ok((shift, below)) => {
            assert_eq!(truth.0.partition_point(|&value| value < shift), below);
            assert_eq!(found.partition_point(|&value| value < shift), below - 1);
        }
        Err(error) => assert!(
            matches!(error, HsimError::Incomplete { missing, .. } if missing > 0)
                || matches!(error, HsimError::NotConverged { .. } | HsimError::Unproven { .. }),
            "{error}"
        ),
    }
}

#[test]
fn components_without_balance_are_not_in_the_kernel() {
    // A path of two, one of two with a potential, a single row of zero, a single row of one.
    let (offsets, indices) = (vec![0, 2, 4, 6, 8, 9, 10], vec![0, 1, 0, 1, 2, 3, 2, 3, 4, 5]);
    let values = vec![1.0, -1.0, -1.0, 1.0, 1.5, -1.0, -1.0, 1.0, 0.0, 1.0];
    let stiffness = SparseMatrix::new(6, 6, offsets, indices, values).unwrap();
    let mass = MassMatrix::Diagonal(vec![1.0, 3.0, 1.0, 1.0, 4.0, 1.0]);
    let component = components(&stiffness, &mass, 0.0);
    assert_eq!(component, [0, 0, NO_KERNEL, NO_KERNEL, 1, NO_KERNEL]);
    let level = Level { stiffness, mass, positions: vec![[0.0; 3]; 6], component };
    let kernel = Kernel::new(&level);
    assert_eq!(kernel.dimension(), 2);
    let basis = kernel.basis(2);
    assert_eq!(basis.column(0), [0.5, 0.5, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(basis.column(1), [0.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
    let mut columns = PanelMatrix::from_dense(&DenseMatrix::from_columns(6, 1, vec![1.0; 6]));
    kernel.remove(&mut columns);
    assert_eq!(columns.column(0), [0.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
}

#[test]
fn every_place_of_a_count_has_as_many_values_below_it_as_is_said() {
    let mut random = SplitMix64::new(3);
    for least in [1, 20, 90, 100] {
        let mut value = 0.0;
        let values: Vec<f64> = (0..100)
            .map(|_| {
                value += random.unit().powi(3);
                value
            })
            .collect();
        let places = places(&values, least, f64::NEG_INFINITY, 1000, 1e4);
        for &(shift, found) in &places {
            assert!(found >= least && found == values.partition_point(|&value| value < shift), "{shift}, {found}");
        }
        // Several in each gap, and one above all.
        let most = places.iter().map(|place| places.iter().filter(|other| other.1 == place.1).count()).max();
        assert!(least == 100 || most >= Some(5), "{places:?}");
        assert_eq!(places.last().map(|place| place.1), Some(100));
    }
}
