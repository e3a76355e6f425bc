//! Corrected eigenfields against dense eigenproblems of all fields, and against the plane, where eigenvalues are known
//! in closed form.

use std::f64::consts::PI;

use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::field::{DesignModel, FieldParameters, FieldSurface, field_basis, whole_space};
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;

/// The unit square of so many vertices along each side.
fn grid(across: usize, up: usize) -> TriangleMesh {
    let at = |i: usize, count: usize| i as f64 / (count - 1) as f64;
    let positions = (0..up).flat_map(|j| (0..across).map(move |i| [at(i, across), at(j, up), 0.0])).collect();
    let cells = (0..up - 1).flat_map(|j| (0..across - 1).map(move |i| (j * across + i) as u32));
    let wide = across as u32;
    let faces = cells.flat_map(|v| [[v, v + 1, v + wide + 1], [v, v + wide + 1, v + wide]]).collect();
    TriangleMesh { positions, faces, ..TriangleMesh::default() }
}

/// The lowest Ritz fields of a space, as many as are corrected together, with their values.
fn start(surface: &FieldSurface, kind: FieldKind, dimension: usize, wanted: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
    let basis = field_basis(surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let count = LowestFields::block_size(wanted, model.dimension());
    let lifted = |k: usize| basis.space.lift(&model.eigenfield(k)).unwrap().into_iter().map(f64::from).collect();
    ((0..count).map(lifted).collect(), model.values()[..count].to_vec())
}

fn full(surface: &FieldSurface, kind: FieldKind) -> FullSpace {
    FullSpace::new(surface, kind, FieldBoundary::default(), &Unwatched).unwrap()
}

/// All eigenvalues of the space of all fields.
fn dense_eigenvalues(surface: &FieldSurface, kind: FieldKind, count: usize) -> Vec<f64> {
    let whole = whole_space(surface, kind, FieldBoundary::default()).unwrap();
    let (stiffness, mass): (DenseMatrix, DenseMatrix) = (whole.stiffness.to_dense(), whole.mass.to_dense());
    CpuSolver.lowest(stiffness, mass, count, &Unwatched).unwrap().values
}

#[test]
fn estimates_tell_how_far_values_are_off_on_fair_and_on_stretched_triangles() {
    let torus = generate(Shape::Torus, 500).unwrap();
    for (mesh, kind, far) in [
        (torus.clone(), FieldKind::Vector {}, false),
        (torus.clone(), FieldKind::NVector { n: 4 }, false),
        (torus, FieldKind::Tensor {}, false),
        (grid(61, 5), FieldKind::Vector {}, true),
        (grid(61, 5), FieldKind::NVector { n: 2 }, false),
    ] {
        let surface = FieldSurface::new(mesh).unwrap();
        let exact = dense_eigenvalues(&surface, kind, 60);
        let (fields, values) = start(&surface, kind, 200, 12);
        let found = full(&surface, kind).eigenfields(fields, 12, EigenfieldGoal::Estimate, &Unwatched).unwrap();
        assert!(found.reached, "{kind:?}");
        let mut worst = 0.0f64;
        for (k, ((own, &value), &least)) in found.fields.iter().zip(&values).zip(&exact).enumerate() {
            let (error, estimate) = (value - least, own.gained + own.left);
            let rounding = 1e-4 * value.max(0.1);
            println!(
                "{kind:?} {k}: {value} {least} error {error} estimate {estimate} bound {} after {}",
                own.bound, found.rounds
            );
            assert!(
                estimate < 1.5 * error + rounding && error < 1.5 * estimate + rounding,
                "{kind:?} {k}: {error} {estimate}"
            );
            assert!(own.gained <= error + rounding && own.value >= least - rounding);
            let nearest = exact.iter().map(|e| (e - own.value).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= own.bound + rounding, "{kind:?} {k}: {nearest} {}", own.bound);
            worst = worst.max(error / least.max(1.0));
        }
        assert_eq!(worst > 1.0, far, "{kind:?}: {worst}");
    }
}

#[test]
fn on_triangles_fifteen_times_as_long_as_wide_the_true_factor_is_told() {
    let surface = FieldSurface::new(grid(121, 9)).unwrap();
    let kind = FieldKind::Vector {};
    let (fields, values) = start(&surface, kind, 960, 8);
    let found = full(&surface, kind).eigenfields(fields, 8, EigenfieldGoal::Estimate, &Unwatched).unwrap();
    assert!(found.reached);
    // Gradients of Neumann's functions, co-gradients of Dirichlet's.
    let smooth = [1.0, 1.0, 2.0, 2.0, 4.0, 4.0, 5.0, 5.0].map(|times| times * PI * PI);
    for ((own, &value), exact) in found.fields.iter().zip(&values).zip(smooth) {
        let (factor, told) = (value / exact, value / (value - own.gained - own.left));
        println!("{value} {exact}: factor {factor}, told {told}, after {}", found.rounds);
        assert!(factor > 3.0 && told < 2.0 * factor && factor < 2.0 * told, "{factor} {told}");
    }
}

#[test]
fn corrected_fields_are_those_of_the_whole_surface() {
    for (mesh, kind) in
        [(generate(Shape::Torus, 500).unwrap(), FieldKind::NVector { n: 4 }), (grid(61, 5), FieldKind::Vector {})]
    {
        let surface = FieldSurface::new(mesh).unwrap();
        let exact = dense_eigenvalues(&surface, kind, 10);
        let whole = whole_space(&surface, kind, FieldBoundary::default()).unwrap();
        let (fields, _) = start(&surface, kind, 200, 10);
        let goal = EigenfieldGoal::Tolerance(1e-8);
        let found = full(&surface, kind).eigenfields(fields, 10, goal, &Unwatched).unwrap();
        println!("{kind:?}: {} rounds", found.rounds);
        assert!(found.reached && found.rounds > 1);
        for (own, exact) in found.fields.iter().zip(exact) {
            assert!((own.value - exact).abs() < 1e-6 * exact.max(1.0), "{kind:?}: {} {exact}", own.value);
            let (image, weighed) = (whole.stiffness.multiply(&own.field), whole.mass.multiply(&own.field));
            let off = image.iter().zip(&weighed).map(|(s, m)| (s - own.value * m).powi(2)).sum::<f64>().sqrt();
            let size = image.iter().map(|s| s * s).sum::<f64>().sqrt();
            assert!(off < 0.02 * size + 1e-6, "{kind:?}: {off} of {size}");
        }
    }
}

#[test]
fn fields_that_do_not_fit_are_refused() {
    let surface = FieldSurface::new(grid(9, 5)).unwrap();
    let kind = FieldKind::Vector {};
    let space = full(&surface, kind);
    let refused = space.eigenfields(vec![vec![0.0; 7]], 1, EigenfieldGoal::Estimate, &Unwatched).unwrap_err();
    assert!(refused.to_string().contains("an eigenfield"), "{refused}");
    let (fields, _) = start(&surface, kind, 20, 2);
    let refused = space.eigenfields(fields, 2, EigenfieldGoal::Tolerance(2.0), &Unwatched).unwrap_err();
    assert!(matches!(refused, RefineError::Tolerance { .. }));
}
