//! What makes a space reproduce fields that are parallel as far as the surface lets them be: the blocks of each face,
//! freed from what carries them, are made to add up to one.
//!
//! Column `g` holds at face `f` a block `w_fg T_fg` with the transport `T_fg` from the sample of `g` and a weight.
//! Where transport does not depend on the way, a parallel field has as coefficients its own numbers at the samples, and
//! the space holds it to the last bit if `Σ_g w_fg = 1` on every face: the patch test of finite elements. Shrinking
//! blocks breaks that sum, by the more the more columns there are; dividing by it puts it right.
//!
//! `T` is not stored: it is the phase that a block had before it was smoothed for the last time. For n-vectors weights
//! are complex numbers and so is their sum; tensors have a real one for their trace beside that of their deviator.
//! Spaces of the Hodge–Laplacian stay as they are: what it has as kernel are the harmonic fields, which are dense
//! columns.

use chladni_base::parallel::*;

use crate::operator::frames::{Complex64, ONE, normalise};
use crate::operator::transport::FieldKind;

use super::smooth::Small;
use super::space::Column;

/// Sums below this share of the usual 1 are left alone: nothing there to divide by.
const LEAST: f64 = 1e-3;

/// A block in the parts that transport keeps apart: what it does to a trace, and to numbers that turn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Parts {
    trace: f64,
    turning: Complex64,
}

impl Parts {
    /// The parts of a block that is a multiple of a turn but for rounding; with `mirrored` of one that follows a change
    /// of orientation.
    pub fn of<const B: usize>(kind: FieldKind, block: &Small<B>, mirrored: bool) -> Self {
        let sign = if mirrored { -1.0 } else { 1.0 };
        let b = block.map(|row| row.map(f64::from));
        if let (FieldKind::Tensor {}, Some(i)) = (kind, B.checked_sub(1).filter(|&i| i == 2)) {
            // In the basis (1, 1, 0)/√2, (1, −1, 0)/√2, (0, 0, 1).
            let trace = 0.5 * (b[0][0] + b[0][1] + b[1][0] + b[1][1]);
            let like = 0.5 * (b[0][0] - b[0][1] - b[1][0] + b[1][1]);
            let (up, down) = ((b[i][0] - b[i][1]) / 2f64.sqrt(), (b[0][i] - b[1][i]) / 2f64.sqrt());
            return Self { trace, turning: 0.5 * Complex64::new(like + sign * b[i][i], up - sign * down) };
        }
        Self { trace: 0.0, turning: 0.5 * Complex64::new(b[0][0] + sign * b[1][1], b[1][0] - sign * b[0][1]) }
    }

    fn size(self) -> f64 {
        self.turning.norm()
    }

    /// The same carried back by the phase that a block had before.
    fn carried_back(self, before: Self) -> Self {
        Self { turning: self.turning * normalise(before.turning).conj(), ..self }
    }
}

/// The weights of a column's blocks, whose phases are those of `before`.
pub(super) fn weights<const B: usize>(kind: FieldKind, before: &[Small<B>], after: &[Small<B>]) -> Vec<Parts> {
    before
        .iter()
        .zip(after)
        .map(|(before, after)| {
            let [same, other] = [false, true].map(|mirrored| Parts::of(kind, before, mirrored));
            let mirrored = other.size() > same.size();
            Parts::of(kind, after, mirrored).carried_back(if mirrored { other } else { same })
        })
        .collect()
}

/// Divides the blocks of each face by the sum of their weights. `weights` has a list for each column, as [`weights`]
/// gives it.
pub(super) fn divide<const B: usize>(kind: FieldKind, columns: &mut [Column<B>], weights: &[Vec<Parts>], faces: usize) {
    let mut sums = vec![Parts::default(); faces];
    for (column, weights) in columns.iter().zip(weights) {
        for (&face, weight) in column.faces.iter().zip(weights) {
            let sum = &mut sums[face as usize];
            sum.trace += weight.trace;
            sum.turning += weight.turning;
        }
    }
    let inverses: Vec<Small<B>> = sums.into_par_iter().map(|sum| inverse(kind, sum)).collect();
    columns.par_iter_mut().for_each(|column| {
        for (&face, block) in column.faces.iter().zip(&mut column.blocks) {
            let inverse = &inverses[face as usize];
            let own = *block;
            *block = std::array::from_fn(|i| std::array::from_fn(|j| (0..B).map(|k| inverse[i][k] * own[k][j]).sum()));
        }
    });
}

/// The block that undoes a sum; the identity where there is nearly none.
fn inverse<const B: usize>(kind: FieldKind, sum: Parts) -> Small<B> {
    let square = sum.turning.norm_sqr();
    let Complex64 { re: c, im: s } = if square > LEAST * LEAST { sum.turning.conj() / square } else { ONE };
    let mut block = [[0.0f32; B]; B];
    if kind == (FieldKind::Tensor {}) && B == 3 {
        let trace = if sum.trace.abs() > LEAST { 1.0 / sum.trace } else { 1.0 };
        let (same, other, side) = (0.5 * (trace + c), 0.5 * (trace - c), s / 2f64.sqrt());
        let rows = [[same, other, -side], [other, same, side], [side, -side, c]];
        for (i, row) in rows.into_iter().enumerate().take(B) {
            block[i] = std::array::from_fn(|j| row.get(j).map_or(0.0, |&x| x as f32));
        }
        return block;
    }
    let rows = [[c, -s], [s, c]];
    for (i, row) in rows.into_iter().enumerate().take(B) {
        block[i] = std::array::from_fn(|j| row.get(j).map_or(0.0, |&x| x as f32));
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::frames::Turn;
    use crate::operator::transport::transport_block;

    fn block<const B: usize>(kind: FieldKind, angle: f64, size: f64) -> Small<B> {
        let order = f64::from(kind.order());
        let (s, c) = (order * angle).sin_cos();
        transport_block::<B>(kind, Turn { by: Complex64::new(c, s), mirrored: false })
            .map(|row| row.map(|x| (size * x) as f32))
    }

    fn check<const B: usize>(kind: FieldKind) {
        // Two columns on three faces: phases as they please, one weight negative.
        let before: [Vec<Small<B>>; 2] = [
            vec![block(kind, 0.3, 0.5), block(kind, 2.0, 0.2), block(kind, -1.0, 0.9)],
            vec![block(kind, 1.1, 0.5), block(kind, 0.4, 0.1)],
        ];
        let after: [Vec<Small<B>>; 2] = [
            vec![block(kind, 0.3, 0.6), block(kind, 2.0, 0.7), block(kind, -1.0, 0.8)],
            vec![block(kind, 1.1, 0.3), block(kind, 0.4, -0.1)],
        ];
        let mut columns = [
            Column { faces: vec![0, 1, 2], blocks: after[0].clone() },
            Column { faces: vec![0, 1], blocks: after[1].clone() },
        ];
        let both: Vec<Vec<Parts>> = (0..2).map(|k| weights(kind, &before[k], &after[k])).collect();
        divide(kind, &mut columns, &both, 3);
        // What transport brings to the samples and the space takes back is the identity.
        for face in 0..3 {
            let mut sum = [[0.0f32; B]; B];
            for (k, column) in columns.iter().enumerate() {
                let Some(at) = column.faces.iter().position(|&f| f == face) else { continue };
                let by = normalise(Parts::of(kind, &before[k][at], false).turning).conj();
                let back = transport_block::<B>(kind, Turn { by, mirrored: false });
                for i in 0..B {
                    for j in 0..B {
                        sum[i][j] += (0..B).map(|l| column.blocks[at][i][l] * back[l][j] as f32).sum::<f32>();
                    }
                }
            }
            for (i, row) in sum.iter().enumerate() {
                for (j, x) in row.iter().enumerate() {
                    assert!((x - f32::from(u8::from(i == j))).abs() < 1e-6, "{kind:?} {face}: {sum:?}");
                }
            }
        }
    }

    #[test]
    fn what_transport_brings_to_the_samples_comes_back_as_it_was() {
        check::<2>(FieldKind::NVector { n: 1 });
        check::<2>(FieldKind::NVector { n: 4 });
        check::<3>(FieldKind::Tensor {});
    }
}
