//! Harmonic fields: neither divergence nor curl, the kernel of the Hodge–Laplacian. No locally supported field comes near them, so a
//! basis carries them as dense columns.
//!
//! Counting how often a loop of faces crosses each edge is a closed 1-form; the field with these integrals along edges has no curl, and taking away the
//! gradient part leaves the harmonic field.

use chladni_algebra::{DenseMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, orthonormalise};
use chladni_base::Monitor;

use crate::operator::hodge::FieldBoundary;

use super::basis::FieldSurface;
use super::loops::{FaceTree, Form, closed_forms};
use super::poisson::{self, PoissonError};

/// The most harmonic fields that are computed: each is a dense column.
pub const MOST_HARMONIC: usize = 256;

/// Why there are no harmonic fields.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HarmonicError {
    /// The surface has too many loops.
    #[error(
        "the surface has {loops} independent loops, more than the {MOST_HARMONIC} harmonic fields that a basis may carry"
    )]
    Loops {
        /// How many there are.
        loops: usize,
    },
    /// The gradient parts were not found.
    #[error(transparent)]
    Poisson(#[from] PoissonError),
}

/// An orthonormal basis of the harmonic fields, `2F` numbers each, on unit area: `2g` for a closed surface of genus `g`; with boundaries that fields run
/// along, one for each independent loop. Empty for other boundaries.
///
/// One sparse factorisation on the vertices, and a solve for each 32 fields.
///
/// # Errors
/// [`HarmonicError`]: too many loops, a matrix that cannot be factored, cancellation.
pub fn harmonic_fields(
    surface: &FieldSurface,
    boundary: FieldBoundary,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<f64>>, HarmonicError> {
    if boundary != FieldBoundary::Tangential && !surface.dual().is_closed() {
        return Ok(Vec::new());
    }
    let forms = closed_forms(surface, &FaceTree::new(surface));
    if forms.len() > MOST_HARMONIC {
        return Err(HarmonicError::Loops { loops: forms.len() });
    }
    if forms.is_empty() {
        return Ok(Vec::new());
    }
    let fields: Vec<Vec<f64>> = forms.iter().map(|form| field_of(surface, form)).collect();
    Ok(without_gradients(surface, fields, monitor)?)
}

/// The field that has the integrals of a form along the edges of each face.
fn field_of(surface: &FieldSurface, form: &Form) -> Vec<f64> {
    let mut integrals: std::collections::BTreeMap<u32, [f64; 3]> = std::collections::BTreeMap::new();
    for &(half, value) in form {
        integrals.entry(half / 3).or_default()[half as usize % 3] += value;
    }
    let mut field = vec![0.0; 2 * surface.faces()];
    for (face, along) in integrals {
        let f = face as usize;
        let e = surface.frames().edges(f);
        let doubled = 2.0 * surface.frames().areas()[f];
        field[2 * f] = (along[0] * e[1][1] - along[1] * e[0][1]) / doubled;
        field[2 * f + 1] = (along[1] * e[0][0] - along[0] * e[1][0]) / doubled;
    }
    field
}

/// Takes the gradients of hat functions out of fields and makes what is left orthonormal.
fn without_gradients(
    surface: &FieldSurface,
    mut fields: Vec<Vec<f64>>,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<f64>>, PoissonError> {
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let mut potentials = PanelMatrix::zeros(mesh.positions.len(), fields.len());
    for (c, field) in fields.iter().enumerate() {
        let panel = &mut potentials.panels_mut()[c / PANEL_WIDTH];
        for (f, x) in field.chunks_exact(2).enumerate() {
            if x[0] == 0.0 && x[1] == 0.0 {
                continue;
            }
            for (k, e) in frames.edges(f).into_iter().enumerate() {
                // A ⟨∇λ, X⟩ with ∇λ = J e / 2A.
                let vertex = mesh.faces[f][k] as usize;
                panel[vertex * PANEL_WIDTH + c % PANEL_WIDTH] += 0.5 * (e[0] * x[1] - e[1] * x[0]);
            }
        }
    }
    // Right-hand sides add up to zero on each component, as those of gradients do: grounding a vertex of each changes nothing but a constant.
    poisson::solve(&cotangents(surface), &mut potentials, monitor)?;
    for (c, field) in fields.iter_mut().enumerate() {
        let panel = &potentials.panels()[c / PANEL_WIDTH];
        for (f, face) in mesh.faces.iter().enumerate() {
            let scale = 0.5 / frames.areas()[f];
            for (k, e) in frames.edges(f).into_iter().enumerate() {
                let u = panel[face[k] as usize * PANEL_WIDTH + c % PANEL_WIDTH];
                field[2 * f] += scale * e[1] * u;
                field[2 * f + 1] -= scale * e[0] * u;
            }
        }
    }
    Ok(orthonormal(surface, fields))
}

fn orthonormal(surface: &FieldSurface, fields: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let (rows, columns) = (2 * surface.faces(), fields.len());
    let areas = surface.frames().areas();
    let Some(mut matrix) = DenseMatrix::from_columns(rows, columns, fields.concat()) else { return Vec::new() };
    // Twice: loops that lie close together are nearly dependent.
    for _ in 0..2 {
        let mut weighted = matrix.clone();
        for c in 0..columns {
            weighted.column_mut(c).iter_mut().enumerate().for_each(|(i, x)| *x *= areas[i / 2]);
        }
        let Some(gram) = matrix.transposed_times(&weighted) else { return Vec::new() };
        if orthonormalise(&mut matrix, gram).is_err() {
            return Vec::new();
        }
    }
    (0..columns).map(|c| matrix.column(c).to_vec()).collect()
}

/// `Gᵀ M_F G`: the stiffness of hat functions, one vertex of each component grounded.
fn cotangents(surface: &FieldSurface) -> SparseMatrix {
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(9 * mesh.faces.len());
    for (f, face) in mesh.faces.iter().enumerate() {
        let e = frames.edges(f);
        let scale = 0.25 / frames.areas()[f];
        for i in 0..3 {
            for j in 0..3 {
                entries.push((face[i], face[j], scale * (e[i][0] * e[j][0] + e[i][1] * e[j][1])));
            }
        }
    }
    poisson::ground(surface, |_| false, &mut entries);
    poisson::assemble(mesh.positions.len(), entries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tangential::FieldOperator;
    use crate::operator::transport::FieldKind;
    use chladni_base::Unwatched;
    use chladni_mesh::fixtures::union;
    use chladni_mesh::shape::{Shape, generate, noisy};

    fn check(mesh: chladni_mesh::TriangleMesh, expected: usize) {
        let surface = FieldSurface::new(mesh).unwrap();
        let fields = harmonic_fields(&surface, FieldBoundary::Tangential, &Unwatched).unwrap();
        assert_eq!(fields.len(), expected);
        let operator = FieldOperator::<2>::assemble(
            FieldKind::Vector {},
            surface.mesh(),
            surface.dual(),
            surface.frames(),
            FieldBoundary::Tangential,
        )
        .unwrap();
        for field in &fields {
            assert!((operator.norm_squared(field) - 1.0).abs() < 1e-9);
            let energy = operator.harmonic_energy(field).unwrap();
            assert!(energy < 1e-8, "{energy}");
        }
    }

    #[test]
    fn there_are_as_many_as_independent_loops_and_none_has_energy() {
        let noise = |shape, vertices| noisy(&generate(shape, vertices).unwrap(), 0.15, 5).unwrap();
        check(noise(Shape::Sphere, 162), 0);
        check(noise(Shape::Disk, 200), 0);
        check(noise(Shape::Torus, 300), 2);
        check(noise(Shape::Genus(2), 900), 4);
        check(noise(Shape::Genus(4), 1700), 8);
        check(union(&[noise(Shape::Torus, 300), noise(Shape::Torus, 200), noise(Shape::Sphere, 42)]), 4);
    }

    #[test]
    fn holes_in_a_surface_have_harmonic_fields_around_them() {
        // A sphere without its two caps is an annulus; a torus with a hole keeps its two loops and gains none.
        let without = |shape, vertices, drop: fn([f64; 3]) -> bool| {
            let mut mesh = generate(shape, vertices).unwrap();
            let positions = mesh.positions.clone();
            mesh.faces.retain(|f| !f.iter().all(|&v| drop(positions[v as usize])));
            mesh
        };
        check(without(Shape::Sphere, 642, |p| p[2].abs() > 0.6), 1);
        check(without(Shape::Torus, 600, |p| p[0] > 1.1 && p[1].abs() < 0.4), 2);
    }
}
