use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::fixtures::sphere;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::frames::{Complex64, Turn, normalise};
use crate::operator::hodge::{
    curl, divergence, edge_masses, gradient, nonconforming_gradient, quarter_turn, vertex_masses,
};
use crate::operator::transport::transport_block;

struct Surface {
    mesh: TriangleMesh,
    dual: DualGraph,
    frames: FaceFrames,
}

fn surface(mesh: TriangleMesh) -> Surface {
    let (dual, frames) = (DualGraph::new(&mesh).unwrap(), FaceFrames::new(&mesh).unwrap());
    Surface { mesh, dual, frames }
}

fn shape(shape: Shape, vertices: usize) -> Surface {
    surface(noisy(&generate(shape, vertices).unwrap(), 0.15, 3).unwrap())
}

impl Surface {
    fn operator<const B: usize>(&self, kind: FieldKind) -> FieldOperator<B> {
        FieldOperator::assemble(kind, &self.mesh, &self.dual, &self.frames, FieldBoundary::Tangential).unwrap()
    }
}

fn lowest(stiffness: &SparseMatrix, mass: &[f64], count: usize) -> Vec<f64> {
    let mut dense = DenseMatrix::zeros(mass.len(), mass.len());
    mass.iter().enumerate().for_each(|(i, &m)| dense.column_mut(i)[i] = m);
    CpuSolver.lowest(stiffness.to_dense(), dense, count, &Unwatched).unwrap().values
}

fn spectrum<const B: usize>(operator: &FieldOperator<B>, count: usize) -> Vec<f64> {
    let mass: Vec<f64> = operator.mass.iter().flat_map(|&m| [m; B]).collect();
    lowest(&operator.stiffness.to_sparse(), &mass, count)
}

/// `Gᵀ M_F G` restricted to some functions.
fn laplacian(gradient: &SparseMatrix, areas: &[f64], keep: &[bool]) -> SparseMatrix {
    let g = gradient.to_dense();
    let kept: Vec<usize> = (0..g.columns()).filter(|&c| keep[c]).collect();
    let mut product = vec![0.0; kept.len() * kept.len()];
    for (j, &c) in kept.iter().enumerate() {
        for (i, &b) in kept.iter().enumerate() {
            product[j * kept.len() + i] = (0..g.rows()).map(|r| areas[r / 2] * g.column(b)[r] * g.column(c)[r]).sum();
        }
    }
    let columns: Vec<u32> = (0..kept.len() * kept.len()).map(|i| (i % kept.len()) as u32).collect();
    let offsets = (0..=kept.len()).map(|r| r * kept.len()).collect();
    SparseMatrix::new(kept.len(), kept.len(), offsets, columns, product).unwrap()
}

fn random(n: usize, salt: f64) -> Vec<f64> {
    (0..n).map(|i| (i as f64 * 12.9898 + salt).sin() * 2.0 % 1.0).collect()
}

#[test]
fn the_hodge_spectrum_is_the_union_of_the_scalar_ones_and_2g_zeros() {
    for (kind, vertices, zeros) in [(Shape::Torus, 60, 2), (Shape::Sphere, 42, 0), (Shape::Disk, 50, 0)] {
        let s = shape(kind, vertices);
        let n = 2 * s.frames.faces();
        let hodge = spectrum(&s.operator::<2>(FieldKind::Vector {}), n);
        let hats = vertex_masses(&s.mesh, &s.frames);
        let conforming = lowest(
            &laplacian(&gradient(&s.mesh, &s.frames), s.frames.areas(), &vec![true; hats.len()]),
            &hats,
            hats.len(),
        );
        // A boundary that fields run along: co-gradients of functions that vanish there.
        let inner: Vec<bool> = s.dual.edge_faces().iter().map(|f| f[1] != chladni_mesh::dual::NO_FACE).collect();
        let midpoints: Vec<f64> =
            edge_masses(&s.dual, &s.frames).into_iter().zip(&inner).filter(|m| *m.1).map(|m| m.0).collect();
        let nonconforming = lowest(
            &laplacian(&nonconforming_gradient(&s.dual, &s.frames), s.frames.areas(), &inner),
            &midpoints,
            midpoints.len(),
        );
        let positive = |v: Vec<f64>| v.into_iter().filter(|x| *x > 1e-6).collect::<Vec<f64>>();
        let mut union = vec![0.0; zeros];
        union.extend(positive(conforming));
        union.extend(positive(nonconforming));
        union.sort_by(f64::total_cmp);
        assert_eq!(union.len(), n, "{kind}");
        let worst = hodge.iter().zip(&union).map(|(a, b)| (a - b).abs() / (1.0 + b)).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{kind}: {worst}");
    }
}

#[test]
fn gradients_and_cogradients_are_orthogonal_and_go_through_the_operator() {
    for mesh in [Shape::Torus, Shape::Disk] {
        let s = shape(mesh, 150);
        let u = random(s.mesh.positions.len(), 0.3);
        let mut v = random(s.dual.edge_count(), 0.7);
        s.dual
            .edge_faces()
            .iter()
            .zip(&mut v)
            .filter(|(f, _)| f[1] == chladni_mesh::dual::NO_FACE)
            .for_each(|(_, v)| *v = 0.0);
        let a = gradient(&s.mesh, &s.frames).multiply(&u);
        let b = quarter_turn(&nonconforming_gradient(&s.dual, &s.frames).multiply(&v));
        let inner: f64 = a.iter().zip(&b).enumerate().map(|(i, (x, y))| s.frames.areas()[i / 2] * x * y).sum();
        let operator = s.operator::<2>(FieldKind::Vector {});
        assert!(inner.abs() < 1e-10 * (operator.norm_squared(&a).unwrap() * operator.norm_squared(&b).unwrap()).sqrt());
        // Their curl and divergence vanish where they should, and the energy is the sum of both parts.
        let no_curl = curl(&s.dual, &s.frames, &a);
        let no_divergence = divergence(&s.mesh, &s.frames, &b);
        let inner_edges = s.dual.edge_faces().iter().zip(&no_curl).filter(|(f, _)| f[1] != chladni_mesh::dual::NO_FACE);
        assert!(inner_edges.fold(0.0f64, |m, (_, c)| m.max(c.abs())) < 1e-8);
        assert!(no_divergence.iter().fold(0.0f64, |m, c| m.max(c.abs())) < 1e-7);
        let field = random(2 * s.frames.faces(), 0.1);
        let (div, rot) = (divergence(&s.mesh, &s.frames, &field), curl(&s.dual, &s.frames, &field));
        let parts: f64 = div.iter().zip(vertex_masses(&s.mesh, &s.frames)).map(|(d, m)| m * d * d).sum::<f64>()
            + rot
                .iter()
                .zip(edge_masses(&s.dual, &s.frames))
                .zip(s.dual.edge_faces())
                .filter(|(_, f)| f[1] != chladni_mesh::dual::NO_FACE)
                .map(|((c, m), _)| m * c * c)
                .sum::<f64>();
        let energy = operator.harmonic_energy(&field).unwrap();
        assert!((parts / energy - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_connection_laplacian_is_both_parts_nonconforming() {
    let s = shape(Shape::Torus, 120);
    let operator = s.operator::<2>(FieldKind::NVector { n: 1 });
    for salt in [0.1, 0.5] {
        let field = random(2 * s.frames.faces(), salt);
        let masses = edge_masses(&s.dual, &s.frames);
        let energy = |field: &[f64]| -> f64 {
            curl(&s.dual, &s.frames, field).iter().zip(&masses).map(|(c, m)| m * c * c).sum()
        };
        let both = energy(&field) + energy(&quarter_turn(&field));
        assert!((both / operator.harmonic_energy(&field).unwrap() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn transport_is_orthogonal_and_that_of_tensors_keeps_trace_and_shape() {
    for angle in [0.0, 0.3, 2.0, -1.1] {
        let turn = Complex64::cis(angle);
        let p = transport_block::<3>(FieldKind::Tensor {}, Turn { by: turn, mirrored: false }.power(2));
        for i in 0..3 {
            for j in 0..3 {
                let inner: f64 = (0..3).map(|k| p[k][i] * p[k][j]).sum();
                assert!((inner - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
        let tensor = [0.7, -0.2, 0.4];
        let carried = p.map(|row| row.iter().zip(tensor).map(|(x, t)| x * t).sum::<f64>());
        assert!((carried[0] + carried[1] - 0.5).abs() < 1e-14);
        // R A Rᵀ with the rotation itself.
        let (c, s) = (turn.re, turn.im);
        let (a, b, d) = (tensor[0], tensor[1], tensor[2] / 2f64.sqrt());
        let expected = [
            c * c * a + s * s * b - 2.0 * c * s * d,
            s * s * a + c * c * b + 2.0 * c * s * d,
            2f64.sqrt() * (c * s * (a - b) + (c * c - s * s) * d),
        ];
        assert!((0..3).all(|i| (carried[i] - expected[i]).abs() < 1e-14));
    }
}

#[test]
fn turning_the_frames_changes_no_spectrum() {
    let s = shape(Shape::Torus, 60);
    let turn = |f: usize| normalise(Complex64::new((f as f64).sin(), (f as f64 * 1.7).cos()));
    let turns: Vec<Complex64> = (0..s.frames.faces()).map(turn).collect();
    let turned = Surface { mesh: s.mesh.clone(), dual: s.dual.clone(), frames: s.frames.turned(&turns) };
    let agree = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-9 * (1.0 + x.abs()));
    for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 4 }] {
        assert!(agree(spectrum(&s.operator::<2>(kind), 40), spectrum(&turned.operator::<2>(kind), 40)));
    }
    let kind = FieldKind::Tensor {};
    assert!(agree(spectrum(&s.operator::<3>(kind), 40), spectrum(&turned.operator::<3>(kind), 40)));
}

#[test]
fn spectra_on_the_sphere_are_the_analytic_ones() {
    let s = surface(generate(Shape::Sphere, 162).unwrap());
    let unit_sphere = |values: Vec<f64>, area: f64| values.into_iter().map(|v| v / area).collect::<Vec<f64>>();
    // Hodge: l(l + 1), each from a gradient and a co-gradient.
    let hodge = s.operator::<2>(FieldKind::Vector {});
    let values = unit_sphere(spectrum(&hodge, 16), hodge.area);
    assert!(values[..6].iter().all(|v| (v / 2.0 - 1.0).abs() < 0.06), "{values:?}");
    assert!(values[6..].iter().all(|v| (v / 6.0 - 1.0).abs() < 0.12), "{values:?}");
    // Spin-weighted harmonics: l(l + 1) − n² from l = n on, 2 (2l + 1) real dimensions; the weights double it.
    for n in [1u32, 2, 4] {
        let operator = s.operator::<2>(FieldKind::NVector { n });
        let count = 2 * (2 * n as usize + 1);
        let values = unit_sphere(spectrum(&operator, count + 1), operator.area);
        let expected = 2.0 * f64::from(n);
        assert!(values[..count].iter().all(|v| (v / expected - 1.0).abs() < 0.12), "{n}: {values:?}");
        assert!(values[count] > 1.5 * expected);
    }
    // Tensors: the trace is a scalar, the deviator a 2-field.
    let operator = s.operator::<3>(FieldKind::Tensor {});
    let values = unit_sphere(spectrum(&operator, 15), operator.area);
    assert!(values[0].abs() < 1e-9 && values[1..14].iter().all(|v| (v / 4.0 - 1.0).abs() < 0.12), "{values:?}");
}

#[test]
fn kinds_out_of_range_and_meshes_that_do_not_fit_are_refused() {
    let s = surface(sphere(2));
    let other = surface(sphere(3));
    let make = |kind, dual| FieldOperator::<2>::assemble(kind, &s.mesh, dual, &s.frames, FieldBoundary::default());
    assert!(matches!(make(FieldKind::NVector { n: 0 }, &s.dual), Err(OperatorError::Parameter { name: "n", .. })));
    assert!(make(FieldKind::NVector { n: 65 }, &s.dual).is_err());
    assert!(make(FieldKind::Tensor {}, &s.dual).is_err());
    assert!(make(FieldKind::Vector {}, &other.dual).is_err());
}
