use std::time::Duration;

use chladni_base::{Cancelled, Monitor, StageClock, Unwatched};

use super::device::Device;
use super::engine::Engine;
use super::multiply::Form;
use super::numbers::Numbers;
use super::real::Real;
use super::*;
use crate::{
    ComputedOn, CpuSolver, DenseMatrix, EigenError, EigenPairs, MassMatrix, PanelMatrix, SparseMatrix,
    SymmetricDefiniteSolver, panel_products,
};

/// The software device that the tests run on; `None` where there is none and none is required.
///
/// `CHLADNI_TEST_GPU=required` makes a missing device a failure; any other value names the adapter to test.
pub(super) fn open() -> Option<Device> {
    open_by(Device::open)
}

/// The same device, as if it knew f32 alone.
fn open_in_f32() -> Option<Device> {
    open_by(Device::open_without_f64)
}

fn open_by(open: fn(&GpuChoice) -> Result<Device, GpuError>) -> Option<Device> {
    let wanted = std::env::var("CHLADNI_TEST_GPU").unwrap_or_default();
    let choice = match wanted.as_str() {
        "" | "required" => GpuChoice::Name("llvmpipe".into()),
        name => name.parse().unwrap(),
    };
    match open(&choice) {
        Ok(device) => Some(device),
        Err(error) if wanted.is_empty() => {
            println!("skipped: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// An accelerator over a device, which is neither tested nor measured.
pub(super) fn accelerator_of(device: Device) -> Accelerator {
    Accelerator::with(Engine::untested(device), GpuChoice::Index(0))
}

/// `QΛQᵀ` and a well-conditioned mass matrix: a pencil whose eigenvalues are `values`, up to rounding.
fn pencil(values: &[f64], seed: u64) -> (DenseMatrix, DenseMatrix) {
    let d = values.len();
    let mut numbers = Numbers(seed);
    let mut columns = DenseMatrix::from_columns(d, d, numbers.take(d * d));
    // Gram and Schmidt, twice.
    for j in 0..d {
        for _ in 0..2 {
            for k in 0..j {
                let other = columns.column(k).to_vec();
                let dot: f64 = other.iter().zip(columns.column(j)).map(|(x, y)| x * y).sum();
                columns.column_mut(j).iter_mut().zip(&other).for_each(|(x, y)| *x -= dot * y);
            }
        }
        let norm = columns.column(j).iter().map(|x| x * x).sum::<f64>().sqrt();
        columns.column_mut(j).iter_mut().for_each(|x| *x /= norm);
    }
    let mut lower = DenseMatrix::zeros(d, d);
    for column in 0..d {
        let scale = 1.0 + numbers.next::<f64>().abs();
        for row in column..d {
            lower.column_mut(column)[row] =
                if row == column { scale } else { 0.3 * numbers.next::<f64>() / (row - column) as f64 };
        }
    }
    // A = L Q Λ Qᵀ Lᵀ and B = L Lᵀ.
    let turned = lower.times(&columns);
    let mut scaled = turned.clone();
    (0..d).for_each(|k| scaled.column_mut(k).iter_mut().for_each(|x| *x *= values[k]));
    let transposed = |matrix: &DenseMatrix| {
        let mut transposed = DenseMatrix::zeros(d, d);
        for column in 0..d {
            (0..d).for_each(|row| transposed.column_mut(row)[column] = matrix.column(column)[row]);
        }
        transposed
    };
    (scaled.times(&transposed(&turned)), lower.times(&transposed(&lower)))
}

/// Checks pairs by their definition, each by itself, and all against the solver on the CPU.
fn check(a: &DenseMatrix, b: &DenseMatrix, pairs: &EigenPairs, count: usize) {
    let expected = CpuSolver.lowest(a.clone(), b.clone(), count, &Unwatched).unwrap();
    let scale = expected.values.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert_eq!(pairs.values.len(), count);
    for (value, expected) in pairs.values.iter().zip(&expected.values) {
        assert!((value - expected).abs() < 1e-11 * scale, "{value} instead of {expected}");
    }
    let (ax, bx) = (a.times(&pairs.vectors), b.times(&pairs.vectors));
    for k in 0..count {
        let bx = bx.column(k);
        let difference: Vec<f64> = ax.column(k).iter().zip(bx).map(|(ax, bx)| ax - pairs.values[k] * bx).collect();
        assert!(norm(&difference) < 1e-10 * scale * norm(bx), "residual of pair {k}: {}", norm(&difference));
        let largest = pairs.vectors.column(k).iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
        assert!(largest > 0.0);
    }
    let gram = pairs.vectors.transposed_times(&bx);
    for i in 0..count {
        for j in 0..count {
            assert!((gram.column(j)[i] - f64::from(u8::from(i == j))).abs() < 1e-11);
        }
    }
}

fn on_gpu(pairs: &EigenPairs) -> bool {
    matches!(pairs.computed_on, ComputedOn::Gpu { .. })
}

/// Eigenvalues as they come: simple ones, one of multiplicity 40, a cluster within 1e-9, and zeros.
fn mixed_spectrum(d: usize) -> Vec<f64> {
    (0..d)
        .map(|k| match k {
            0..4 => 0.0,
            30..70 => 5.0,
            100..120 => 20.0 + 1e-9 * k as f64,
            _ => 0.1 * k as f64,
        })
        .collect()
}

#[test]
fn every_kernel_agrees_with_its_twin_in_both_precisions() {
    let Some(mut device) = open() else { return };
    fn odd_sizes<T: Real>(device: &Device) {
        self_test::test::<T>(device).unwrap();
        for form in [Form::Plain, Form::First, Form::Second] {
            self_test::product::<T>(device, form, (1, 1, 1)).unwrap();
            self_test::product::<T>(device, form, (129, 65, 301)).unwrap();
        }
        self_test::transposition::<T>(device, 299, 131).unwrap();
        self_test::reduction_step::<T>(device, 300, 40, 8, (0, 300)).unwrap();
        self_test::reduction_step::<T>(device, 299, 270, 31, (250, 49)).unwrap();
        self_test::sparse_product::<T>(device, 301, 77, 33).unwrap();
    }
    for width in [16, 32, 64] {
        self_test::smoothing(&device, 131, width).unwrap();
        self_test::trees(&device, width).unwrap();
    }
    odd_sizes::<f32>(&device);
    odd_sizes::<f64>(&device);
    // The same cut into panels of a few rows.
    device.limit(40 << 10, 1 << 30);
    for form in [Form::Plain, Form::First, Form::Second] {
        self_test::product::<f64>(&device, form, (129, 65, 101)).unwrap();
    }
    self_test::transposition::<f64>(&device, 99, 131).unwrap();
    self_test::sparse_product::<f64>(&device, 301, 77, 133).unwrap();
}

#[test]
fn pairs_of_simple_multiple_and_clustered_eigenvalues_satisfy_the_definition() {
    let Some(device) = open() else { return };
    let solver = accelerator_of(device);
    for (d, count) in [(64, 64), (65, 1), (131, 60), (300, 150)] {
        let (a, b) = pencil(&mixed_spectrum(d), d as u64);
        let clock = StageClock::new(&Unwatched);
        let pairs = solver.lowest(a.clone(), b.clone(), count, &clock).unwrap();
        assert_eq!(clock.notes(), [("dense_solver", solver.adapter().unwrap())]);
        assert!(on_gpu(&pairs), "size {d}: {:?}", pairs.computed_on);
        check(&a, &b, &pairs, count);
    }
    assert_eq!(solver.fallbacks(), 0);
}

#[test]
fn a_device_with_f32_alone_gives_pairs_of_f64() {
    let Some(device) = open_in_f32() else { return };
    let solver = accelerator_of(device);
    // The counts end among simple values, in the middle of the multiple one and of the cluster, and before everything.
    for (d, count) in [(64, 30), (65, 1), (131, 60), (131, 87), (300, 110), (300, 200)] {
        let (a, b) = pencil(&mixed_spectrum(d), d as u64);
        let clock = StageClock::new(&Unwatched);
        let pairs = solver.lowest(a.clone(), b.clone(), count, &clock).unwrap();
        assert!(on_gpu(&pairs), "{count} of {d}: {:?}", pairs.computed_on);
        check(&a, &b, &pairs, count);
    }
    // More than two thirds of the pairs are the CPU's, and so are products, which f32 does not serve.
    let (a, b) = pencil(&mixed_spectrum(70), 1);
    let pairs = solver.lowest(a.clone(), b.clone(), 70, &Unwatched).unwrap();
    assert_eq!(pairs.computed_on, ComputedOn::Cpu);
    let (stiffness, mass, x) = path(501, 37);
    assert!(solver.restrict(&stiffness, &mass, &x, &Unwatched).unwrap().2.is_none());
    assert_eq!(solver.fallbacks(), 0);
}

/// `cargo test --release --lib gpu::tests::steps -- --ignored --nocapture`: how many products with the matrix a
/// refinement takes, at sizes that the software driver needs a while for. docs/decisions/0019 stands on it.
#[test]
#[ignore = "measures"]
fn steps_of_refinement_at_larger_sizes() {
    #[derive(Default)]
    struct Steps(std::sync::Mutex<Vec<String>>);
    impl Monitor for Steps {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn detail(&self, text: &str) {
            self.0.lock().unwrap().push(text.to_owned());
        }
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Ok(())
        }
    }
    let Some(device) = open_in_f32() else { return };
    let solver = accelerator_of(device);
    for (d, count) in [(500, 50), (500, 250), (1000, 100), (1000, 500)] {
        // The values of a surface's Laplacian grow linearly.
        let values: Vec<f64> = (0..d).map(|k| k as f64 + 0.3 * (k as f64).sin()).collect();
        let (a, b) = pencil(&values, 1);
        let steps = Steps::default();
        let pairs = solver.lowest(a.clone(), b.clone(), count, &steps).unwrap();
        check(&a, &b, &pairs, count);
        println!("{count} of {d}: {:?}, {:?}", steps.0.lock().unwrap().last(), pairs.computed_on);
    }
}

#[test]
fn what_f32_cannot_tell_apart_is_refined_or_comes_back_to_the_cpu() {
    let Some(device) = open_in_f32() else { return };
    let solver = accelerator_of(device);
    let d = 120;
    let (_, b) = pencil(&mixed_spectrum(d), 1);
    for a in [DenseMatrix::zeros(d, d), b.clone()] {
        let pairs = solver.lowest(a.clone(), b.clone(), 50, &Unwatched).unwrap();
        assert!(on_gpu(&pairs), "{:?}", pairs.computed_on);
        check(&a, &b, &pairs, 50);
    }
    // A hundred values within 1e-7 of each other, of which fifty are wanted: whatever is cut off is too near.
    let values: Vec<f64> = (0..d).map(|k| if k < 100 { 1.0 + 1e-9 * k as f64 } else { k as f64 }).collect();
    let (a, b) = pencil(&values, 2);
    let pairs = solver.lowest(a.clone(), b.clone(), 50, &Unwatched).unwrap();
    check(&a, &b, &pairs, 50);
    let told = matches!(&pairs.computed_on, ComputedOn::CpuInstead { reason, .. } if reason.contains("refinement"));
    assert!(told, "{:?}", pairs.computed_on);
    assert_eq!((solver.fallbacks(), solver.available()), (1, true));
}

#[test]
fn extreme_pencils_are_solved_like_any_other() {
    let Some(device) = open() else { return };
    let solver = accelerator_of(device);
    let d = 70;
    let (_, b) = pencil(&mixed_spectrum(d), 1);
    // All eigenvalues zero, all one, and a matrix that is diagonal already, of magnitude 1e120.
    let mut diagonal = DenseMatrix::zeros(d, d);
    (0..d).for_each(|k| diagonal.column_mut(k)[k] = 1e120 * (k as f64 - 10.0));
    let mut identity = DenseMatrix::zeros(d, d);
    (0..d).for_each(|k| identity.column_mut(k)[k] = 1.0);
    for (a, b) in [(DenseMatrix::zeros(d, d), b.clone()), (b.clone(), b.clone()), (diagonal, identity)] {
        let pairs = solver.lowest(a.clone(), b.clone(), d, &Unwatched).unwrap();
        assert!(on_gpu(&pairs), "{:?}", pairs.computed_on);
        check(&a, &b, &pairs, d);
    }
}

#[test]
fn matrices_larger_than_a_binding_are_cut_into_panels() {
    let Some(mut device) = open() else { return };
    // 64 rows of 180 numbers, which is as few as a block of reflectors needs.
    device.limit(64 * 180 * 8, 1 << 30);
    let solver = accelerator_of(device);
    let (a, b) = pencil(&mixed_spectrum(180), 7);
    let pairs = solver.lowest(a.clone(), b.clone(), 50, &Unwatched).unwrap();
    assert!(on_gpu(&pairs), "{:?}", pairs.computed_on);
    check(&a, &b, &pairs, 50);
}

#[test]
fn only_the_lower_triangles_are_read() {
    let Some(device) = open() else { return };
    let solver = accelerator_of(device);
    let (mut a, mut b) = pencil(&mixed_spectrum(90), 3);
    let whole = solver.lowest(a.clone(), b.clone(), 40, &Unwatched).unwrap();
    for column in 0..90 {
        a.column_mut(column)[..column].fill(f64::NAN);
        b.column_mut(column)[..column].fill(f64::NAN);
    }
    assert_eq!(solver.lowest(a, b, 40, &Unwatched).unwrap(), whole);
}

/// What a solver that meets a fault says, and that its pairs are right nevertheless.
fn solve_in_spite_of(solver: &Accelerator, a: &DenseMatrix, b: &DenseMatrix) -> String {
    let before = solver.fallbacks();
    let clock = StageClock::new(&Unwatched);
    let pairs = solver.lowest(a.clone(), b.clone(), 30, &clock).unwrap();
    let [("dense_solver", note)] = &clock.notes()[..] else { panic!("{:?}", clock.notes()) };
    assert!(note.starts_with("the CPU instead of "), "{note}");
    check(a, b, &pairs, 30);
    assert_eq!(solver.fallbacks(), before + 1);
    match pairs.computed_on {
        ComputedOn::CpuInstead { reason, .. } => reason,
        other => panic!("no fall-back: {other:?}"),
    }
}

#[test]
fn faults_of_the_device_lead_back_to_the_cpu_and_are_counted() {
    let (a, b) = pencil(&mixed_spectrum(80), 5);
    // A device that is lost at the first submission or in the middle of the work is given up.
    for after in [0, 4] {
        let Some(device) = open() else { return };
        let solver = accelerator_of(device);
        solver.inject(|faults| faults.lose_after(after));
        let reason = solve_in_spite_of(&solver, &a, &b);
        assert!(reason.contains("lost"), "after {after}: {reason}");
        assert!(!solver.available() && matches!(solver.reason(), Some(GpuError::Lost { .. })));
        let pairs = solver.lowest(a.clone(), b.clone(), 30, &Unwatched).unwrap();
        assert_eq!((pairs.computed_on, solver.fallbacks()), (ComputedOn::Cpu, 1));
    }
    // One that has no memory is not.
    for after in [0, 3, 7] {
        let Some(device) = open() else { return };
        let solver = accelerator_of(device);
        solver.inject(|faults| faults.refuse_memory_after(after));
        assert!(solve_in_spite_of(&solver, &a, &b).contains("could not allocate"));
        assert!(on_gpu(&solver.lowest(a.clone(), b.clone(), 30, &Unwatched).unwrap()));
    }
    // Larger than a buffer may be.
    let Some(mut device) = open() else { return };
    device.limit(u64::MAX, 512);
    assert!(solve_in_spite_of(&accelerator_of(device), &a, &b).contains("could not allocate 640 bytes"));
    // One that does not answer, pretended, and truly within no time at all.
    for pretended in [true, false] {
        let Some(mut device) = open() else { return };
        if !pretended {
            device.limit_time(Duration::from_nanos(1));
        }
        let solver = accelerator_of(device);
        if pretended {
            solver.inject(|faults| faults.time_out_after(3));
        }
        assert!(solve_in_spite_of(&solver, &a, &b).contains("did not answer"));
        assert!(!solver.available());
    }
    // One that computes wrong.
    let Some(device) = open() else { return };
    let solver = accelerator_of(device);
    solver.inject(|faults| faults.spoil());
    assert!(solve_in_spite_of(&solver, &a, &b).contains("is wrong"));
    assert!(!solver.available());
}

#[test]
fn errors_of_the_pencil_are_those_of_the_cpu() {
    let Some(device) = open() else { return };
    let solver = accelerator_of(device);
    let (a, b) = pencil(&mixed_spectrum(80), 5);
    let solve = |a, b, count| solver.lowest(a, b, count, &Unwatched).unwrap_err();
    assert_eq!(solve(a.clone(), b.clone(), 81), EigenError::Count { count: 81, size: 80 });
    let mut bad = b.clone();
    bad.column_mut(3)[3] = -1.0;
    assert_eq!(solve(a.clone(), bad, 2), EigenError::NotPositiveDefinite { pivot: 3 });
    let mut bad = a;
    bad.column_mut(2)[4] = f64::NAN;
    assert_eq!(solve(bad, b, 2).to_string(), "entry (4, 2) of A is not finite");
    assert_eq!(solver.fallbacks(), 0);
}

#[test]
fn work_ends_when_it_is_told_to() {
    struct Stop(std::sync::atomic::AtomicU32);
    impl Monitor for Stop {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            let before = self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if before > 5 { Err(Cancelled) } else { Ok(()) }
        }
    }
    let Some(device) = open() else { return };
    let solver = accelerator_of(device);
    let (a, b) = pencil(&mixed_spectrum(80), 5);
    let stopped = solver.lowest(a, b, 30, &Stop(0.into())).unwrap_err();
    assert!(matches!(stopped, EigenError::Cancelled(_)));
    assert_eq!((solver.fallbacks(), solver.available()), (0, true));
}

#[test]
fn both_sides_are_measured_and_a_device_in_software_gets_nothing() {
    let Some(device) = open() else { return };
    self_test::measure::<f64>(&device).unwrap();
    self_test::measure::<f32>(&device).unwrap();
    let speeds = speeds::Speeds::measure(&device).unwrap();
    println!("{speeds:?}");
    if device.adapter().software {
        assert!(speeds.best(4000, 2000).is_none() && !speeds.products_are_faster(1_000_000, 500), "{speeds:?}");
        assert!(!speeds.lifting_is_faster(1_000_000, 16_000_000, 500), "{speeds:?}");
    }
}

#[test]
fn without_an_adapter_everything_runs_on_the_cpu() {
    let solver = Accelerator::new(GpuChoice::Name("no such card".into()));
    solver.open();
    assert!(!solver.available() && solver.adapter().is_none());
    assert!(matches!(solver.reason(), Some(GpuError::NoAdapter { .. })), "{:?}", solver.reason());
    let (a, b) = pencil(&mixed_spectrum(70), 5);
    let pairs = solver.lowest(a.clone(), b.clone(), 30, &Unwatched).unwrap();
    assert_eq!((&pairs.computed_on, solver.fallbacks()), (&ComputedOn::Cpu, 0));
    check(&a, &b, &pairs, 30);
    let off = Accelerator::off();
    assert!(!off.available() && off.reason().is_none());
}

/// A path of `n` vertices: its stiffness, a lumped mass, and arbitrary columns on it.
fn path(n: usize, q: usize) -> (SparseMatrix, MassMatrix, PanelMatrix) {
    let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in 0..n {
        for column in row.saturating_sub(1)..(row + 2).min(n) {
            columns.push(column as u32);
            values.push(if row == column { 2.1 } else { -1.0 });
        }
        starts.push(columns.len());
    }
    let stiffness = SparseMatrix::from_sorted_parts(n, n, starts, columns, values);
    let mass = MassMatrix::Diagonal((0..n).map(|k| 1.0 + 0.5 * (k as f64).sin()).collect());
    let x = DenseMatrix::from_columns(n, q, Numbers(n as u64).take(n * q));
    (stiffness, mass, PanelMatrix::from_dense(&x))
}

fn largest_difference(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn products_of_rayleigh_and_ritz_agree_with_those_of_the_cpu_also_in_panels() {
    for binding_bytes in [u64::MAX, 40 << 10] {
        let Some(mut device) = open() else { return };
        device.limit(binding_bytes, u64::MAX);
        let accelerator = accelerator_of(device);
        let (stiffness, mass, x) = path(1501, 37);
        let (a, b, resident) = accelerator.restrict(&stiffness, &mass, &x, &Unwatched).unwrap();
        let expected = panel_products::restrict(&stiffness, &mass, &x, &Unwatched).unwrap();
        assert!(largest_difference(a.values(), expected.0.values()) < 1e-11);
        assert!(largest_difference(b.values(), expected.1.values()) < 1e-11);
        assert!(resident.is_some());
        let z = DenseMatrix::from_columns(37, 33, Numbers(5).take(37 * 33));
        let (mut rotated, mut expected) = (x.clone(), x.clone());
        accelerator.rotate(&mut rotated, resident, &z, &Unwatched).unwrap();
        panel_products::rotate(&mut expected, &z, &Unwatched).unwrap();
        assert_eq!(rotated.columns(), 33);
        for (rotated, expected) in rotated.panels().iter().zip(expected.panels()) {
            assert!(largest_difference(rotated, expected) < 1e-12);
        }
        // Columns of functions of three vertices each.
        let (n, d) = (900, 90);
        let places: Vec<u32> =
            (0..n as u32).flat_map(|row| [row / 10, row / 10 + 1].map(|k| k.min(d as u32 - 1))).collect();
        let starts = (0..=n).map(|row| 2 * row).collect();
        let space =
            SparseMatrix::from_sorted_parts(n, d, starts, places, (0..2 * n).map(|k| 0.1 * (k % 7) as f32).collect());
        let coefficients = DenseMatrix::from_columns(d, 40, Numbers(6).take(d * 40));
        let lifted = accelerator.lift(&space, &coefficients, &Unwatched).unwrap();
        let expected = panel_products::prolong(&space, &PanelMatrix::from_dense(&coefficients));
        for (lifted, expected) in lifted.panels().iter().zip(expected.panels()) {
            assert!(largest_difference(lifted, expected) < 1e-12);
        }
        assert_eq!(accelerator.fallbacks(), 0);
    }
}

#[test]
fn products_come_back_to_the_cpu_when_the_device_fails() {
    let (stiffness, mass, x) = path(500, 40);
    let expected = panel_products::restrict(&stiffness, &mass, &x, &Unwatched).unwrap();
    let Some(device) = open() else { return };
    let accelerator = accelerator_of(device);
    accelerator.inject(|faults| faults.refuse_memory_after(4));
    let (a, _, resident) = accelerator.restrict(&stiffness, &mass, &x, &Unwatched).unwrap();
    assert!(largest_difference(a.values(), expected.0.values()) < 1e-12 && resident.is_none());
    assert_eq!((accelerator.fallbacks(), accelerator.available()), (1, true));
    // Lost between two products.
    let (_, _, resident) = accelerator.restrict(&stiffness, &mass, &x, &Unwatched).unwrap();
    accelerator.inject(|faults| faults.lose_after(0));
    let z = DenseMatrix::from_columns(40, 20, Numbers(5).take(40 * 20));
    let (mut rotated, mut expected) = (x.clone(), x.clone());
    accelerator.rotate(&mut rotated, resident, &z, &Unwatched).unwrap();
    panel_products::rotate(&mut expected, &z, &Unwatched).unwrap();
    assert_eq!(rotated, expected);
    assert_eq!((accelerator.fallbacks(), accelerator.available()), (2, false));
}
