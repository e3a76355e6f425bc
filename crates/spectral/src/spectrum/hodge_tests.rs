use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::field::{FieldSurface, harmonic_fields};
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

fn operator(surface: &FieldSurface) -> FieldOperator<2> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    FieldOperator::assemble(FieldKind::Vector {}, mesh, dual, frames, FieldBoundary::Tangential).unwrap()
}

fn spectrum(surface: &FieldSurface, count: usize, tolerance: f64) -> HodgeSpectrum {
    let harmonic = harmonic_fields(surface, FieldBoundary::Tangential, &Unwatched).unwrap();
    let parameters = HsimParameters { tolerance, ..HsimParameters::default() };
    let parts = (surface.dual(), surface.frames());
    hodge_spectrum(surface.mesh(), parts, &harmonic, count, &parameters, &Unwatched).unwrap()
}

#[test]
fn the_union_of_the_scalar_spectra_is_that_of_the_assembled_operator() {
    for (shape, vertices, kernel) in [(Shape::Sphere, 162, 0), (Shape::Torus, 200, 2), (Shape::Disk, 150, 0)] {
        let mut mesh = noisy(&generate(shape, vertices).unwrap(), 0.1, 2).unwrap();
        mesh.positions.iter_mut().flatten().for_each(|x| *x *= 3.0);
        let surface = FieldSurface::new(mesh).unwrap();
        let (operator, m) = (operator(&surface), 40);
        let found = spectrum(&surface, m, 1e-8);
        let mass: Vec<f64> = operator.mass.iter().flat_map(|&m| [m; 2]).collect();
        let mut dense = DenseMatrix::zeros(mass.len(), mass.len());
        mass.iter().enumerate().for_each(|(i, &m)| dense.column_mut(i)[i] = m);
        let expected = CpuSolver.lowest(operator.stiffness.to_sparse().to_dense(), dense, m, &Unwatched).unwrap();
        for (k, (a, b)) in found.values.iter().zip(&expected.values).enumerate() {
            let b = b / operator.area;
            assert!((a - b).abs() < 1e-6 * expected.values[m - 1] / operator.area, "{shape} {k}: {a} {b}");
        }
        assert_eq!(found.parts.iter().filter(|p| **p == FieldPart::Harmonic).count(), kernel);
        assert!(found.complete && defect(surface.frames(), &found.fields) < 1e-5);
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

#[test]
fn a_triangle_has_two_fields_and_both_are_gradients() {
    let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.5, 1.0, 0.0], [2.5, 1.5, 0.3]];
    for (vertices, faces, co_gradients) in [(3, vec![[0, 1, 2]], 0), (4, vec![[0, 1, 2], [1, 3, 2]], 1)] {
        let mesh = TriangleMesh { positions: corners[..vertices].to_vec(), faces, ..TriangleMesh::default() };
        let surface = FieldSurface::new(mesh).unwrap();
        let (operator, m) = (operator(&surface), 2 * surface.faces());
        let found = spectrum(&surface, m, 1e-8);
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
            let energy = operator.harmonic_energy(&x).unwrap() / operator.norm_squared(&x);
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
