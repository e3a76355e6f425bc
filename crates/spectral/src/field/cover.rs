//! Every face is in a column.
//!
//! On needles a billion times as long as wide, single precision has no room for what a heat step multiplies with, and a
//! column comes out with blocks that are no numbers, or none, on some faces. Those faces take the columns of a
//! neighbour, carried over the edge between them.

use chladni_mesh::dual::{DualGraph, NO_FACE};

use crate::operator::frames::FaceFrames;
use crate::operator::transport::{FieldKind, transport_block, turn};

use super::smooth::Small;
use super::space::Column;

/// Drops blocks that are no numbers, and has faces that are then in no column take those of the nearest that are in
/// some.
pub(super) fn cover<const B: usize>(columns: &mut [Column<B>], kind: FieldKind, dual: &DualGraph, frames: &FaceFrames) {
    let mut covered = vec![false; dual.faces()];
    for column in columns.iter_mut() {
        let finite = |block: &Small<B>| block.as_flattened().iter().all(|x| x.is_finite());
        if !column.blocks.iter().all(finite) {
            let own = column.faces.drain(..).zip(column.blocks.drain(..)).filter(|own| finite(&own.1));
            (column.faces, column.blocks) = own.collect::<Vec<_>>().into_iter().unzip();
        }
        column.faces.iter().for_each(|&face| covered[face as usize] = true);
    }
    let mut left: Vec<u32> = (0..covered.len() as u32).filter(|&face| !covered[face as usize]).collect();
    while !left.is_empty() {
        // Rounds, so that each takes from a face that was in a column before.
        let neighbour = |face: u32| {
            let beside = dual.neighbours(face as usize).into_iter().enumerate();
            beside.filter(|own| own.1 != NO_FACE).find(|own| covered[own.1 as usize])
        };
        let found: Vec<(u32, (usize, u32))> = left.iter().filter_map(|&face| Some((face, neighbour(face)?))).collect();
        if found.is_empty() {
            // A component without any: nothing to take.
            return;
        }
        for (face, (edge, from)) in found {
            covered[face as usize] = true;
            let Some(carried) = turn(kind, dual, frames, face as usize, edge) else { continue };
            let carry = transport_block::<B>(kind, carried).map(|row| row.map(|x| x as f32));
            for column in columns.iter_mut() {
                let (Ok(at), Err(into)) = (column.faces.binary_search(&from), column.faces.binary_search(&face)) else {
                    continue;
                };
                let own = column.blocks[at];
                let sum = |i: usize, j: usize| (0..B).map(|k| carry[i][k] * own[k][j]).sum();
                column.faces.insert(into, face);
                column.blocks.insert(into, std::array::from_fn(|i| std::array::from_fn(|j| sum(i, j))));
            }
        }
        left.retain(|&face| !covered[face as usize]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::FieldSurface;
    use chladni_mesh::shape::{Shape, generate};

    #[test]
    fn faces_without_numbers_take_those_of_their_neighbours() {
        // On a flat surface whose frames are all alike parallel numbers stay what they are.
        let surface = FieldSurface::new(generate(Shape::Rectangle, 60).unwrap()).unwrap();
        let (faces, one) = (surface.faces() as u32, [[1.0f32, 0.0], [0.0, 1.0]]);
        let nothing = [[f32::NAN, 0.0], [0.0, 1.0]];
        let block = |face: u32| if face % 5 == 2 { nothing } else { one };
        let mut columns = [Column::<2> { faces: (0..faces).collect(), blocks: (0..faces).map(block).collect() }];
        let kind = FieldKind::NVector { n: 1 };
        cover(&mut columns, kind, surface.dual(), surface.frames());
        assert_eq!(columns[0].faces, (0..faces).collect::<Vec<_>>());
        for (face, block) in columns[0].blocks.iter().enumerate().filter(|own| own.0 % 5 == 2) {
            let beside = |k: usize| turn(kind, surface.dual(), surface.frames(), face, k);
            let expected = (0..3).filter_map(beside).map(|own| transport_block::<2>(kind, own));
            let near = |other: &[[f64; 2]; 2]| {
                other.as_flattened().iter().zip(block.as_flattened()).all(|(a, b)| (a - f64::from(*b)).abs() < 1e-6)
            };
            assert!(expected.into_iter().any(|other| near(&other)), "{face}: {block:?}");
        }
        // Twice is once.
        let before = columns.clone();
        cover(&mut columns, kind, surface.dual(), surface.frames());
        assert_eq!(columns, before);
    }
}
