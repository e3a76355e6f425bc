use super::*;
use crate::analysis::fixtures::solved;
use crate::analysis::value_gradient::value_gradient;
use crate::basis::{DenseFunctions, Precision};
use crate::operator::elastic::tests::bar;
use crate::operator::{Boundary, MeshOperator, OperatorKind, OperatorParameters, assemble, volume};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_mesh::{TetMesh, TriangleMesh};

fn basis(operator: &MeshOperator, vertices: usize, count: usize) -> Basis {
    solved(operator, vertices, count, 1e-10)
}

fn on_surface(mesh: &TriangleMesh, mass: MassKind, boundary: Boundary) -> MeshOperator {
    assemble(mesh, &OperatorParameters { operator: OperatorKind::Laplace, mass, boundary }, &Unwatched).unwrap()
}

/// A loss with its derivatives by values and functions, of the first few pairs.
type Loss = fn(&[f64], &DenseMatrix) -> (f64, Vec<f64>, DenseMatrix);

/// `Σ_k a_k λ_k + Σ_v d_v x_k(v)²` with numbers `a` and `d` at random, and products of neighbouring functions, which
/// change with neither sign.
fn squares(values: &[f64], functions: &DenseMatrix) -> (f64, Vec<f64>, DenseMatrix) {
    let (n, c) = (functions.rows(), functions.columns());
    let mut random = SplitMix64::new(3);
    let of_values: Vec<f64> = (0..c).map(|_| random.signed_unit()).collect();
    let mut loss: f64 = values.iter().zip(&of_values).map(|(value, weight)| value * weight).sum();
    let mut derivatives = DenseMatrix::zeros(n, c);
    for k in 0..c {
        for v in 0..n {
            let (d, e) = (random.signed_unit(), 0.1 * random.signed_unit());
            let (x, next) = (functions.column(k)[v], functions.column((k + 1) % c)[v]);
            loss += d * x * x + e * x * x * next * next;
            derivatives.column_mut(k)[v] += 2.0 * d * x + 2.0 * e * x * next * next;
            derivatives.column_mut((k + 1) % c)[v] += 2.0 * e * next * x * x;
        }
    }
    (loss, of_values, derivatives)
}

/// `Σ_k exp(−λ_k t) x_k(u) x_k(v)` for some vertices: it does not depend on which functions stand for a multiplet.
fn heat(values: &[f64], functions: &DenseMatrix) -> (f64, Vec<f64>, DenseMatrix) {
    const TIME: f64 = 0.2;
    let (n, c) = (functions.rows(), functions.columns());
    let (mut loss, mut of_values, mut derivatives) = (0.0, vec![0.0; c], DenseMatrix::zeros(n, c));
    for k in 0..c {
        let decay = (-TIME * values[k]).exp();
        for (u, v) in [(3, 50), (7, 7), (20, 91)] {
            let (at_u, at_v) = (functions.column(k)[u], functions.column(k)[v]);
            loss += decay * at_u * at_v;
            of_values[k] -= TIME * decay * at_u * at_v;
            derivatives.column_mut(k)[u] += decay * at_v;
            derivatives.column_mut(k)[v] += decay * at_u;
        }
    }
    (loss, of_values, derivatives)
}

fn first(basis: &Basis, count: usize) -> (Vec<f64>, DenseMatrix) {
    let columns = basis.lift::<f64>(0..count).unwrap();
    (basis.eigenvalues[..count].to_vec(), DenseMatrix::from_columns(basis.vertices(), count, columns))
}

/// Compares the gradient of a loss of the first `count` pairs, of `of_all` that are computed, with differences along
/// random motions.
fn agrees(
    operator: impl Fn(&[[f64; 3]]) -> MeshOperator,
    positions: &[[f64; 3]],
    (elements, mass): (Elements<'_>, MassKind),
    (count, of_all): (usize, usize),
    loss: Loss,
) {
    let solved = |positions: &[[f64; 3]]| {
        let operator = operator(positions);
        let basis = basis(&operator, positions.len(), of_all);
        (operator, basis)
    };
    let (at_rest, found) = solved(positions);
    let (values, functions) = first(&found, count);
    let (_, of_values, derivatives) = loss(&values, &functions);
    let of = LossDerivatives { values: &of_values, functions: &derivatives };
    let gradient = mode_gradient(&found, &at_rest.problem, (elements, mass), of, &Unwatched).unwrap();
    let mut random = SplitMix64::new(7);
    for _ in 0..2 {
        let motion: Vec<[f64; 3]> = positions.iter().map(|_| [0; 3].map(|_| random.signed_unit())).collect();
        let at = |step: f64| -> f64 {
            let moved: Vec<[f64; 3]> =
                positions.iter().zip(&motion).map(|(p, v)| [0, 1, 2].map(|k| p[k] + step * v[k])).collect();
            let (values, functions) = first(&solved(&moved).1, count);
            loss(&values, &functions).0
        };
        let central = |step: f64| (at(step) - at(-step)) / (2.0 * step);
        let step = 2e-4;
        let measured = (4.0 * central(step) - central(2.0 * step)) / 3.0;
        let found: f64 = gradient.as_flattened().iter().zip(motion.as_flattened()).map(|(g, v)| g * v).sum();
        let size: f64 = gradient.as_flattened().iter().zip(motion.as_flattened()).map(|(g, v)| (g * v).abs()).sum();
        assert!((found - measured).abs() < 1e-6 * size, "{found} by the gradient, {measured} by differences of {size}");
    }
}

#[test]
fn gradients_of_functions_are_what_differences_say() {
    let closed = noisy(&generate(Shape::Torus, 150).unwrap(), 0.2, 3).unwrap();
    let open = noisy(&generate(Shape::Disk, 150).unwrap(), 0.2, 3).unwrap();
    for (mesh, mass, boundary) in [
        (&closed, MassKind::Barycentric, Boundary::Neumann),
        (&closed, MassKind::Consistent, Boundary::Neumann),
        (&open, MassKind::Consistent, Boundary::Dirichlet),
    ] {
        let operator = |positions: &[[f64; 3]]| {
            on_surface(
                &TriangleMesh { positions: positions.to_vec(), faces: mesh.faces.clone(), ..Default::default() },
                mass,
                boundary,
            )
        };
        // All that the basis has, and a part.
        for counts in [(7, 7), (5, 12)] {
            agrees(operator, &mesh.positions, (Elements::Triangles(mesh), mass), counts, squares);
        }
    }
}

#[test]
fn gradients_of_functions_in_solids_are_what_differences_say() {
    let mut solid = bar([1.0, 1.3, 1.7], [3, 3, 4]);
    let mut random = SplitMix64::new(5);
    solid.positions.as_flattened_mut().iter_mut().for_each(|x| *x += 0.05 * random.signed_unit());
    let operator = |positions: &[[f64; 3]]| {
        let solid = TetMesh { positions: positions.to_vec(), tetrahedra: solid.tetrahedra.clone() };
        volume::assemble(&solid, MassKind::Barycentric, Boundary::Neumann, &Unwatched).unwrap()
    };
    let elements = (Elements::Tetrahedra(&solid), MassKind::Barycentric);
    agrees(operator, &solid.positions, elements, (4, 6), squares);
}

/// `Σ_k λ_k + x_k(u) x_k(v)`: values count alike, so that it may have multiplets.
fn spaces(values: &[f64], functions: &DenseMatrix) -> (f64, Vec<f64>, DenseMatrix) {
    let still = vec![0.0; values.len()];
    let (loss, _, derivatives) = heat(&still, functions);
    (loss + values.iter().sum::<f64>(), vec![1.0; values.len()], derivatives)
}

#[test]
fn a_loss_of_whole_multiplets_has_a_gradient() {
    let mesh = generate(Shape::Sphere, 160).unwrap();
    let operator = |positions: &[[f64; 3]]| {
        let mesh = TriangleMesh { positions: positions.to_vec(), faces: mesh.faces.clone(), ..Default::default() };
        on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann)
    };
    // One, three and five; beyond them seven.
    let elements = (Elements::Triangles(&mesh), MassKind::Barycentric);
    agrees(operator, &mesh.positions, elements, (9, 9), spaces);
    agrees(operator, &mesh.positions, elements, (4, 9), spaces);
    // All but multiplets, whose values count differently.
    for noise in [1e-3, 1e-5] {
        let mesh = noisy(&mesh, noise, 3).unwrap();
        agrees(operator, &mesh.positions, (Elements::Triangles(&mesh), MassKind::Barycentric), (9, 9), heat);
    }
}

/// What derivatives are off by, by rounding or by noise, says nothing of functions that share an eigenvalue: divided by
/// the rounding between their values, it would be all that is left of the gradient.
#[test]
fn rounded_derivatives_do_no_harm_to_multiplets() {
    let sphere = generate(Shape::Sphere, 160).unwrap();
    let operator = on_surface(&sphere, MassKind::Barycentric, Boundary::Neumann);
    let elements = (Elements::Triangles(&sphere), MassKind::Barycentric);
    for (count, of_all) in [(9, 9), (4, 9), (9, 16)] {
        let found = basis(&operator, sphere.positions.len(), of_all);
        let (values, functions) = first(&found, count);
        let (_, of_values, derivatives) = spaces(&values, &functions);
        let of = |derivatives: &DenseMatrix| {
            let loss = LossDerivatives { values: &of_values, functions: derivatives };
            mode_gradient(&found, &operator.problem, elements, loss, &Unwatched).unwrap()
        };
        let exact = of(&derivatives);
        let size = exact.as_flattened().iter().fold(0.0f64, |most, g| most.max(g.abs()));
        let mut random = SplitMix64::new(11);
        let changed = |change: &mut dyn FnMut(f64) -> f64| {
            let mut changed = derivatives.clone();
            changed.values_mut().iter_mut().for_each(|g| *g = change(*g));
            changed
        };
        let cases = [
            (changed(&mut |g| f64::from(g as f32)), 1e-5),
            (changed(&mut |g| g * (1.0 + 1e-12 * random.signed_unit())), 1e-9),
            (changed(&mut |g| g * (1.0 + 1e-10 * random.signed_unit())), 1e-7),
        ];
        for (changed, within) in cases {
            for (g, exact) in of(&changed).as_flattened().iter().zip(exact.as_flattened()) {
                assert!((g - exact).abs() < within * size, "{count} of {of_all}: {g} {exact} of {size}");
            }
        }
    }
}

/// Zeros stay zeros whatever moves: that a loss counts those of several components differently does not matter.
#[test]
fn several_components_have_gradients_of_losses_that_decay() {
    let parts = [(Shape::Torus, 0.0), (Shape::Disk, 9.0), (Shape::Sphere, -9.0)]
        .map(|(shape, x)| (noisy(&generate(shape, 90).unwrap(), 0.2, 3).unwrap(), x));
    let mut mesh = TriangleMesh::default();
    for (part, x) in &parts {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions.iter().map(|p| [p[0] + x, p[1], p[2]]));
        mesh.faces.extend(part.faces.iter().map(|face| face.map(|v| first + v)));
    }
    let operator = |positions: &[[f64; 3]]| {
        let mesh = TriangleMesh { positions: positions.to_vec(), faces: mesh.faces.clone(), ..Default::default() };
        on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann)
    };
    for counts in [(8, 10), (3, 8)] {
        agrees(operator, &mesh.positions, (Elements::Triangles(&mesh), MassKind::Barycentric), counts, heat);
    }
}

/// Inaccurate pairs are not called a cluster that is cut.
#[test]
fn rough_pairs_are_called_rough() {
    let mesh = noisy(&generate(Shape::Torus, 400).unwrap(), 0.2, 3).unwrap();
    let operator = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann);
    let mut found = basis(&operator, mesh.positions.len(), 9);
    // In the place of the second function stands one from beyond.
    let n = mesh.positions.len();
    let more = basis(&operator, n, 14);
    let mut columns = found.lift::<f64>(0..9).unwrap();
    columns[n..2 * n].copy_from_slice(&more.lift::<f64>(13..14).unwrap());
    let everywhere: Vec<u32> = (0..n as u32).collect();
    let panels = rows(&DenseMatrix::from_columns(n, 9, columns), &everywhere);
    found.functions = Functions::Dense(DenseFunctions::from_panels(panels, Precision::F64));
    let (values, functions) = first(&found, 4);
    let (_, of_values, derivatives) = squares(&values, &functions);
    let loss = LossDerivatives { values: &of_values, functions: &derivatives };
    let elements = (Elements::Triangles(&mesh), MassKind::Barycentric);
    let refused = mode_gradient(&found, &operator.problem, elements, loss, &Unwatched);
    assert!(matches!(refused, Err(AnalysisError::Rough { index: 1..=3 })), "{refused:?}");
}

#[test]
fn cut_multiplets_are_named() {
    let mesh = generate(Shape::Sphere, 160).unwrap();
    let operator = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann);
    let of = |count: usize, of_all: usize, loss: Loss| {
        let found = basis(&operator, mesh.positions.len(), of_all);
        let (values, functions) = first(&found, count);
        let (_, of_values, derivatives) = loss(&values, &functions);
        let loss = LossDerivatives { values: &of_values, functions: &derivatives };
        let elements = (Elements::Triangles(&mesh), MassKind::Barycentric);
        mode_gradient(&found, &operator.problem, elements, loss, &Unwatched)
    };
    assert!(matches!(of(3, 9, spaces), Err(AnalysisError::Turned { first: 1 | 2, second: 3 })));
    assert!(matches!(of(6, 6, spaces), Err(AnalysisError::Cut { index: 4 | 5 })));
    assert!(matches!(of(4, 9, heat), Err(AnalysisError::Mixed { .. })));
    // What lies beyond may be cut where nothing counts it.
    assert!(of(4, 6, spaces).is_ok());
}

#[test]
fn without_functions_it_is_the_gradient_of_the_values() {
    let mesh = noisy(&generate(Shape::Torus, 150).unwrap(), 0.2, 3).unwrap();
    let operator = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann);
    let found = basis(&operator, mesh.positions.len(), 6);
    let elements = (Elements::Triangles(&mesh), MassKind::Barycentric);
    let nothing = DenseMatrix::zeros(mesh.positions.len(), 0);
    let weights = [0.0, 1.0, -0.5, 0.0, 2.0, 0.1];
    let of = |values: &[f64], functions: &DenseMatrix| {
        mode_gradient(&found, &operator.problem, elements, LossDerivatives { values, functions }, &Unwatched)
    };
    let expected = value_gradient(&found, elements.0, elements.1, &weights, &Unwatched).unwrap();
    assert_eq!(of(&weights, &nothing).unwrap(), expected);
    assert_eq!(of(&weights[..5], &nothing).unwrap().len(), expected.len());
    let refused = |result: Result<Vec<[f64; 3]>, AnalysisError>| result.unwrap_err().to_string();
    assert_eq!(refused(of(&[1.0; 7], &nothing)), "the number of weights must be between 0 and 6, got 7");
    assert!(refused(of(&[], &DenseMatrix::zeros(3, 1))).starts_with("the number of values of a derivative must be "));
    let mut odd = DenseMatrix::zeros(mesh.positions.len(), 1);
    odd.column_mut(0)[4] = f64::INFINITY;
    assert!(refused(of(&[], &odd)).ends_with("a derivative must be a finite number, got inf"));
}
