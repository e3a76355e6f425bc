//! Refined designs against direct solves in the space of all fields.

use std::sync::Arc;

use chladni_algebra::{DefiniteFactor, DenseMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix};
use chladni_base::Unwatched;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate};

use super::compliance::Compliance;
use super::refine_response::conjugate_gradients;
use super::*;
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;

struct Problem {
    basis: FieldBasis,
    /// `S`, and the masses of all numbers.
    stiffness: SparseMatrix,
    masses: Vec<f64>,
    full: FullSpace,
    model: DesignModel,
    surface: FieldSurface,
}

fn problem(surface: FieldSurface, kind: FieldKind, dimension: usize) -> Problem {
    let basis = field_basis(&surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
    let boundary = FieldBoundary::default();
    let whole = whole_space(&surface, kind, boundary).unwrap();
    let masses = (0..whole.mass.rows()).map(|i| whole.mass.row(i).1[0]).collect();
    let full = FullSpace::by_cycles(&surface, kind, boundary).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    Problem { basis, stiffness: whole.stiffness, masses, full, model, surface }
}

/// Constraints on faces that are spread over a surface.
fn spread(faces: usize, count: usize, hold: impl Fn(usize) -> Hold) -> Vec<Constraint> {
    let one = |i: usize| Constraint {
        face: ((i * faces) / count + i * i % 7) as u32,
        value: [(1.3 * i as f64).cos(), (0.7 * i as f64).sin(), 0.4],
        hold: hold(i),
    };
    (0..count).map(one).collect()
}

impl Problem {
    /// The minimiser by a dense factor: soft constraints by their weights, those that are met exactly by elimination.
    fn dense_minimiser(
        &self,
        weights: EnergyWeights,
        held: &[f64],
        force: &[f64],
        compliance: &Compliance,
    ) -> Vec<f64> {
        let n = self.masses.len();
        let b = self.basis.space.block();
        let dense = self.stiffness.to_dense();
        let mut scaled = dense.clone();
        for j in 0..n {
            scaled.column_mut(j).iter_mut().zip(&self.masses).for_each(|(x, m)| *x /= m.sqrt());
        }
        let mut matrix = scaled.transposed_times(&scaled);
        matrix.values_mut().iter_mut().zip(dense.values()).for_each(|(k, s)| {
            *k = weights.biharmonic * *k + weights.harmonic * s;
        });
        (0..n).for_each(|i| matrix.column_mut(i)[i] += held[i]);
        let mut right = force.to_vec();
        let mut fixed = vec![None; n];
        for (i, (&value, &slack)) in compliance.values.iter().zip(&compliance.slacks).enumerate() {
            let at = b * compliance.faces[i / b] as usize + i % b;
            if slack > 0.0 {
                matrix.column_mut(at)[at] += 1.0 / slack;
                right[at] += value / slack;
            } else {
                fixed[at] = Some(value);
            }
        }
        let free: Vec<usize> = (0..n).filter(|&i| fixed[i].is_none()).collect();
        let (mut own, mut rhs) = (DenseMatrix::zeros(free.len(), free.len()), DenseMatrix::zeros(free.len(), 1));
        for (at, &i) in free.iter().enumerate() {
            rhs.column_mut(0)[at] = right[i];
            free.iter().enumerate().for_each(|(to, &j)| own.column_mut(at)[to] = matrix.column(i)[j]);
        }
        for (j, value) in fixed.iter().enumerate().filter_map(|(j, v)| v.map(|v| (j, v))) {
            free.iter().enumerate().for_each(|(at, &i)| rhs.column_mut(0)[at] -= matrix.column(j)[i] * value);
        }
        DefiniteFactor::new(own).unwrap().solve(&mut rhs).unwrap();
        let mut field: Vec<f64> = fixed.iter().map(|v| v.unwrap_or(0.0)).collect();
        free.iter().zip(rhs.column(0)).for_each(|(&i, &x)| field[i] = x);
        field
    }

    /// The minimiser under soft constraints by a sparse factor of `[h S + CᵀWC, √μ S; √μ S, −M]`.
    fn sparsely(&self, weights: EnergyWeights, compliance: &Compliance) -> Vec<f64> {
        let (n, b, root) = (self.masses.len(), self.basis.space.block(), weights.biharmonic.sqrt());
        let mut held = vec![0.0; n];
        let mut right = PanelMatrix::zeros(2 * n, 1);
        for (i, (&value, &slack)) in compliance.values.iter().zip(&compliance.slacks).enumerate() {
            let at = b * compliance.faces[i / b] as usize + i % b;
            held[at] += 1.0 / slack;
            right.panels_mut()[0][at * PANEL_WIDTH] += value / slack;
        }
        let mut entries = Vec::new();
        for i in 0..n {
            let (columns, values) = self.stiffness.row(i);
            for (&j, &s) in columns.iter().zip(values) {
                let (i, j, m) = (i as u32, j, n as u32);
                entries.extend([(i, j, weights.harmonic * s), (i, m + j, root * s), (m + i, j, root * s)]);
            }
            entries.push((i as u32, i as u32, held[i]));
            entries.push(((n + i) as u32, (n + i) as u32, -self.masses[i]));
        }
        poisson::solve(&SparseMatrix::summed(2 * n, entries), &mut right, &Unwatched).unwrap();
        right.column(0)[..n].to_vec()
    }

    /// `‖a − b‖ / ‖b‖` by area.
    fn off(&self, a: &[f64], b: &[f64]) -> f64 {
        let square = |x: &mut dyn Iterator<Item = f64>| x.zip(&self.masses).map(|(x, m)| m * x * x).sum::<f64>();
        (square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())).sqrt()
    }
}

#[test]
fn refined_designs_are_those_of_a_dense_factor_of_the_whole_space() {
    for shape in [Shape::Sphere, Shape::Torus, Shape::Rectangle] {
        for kind in
            [FieldKind::Vector {}, FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}]
        {
            let surface = FieldSurface::new(generate(shape, 260).unwrap()).unwrap();
            let p = problem(surface, kind, 120);
            let (faces, b) = (p.surface.faces(), kind.block());
            for (harmonic, biharmonic) in [(1.0, 0.05), (0.0, 1.0), (1.0, 0.0)] {
                let weights = EnergyWeights { harmonic, biharmonic };
                let weighted = p.model.weighted(weights, None).unwrap();
                let hold = |i: usize| if i.is_multiple_of(3) { Hold::Exact } else { Hold::Strength(0.5 + i as f64) };
                let constraints = spread(faces, 9, hold);
                let design = weighted.solve(&p.basis, &constraints).unwrap();
                let refined = p.full.refine(&weighted, &p.basis, &constraints, &design, 1e-9, &Unwatched).unwrap();
                let compliance = weighted.compliance(&p.basis, &constraints).unwrap();
                let exact = p.dense_minimiser(weights, &vec![0.0; b * faces], &vec![0.0; b * faces], &compliance);
                let off = p.off(&refined.field, &exact);
                println!("{shape:?} {kind:?} {harmonic} {biharmonic}: {off:.1e} after {} responses", refined.responses);
                assert!(off < 1e-8, "{shape:?} {kind:?} {weights:?}: {off}");
                let reduced: Vec<f64> =
                    p.basis.space.lift(&design.coefficients).unwrap().into_iter().map(f64::from).collect();
                assert!((refined.distance - p.off(&reduced, &exact)).abs() < 1e-6 * refined.distance.max(1.0));
                let image = p.stiffness.multiply(&exact);
                let energy: f64 = image.iter().zip(&exact).map(|(a, b)| a * b).sum();
                assert!((refined.harmonic_energy - energy).abs() < 1e-6 * energy);
                assert!(refined.residuals.iter().step_by(3).all(|missed| *missed < 1e-7), "{:?}", refined.residuals);
            }
        }
    }
}

#[test]
fn refined_alignments_are_those_of_a_dense_factor_with_and_without_weights_per_face() {
    let surface = FieldSurface::new(generate(Shape::Torus, 260).unwrap()).unwrap();
    for kind in [FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
        let p = problem(surface.clone(), kind, 120);
        let (faces, b) = (surface.faces(), kind.block());
        let areas = surface.frames().areas();
        let target: Vec<f64> = (0..b * faces).map(|i| (i as f64 * 0.37).sin()).collect();
        let shares: Vec<f64> = (0..faces).map(|f| 0.5 + (f as f64 * 0.11).cos() * 0.5).collect();
        // The second has complex roots: its sum is no product.
        for (harmonic, biharmonic, weight) in [(1.0, 0.05, 2.0), (0.01, 1e-4, 1.0), (1.0, 0.0, 3.0)] {
            let weights = EnergyWeights { harmonic, biharmonic };
            for per_face in [None, Some(shares.as_slice())] {
                let alignment = Arc::new(p.model.alignment(&p.basis, areas, &target, per_face).unwrap());
                let weighted = p.model.weighted(weights, Some((alignment, weight))).unwrap();
                let constraints = spread(faces, 4, |_| Hold::Strength(1.0));
                let design = weighted.solve(&p.basis, &constraints).unwrap();
                let refined = p.full.refine(&weighted, &p.basis, &constraints, &design, 1e-9, &Unwatched).unwrap();
                let held: Vec<f64> =
                    (0..b * faces).map(|i| weight * areas[i / b] * per_face.map_or(1.0, |own| own[i / b])).collect();
                let force: Vec<f64> = held.iter().zip(&target).map(|(h, t)| h * t).collect();
                let compliance = weighted.compliance(&p.basis, &constraints).unwrap();
                let off = p.off(&refined.field, &p.dense_minimiser(weights, &held, &force, &compliance));
                assert!(off < 1e-8, "{kind:?} {weights:?} per face {}: {off}", per_face.is_some());
            }
        }
    }
}

#[test]
fn refined_designs_on_a_finer_surface_are_those_of_a_sparse_factor_and_estimates_are_near() {
    for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }] {
        let p = problem(FieldSurface::new(generate(Shape::Knot, 4000).unwrap()).unwrap(), kind, 400);
        agrees(&p, "knot");
    }
}

/// Strokes on a surface: the refined design is that of a sparse factor, and the estimate of the distance is within a
/// tenth.
fn agrees(p: &Problem, name: &str) {
    let weights = EnergyWeights::default();
    let weighted = p.model.weighted(weights, None).unwrap();
    let constraints = spread(p.surface.faces(), 16, |_| Hold::Strength(1.0));
    let design = weighted.solve(&p.basis, &constraints).unwrap();
    let refined = p.full.refine(&weighted, &p.basis, &constraints, &design, 1e-9, &Unwatched).unwrap();
    let exact = p.sparsely(weights, &weighted.compliance(&p.basis, &constraints).unwrap());
    let off = p.off(&refined.field, &exact);
    let estimate = p.full.distance(&weighted, &p.basis, &constraints, &design, &Unwatched).unwrap();
    println!(
        "{name}: {off:.1e}, distance {:.3e}, estimated {estimate:.3e}, {} responses",
        refined.distance, refined.responses
    );
    assert!(off < 1e-8, "{name}: {off}");
    assert!((estimate / refined.distance - 1.0).abs() < 0.1, "{name}: {estimate} {}", refined.distance);
}

#[test]
fn refined_designs_on_real_surfaces_are_those_of_a_sparse_factor() {
    for (name, kind) in [("rocker-arm.off", FieldKind::Vector {}), ("fertility-14k.obj", FieldKind::NVector { n: 4 })] {
        let Some(surface) = real_meshes::surface(name) else { return };
        agrees(&problem(surface, kind, 600), name);
    }
}

#[test]
fn whatever_tolerance_is_allowed_a_design_is_refined_to_it() {
    let p = problem(FieldSurface::new(generate(Shape::Sphere, 260).unwrap()).unwrap(), FieldKind::Vector {}, 120);
    let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
    let constraints = spread(p.surface.faces(), 5, |_| Hold::Strength(1.0));
    let design = weighted.solve(&p.basis, &constraints).unwrap();
    let refined = |tolerance| p.full.refine(&weighted, &p.basis, &constraints, &design, tolerance, &Unwatched).unwrap();
    let close = refined(1e-10).field;
    for tolerance in [0.99, 0.5, 0.1, 0.02, 1e-3, 1e-6] {
        let off = p.off(&refined(tolerance).field, &close);
        // What is left is measured by pulls, and is about that share of the field.
        assert!(off < 3.0 * tolerance, "{tolerance}: {off}");
    }
}

/// One stroke fixes two of the four numbers of fields without energy on two plates. The least field that meets it is
/// zero on the other plate.
#[test]
fn fields_without_energy_that_no_constraint_holds_are_as_small_as_possible() {
    let plates = [260, 300].map(|vertices| generate(Shape::Rectangle, vertices).unwrap());
    let first = plates[0].faces.len();
    let p = problem(FieldSurface::new(union(&plates)).unwrap(), FieldKind::NVector { n: 4 }, 120);
    let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
    for face in [17, first as u32 + 40] {
        let constraints = [Constraint { face, value: [0.6, -1.1, 0.0], hold: Hold::Strength(1.0) }];
        let design = weighted.solve(&p.basis, &constraints).unwrap();
        let refined = p.full.refine(&weighted, &p.basis, &constraints, &design, 1e-9, &Unwatched).unwrap();
        for (at, u) in refined.field.as_chunks::<2>().0.iter().enumerate() {
            let wanted = if (at < first) == ((face as usize) < first) { 0.6f64.hypot(1.1) } else { 0.0 };
            assert!((u[0].hypot(u[1]) - wanted).abs() < 1e-6, "stroke on face {face}, face {at}: {u:?}");
        }
        assert!(refined.distance < 1e-3, "{}", refined.distance);
    }
}

#[test]
fn what_is_no_residual_is_no_convergence() {
    let solve = |factor: f64, f: &[f64]| {
        let precondition = |r: &[f64]| Ok(r.iter().map(|x| factor * x).collect());
        conjugate_gradients(<[f64]>::to_vec, precondition, f, 1e-6, &Unwatched)
    };
    assert_eq!(solve(1.0, &[1.0, 2.0]), Ok(vec![1.0, 2.0]));
    assert_eq!(solve(1.0, &[0.0, 0.0]), Ok(vec![0.0, 0.0]));
    for (factor, f) in [(f64::NAN, [1.0, 2.0]), (-1.0, [1.0, 2.0]), (1.0, [f64::NAN, 0.0]), (1.0, [1e200, 0.0])] {
        assert_eq!(solve(factor, &f), Err(RefineError::NotConverged { tolerance: 1e-6 }), "{factor} {f:?}");
    }
}

#[test]
fn tolerances_weights_and_singularities_that_refinement_cannot_have_are_refused() {
    let p = problem(FieldSurface::new(generate(Shape::Sphere, 260).unwrap()).unwrap(), FieldKind::Vector {}, 120);
    let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
    let constraints = spread(p.surface.faces(), 3, |_| Hold::Strength(1.0));
    let design = weighted.solve(&p.basis, &constraints).unwrap();
    for tolerance in [0.0, 1e-12, 1.0, f64::NAN] {
        let refused = p.full.refine(&weighted, &p.basis, &constraints, &design, tolerance, &Unwatched);
        assert!(matches!(refused, Err(RefineError::Tolerance { .. })), "{tolerance}");
    }
    let uneven = p.model.weighted(EnergyWeights { harmonic: 1.0, biharmonic: 1e-40 }, None).unwrap();
    let refused = p.full.refine(&uneven, &p.basis, &constraints, &design, 1e-6, &Unwatched);
    assert!(matches!(refused, Err(RefineError::Weights { .. })), "{refused:?}");
    let at = [0, 40].map(|vertex| Prescribed { vertex, numerator: 1 });
    let field = PrescribedField::new(&p.surface, p.basis.kind, &at, &Unwatched).unwrap();
    let prescription = Arc::new(p.model.prescription(&p.basis, &p.surface, field).unwrap());
    let weighted = p.model.weighted_with(EnergyWeights::default(), Vec::new(), Some((prescription, 100.0))).unwrap();
    let refused = p.full.refine(&weighted, &p.basis, &constraints, &design, 1e-6, &Unwatched);
    assert_eq!(refused, Err(RefineError::Prescribed));
}

#[test]
fn refinement_ends_when_nobody_waits_for_it() {
    struct Gone;
    impl chladni_base::Monitor for Gone {
        fn stage(&self, _name: &'static str) {}
        fn progress(&self, _fraction: f64) {}
        fn checkpoint(&self) -> Result<(), chladni_base::Cancelled> {
            Err(chladni_base::Cancelled)
        }
    }
    let p = problem(FieldSurface::new(generate(Shape::Sphere, 260).unwrap()).unwrap(), FieldKind::Vector {}, 120);
    let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
    let constraints = spread(p.surface.faces(), 3, |_| Hold::Strength(1.0));
    let design = weighted.solve(&p.basis, &constraints).unwrap();
    let refused = p.full.refine(&weighted, &p.basis, &constraints, &design, 1e-6, &Gone);
    assert!(matches!(refused, Err(RefineError::Cancelled(_))));
}
