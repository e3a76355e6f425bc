use chladni_algebra::DenseMatrix;
use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::field::{FieldSurface, harmonic_fields};
use crate::operator::hodge::{FieldBoundary, hodge_problem};
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

fn operator_of(surface: &FieldSurface, boundary: FieldBoundary) -> FieldOperator<2> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    FieldOperator::assemble(FieldKind::Vector {}, mesh, dual, frames, boundary).unwrap()
}

fn operator(surface: &FieldSurface) -> FieldOperator<2> {
    operator_of(surface, FieldBoundary::Tangential)
}

fn spectrum_of(surface: &FieldSurface, boundary: FieldBoundary, count: usize, tolerance: f64) -> HodgeSpectrum {
    let harmonic = harmonic_fields(surface, boundary, &Unwatched).unwrap();
    let parameters = HsimParameters { tolerance, ..HsimParameters::default() };
    let parts = (surface.dual(), surface.frames());
    hodge_spectrum(surface.mesh(), parts, boundary, &harmonic, count, &parameters, &Unwatched).unwrap()
}

fn spectrum(surface: &FieldSurface, count: usize, tolerance: f64) -> HodgeSpectrum {
    spectrum_of(surface, FieldBoundary::Tangential, count, tolerance)
}

/// A shape without the faces all of whose corners are dropped.
fn without(shape: Shape, vertices: usize, drop: fn([f64; 3]) -> bool) -> TriangleMesh {
    let mut mesh = noisy(&generate(shape, vertices).unwrap(), 0.1, 2).unwrap();
    let positions = mesh.positions.clone();
    mesh.faces.retain(|f| !f.iter().all(|&v| drop(positions[v as usize])));
    let mut number = vec![u32::MAX; positions.len()];
    mesh.positions.clear();
    for v in mesh.faces.as_flattened_mut() {
        let new = &mut number[*v as usize];
        if *new == u32::MAX {
            *new = mesh.positions.len() as u32;
            mesh.positions.push(positions[*v as usize]);
        }
        *v = *new;
    }
    mesh
}

#[test]
fn the_union_of_the_scalar_spectra_is_that_of_the_assembled_operator() {
    use FieldBoundary::{Normal, Tangential};
    let annulus = || without(Shape::Sphere, 362, |p| p[2].abs() > 0.5);
    let handle = || without(Shape::Torus, 300, |p| p[0] > 1.1 && p[1].abs() < 0.4);
    let parts = || {
        // One closed, one open, each with a kernel of its own.
        chladni_mesh::fixtures::union(&[generate(Shape::Sphere, 42).unwrap(), without(Shape::Disk, 150, |_| false)])
    };
    for (shape, mesh, boundary, kernel) in [
        ("sphere", without(Shape::Sphere, 162, |_| false), Tangential, 0),
        ("sphere", without(Shape::Sphere, 162, |_| false), Normal, 0),
        ("torus", without(Shape::Torus, 200, |_| false), Tangential, 2),
        ("disk", without(Shape::Disk, 150, |_| false), Tangential, 0),
        ("disk", without(Shape::Disk, 150, |_| false), Normal, 0),
        ("annulus", annulus(), Tangential, 1),
        ("annulus", annulus(), Normal, 1),
        ("torus with a hole", handle(), Tangential, 2),
        ("torus with a hole", handle(), Normal, 2),
        ("sphere and disk", parts(), Normal, 0),
    ] {
        let mut mesh = mesh;
        mesh.positions.iter_mut().flatten().for_each(|x| *x *= 3.0);
        let surface = FieldSurface::new(mesh).unwrap();
        let (operator, m) = (operator_of(&surface, boundary), 40);
        let found = spectrum_of(&surface, boundary, m, 1e-8);
        let shape = format!("{shape}, {boundary:?}");
        let mass: Vec<f64> = operator.mass.iter().flat_map(|&m| [m; 2]).collect();
        let mut dense = DenseMatrix::zeros(mass.len(), mass.len());
        mass.iter().enumerate().for_each(|(i, &m)| dense.column_mut(i)[i] = m);
        let expected = CpuSolver.lowest(operator.stiffness.to_sparse().to_dense(), dense, m, &Unwatched).unwrap();
        for (k, (a, b)) in found.values.iter().zip(&expected.values).enumerate() {
            let b = b / operator.area;
            assert!((a - b).abs() < 1e-6 * expected.values[m - 1] / operator.area, "{shape} {k}: {a} {b}");
        }
        assert_eq!(found.parts.iter().filter(|p| **p == FieldPart::Harmonic).count(), kernel);
        assert!(found.complete && defect(surface.frames(), &found.fields, &Unwatched).unwrap() < 1e-5);
        // Residuals are those of the assembled operator.
        for k in kernel..m {
            let x = found.fields.column(k);
            let image = operator.stiffness.multiply(&x);
            let scale = found.values[k] * operator.area;
            let rest: f64 = image.iter().zip(x.iter().zip(&mass)).map(|(s, (x, m))| (s - scale * m * x).powi(2)).sum();
            let size: f64 = image.iter().map(|s| s * s).sum();
            assert!(((rest / size).sqrt() - found.residuals[k]).abs() < 1e-7, "{shape} {k}");
        }
    }
}

/// A needle at the boundary, of a ten-millionth of the area of its neighbours: what is left of a field there is next to
/// nothing, and most of its residual.
#[test]
fn fields_meet_their_tolerance_on_a_needle_at_the_boundary() {
    let mut mesh = generate(Shape::Disk, 300).unwrap();
    let mut edges = std::collections::BTreeMap::new();
    for face in &mesh.faces {
        (0..3).for_each(|k| *edges.entry((face[k], face[(k + 1) % 3])).or_insert(0) += 1);
    }
    let &(from, to) = edges.keys().find(|&&(a, b)| !edges.contains_key(&(b, a))).unwrap();
    let [a, b] = [from, to].map(|vertex| mesh.positions[vertex as usize]);
    let (middle, out) = ([0, 1].map(|k| 0.5 * (a[k] + b[k])), [b[1] - a[1], a[0] - b[0]]);
    mesh.positions.push([middle[0] + 1e-7 * out[0], middle[1] + 1e-7 * out[1], 0.0]);
    mesh.faces.push([to, from, mesh.positions.len() as u32 - 1]);
    let surface = FieldSurface::new(mesh).unwrap();
    for boundary in [FieldBoundary::Tangential, FieldBoundary::Normal] {
        for tolerance in [1e-2, 1e-6] {
            let found = spectrum_of(&surface, boundary, 12, tolerance);
            let worst = found.residuals.iter().copied().fold(0.0, f64::max);
            assert!(found.complete && worst <= tolerance, "{boundary:?}: {worst:e}");
            let problem = hodge_problem(surface.mesh(), surface.dual(), surface.frames(), boundary);
            let masses = problem.mass.lumped();
            for (k, &value) in found.values.iter().enumerate() {
                let x = found.fields.column(k);
                let (image, theta) = (problem.stiffness.multiply(&x), value * problem.area);
                let rest = image.iter().zip(x.iter().zip(&masses)).map(|(s, (x, m))| (s - theta * m * x).powi(2));
                let residual = (rest.sum::<f64>() / image.iter().map(|s| s * s).sum::<f64>()).sqrt();
                assert!(residual <= 1.5 * tolerance, "{boundary:?} {k}: {residual:e}");
            }
            assert!(found.orthonormality_defect < 10.0 * tolerance, "{:e}", found.orthonormality_defect);
        }
    }
}

#[test]
fn a_triangle_has_two_fields_and_both_are_gradients() {
    let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.5, 1.0, 0.0], [2.5, 1.5, 0.3]];
    for (vertices, faces, co_gradients) in [(3, vec![[0, 1, 2]], 0), (4, vec![[0, 1, 2], [1, 3, 2]], 1)] {
        let mesh = TriangleMesh { positions: corners[..vertices].to_vec(), faces, ..TriangleMesh::default() };
        let surface = FieldSurface::new(mesh).unwrap();
        let (operator, m) = (operator(&surface), 2 * surface.faces());
        let found = spectrum(&surface, m, 1e-8);
        // Across the boundary all are co-gradients, as no vertex is within.
        let across = spectrum_of(&surface, FieldBoundary::Normal, m, 1e-8);
        assert!(across.complete && across.parts.iter().all(|part| *part == FieldPart::CoGradient));
        let mut mass = DenseMatrix::zeros(m, m);
        (0..m).for_each(|i| mass.column_mut(i)[i] = operator.mass[i / 2]);
        let expected = CpuSolver.lowest(operator.stiffness.to_sparse().to_dense(), mass, m, &Unwatched).unwrap();
        for (value, expected) in found.values.iter().zip(&expected.values) {
            assert!((value * operator.area - expected).abs() < 1e-9 * expected, "{value} {expected}");
        }
        assert_eq!(found.parts.iter().filter(|part| **part == FieldPart::CoGradient).count(), co_gradients);
        assert!(found.values.len() == m && found.complete);
    }
}

#[test]
fn kernels_of_real_surfaces_have_two_fields_for_each_handle() {
    use chladni_mesh::check::check;
    use chladni_mesh::read::{MeshFormat, read};
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        println!("skipped: CHLADNI_MESHES is not set");
        return;
    };
    for (name, kernel) in [("rocker-arm.off", 2), ("3holes.off", 6), ("fertility.off", 8)] {
        let bytes = std::fs::read(std::path::Path::new(&folder).join(name)).unwrap();
        let mesh =
            check(read(&bytes, MeshFormat::Off, &Default::default()).unwrap(), &Default::default()).unwrap().mesh;
        let surface = FieldSurface::new(mesh).unwrap();
        let found = spectrum(&surface, 30, 1e-2);
        assert!(found.complete, "{name}");
        assert_eq!(found.parts.iter().filter(|p| **p == FieldPart::Harmonic).count(), kernel, "{name}");
        assert!(found.values[kernel] > 0.0 && found.values.is_sorted());
        let operator = operator(&surface);
        for (k, &value) in found.values.iter().enumerate() {
            let x = found.fields.column(k);
            let energy = operator.harmonic_energy(&x).unwrap() / operator.norm_squared(&x).unwrap();
            let scale = found.values[kernel];
            assert!(
                (energy / operator.area - value).abs() < 1e-3 * value + 1e-6 * scale,
                "{name} {k}: {energy} {value}"
            );
        }
    }
}

#[test]
fn residuals_of_fields_keep_the_tolerance() {
    for (shape, vertices, seed) in [(Shape::Sphere, 1200, 1), (Shape::Torus, 1500, 2), (Shape::Disk, 900, 3)] {
        let surface = FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.15, seed).unwrap()).unwrap();
        for tolerance in [1e-3, 1e-6] {
            let found = spectrum(&surface, 40, tolerance);
            let worst = found.residuals.iter().copied().fold(0.0, f64::max);
            assert!(found.complete && worst <= tolerance, "{shape}, {tolerance}: {worst}");
            assert!(found.inertia.iter().all(|counts| !counts.is_empty()));
        }
    }
}

#[test]
fn fields_that_vanish_at_the_boundary_fall_into_no_two_parts() {
    let surface = FieldSurface::new(generate(Shape::Disk, 150).unwrap()).unwrap();
    let (parts, parameters) = ((surface.dual(), surface.frames()), HsimParameters::default());
    let refused =
        hodge_spectrum(surface.mesh(), parts, FieldBoundary::Clamped, &[], 10, &parameters, &Unwatched).unwrap_err();
    assert!(matches!(refused, HsimError::Parameter { name: "boundary", .. }), "{refused}");
}
