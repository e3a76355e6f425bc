//! What the columns of a space are on a surface, computed anew: whether a basis is of it.

use chladni_base::Monitor;

use super::basis::FieldError;
use super::surface::FieldSurface;
use crate::basis::FieldBasis;
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;

/// The energy of one column of a space on a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ColumnEnergy {
    /// `uᵀSu`.
    pub energy: f64,
    /// The sum of the magnitudes of all terms.
    pub magnitude: f64,
    /// By how much it is off where the terms of each face are off independently of those of others: the root of the sum
    /// of the squares of what the faces are off by.
    pub room: f64,
}

/// The harmonic energy of each column of a space, `diag(UᵀSU)`, as the surface has it: it depends on the frame of every
/// face, and on which faces are neighbours. `rounding` gives the share by which the terms of a face may be off.
///
/// # Errors
/// [`FieldError`]: a basis of a surface with another number of faces, or the work was cancelled.
pub fn column_energies(
    surface: &FieldSurface,
    basis: &FieldBasis,
    boundary: FieldBoundary,
    rounding: &dyn Fn(usize) -> f64,
    monitor: &dyn Monitor,
) -> Result<Vec<ColumnEnergy>, FieldError> {
    if basis.space.faces() != surface.faces() {
        let (value, least) = (basis.space.faces() as f64, surface.faces() as f64);
        return Err(FieldError::Parameter { name: "faces", value, least, most: least });
    }
    match basis.kind.block() {
        2 => of_blocks::<2>(surface, basis, boundary, rounding, monitor),
        _ => of_blocks::<3>(surface, basis, boundary, rounding, monitor),
    }
}

fn of_blocks<const B: usize>(
    surface: &FieldSurface,
    basis: &FieldBasis,
    boundary: FieldBoundary,
    rounding: &dyn Fn(usize) -> f64,
    monitor: &dyn Monitor,
) -> Result<Vec<ColumnEnergy>, FieldError> {
    let operator =
        FieldOperator::<B>::assemble(basis.kind, surface.mesh(), surface.dual(), surface.frames(), boundary)?;
    let space = &basis.space;
    let mut energies = vec![ColumnEnergy::default(); space.dimension()];
    // The row of a face, and where in it each column stands that it has.
    let mut row: Vec<[f64; B]> = Vec::new();
    let mut places = vec![(usize::MAX, 0); space.dimension()];
    let mut sizes: Vec<f64> = Vec::new();
    for face in 0..surface.faces() {
        if face % 4096 == 0 {
            monitor.checkpoint()?;
        }
        row.clear();
        space.row_entries(face, |column, u| {
            places[column] = (face, row.len());
            row.push(std::array::from_fn(|i| u[i]));
        });
        let share = rounding(face);
        sizes.clear();
        sizes.resize(row.len(), 0.0);
        let (neighbours, blocks) = operator.stiffness.row(face);
        for (&neighbour, block) in neighbours.iter().zip(blocks) {
            space.row_entries(neighbour as usize, |column, u| {
                let (of, place) = places[column];
                if of == face {
                    let own = row[place];
                    let term: f64 = (0..B).map(|i| own[i] * (0..B).map(|j| block[i][j] * u[j]).sum::<f64>()).sum();
                    energies[column].energy += term;
                    sizes[place] += term.abs();
                }
            });
        }
        space.row_entries(face, |column, _| {
            let size = sizes[places[column].1];
            energies[column].magnitude += size;
            energies[column].room += (share * size).powi(2);
        });
    }
    energies.iter_mut().for_each(|own| own.room = own.room.sqrt());
    Ok(energies)
}
