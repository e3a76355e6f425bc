//! Whether a surface is the one that a field basis of a file lives on: a file has no positions, but the products of all
//! columns by area and by energy.

use chladni_base::Monitor;
use chladni_spectral::basis::{ProvenanceError, StoredFields};
use chladni_spectral::field::{FieldError, FieldSurface, column_energies};

/// By how much positions may differ that went through a file, next to the largest coordinate: single precision, or six
/// digits of a text.
const ROUNDED: f64 = 4e-6;

/// By how much squares and energies of columns may differ beside, whose numbers are kept in single precision.
const KEPT: f64 = 1e-5;

/// Far from the origin, where rounding is as large as a face, no more than this share is put down to it.
const MOST_ROUNDED: f64 = 0.05;

/// Vertices are rounded independently of each other, so that what that does to faces adds up as squares do. A column
/// may be off by so many times as much: six digits, 1,000 from a torus of 1,200 faces, take .6 of it at most, and its
/// stretching by half takes twice of it.
const SPREAD: f64 = 4.0;

/// Why a field basis is none of a surface.
#[derive(Debug, thiserror::Error)]
pub enum StrangeSurface {
    /// It has another number of faces.
    #[error("the basis is of a surface of {basis} faces, the mesh has {surface}")]
    Faces {
        /// Faces of the basis.
        basis: usize,
        /// Faces of the surface.
        surface: usize,
    },
    /// A column has another length.
    #[error(
        "the basis is of another mesh: by the areas of the faces of this one its column {column} has the square {expected}, and {found} in the basis; the mesh may be changed, or its faces numbered differently"
    )]
    Square {
        /// The column.
        column: usize,
        /// Its square in the basis.
        found: f64,
        /// That on the surface.
        expected: f64,
    },
    /// A column has another energy.
    #[error(
        "the basis is of another mesh: on this one its column {column} has the energy {expected}, and {found} in the basis; faces may begin at another corner, be flipped or be numbered differently, or the mesh may be changed"
    )]
    Energy {
        /// The column.
        column: usize,
        /// Its energy in the basis.
        found: f64,
        /// That on the surface.
        expected: f64,
    },
    /// The basis does not say what to compare.
    #[error("whether the basis is of this mesh cannot be checked: {0}")]
    Provenance(#[from] ProvenanceError),
    /// The operator cannot be made on the surface.
    #[error(transparent)]
    Operator(#[from] FieldError),
}

/// Checks that a field basis lives on this surface, by the square of every column, which areas decide, and its energy,
/// which depends on the frame of every face and on its neighbours. Positions may be rounded as files round them, and
/// moved, turned or scaled as a whole.
///
/// # Errors
/// [`StrangeSurface`] names the first column that differs; cancellation.
pub fn check_own_surface(
    fields: &StoredFields,
    surface: &FieldSurface,
    monitor: &dyn Monitor,
) -> Result<(), StrangeSurface> {
    let basis = &fields.basis;
    let (space, mesh) = (&basis.space, surface.mesh());
    if space.faces() != surface.faces() {
        return Err(StrangeSurface::Faces { basis: space.faces(), surface: surface.faces() });
    }
    let off = ROUNDED * mesh.positions.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let edges = |face: usize| {
        let corners = mesh.faces[face].map(|v| mesh.positions[v as usize]);
        [[0, 1], [1, 2], [2, 0]]
            .map(|[a, b]: [usize; 2]| (0..3).map(|i| (corners[a][i] - corners[b][i]).powi(2)).sum::<f64>().sqrt())
    };
    let mut squares = vec![[0.0; 2]; space.dimension()];
    for face in 0..surface.faces() {
        let own = surface.frames().areas()[face];
        let room = 2.0 * off * edges(face).iter().sum::<f64>() / surface.frames().area();
        let room = room.min(MOST_ROUNDED * own);
        space.row_entries(face, |column, u| {
            let square = u.iter().map(|u| u * u).sum::<f64>();
            squares[column][0] += own * square;
            squares[column][1] += (room * square).powi(2);
        });
    }
    let on_diagonal = |matrix: &chladni_algebra::SparseMatrix, column: usize| {
        let (columns, values) = matrix.row(column);
        let own = columns.iter().zip(values).find(|(other, _)| **other as usize == column);
        own.map_or(0.0, |own| *own.1)
    };
    for (column, [expected, room]) in squares.into_iter().enumerate() {
        let found = on_diagonal(&basis.mass, column);
        let room = SPREAD * room.sqrt() + KEPT * expected.abs().max(found.abs());
        if !((found - expected).abs() <= room) {
            return Err(StrangeSurface::Square { column, found, expected });
        }
    }
    let boundary = fields.metadata.field_boundary(basis.kind)?;
    // Of a face the angles are off by what a position is off by, next to its shortest edge.
    let rounding = |face: usize| {
        let shortest = edges(face).into_iter().fold(f64::INFINITY, f64::min);
        (4.0 * off / shortest).min(MOST_ROUNDED)
    };
    let energies = column_energies(surface, basis, boundary, &rounding, monitor)?;
    for (column, own) in energies.into_iter().enumerate() {
        let (found, expected) = (on_diagonal(&basis.stiffness, column), own.energy);
        let room = SPREAD * own.room + KEPT * own.magnitude;
        if !((found - expected).abs() <= room) {
            return Err(StrangeSurface::Energy { column, found, expected });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::Unwatched;
    use chladni_mesh::TriangleMesh;
    use chladni_mesh::shape::{Shape, generate, noisy};
    use chladni_spectral::basis::FieldBasis;
    use chladni_spectral::field::{FieldParameters, field_basis};
    use chladni_spectral::operator::transport::FieldKind;
    use serde_json::json;

    fn surface(mesh: &TriangleMesh, place: impl Fn([f64; 3]) -> [f64; 3]) -> FieldSurface {
        let positions = mesh.positions.iter().map(|p| place(*p)).collect();
        FieldSurface::new(TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() }).unwrap()
    }

    fn stored(own: &FieldSurface, kind: FieldKind) -> StoredFields {
        let basis: FieldBasis = field_basis(own, &FieldParameters::new(kind, 80), &Unwatched).unwrap();
        StoredFields { basis, ritz: None, metadata: json!({"parameters": {"boundary": "tangential"}}).into() }
    }

    fn changed(mesh: &TriangleMesh, change: impl Fn(usize, [u32; 3]) -> [u32; 3]) -> FieldSurface {
        let faces = mesh.faces.iter().enumerate().map(|(f, face)| change(f, *face)).collect();
        FieldSurface::new(TriangleMesh { positions: mesh.positions.clone(), faces, ..Default::default() }).unwrap()
    }

    #[test]
    fn a_field_basis_is_taken_for_its_own_surface_alone() {
        let mesh = noisy(&generate(Shape::Torus, 600).unwrap(), 0.1, 3).unwrap();
        let own = surface(&mesh, |p| p);
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
            let fields = stored(&own, kind);
            let check = |surface: &FieldSurface| check_own_surface(&fields, surface, &Unwatched);
            let single = |x: f64| f64::from(x as f32);
            let six_digits = |x: f64| format!("{x:.5e}").parse::<f64>().unwrap();
            for same in [
                surface(&mesh, |p| p.map(six_digits)),
                surface(&mesh, |p| p.map(|x| six_digits(100.0 + x))),
                surface(&mesh, |p| p.map(|x| six_digits(1000.5 + x))),
                surface(&mesh, |p| p),
                surface(&mesh, |p| p.map(single)),
                surface(&mesh, |p| [p[1], p[2], p[0]]),
                surface(&mesh, |p| p.map(|x| (x * 1e5).round() / 1e5)),
                surface(&mesh, |p| p.map(|x| single(300.0 + x))),
                surface(&mesh, |p| p.map(|x| 7.0 * x)),
            ] {
                assert!(check(&same).is_ok(), "{kind:?}: {:?}", check(&same));
            }
            // As many faces, in other places or another order, also far from the origin.
            for far in [0.0, 1e3, 1e5] {
                let place = |by: f64| move |[x, y, z]: [f64; 3]| [x + far, y + far, by * z + far];
                assert!(check(&surface(&mesh, place(1.5))).is_err(), "{kind:?} {far}");
                let mut other = mesh.clone();
                other.faces.rotate_left(7);
                assert!(check(&surface(&other, place(1.0))).is_err(), "{kind:?} {far}");
            }
            let another = surface(&generate(Shape::Torus, 300).unwrap(), |p| p);
            assert!(matches!(check(&another), Err(StrangeSurface::Faces { .. })), "{kind:?}");
        }
    }

    /// Numbers of fields are in the frames of faces, which begin at their first corner.
    #[test]
    fn faces_that_begin_elsewhere_are_told() {
        let mesh = noisy(&generate(Shape::Torus, 600).unwrap(), 0.1, 3).unwrap();
        let own = surface(&mesh, |p| p);
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
            let fields = stored(&own, kind);
            for (what, other) in [
                ("corners", changed(&mesh, |_, [a, b, c]| [b, c, a])),
                ("flipped", changed(&mesh, |_, [a, b, c]| [a, c, b])),
                ("one face", changed(&mesh, |f, [a, b, c]| if f == 100 { [b, c, a] } else { [a, b, c] })),
            ] {
                let found = check_own_surface(&fields, &other, &Unwatched);
                assert!(matches!(found, Err(StrangeSurface::Energy { .. })), "{kind:?}, {what}: {found:?}");
            }
        }
    }
}
