//! The space of all fields of a surface: what those of few dimensions are measured against.

use chladni_algebra::BlockMatrix;

use crate::basis::{FieldBasis, FieldSpace};
use crate::operator::OperatorError;
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

use super::surface::FieldSurface;

/// All fields of a surface as a basis: `U` is the identity, so that `S̄`, `M̄` are `S`, `M`, and both biharmonic
/// energies are `S M⁻¹ S`. Designs in it, by [`super::DesignModel::sparse`], are the exact minimisers; they cost a
/// factorisation of the size of the mesh.
///
/// # Errors
/// [`OperatorError`]: the kind is out of range.
pub fn whole_space(
    surface: &FieldSurface,
    kind: FieldKind,
    boundary: FieldBoundary,
) -> Result<FieldBasis, OperatorError> {
    match kind.block() {
        2 => whole::<2>(surface, kind, boundary),
        _ => whole::<3>(surface, kind, boundary),
    }
}

fn whole<const B: usize>(
    surface: &FieldSurface,
    kind: FieldKind,
    boundary: FieldBoundary,
) -> Result<FieldBasis, OperatorError> {
    let operator = FieldOperator::<B>::assemble(kind, surface.mesh(), surface.dual(), surface.frames(), boundary)?;
    let faces = surface.faces();
    let identity: [f32; 9] = std::array::from_fn(|at| f32::from(u8::from(at < B * B && at / B == at % B)));
    let values = (0..faces).flat_map(|_| identity[..B * B].to_vec()).collect();
    let every: Vec<u32> = (0..faces as u32).collect();
    let offsets = (0..=faces as u32).collect();
    let space = FieldSpace::from_sorted_parts(B, faces, offsets, every.clone(), values);
    let mass = BlockMatrix::<B>::from_rows(faces, faces, |face, entries| {
        let diagonal = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { operator.mass[face] } else { 0.0 }));
        entries.push((face as u32, diagonal));
    });
    let (stiffness, mass) = (operator.stiffness.to_sparse(), mass.to_sparse());
    Ok(FieldBasis { kind, space, stiffness, mass, samples: every, area: operator.area })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Constraint, DesignModel, EnergyWeights, FieldParameters, Hold, field_basis};
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};

    #[test]
    fn designs_of_the_whole_space_have_no_more_energy_than_those_of_a_small_one() {
        let surface = FieldSurface::new(generate(Shape::Torus, 600).unwrap()).unwrap();
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
            let whole = whole_space(&surface, kind, FieldBoundary::default()).unwrap();
            assert_eq!(whole.space.dimension(), kind.block() * surface.faces());
            let small = field_basis(&surface, &FieldParameters::new(kind, 240), &Unwatched).unwrap();
            let constraints: Vec<Constraint> = (0..5)
                .map(|i| Constraint { face: 200 * i, value: [1.0, 0.3 * f64::from(i), 0.2], hold: Hold::Exact })
                .collect();
            for (harmonic, biharmonic) in [(1.0, 0.0), (1.0, 0.01), (0.0, 1.0)] {
                let weights = EnergyWeights { harmonic, biharmonic };
                let design = |basis: &FieldBasis, model: DesignModel| {
                    let design = model.weighted(weights, None).unwrap().solve(basis, &constraints).unwrap();
                    assert!(design.residuals.iter().all(|r| *r < 1e-3), "{kind:?}: {:?}", design.residuals);
                    let energy = harmonic * design.harmonic_energy + biharmonic * design.biharmonic_energy;
                    (energy, basis.space.lift(&design.coefficients).unwrap())
                };
                let (least, exact) = design(&whole, DesignModel::sparse(&whole));
                let (energy, field) = design(&small, DesignModel::new(&small, &Unwatched).unwrap());
                if biharmonic == 0.0 {
                    assert!(least <= energy * (1.0 + 1e-6), "{kind:?}: {least} {energy}");
                    continue;
                }
                // Point constraints have designs of their own only where the energy is biharmonic.
                let norm = |field: &mut dyn Iterator<Item = f32>| field.map(|x| x * x).sum::<f32>().sqrt();
                let off = norm(&mut exact.iter().zip(&field).map(|(a, b)| a - b)) / norm(&mut exact.iter().copied());
                assert!(off < 0.2, "{kind:?} {weights:?}: {off}");
            }
        }
    }
}
