//! Matrices of blocks in single precision, as cycles multiply by them. The time of a product is that of reading its blocks: those that turn and stretch,
//! and of n-fields all do, are two numbers instead of four.

use chladni_algebra::{Block, BlockMatrix};
use rayon::prelude::*;

/// Rows that one task handles.
const ROWS: usize = 2048;

/// Blocks are taken for turns where they are that close to one, as a share of their size.
const CLOSE: f64 = 1e-7;

type Small<const B: usize> = [[f32; B]; B];

/// One vector for each node.
pub(super) type Vector<const B: usize> = Vec<[f32; B]>;

/// The blocks of a matrix.
enum Blocks<const B: usize> {
    Full(Vec<Small<B>>),
    /// `[a, −b; b, a]`.
    Turns(Vec<Turned>),
}

/// A block.
trait Entry<const B: usize>: Copy + Send + Sync {
    /// `y += A x`.
    fn add(&self, x: &[f32; B], y: &mut [f32; B]);
    /// `self + factor · other`.
    fn plus(&self, factor: f32, other: &Self) -> Self;
}

impl<const B: usize> Entry<B> for Small<B> {
    #[inline(always)]
    fn add(&self, x: &[f32; B], y: &mut [f32; B]) {
        for i in 0..B {
            for j in 0..B {
                y[i] += self[i][j] * x[j];
            }
        }
    }
    #[inline(always)]
    fn plus(&self, factor: f32, other: &Self) -> Self {
        std::array::from_fn(|i| std::array::from_fn(|j| self[i][j] + factor * other[i][j]))
    }
}

#[derive(Clone, Copy)]
struct Turned([f32; 2]);

/// For two numbers a node only.
impl<const B: usize> Entry<B> for Turned {
    #[inline(always)]
    fn add(&self, x: &[f32; B], y: &mut [f32; B]) {
        let [a, b] = self.0;
        y[0] += a * x[0] - b * x[1];
        y[1] += b * x[0] + a * x[1];
    }
    #[inline(always)]
    fn plus(&self, factor: f32, other: &Self) -> Self {
        Self([0, 1].map(|i| self.0[i] + factor * other.0[i]))
    }
}

/// What is added to a matrix, times a factor.
enum Second<const B: usize> {
    Nothing,
    /// A number for each node.
    Masses(Vec<f32>),
    /// On the pattern of the matrix, and in blocks of the same kind.
    Blocks(Blocks<B>),
}

/// A sum `A + γC` on one pattern, γ to be chosen at every product.
pub(super) struct SumRows<const B: usize> {
    offsets: Vec<u32>,
    indices: Vec<u32>,
    first: Blocks<B>,
    second: Second<B>,
}

/// The same with blocks of one kind.
struct View<'a, E> {
    offsets: &'a [u32],
    indices: &'a [u32],
    first: &'a [E],
    second: Option<&'a [E]>,
    masses: Option<&'a [f32]>,
}

impl<E> View<'_, E> {
    /// One row of `(A + γC) x`.
    #[inline(always)]
    fn row<const B: usize>(&self, gamma: f32, row: usize, x: &[[f32; B]]) -> [f32; B]
    where
        E: Entry<B>,
    {
        let range = self.offsets[row] as usize..self.offsets[row + 1] as usize;
        let mut y = [0.0; B];
        if let Some(masses) = self.masses {
            y = x[row].map(|x| gamma * masses[row] * x);
        }
        let (indices, first) = (&self.indices[range.clone()], &self.first[range.clone()]);
        match self.second {
            None => {
                for (&column, block) in indices.iter().zip(first) {
                    block.add(&x[column as usize], &mut y);
                }
            }
            Some(second) => {
                for ((&column, block), other) in indices.iter().zip(first).zip(&second[range]) {
                    block.plus(gamma, other).add(&x[column as usize], &mut y);
                }
            }
        }
        y
    }
}

/// What is done with every row of a product.
trait Pass<const B: usize>: Sized {
    fn run<E: Entry<B>>(self, view: &View<'_, E>);
}

/// `out = act(row, row of the product)`.
struct Each<'a, const B: usize, F> {
    gamma: f32,
    x: &'a [[f32; B]],
    out: &'a mut [[f32; B]],
    act: F,
}

impl<const B: usize, F: Fn(usize, [f32; B], &mut [f32; B]) + Sync> Pass<B> for Each<'_, B, F> {
    fn run<E: Entry<B>>(self, view: &View<'_, E>) {
        let Self { gamma, x, out, act } = self;
        out.par_chunks_mut(ROWS).enumerate().for_each(|(task, out)| {
            for (k, out) in out.iter_mut().enumerate() {
                let row = task * ROWS + k;
                act(row, view.row(gamma, row, x), out);
            }
        });
    }
}

/// The same with two results of each row.
struct Both<'a, const B: usize, F> {
    gamma: f32,
    x: &'a [[f32; B]],
    out: (&'a mut [[f32; B]], &'a mut [[f32; B]]),
    act: F,
}

impl<const B: usize, F: Fn(usize, [f32; B], &mut [f32; B], &mut [f32; B]) + Sync> Pass<B> for Both<'_, B, F> {
    fn run<E: Entry<B>>(self, view: &View<'_, E>) {
        let Self { gamma, x, out, act } = self;
        out.0.par_chunks_mut(ROWS).zip(out.1.par_chunks_mut(ROWS)).enumerate().for_each(|(task, (first, second))| {
            for (k, (first, second)) in first.iter_mut().zip(second).enumerate() {
                let row = task * ROWS + k;
                act(row, view.row(gamma, row, x), first, second);
            }
        });
    }
}

fn is_turn<const B: usize>(block: &Block<B>) -> bool {
    if B != 2 {
        return false;
    }
    let size = block.as_flattened().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    (block[0][0] - block[1][1]).abs() <= CLOSE * size && (block[0][1] + block[1][0]).abs() <= CLOSE * size
}

fn blocks_of<const B: usize>(blocks: &[Block<B>], turns: bool) -> Blocks<B> {
    let own = blocks.par_iter().with_min_len(1 << 14);
    match turns {
        true => Blocks::Turns(
            own.map(|m| {
                let ([a, b], [c, d]) = ([m[0][0], m[0][1]], [m[1][0], m[1][1]]);
                Turned([(0.5 * (a + d)) as f32, (0.5 * (c - b)) as f32])
            })
            .collect(),
        ),
        false => Blocks::Full(own.map(|block| block.map(|row| row.map(|x| x as f32))).collect()),
    }
}

fn bytes_of<const B: usize>(blocks: &Blocks<B>) -> u64 {
    match blocks {
        Blocks::Full(blocks) => (size_of::<Small<B>>() * blocks.len()) as u64,
        Blocks::Turns(blocks) => 8 * blocks.len() as u64,
    }
}

impl<const B: usize> SumRows<B> {
    fn new(matrix: &BlockMatrix<B>, turns: bool, second: Second<B>) -> Self {
        Self {
            offsets: matrix.offsets().iter().map(|&o| o as u32).collect(),
            indices: matrix.indices().to_vec(),
            first: blocks_of(matrix.blocks(), turns),
            second,
        }
    }

    fn all_turn(matrix: &BlockMatrix<B>) -> bool {
        matrix.blocks().par_iter().with_min_len(1 << 14).all(is_turn)
    }

    /// One matrix alone.
    pub fn of(matrix: &BlockMatrix<B>) -> Self {
        Self::new(matrix, Self::all_turn(matrix), Second::Nothing)
    }

    /// With masses of nodes.
    pub fn with_masses(matrix: &BlockMatrix<B>, masses: Vec<f32>) -> Self {
        Self::new(matrix, Self::all_turn(matrix), Second::Masses(masses))
    }

    /// With a matrix whose pattern lies within its own.
    pub fn with(matrix: &BlockMatrix<B>, other: &BlockMatrix<B>) -> Self {
        let turns = Self::all_turn(matrix) && Self::all_turn(other);
        let mut second = Vec::with_capacity(matrix.entries());
        for row in 0..matrix.rows() {
            let (columns, blocks) = other.row(row);
            let own = |column: &u32| columns.binary_search(column).map_or([[0.0; B]; B], |at| blocks[at]);
            second.extend(matrix.row(row).0.iter().map(own));
        }
        Self::new(matrix, turns, Second::Blocks(blocks_of(&second, turns)))
    }

    /// About the bytes that they take.
    pub fn bytes(&self) -> u64 {
        let second = match &self.second {
            Second::Nothing => 0,
            Second::Masses(masses) => 4 * masses.len() as u64,
            Second::Blocks(blocks) => bytes_of(blocks),
        };
        4 * (self.offsets.len() + self.indices.len()) as u64 + bytes_of(&self.first) + second
    }

    /// How many rows.
    pub fn nodes(&self) -> usize {
        self.offsets.len() - 1
    }

    fn pass(&self, pass: impl Pass<B>) {
        let (offsets, indices) = (&self.offsets[..], &self.indices[..]);
        let masses = if let Second::Masses(masses) = &self.second { Some(&masses[..]) } else { None };
        match (&self.first, &self.second) {
            (Blocks::Full(first), Second::Blocks(Blocks::Full(second))) => {
                pass.run(&View { offsets, indices, first, second: Some(second), masses });
            }
            (Blocks::Turns(first), Second::Blocks(Blocks::Turns(second))) => {
                pass.run(&View { offsets, indices, first, second: Some(second), masses });
            }
            (Blocks::Full(first), _) => pass.run(&View { offsets, indices, first, second: None, masses }),
            (Blocks::Turns(first), _) => pass.run(&View { offsets, indices, first, second: None, masses }),
        }
    }

    /// `y = (A + γC) x`.
    pub fn multiply(&self, gamma: f32, x: &[[f32; B]], y: &mut [[f32; B]]) {
        self.pass(Each { gamma, x, out: y, act: |_: usize, product: [f32; B], y: &mut [f32; B]| *y = product });
    }

    /// `y += (A + γC) x`.
    pub fn add(&self, gamma: f32, x: &[[f32; B]], y: &mut [[f32; B]]) {
        let act = |_: usize, product: [f32; B], y: &mut [f32; B]| (0..B).for_each(|i| y[i] += product[i]);
        self.pass(Each { gamma, x, out: y, act });
    }

    /// `y = r − (A + γC) x`.
    pub fn rest(&self, gamma: f32, x: &[[f32; B]], r: &[[f32; B]], y: &mut [[f32; B]]) {
        let act =
            |row: usize, product: [f32; B], y: &mut [f32; B]| *y = std::array::from_fn(|i| r[row][i] - product[i]);
        self.pass(Each { gamma, x, out: y, act });
    }

    /// A step of a smoother: `change ← keep · change + add(row) · (r − (A + γC) x)` and `y = x + change`.
    pub fn step(
        &self,
        (gamma, keep): (f32, f32),
        add: impl Fn(usize) -> f32 + Sync,
        (x, r): (&[[f32; B]], &[[f32; B]]),
        out: (&mut [[f32; B]], &mut [[f32; B]]),
    ) {
        let act = |row: usize, product: [f32; B], change: &mut [f32; B], y: &mut [f32; B]| {
            let add = add(row);
            for i in 0..B {
                // What is not kept may never have been written.
                let kept = if keep == 0.0 { 0.0 } else { keep * change[i] };
                change[i] = kept + add * (r[row][i] - product[i]);
                y[i] = x[row][i] + change[i];
            }
        };
        self.pass(Both { gamma, x, out, act });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    /// Rows with themselves, the next and one further on, and blocks of either kind.
    fn matrix(n: usize, turns: bool, seed: u64) -> BlockMatrix<2> {
        BlockMatrix::from_rows(n, n, |row, entries| {
            let mut random = SplitMix64::new(seed + row as u64);
            let mut columns = [row, (row + 1) % n, (row * 7 + 3) % n].map(|c| c as u32);
            columns.sort_unstable();
            for (k, column) in columns.into_iter().enumerate() {
                if k == 0 || columns[k - 1] != column {
                    let [a, b, c, d] = [(); 4].map(|()| random.signed_unit());
                    entries.push((column, if turns { [[a, -b], [b, a]] } else { [[a, b], [c, d]] }));
                }
            }
        })
    }

    #[test]
    fn products_of_either_kind_are_those_of_the_matrix() {
        let n = 5000;
        let mut random = SplitMix64::new(1);
        let x: Vector<2> = (0..n).map(|_| [0; 2].map(|_| random.signed_unit() as f32)).collect();
        let wide: Vec<f64> = x.as_flattened().iter().map(|&x| f64::from(x)).collect();
        let close = |own: &[[f32; 2]], expected: &[f64]| {
            own.as_flattened().iter().zip(expected).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5)
        };
        for turns in [false, true] {
            let (a, c) = (matrix(n, turns, 3), matrix(n, turns, 90));
            let sum = SumRows::with(&a, &c);
            assert_eq!(matches!(sum.first, Blocks::Turns(_)), turns);
            let expected: Vec<f64> =
                a.multiply(&wide).iter().zip(c.multiply(&wide)).map(|(a, c)| a + 0.5 * c).collect();
            let mut y = vec![[f32::NAN; 2]; n];
            sum.multiply(0.5, &x, &mut y);
            assert!(close(&y, &expected));
            let mut rest = vec![[f32::NAN; 2]; n];
            sum.rest(0.5, &x, &y, &mut rest);
            assert!(close(&rest, &vec![0.0; 2 * n]));
            let (mut change, mut next) = (vec![[f32::NAN; 2]; n], vec![[f32::NAN; 2]; n]);
            sum.step((0.5, 0.0), |_| -2.0, (&x, &rest), (&mut change, &mut next));
            let doubled: Vec<f64> = expected.iter().map(|x| 2.0 * x).collect();
            assert!(close(&change, &doubled));
            let moved: Vec<f64> = doubled.iter().zip(&wide).map(|(d, x)| d + x).collect();
            assert!(close(&next, &moved));
            let mixed = SumRows::with(&a, &matrix(n, !turns, 4));
            assert!(matches!(mixed.first, Blocks::Full(_)));
            let held = SumRows::with_masses(&a, vec![3.0; n]);
            held.multiply(2.0, &x, &mut y);
            let expected: Vec<f64> = a.multiply(&wide).iter().zip(&wide).map(|(a, x)| a + 6.0 * x).collect();
            assert!(close(&y, &expected));
            SumRows::of(&a).add(0.0, &x, &mut y);
            let expected: Vec<f64> = a.multiply(&wide).iter().zip(&wide).map(|(a, x)| 2.0 * a + 6.0 * x).collect();
            assert!(close(&y, &expected));
        }
    }
}
