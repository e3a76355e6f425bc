//! Whether a surface is the one that a field basis of a file lives on: a file has no positions, but the products of all
//! columns by area.

use chladni_spectral::basis::FieldBasis;
use chladni_spectral::field::FieldSurface;

/// By how much positions may differ that went through a file, next to the largest coordinate: single precision, or six
/// digits of a text.
const ROUNDED: f64 = 4e-6;

/// By how much squares of columns may differ beside, which are kept in single precision.
const KEPT: f64 = 1e-5;

/// Why a field basis is none of a surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
}

/// Checks that a field basis lives on this surface, by the square of every column. Positions may be rounded as files
/// round them, and moved, turned or scaled as a whole.
///
/// # Errors
/// [`StrangeSurface`] names the first column that differs.
pub fn check_own_surface(basis: &FieldBasis, surface: &FieldSurface) -> Result<(), StrangeSurface> {
    let (space, mesh) = (&basis.space, surface.mesh());
    if space.faces() != surface.faces() {
        return Err(StrangeSurface::Faces { basis: space.faces(), surface: surface.faces() });
    }
    let off = ROUNDED * mesh.positions.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let mut squares = vec![[0.0; 2]; space.dimension()];
    for (face, corners) in mesh.faces.iter().enumerate() {
        let own = surface.frames().areas()[face];
        let edges = [[0, 1], [1, 2], [2, 0]].map(|ends| {
            let [p, q] = ends.map(|k: usize| mesh.positions[corners[k] as usize]);
            (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt()
        });
        let room = 2.0 * off * edges.iter().sum::<f64>() / surface.frames().area();
        space.row_entries(face, |column, u| {
            let square = u.iter().map(|u| u * u).sum::<f64>();
            squares[column][0] += own * square;
            squares[column][1] += room * square;
        });
    }
    for (column, [expected, room]) in squares.into_iter().enumerate() {
        let (columns, values) = basis.mass.row(column);
        let own = columns.iter().zip(values).find(|(other, _)| **other as usize == column);
        let found = own.map_or(0.0, |own| *own.1);
        if !((found - expected).abs() <= room + KEPT * expected.abs().max(found.abs())) {
            return Err(StrangeSurface::Square { column, found, expected });
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
    use chladni_spectral::field::{FieldParameters, field_basis};
    use chladni_spectral::operator::transport::FieldKind;

    fn surface(mesh: &TriangleMesh, place: impl Fn([f64; 3]) -> [f64; 3]) -> FieldSurface {
        let positions = mesh.positions.iter().map(|p| place(*p)).collect();
        FieldSurface::new(TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() }).unwrap()
    }

    #[test]
    fn a_field_basis_is_taken_for_its_own_surface_alone() {
        let mesh = noisy(&generate(Shape::Torus, 600).unwrap(), 0.1, 3).unwrap();
        let own = surface(&mesh, |p| p);
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
            let basis = field_basis(&own, &FieldParameters::new(kind, 80), &Unwatched).unwrap();
            let single = |x: f64| f64::from(x as f32);
            for same in [
                surface(&mesh, |p| p),
                surface(&mesh, |p| p.map(single)),
                surface(&mesh, |p| [p[1], p[2], p[0]]),
                surface(&mesh, |p| p.map(|x| (x * 1e5).round() / 1e5)),
            ] {
                assert_eq!(check_own_surface(&basis, &same), Ok(()), "{kind:?}");
            }
            // As many faces, in other places or another order.
            let stretched = surface(&mesh, |[x, y, z]| [x, y, 1.5 * z]);
            assert!(matches!(check_own_surface(&basis, &stretched), Err(StrangeSurface::Square { .. })), "{kind:?}");
            let mut other = mesh.clone();
            other.faces.rotate_left(7);
            let other = FieldSurface::new(other).unwrap();
            assert!(matches!(check_own_surface(&basis, &other), Err(StrangeSurface::Square { .. })), "{kind:?}");
            let another = surface(&generate(Shape::Torus, 300).unwrap(), |p| p);
            assert!(matches!(check_own_surface(&basis, &another), Err(StrangeSurface::Faces { .. })), "{kind:?}");
        }
    }
}
