//! Harmonic fields: neither divergence nor curl, the kernel of the Hodge–Laplacian. No locally supported field comes
//! near them, so a basis carries them as dense columns.
//!
//! Counting how often a loop of faces crosses each edge is a closed 1-form; the field with these integrals along edges
//! has no curl, and taking away the gradient part leaves the harmonic field.

use chladni_algebra::{DenseMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, orthonormalise};
use chladni_base::{Cancelled, Monitor, stopped};
use chladni_mesh::dual::NO_FACE;

use crate::operator::frames::{complex, inner, outer};
use crate::operator::hodge::FieldBoundary;

use super::loops::{DualTree, Form, closed_forms, closed_loops, ends};
use super::poisson::{self, PoissonError};
use super::surface::FieldSurface;

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
    Poisson(PoissonError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(HarmonicError: PoissonError => Self::Poisson);

/// An orthonormal basis of the harmonic fields, `2F` numbers each, on unit area: `2g` for a closed surface of genus
/// `g`, and `b − 1` more where it has `b` boundaries that fields run along, or that they run across. None for clamped
/// boundaries.
///
/// Fields that run across a boundary have no integral along it: their forms are those of closed loops, which do not
/// cross it, and the potentials of what is taken away vanish there.
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
    surface.dual().oriented().map_err(PoissonError::OneSided)?;
    let tree = DualTree::new(surface);
    let forms = match boundary {
        FieldBoundary::Tangential => closed_forms(surface, &tree),
        FieldBoundary::Clamped if !surface.dual().is_closed() => return Ok(Vec::new()),
        FieldBoundary::Normal | FieldBoundary::Clamped => closed_loops(surface, &tree),
    };
    if forms.len() > MOST_HARMONIC {
        return Err(HarmonicError::Loops { loops: forms.len() });
    }
    if forms.is_empty() {
        return Ok(Vec::new());
    }
    let fields: Vec<Vec<f64>> = forms.iter().map(|form| field_of(surface, form)).collect();
    let rim =
        if boundary == FieldBoundary::Normal { rim(surface) } else { vec![false; surface.mesh().positions.len()] };
    Ok(without_gradients(surface, fields, &rim, monitor)?)
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
        field[2 * f] = (along[0] * e[1].im - along[1] * e[0].im) / doubled;
        field[2 * f + 1] = (along[1] * e[0].re - along[0] * e[1].re) / doubled;
    }
    field
}

/// Which vertices lie on the boundary.
pub(super) fn rim(surface: &FieldSurface) -> Vec<bool> {
    let mut rim = vec![false; surface.mesh().positions.len()];
    for (edge, faces) in surface.dual().edge_faces().iter().enumerate() {
        if faces[1] == NO_FACE {
            ends(surface, edge).into_iter().for_each(|v| rim[v as usize] = true);
        }
    }
    rim
}

/// Takes the gradients of hat functions out of fields, but for those of the vertices in `held`, and makes what is left
/// orthonormal.
fn without_gradients(
    surface: &FieldSurface,
    mut fields: Vec<Vec<f64>>,
    held: &[bool],
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
                if held[vertex] {
                    continue;
                }
                panel[vertex * PANEL_WIDTH + c % PANEL_WIDTH] += 0.5 * outer(e, complex([x[0], x[1]]));
            }
        }
    }
    // Right-hand sides add up to zero on each component, as those of gradients do: grounding a vertex of each changes
    // nothing but a constant.
    poisson::solve(&cotangents(surface, held), &mut potentials, monitor)?;
    for (c, field) in fields.iter_mut().enumerate() {
        let panel = &potentials.panels()[c / PANEL_WIDTH];
        for (f, face) in mesh.faces.iter().enumerate() {
            let scale = 0.5 / frames.areas()[f];
            for (k, e) in frames.edges(f).into_iter().enumerate() {
                let u = panel[face[k] as usize * PANEL_WIDTH + c % PANEL_WIDTH];
                field[2 * f] += scale * e.im * u;
                field[2 * f + 1] -= scale * e.re * u;
            }
        }
    }
    Ok(orthonormal(surface, fields))
}

fn orthonormal(surface: &FieldSurface, fields: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let (rows, columns) = (2 * surface.faces(), fields.len());
    let areas = surface.frames().areas();
    let mut matrix = DenseMatrix::from_columns(rows, columns, fields.concat());
    // Twice: loops that lie close together are nearly dependent.
    for _ in 0..2 {
        let mut weighted = matrix.clone();
        for c in 0..columns {
            weighted.column_mut(c).iter_mut().enumerate().for_each(|(i, x)| *x *= areas[i / 2]);
        }
        let gram = matrix.transposed_times(&weighted);
        if orthonormalise(&mut matrix, gram).is_err() {
            return Vec::new();
        }
    }
    (0..columns).map(|c| matrix.column(c).to_vec()).collect()
}

/// `Gᵀ M_F G`: the stiffness of hat functions, those of the vertices in `held` left out, one vertex of each component
/// grounded that has none of them.
fn cotangents(surface: &FieldSurface, held: &[bool]) -> SparseMatrix {
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(9 * mesh.faces.len());
    let free = |v: u32| !held[v as usize];
    for (f, face) in mesh.faces.iter().enumerate() {
        let e = frames.edges(f);
        let scale = 0.25 / frames.areas()[f];
        for i in (0..3).filter(|&i| free(face[i])) {
            for j in (0..3).filter(|&j| free(face[j])) {
                entries.push((face[i], face[j], scale * inner(e[i], e[j])));
            }
        }
    }
    entries.extend((0..held.len() as u32).filter(|&v| !free(v)).map(|v| (v, v, 1.0)));
    poisson::ground(surface, |v| !free(v), &mut entries);
    SparseMatrix::summed(mesh.positions.len(), entries)
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
        for boundary in [FieldBoundary::Tangential, FieldBoundary::Normal] {
            check_with(mesh.clone(), boundary, expected);
        }
    }

    fn check_with(mesh: chladni_mesh::TriangleMesh, boundary: FieldBoundary, expected: usize) {
        let surface = FieldSurface::new(mesh).unwrap();
        let fields = harmonic_fields(&surface, boundary, &Unwatched).unwrap();
        assert_eq!(fields.len(), expected, "{boundary:?}");
        let operator = FieldOperator::<2>::assemble(
            FieldKind::Vector {},
            surface.mesh(),
            surface.dual(),
            surface.frames(),
            boundary,
        )
        .unwrap();
        for field in &fields {
            assert!((operator.norm_squared(field).unwrap() - 1.0).abs() < 1e-9);
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

    /// A plate with square holes, its vertices moved within the plane.
    fn pierced(holes: &[[f64; 2]], seed: u64) -> chladni_mesh::TriangleMesh {
        let mut mesh = generate(Shape::Rectangle, 2500).unwrap();
        let centre = |mesh: &chladni_mesh::TriangleMesh, f: &[u32; 3]| {
            [0, 1].map(|i| f.iter().map(|&v| mesh.positions[v as usize][i]).sum::<f64>() / 3.0)
        };
        let extent = [0, 1].map(|i| mesh.positions.iter().map(|p| p[i]).fold(f64::NEG_INFINITY, f64::max));
        let least = [0, 1].map(|i| mesh.positions.iter().map(|p| p[i]).fold(f64::INFINITY, f64::min));
        let whole = mesh.clone();
        mesh.faces.retain(|f| {
            let c = centre(&whole, f);
            let at = [0, 1].map(|i| (c[i] - least[i]) / (extent[i] - least[i]));
            !holes.iter().any(|hole| (at[0] - hole[0]).abs() < 0.09 && (at[1] - hole[1]).abs() < 0.12)
        });
        let mut random = chladni_base::SplitMix64::new(seed);
        mesh.positions.iter_mut().for_each(|p| *p = [p[0] + 0.003 * random.unit(), p[1] + 0.003 * random.unit(), 0.0]);
        mesh
    }

    #[test]
    fn plates_with_holes_have_a_field_for_each_hole_whatever_fields_do_at_the_boundary() {
        use crate::field::{DesignModel, FieldParameters, field_basis};
        let holes = [[0.25, 0.5], [0.7, 0.4], [0.5, 0.8]];
        for count in 1..=3 {
            check(pierced(&holes[..count], count as u64), count);
        }
        // Spaces hold them as fields without energy, and no more of those.
        let surface = FieldSurface::new(pierced(&holes[..2], 9)).unwrap();
        for boundary in [FieldBoundary::Tangential, FieldBoundary::Normal] {
            let parameters = FieldParameters { boundary, ..FieldParameters::new(FieldKind::Vector {}, 200) };
            let basis = field_basis(&surface, &parameters, &Unwatched).unwrap();
            let values = DesignModel::new(&basis, &Unwatched).unwrap().values().to_vec();
            assert!(values[1] < 1e-6 && values[2] > 0.1, "{boundary:?}: {:?}", &values[..4]);
        }
    }
}
