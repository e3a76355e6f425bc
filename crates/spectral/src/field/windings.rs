//! Whole turns of least energy: the closest point of a lattice.
//!
//! What a field turns by along independent loops is known up to whole turns, and its energy is a quadratic form `Q` in
//! all of them together: rounding one by one finds no minimum, since loops share the turns of others. The lattice gets
//! a basis that is nearly orthogonal (Lenstra, Lenstra and Lovász 1982), the nearest planes in it give a first point
//! (Babai 1986), and the tree of all points that are no worse is searched (Schnorr and Euchner 1994) as far as half a
//! second reaches: on surfaces of some ten handles to its end, so that there is no better one. Beyond that, moves of
//! single turns and of pairs go on until none lessens the energy.

use chladni_algebra::DenseMatrix;

/// Lattices of more dimensions are left as they are, and improved by single turns and pairs alone.
const MOST_REDUCED: usize = 160;

/// So many multiplications are spent on the tree at most.
const MOST_WORK: u64 = 400_000_000;

/// What lessens the energy by no more than this share is rounding.
const GAIN: f64 = 1e-10;

/// How much shorter a vector of the basis has to be to come before another.
const LOVASZ: f64 = 0.99;

/// So often at most single turns and pairs are tried.
const ROUNDS: usize = 10_000;

/// The whole numbers `z` of least `(y + z)ᵀ Q (y + z)` for a symmetric positive definite `Q`: zeros where nothing is
/// better than `y` itself.
pub(super) fn nearest(form: &DenseMatrix, offset: &[f64]) -> Vec<f64> {
    let size = offset.len();
    let mut best = vec![0.0; size];
    if size == 0 {
        return best;
    }
    let start = energy(form, offset, &best);
    let better = |z: &[f64], than: f64| energy(form, offset, z) < than - GAIN * start;
    if size <= MOST_REDUCED
        && let Some(lattice) = Lattice::reduced(form)
    {
        let found = lattice.nearest(offset);
        if better(&found, start) {
            best = found;
        }
    }
    let moved = descend(form, offset, &best);
    if better(&moved, energy(form, offset, &best)) { moved } else { best }
}

fn energy(form: &DenseMatrix, offset: &[f64], whole: &[f64]) -> f64 {
    let point: Vec<f64> = offset.iter().zip(whole).map(|(y, z)| y + z).collect();
    let product = |column: &[f64]| -> f64 { column.iter().zip(&point).map(|(q, y)| q * y).sum() };
    (0..point.len()).map(|k| point[k] * product(form.column(k))).sum()
}

/// Moves by one turn of one loop or of two, the one that lessens the energy most first.
fn descend(form: &DenseMatrix, offset: &[f64], start: &[f64]) -> Vec<f64> {
    let size = offset.len();
    let mut whole = start.to_vec();
    let mut slope = vec![0.0; size];
    for k in 0..size {
        let y = offset[k] + whole[k];
        slope.iter_mut().zip(form.column(k)).for_each(|(s, q)| *s += 2.0 * q * y);
    }
    let least = -GAIN * energy(form, offset, start);
    for _ in 0..ROUNDS {
        let single = |k: usize| form.column(k)[k] - slope[k].abs();
        let mut best = (least, [None; 2]);
        for k in 0..size {
            if single(k) < best.0 {
                best = (single(k), [Some((k, -slope[k].signum())), None]);
            }
            for l in 0..k {
                for signs in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                    let gain = form.column(k)[k]
                        + form.column(l)[l]
                        + 2.0 * signs[0] * signs[1] * form.column(k)[l]
                        + signs[0] * slope[k]
                        + signs[1] * slope[l];
                    if gain < best.0 {
                        best = (gain, [Some((k, signs[0])), Some((l, signs[1]))]);
                    }
                }
            }
        }
        if best.1[0].is_none() {
            break;
        }
        for (k, by) in best.1.into_iter().flatten() {
            whole[k] += by;
            slope.iter_mut().zip(form.column(k)).for_each(|(s, q)| *s += 2.0 * q * by);
        }
    }
    whole
}

/// A basis of all whole numbers that is nearly orthogonal in a form.
struct Lattice {
    /// Vectors of whole numbers.
    basis: Vec<Vec<f64>>,
    /// Below the diagonal the Gram–Schmidt coefficients of each vector.
    coefficients: Vec<Vec<f64>>,
    /// Squared lengths of the orthogonal vectors.
    squares: Vec<f64>,
    /// What takes a point to its coordinates along the orthogonal vectors: `Q bᵢ` of each vector, made orthogonal.
    readers: Vec<Vec<f64>>,
}

impl Lattice {
    /// Reduces the basis of units; `None` where the form is not definite in double precision.
    fn reduced(form: &DenseMatrix) -> Option<Self> {
        let size = form.rows();
        let unit = |i: usize| (0..size).map(|k| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
        let mut basis: Vec<Vec<f64>> = (0..size).map(unit).collect();
        let mut lattice = Self::orthogonal(form, basis)?;
        let mut at = 1;
        // Each exchange lessens a product of lengths by a hundredth, so that there are few of them.
        for _ in 0..200 * size * size {
            if at >= size {
                break;
            }
            lattice.shorten(at);
            let before = lattice.coefficients[at][at - 1];
            if lattice.squares[at] >= (LOVASZ - before * before) * lattice.squares[at - 1] {
                at += 1;
            } else {
                lattice.exchange(at);
                at = (at - 1).max(1);
            }
        }
        // From exact whole numbers once more, without what the updates rounded.
        basis = lattice.basis;
        Self::orthogonal(form, basis)
    }

    fn orthogonal(form: &DenseMatrix, basis: Vec<Vec<f64>>) -> Option<Self> {
        let size = basis.len();
        let mut coefficients: Vec<Vec<f64>> = Vec::with_capacity(size);
        let (mut squares, mut readers) = (Vec::with_capacity(size), Vec::<Vec<f64>>::with_capacity(size));
        for vector in &basis {
            let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
            let mut reader: Vec<f64> = (0..size).map(|k| dot(form.column(k), vector)).collect();
            let row: Vec<f64> = readers.iter().zip(&squares).map(|(r, square)| dot(r, vector) / square).collect();
            for (own, coefficient) in readers.iter().zip(&row) {
                reader.iter_mut().zip(own).for_each(|(r, o)| *r -= coefficient * o);
            }
            let square = dot(&reader, vector);
            if !(square > 0.0 && square.is_finite()) {
                return None;
            }
            coefficients.push(row);
            squares.push(square);
            readers.push(reader);
        }
        Some(Self { basis, coefficients, squares, readers })
    }

    /// Takes whole multiples of the vectors before it from a vector.
    fn shorten(&mut self, at: usize) {
        for other in (0..at).rev() {
            let times = self.coefficients[at][other].round();
            if times == 0.0 {
                continue;
            }
            let (before, own) = self.basis.split_at_mut(at);
            own[0].iter_mut().zip(&before[other]).for_each(|(x, o)| *x -= times * o);
            let (before, own) = self.coefficients.split_at_mut(at);
            own[0].iter_mut().zip(&before[other]).for_each(|(x, o)| *x -= times * o);
            own[0][other] -= times;
        }
    }

    /// Exchanges a vector with the one before it.
    fn exchange(&mut self, at: usize) {
        self.basis.swap(at - 1, at);
        let mu = self.coefficients[at][at - 1];
        let (low, high) = (self.squares[at - 1], self.squares[at]);
        let square = high + mu * mu * low;
        self.squares[at - 1] = square;
        self.squares[at] = low * high / square;
        let own = mu * low / square;
        for k in 0..at - 1 {
            let kept = self.coefficients[at][k];
            self.coefficients[at][k] = self.coefficients[at - 1][k];
            self.coefficients[at - 1][k] = kept;
        }
        self.coefficients[at][at - 1] = own;
        for row in &mut self.coefficients[at + 1..] {
            let (a, b) = (row[at - 1], row[at]);
            row[at - 1] = b * high / square + a * own;
            row[at] = a - b * mu;
        }
    }

    /// The whole numbers that bring a point closest to zero, as far as the work reaches.
    fn nearest(&self, offset: &[f64]) -> Vec<f64> {
        let size = self.basis.len();
        // The point along the orthogonal vectors; level after level from the last one, whole numbers are chosen.
        let target: Vec<f64> = (0..size)
            .map(|i| self.readers[i].iter().zip(offset).map(|(r, y)| r * y).sum::<f64>() / self.squares[i])
            .collect();
        let mut tree = Tree { lattice: self, target, chosen: vec![0.0; size], best: None, work: MOST_WORK };
        tree.search(size, 0.0);
        let chosen = tree.best.map_or_else(|| vec![0.0; size], |best| best.1);
        let mut whole = vec![0.0; size];
        for (vector, times) in self.basis.iter().zip(&chosen) {
            whole.iter_mut().zip(vector).for_each(|(w, v)| *w += times * v);
        }
        whole
    }
}

/// A search through whole numbers, depth first: the first leaf is that of the nearest planes.
struct Tree<'a> {
    lattice: &'a Lattice,
    target: Vec<f64>,
    chosen: Vec<f64>,
    best: Option<(f64, Vec<f64>)>,
    work: u64,
}

impl Tree<'_> {
    /// Chooses the numbers below `level`, where those above cost `spent`.
    fn search(&mut self, level: usize, spent: f64) {
        let Some(at) = level.checked_sub(1) else {
            if self.best.as_ref().is_none_or(|best| spent < best.0) {
                self.best = Some((spent, self.chosen.clone()));
            }
            return;
        };
        let size = self.chosen.len();
        let above = (at + 1..size).map(|k| self.lattice.coefficients[k][at] * self.chosen[k]).sum::<f64>();
        let center = -(self.target[at] + above);
        let first = center.round();
        let side = if center >= first { 1.0 } else { -1.0 };
        for step in 0.. {
            // To both sides in turn, the nearer one first.
            let away = f64::from((step + 1) / 2) * if step % 2 == 1 { side } else { -side };
            let number = first + away;
            let cost = spent + self.lattice.squares[at] * (number - center).powi(2);
            self.work = self.work.saturating_sub(size as u64);
            let bound = self.best.as_ref().map_or(f64::INFINITY, |best| best.0 * (1.0 - GAIN));
            if !(cost < bound) || self.best.is_some() && self.work == 0 {
                break;
            }
            self.chosen[at] = number;
            self.search(at, cost);
        }
        self.chosen[at] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A form as the sum of squares of vectors of pseudo-random whole numbers, long and nearly parallel.
    fn form(size: usize, seed: u64) -> DenseMatrix {
        let mut state = seed;
        let mut next = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1u32 << 24) - 0.5
        };
        let vectors: Vec<Vec<f64>> =
            (0..size).map(|i| (0..size).map(|k| 3.0 + next() + if i == k { 0.7 } else { 0.0 }).collect()).collect();
        let mut form = DenseMatrix::zeros(size, size);
        for a in 0..size {
            for b in 0..size {
                form.column_mut(a)[b] = vectors[a].iter().zip(&vectors[b]).map(|(x, y)| x * y).sum();
            }
        }
        form
    }

    fn least_by_trial(form: &DenseMatrix, offset: &[f64], reach: i32) -> f64 {
        let width = (2 * reach + 1) as usize;
        (0..width.pow(offset.len() as u32))
            .map(|code| {
                let number = |k: usize| f64::from((code / width.pow(k as u32) % width) as i32 - reach);
                energy(form, offset, &(0..offset.len()).map(number).collect::<Vec<_>>())
            })
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn no_whole_numbers_within_reach_are_better() {
        for seed in 1..60 {
            let size = 2 + (seed as usize) % 3;
            let form = form(size, seed);
            let offset: Vec<f64> =
                (0..size).map(|k| ((seed * 37 + 11 * k as u64) % 100) as f64 / 100.0 - 0.5).collect();
            let found = energy(&form, &offset, &nearest(&form, &offset));
            let least = least_by_trial(&form, &offset, 7);
            assert!(found <= least * (1.0 + 1e-9) + 1e-12, "{seed}: {found} {least}");
        }
    }

    #[test]
    fn zeros_are_the_answer_where_nothing_is_better() {
        let mut form = DenseMatrix::zeros(2, 2);
        (0..2).for_each(|k| form.column_mut(k)[k] = 1.0);
        // Half a turn is as good either way: it stays where it is.
        assert_eq!(nearest(&form, &[0.5, -0.5]), [0.0, 0.0]);
        assert_eq!(nearest(&form, &[0.6, -1.7]), [-1.0, 2.0]);
        assert_eq!(nearest(&DenseMatrix::zeros(0, 0), &[]), [0.0; 0]);
    }

    #[test]
    fn many_dimensions_end_where_no_pair_of_turns_is_better() {
        let size = 200;
        let form = form(size, 5);
        let offset: Vec<f64> = (0..size).map(|k| ((k * 37) % 100) as f64 / 100.0 - 0.5).collect();
        let found = nearest(&form, &offset);
        let least = energy(&form, &offset, &found);
        for k in (0..size).step_by(7) {
            for l in 0..size {
                for signs in [[1.0, 0.0], [-1.0, 0.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
                    let mut other = found.clone();
                    other[k] += signs[0];
                    other[l] += signs[1];
                    assert!(energy(&form, &offset, &other) >= least * (1.0 - 1e-6), "{k} {l}");
                }
            }
        }
    }
}
