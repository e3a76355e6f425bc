//! Pairs without a start: block Lanczos on the inverse at one shift in the middle of what is wanted.
//!
//! A step of subspace iteration takes a solve for every column, and divides errors by a constant. A Krylov space of
//! narrow blocks grows by powers of the operator instead: with eight columns in a block, about two columns for each
//! wanted pair hold all of them to nine digits (Grimes, Lewis and Simon 1994). Only where a good start and a single
//! step are enough, as on large meshes at loose tolerances, is a hierarchy cheaper.
//!
//! The operator is `T = (S − μM)⁻¹M`, self-adjoint for the inner product of the mass. Its eigenvalues are
//! `ν = 1 / (λ − μ)`: those below the shift are negative, and the count at `μ` says how many. Blocks are made
//! orthogonal to all before them.

use chladni_algebra::{
    DenseMatrix, Factor, KRYLOV_WIDTH, KrylovRow, KrylovSquare, PANEL_WIDTH, PanelMatrix, SolveScratch, SolveTree,
    SymbolicFactor, append_blocks, basis_products, block_gram, block_products, block_times_square, lowest_symmetric,
    mass_times_block, rotate_and_spare, subtract_blocks, subtract_from_blocks,
};
use chladni_base::{Monitor, Quiet, SplitMix64};

use super::HsimError;
use super::kernel::Kernel;
pub(super) use super::krylov_request::{KrylovRequest, Leave};
use super::level::Level;
use super::scout::Scout;
use super::tuning::TUNING;

/// What was found.
#[derive(Debug)]
pub(super) struct KrylovPairs {
    /// Ritz values beside the kernel from the first wanted one on, ascending.
    pub values: Vec<f64>,
    /// Their vectors, orthonormal up to rounding.
    pub vectors: PanelMatrix,
    /// How many of those that are wanted have not converged.
    pub left: usize,
}

/// The shift of the inverse.
pub(super) struct Shift<'a> {
    pub at: f64,
    pub factor: Factor<'a>,
    /// Eigenvalues below it that are not those of the kernel.
    pub below: usize,
}

/// Operations of a look for each cube of a column; of a block for each row, for each column of the space and for the
/// solve.
const LOOK: f64 = 12.0;
const GROWTH: (f64, f64) = (32.0, 60.0);

/// So many columns are what is told of as one look.
const ONE_LOOK: usize = TUNING.krylov.most_between_looks * KRYLOV_WIDTH;

/// A column of a block of which less than this share of the operator's size is left depends on the columns before it.
const SPENT: f64 = 1e-13;

/// A block is orthonormal to rounding if it was to this before it was made so.
const ORTHONORMAL: f64 = 1e-6;
const MOST_TIMES: usize = 3;

/// A block that waits has products `c` with others that have grown from rounding errors by a factor `g`, the largest
/// eigenvalue of the operator over the size of the block, so that `c` is `g ε`. Small matrices are off by `c² g` times
/// that size, which is `c³ / ε`: this times the residual that is asked for is the largest `c³` (decision 0139).
const LOSS: f64 = 0.1 * f64::EPSILON;

/// Products of columns that are less than this are as good as rounding errors.
const NOTHING: f64 = 1e-15;

/// Columns of a space from a shift among clusters, where few pairs are wanted, and the most numbers in them: 128 MB,
/// which every promise has room for.
const FOR_CLUSTERS: usize = 400;
pub(super) const NUMBERS_FOR_CLUSTERS: usize = 16 << 20;

/// Residuals of eigenvalues below this share of the shift are taken relative to that.
const LEAST: f64 = 5e-3;

/// Whether so many pairs of a level of a size, with such residuals, are had for less in a Krylov space than from a
/// hierarchy.
pub(super) fn is_cheaper(size: usize, pairs: usize, tolerance: f64) -> bool {
    (tolerance <= TUNING.krylov.loose || size <= TUNING.krylov.large) && has_room(size, pairs, tolerance)
}

/// Whether a level of a size has room for the space.
pub(super) fn has_room(size: usize, pairs: usize, tolerance: f64) -> bool {
    TUNING.krylov.largest_share * first_look(pairs, tolerance) <= size
}

/// The columns that the space has when convergence is looked at first.
fn first_look(pairs: usize, tolerance: f64) -> usize {
    let (columns, more, beside) = TUNING.krylov.first_look;
    let digits = -tolerance.log10().clamp(-12.0, -1.0);
    (((columns + more * digits) * pairs as f64) as usize + beside).next_multiple_of(KRYLOV_WIDTH)
}

/// How many blocks a space of so many columns takes up before it is looked at again: a look is a dense eigenproblem,
/// next to nothing beside a block of a large level, and worth several of a small one.
fn blocks_between_looks(size: usize, columns: usize) -> usize {
    let (size, columns) = (size as f64, columns as f64);
    let blocks = 2.0 * LOOK * columns.powi(3) / (GROWTH.0 * size * (columns + GROWTH.1));
    (blocks.ceil() as usize).clamp(1, TUNING.krylov.most_between_looks)
}

/// The most columns of a space for so many pairs of a level of a size: no more memory than an iteration takes.
pub(super) fn most(size: usize, pairs: usize) -> usize {
    let (for_two, beside) = TUNING.krylov.most;
    (for_two * pairs / 2 + beside).min(size / TUNING.krylov.largest_share)
}

/// The same where memory is scarce. More columns are rarely needed.
pub(super) fn most_sparing(size: usize, pairs: usize, tolerance: f64) -> usize {
    let (for_hundred, beside) = TUNING.krylov.most_sparing;
    (first_look(pairs, tolerance) + for_hundred * pairs / 100 + beside).min(size / TUNING.krylov.largest_share)
}

/// As [`pairs`] with a shift that counts find; nothing where they find none, or the space breaks down or does not hold
/// what is wanted.
pub(super) fn start(
    level: &Level,
    symbolic: &SymbolicFactor,
    kernel: &Kernel<'_>,
    wanted: KrylovRequest,
    monitor: &dyn Monitor,
) -> Result<Option<KrylovPairs>, HsimError> {
    let of = (wanted.pairs, kernel.dimension());
    let mut scout = Scout::new(level, symbolic, monitor);
    let Some(shift) = scout.middle(of, wanted.least_shift, monitor)? else { return Ok(None) };
    let found = pairs_or_none(level, symbolic, kernel, &shift, wanted, monitor)?;
    if found.is_some() {
        return Ok(found);
    }
    scout.keep_storage(shift.factor);
    let Some(shift) = scout.strict_middle(of, wanted.least_shift, monitor)? else { return Ok(None) };
    // Clusters have to be gone through before what lies far below them shows.
    let wanted = KrylovRequest { most: wanted.most.max(for_clusters(level.size())), ..wanted };
    pairs_or_none(level, symbolic, kernel, &shift, wanted, monitor)
}

/// The columns of a space from a shift among clusters, of a level of a size.
pub(super) fn for_clusters(size: usize) -> usize {
    FOR_CLUSTERS.min(NUMBERS_FOR_CLUSTERS / size).min(size / TUNING.krylov.largest_share)
}

/// As [`pairs`]; nothing where the space breaks down: another start may serve.
pub(super) fn pairs_or_none(
    level: &Level,
    symbolic: &SymbolicFactor,
    kernel: &Kernel<'_>,
    shift: &Shift<'_>,
    wanted: KrylovRequest,
    monitor: &dyn Monitor,
) -> Result<Option<KrylovPairs>, HsimError> {
    match pairs(level, symbolic, kernel, shift, wanted, &mut Vec::new(), monitor) {
        Err(HsimError::Numerical(_)) => Ok(None),
        found => found,
    }
}

/// Ritz pairs beside the kernel from one factor, with a shift among them. Those that are wanted have converged, or all
/// but a few; nothing where more have not, as where an eigenvalue has far more eigenvectors than a block has columns.
/// `memory` of panels is used and given back.
pub(super) fn pairs(
    level: &Level,
    symbolic: &SymbolicFactor,
    kernel: &Kernel<'_>,
    shift: &Shift<'_>,
    wanted: KrylovRequest,
    memory: &mut Vec<Vec<f64>>,
    monitor: &dyn Monitor,
) -> Result<Option<KrylovPairs>, HsimError> {
    let mut space = Space::new(level, symbolic, kernel, shift, wanted, std::mem::take(memory), monitor)?;
    let most = wanted.most;
    let latest = first_look(wanted.pairs, wanted.tolerance);
    let between = KRYLOV_WIDTH * blocks_between_looks(level.size(), latest);
    let first = (latest + between - ONE_LOOK).min(most);
    let mut look = first;
    loop {
        while space.columns() < look {
            let (done, n) = (space.columns(), level.size());
            monitor.checkpoint()?;
            monitor.detail(&format!("dimension {n}, Krylov space of {done} columns, to be checked at {look}"));
            monitor.progress(done as f64 / look as f64);
            space.grow()?;
        }
        let ritz = space.ritz()?;
        let chosen = ritz.from(wanted.from, shift, wanted.columns);
        let pending = chosen
            .iter()
            .take(wanted.pairs)
            .filter(|&&k| !(ritz.residuals[k] <= TUNING.krylov.safe * wanted.tolerance));
        // Of the pairs below the shift all are known to be there, if the space reaches that far down.
        let down =
            if wanted.from == 0 { ritz.below() == shift.below } else { ritz.below() + wanted.from >= shift.below };
        let complete = down && chosen.len() >= wanted.pairs;
        match pending.count() {
            left if complete && left <= wanted.leave.most(wanted.pairs, look == most, (look - first) / ONE_LOOK) => {
                return Ok(Some(KrylovPairs { left, ..space.vectors(&ritz, &chosen, memory)? }));
            }
            _ if look == most => return Ok(None),
            _ => look = (look + between).min(most),
        }
    }
}

/// A Krylov space with the operator in it, which is block tridiagonal.
struct Space<'a> {
    level: &'a Level,
    kernel: &'a Kernel<'a>,
    shift: &'a Shift<'a>,
    tree: SolveTree<'a>,
    monitor: &'a dyn Monitor,
    random: SplitMix64,
    /// The first blocks, orthonormal for the mass.
    basis: PanelMatrix,
    /// The blocks after those of the basis, fewer than make up a panel, and one.
    open: Vec<Block>,
    /// The block that comes next.
    next: Block,
    /// The products of the operator with each block and the block itself.
    diagonal: Vec<KrylovSquare>,
    /// What the product with each block has of the next one.
    beside: Vec<KrylovSquare>,
    /// Memory that is used again: fresh memory costs as much as what is done with it.
    image: Block,
    inertia: Block,
    scratch: SolveScratch,
    memory: Vec<Vec<f64>>,
    /// No columns.
    nothing: PanelMatrix,
    zeros: Option<usize>,
    /// Whether every other block may wait for the one after it before it is made orthogonal to all.
    in_twos: bool,
    /// The largest product with other blocks that one may come to have while it waits.
    largest_loss: f64,
    /// Whether the next block is orthogonal to those of the last panel only, up to what rounding errors have grown to.
    is_loose: bool,
}

type Block = Vec<KrylovRow>;

/// Blocks that make up a panel of the basis.
const BLOCKS: usize = PANEL_WIDTH / KRYLOV_WIDTH;

impl<'a> Space<'a> {
    fn new(
        level: &'a Level,
        symbolic: &'a SymbolicFactor,
        kernel: &'a Kernel<'a>,
        shift: &'a Shift<'a>,
        wanted: KrylovRequest,
        memory: Vec<Vec<f64>>,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, HsimError> {
        let mut space = Self {
            level,
            kernel,
            shift,
            tree: SolveTree::new(symbolic),
            monitor,
            random: SplitMix64::new(wanted.seed ^ 0x1a5c_2053),
            basis: PanelMatrix::zeros(level.size(), 0),
            open: Vec::new(),
            next: Vec::new(),
            diagonal: Vec::new(),
            beside: Vec::new(),
            image: Vec::new(),
            inertia: Vec::new(),
            scratch: SolveScratch::default(),
            memory,
            nothing: PanelMatrix::zeros(level.size(), 0),
            zeros: wanted.zeros,
            in_twos: true,
            largest_loss: (LOSS * wanted.tolerance).cbrt(),
            is_loose: false,
        };
        // Random vectors hold every frequency alike; solves leave those that are near.
        let mut block = space.random_block();
        for _ in 0..2 {
            block = space.product(&block);
            space.orthonormalise(&mut block, &mut Vec::new(), 0.0)?;
        }
        space.next = block;
        Ok(space)
    }

    fn columns(&self) -> usize {
        self.basis.columns() + KRYLOV_WIDTH * self.open.len()
    }

    fn random_block(&mut self) -> Block {
        let mut block: Block =
            (0..self.level.size()).map(|_| std::array::from_fn(|_| self.random.signed_unit())).collect();
        self.kernel.remove_from_rows(&mut block);
        block
    }

    /// `(S − μM)⁻¹M` times a block, orthogonal to the kernel.
    fn product(&mut self, block: &[KrylovRow]) -> Block {
        let mut product = std::mem::take(&mut self.image);
        mass_times_block(&self.level.mass, block, &mut product);
        self.tree.solve(&self.shift.factor, &mut product, &mut self.scratch);
        self.kernel.remove_from_rows(&mut product);
        product
    }

    /// Takes the next block into the space and makes the one after it; or leaves it where it was to be taken up anew.
    fn grow(&mut self) -> Result<(), HsimError> {
        if self.open.len() > BLOCKS {
            append_blocks(&mut self.basis, &self.open[..BLOCKS], &mut self.memory);
            self.image = self.open.drain(..BLOCKS).next().unwrap_or_default();
        }
        let mut last = std::mem::take(&mut self.next);
        let mut image = self.product(&last);
        // What is known to be there first, so that the products with all blocks are of what is left.
        let mut inertia = std::mem::take(&mut self.inertia);
        mass_times_block(&self.level.mass, &last, &mut inertia);
        let diagonal = symmetric(&block_products(&inertia, &image));
        let size = largest(&diagonal).max(self.beside.last().map_or(0.0, largest));
        let before = self.open.last().zip(self.beside.last()).map(|(block, beside)| (&block[..], transposed(beside)));
        subtract_blocks(&mut image, &before.into_iter().chain([(&last[..], diagonal)]).collect::<Vec<_>>());
        if self.is_loose && self.project_both(&mut image, &mut last, &mut inertia)? > self.largest_loss {
            // It is taken up anew, as it has become.
            (self.in_twos, self.is_loose) = (false, false);
            (self.next, self.image, self.inertia) = (last, image, inertia);
            return Ok(());
        }
        self.diagonal.push(diagonal);
        self.open.push(last);
        if self.in_twos && !self.is_loose {
            self.project_from(&self.nothing, &mut image, &mut inertia)?;
        } else if !self.in_twos {
            self.project(&mut image, &mut inertia)?;
        }
        self.is_loose = self.in_twos && !self.is_loose;
        let beside = self.orthonormalise(&mut image, &mut inertia, size)?;
        self.inertia = inertia;
        self.beside.push(beside);
        self.next = image;
        Ok(())
    }

    /// Takes off a block what it has of the space.
    fn project(&self, block: &mut Block, inertia: &mut Block) -> Result<(), HsimError> {
        self.project_from(&self.basis, block, inertia)
    }

    /// The same with another basis before the open blocks.
    fn project_from(&self, basis: &PanelMatrix, block: &mut Block, inertia: &mut Block) -> Result<(), HsimError> {
        mass_times_block(&self.level.mass, block, inertia);
        let space = (basis, &self.open[..]);
        let products = basis_products(space, [inertia], self.monitor)?;
        subtract_from_blocks([block], space, &products, self.monitor)?;
        Ok(())
    }

    /// Takes off a block and the one before it, which is not in the space yet, what they have of all others, and reads
    /// the basis once for both. Gives the largest product that the one before had with any.
    fn project_both(&mut self, block: &mut Block, last: &mut Block, inertia: &mut Block) -> Result<f64, HsimError> {
        let mass = &self.level.mass;
        mass_times_block(mass, block, inertia);
        mass_times_block(mass, last, &mut self.image);
        let space = (&self.basis, &self.open[..]);
        let products = basis_products(space, [inertia, &self.image], self.monitor)?;
        subtract_from_blocks([block, last], space, &products, self.monitor)?;
        let loss = products[1].iter().flatten().fold(0f64, |most, x| most.max(x.abs()));
        mass_times_block(mass, last, inertia);
        let products = block_products(inertia, block);
        subtract_blocks(block, &[(last, products)]);
        Ok(loss)
    }

    /// Makes a block that is orthogonal to the space orthonormal; gives `R` with the block as it was equal to the new
    /// one times `R`. Columns that depend on others, next to the size of the operator, are replaced by random ones.
    fn orthonormalise(&mut self, block: &mut Block, scratch: &mut Block, size: f64) -> Result<KrylovSquare, HsimError> {
        let mass = &self.level.mass;
        let (first, spent) = cholesky(&block_gram(mass, block, scratch), SPENT * size);
        block_times_square(block, &inverse(&first, &spent));
        if spent.contains(&true) {
            let random = self.random_block();
            let mut fresh = self.product(&random);
            for _ in 0..2 {
                let gram = block_gram(mass, &fresh, scratch);
                scale(&mut fresh, &gram);
                self.project(&mut fresh, scratch)?;
            }
            for (row, fresh) in block.iter_mut().zip(&fresh) {
                (0..KRYLOV_WIDTH).filter(|&k| spent[k]).for_each(|k| row[k] = fresh[k]);
            }
        }
        // Until it is orthonormal: each time loses digits where columns are nearly dependent.
        let mut whole = first;
        for _ in 0..MOST_TIMES {
            let gram = block_gram(mass, block, scratch);
            let (again, lost) = cholesky(&gram, 0.0);
            if lost.contains(&true) {
                return Err(HsimError::Numerical("the columns of a Krylov block are linearly dependent".to_owned()));
            }
            block_times_square(block, &inverse(&again, &lost));
            whole = times(&again, &whole);
            if defect(&gram) < ORTHONORMAL {
                break;
            }
        }
        Ok(whole)
    }

    /// The Ritz pairs of the operator.
    fn ritz(&self) -> Result<Ritz, HsimError> {
        let m = self.columns();
        let mut matrix = DenseMatrix::zeros(m, m);
        for (block, diagonal) in self.diagonal.iter().enumerate() {
            let start = block * KRYLOV_WIDTH;
            for j in 0..KRYLOV_WIDTH {
                for k in 0..KRYLOV_WIDTH {
                    matrix.column_mut(start + k)[start + j] = diagonal[j][k];
                }
            }
        }
        for (block, beside) in self.beside.iter().enumerate().take(self.diagonal.len() - 1) {
            let start = block * KRYLOV_WIDTH;
            for j in 0..KRYLOV_WIDTH {
                for k in 0..KRYLOV_WIDTH {
                    matrix.column_mut(start + k)[start + KRYLOV_WIDTH + j] = beside[j][k];
                    matrix.column_mut(start + KRYLOV_WIDTH + j)[start + k] = beside[j][k];
                }
            }
        }
        let pairs = lowest_symmetric(matrix, m, &Quiet(self.monitor))?;
        // What the operator makes of a Ritz vector beside the space, in terms of the next block.
        let beside = self.beside.last().copied().unwrap_or_default();
        let rest = |k: usize| -> KrylovRow {
            let end = &pairs.vectors.column(k)[m - KRYLOV_WIDTH..];
            std::array::from_fn(|j| (0..KRYLOV_WIDTH).map(|i| beside[j][i] * end[i]).sum())
        };
        let rests: Vec<KrylovRow> = (0..m).map(rest).collect();
        // After one more application `S x − λ M x` is `M` times the rest over `ν²`; and `S x` is about `λ` times a
        // vector of the mean mass.
        let mut inertia = Vec::new();
        mass_times_block(&self.level.mass, &self.next, &mut inertia);
        let squares = block_products(&inertia, &inertia);
        let mass = self.level.mass.lumped();
        let mean = mass.iter().map(|m| m * m).sum::<f64>() / mass.iter().sum::<f64>();
        let unit = self.lowest_above_zeros(&pairs.values);
        let residual = |(rest, &nu): (&KrylovRow, &f64)| {
            let square: f64 = (0..KRYLOV_WIDTH)
                .map(|j| rest[j] * (0..KRYLOV_WIDTH).map(|k| squares[j][k] * rest[k]).sum::<f64>())
                .sum();
            let value = self.shift.at + nu.recip();
            let value = unit.map_or_else(|| value.abs().max(LEAST * self.shift.at.abs()), |unit| value.abs() + unit);
            (square.max(0.0) / mean).sqrt() / (nu * nu * value)
        };
        let residuals = rests.iter().zip(&pairs.values).map(residual).collect();
        Ok(Ritz { operator: pairs.values, vectors: pairs.vectors, rests, residuals })
    }

    /// The lowest value above those that are zero, where some are known to be.
    fn lowest_above_zeros(&self, operator: &[f64]) -> Option<f64> {
        let below = operator.partition_point(|&nu| nu < 0.0);
        let nu = operator.get(below.checked_sub(self.zeros? + 1)?)?;
        Some((self.shift.at + nu.recip()).abs())
    }

    /// Some Ritz pairs, after one application of the operator more, which is known already: it takes off what they have
    /// of stiff directions.
    ///
    /// It is orthogonal to the space: what becomes of a Ritz vector `x` is `y = T x / ν = x + Q f`, with the next block
    /// `Q`. So `YᵀMY = I + FᵀF`, and from `(S − μM) T = M` follows `Yᵀ(S − μM)Y = diag(1 / ν)`: the Ritz pairs of their
    /// span are those of a small pencil.
    fn vectors(mut self, ritz: &Ritz, chosen: &[usize], memory: &mut Vec<Vec<f64>>) -> Result<KrylovPairs, HsimError> {
        let (m, q) = (self.columns(), chosen.len());
        let mut coefficients = DenseMatrix::zeros(m + KRYLOV_WIDTH, q);
        let mut rests = DenseMatrix::zeros(KRYLOV_WIDTH, q);
        let mut most = 0f64;
        for (to, &from) in chosen.iter().enumerate() {
            let (column, nu) = (coefficients.column_mut(to), ritz.operator[from]);
            column[..m].copy_from_slice(ritz.vectors.column(from));
            let rest = ritz.rests[from].map(|rest| rest / nu);
            column[m..].copy_from_slice(&rest);
            rests.column_mut(to).copy_from_slice(&rest);
            most = most.max(rest.iter().map(|x| x * x).sum());
        }
        let mut values: Vec<f64> = chosen.iter().map(|&k| ritz.operator[k].recip()).collect();
        if most > NOTHING {
            let (mut shifted, mut gram) = (DenseMatrix::zeros(q, q), rests.transposed_times(&rests));
            for (k, value) in values.iter().enumerate() {
                shifted.column_mut(k)[k] = *value;
                gram.column_mut(k)[k] += 1.0;
            }
            let rotation;
            (values, rotation) = super::ritz::ritz(shifted, gram, q, self.monitor)?;
            coefficients = coefficients.times(&rotation);
        }
        values.iter_mut().for_each(|value| *value += self.shift.at);
        self.open.push(self.next);
        self.open.chunks(BLOCKS).for_each(|blocks| append_blocks(&mut self.basis, blocks, &mut self.memory));
        drop(self.open);
        self.memory.extend(rotate_and_spare(&mut self.basis, &coefficients, self.monitor)?);
        *memory = self.memory;
        Ok(KrylovPairs { values, vectors: self.basis, left: 0 })
    }
}

/// Ritz pairs of the operator in a space.
struct Ritz {
    /// The eigenvalues `ν`, ascending.
    operator: Vec<f64>,
    /// In terms of the basis.
    vectors: DenseMatrix,
    /// What the operator makes of each beside the space, in terms of the next block.
    rests: Vec<KrylovRow>,
    /// About the residuals (4.6) of the pencil.
    residuals: Vec<f64>,
}

impl Ritz {
    /// How many lie below the shift.
    fn below(&self) -> usize {
        self.operator.partition_point(|&nu| nu < 0.0)
    }

    /// By ascending eigenvalue of the pencil from an index on, which lies below the shift: those below it, by
    /// descending `ν`, then those above by descending `ν` again.
    fn from(&self, first: usize, shift: &Shift<'_>, columns: usize) -> Vec<usize> {
        let below = self.below();
        // Of the negative ones, the smallest are no eigenvalues yet, where more are there than lie below.
        let down = below.min(shift.below - first);
        (0..down).rev().chain((below..self.operator.len()).rev()).take(columns).collect()
    }
}

/// The upper triangular `R` with `RᵀR = G`; the rows of columns of which at most `least` is left after those before are
/// zero, and these are named.
fn cholesky(gram: &KrylovSquare, least: f64) -> (KrylovSquare, [bool; KRYLOV_WIDTH]) {
    let (mut r, mut spent) = ([[0.0; KRYLOV_WIDTH]; KRYLOV_WIDTH], [false; KRYLOV_WIDTH]);
    for k in 0..KRYLOV_WIDTH {
        let square = gram[k][k] - (0..k).map(|i| r[i][k] * r[i][k]).sum::<f64>();
        // Less than rounding errors of the difference are nothing.
        if !(square > least * least && square > CANCELLED * gram[k][k]) {
            spent[k] = true;
            continue;
        }
        r[k][k] = square.sqrt();
        for j in k + 1..KRYLOV_WIDTH {
            let sum: f64 = (0..k).map(|i| r[i][k] * r[i][j]).sum();
            r[k][j] = (0.5 * (gram[k][j] + gram[j][k]) - sum) / r[k][k];
        }
    }
    (r, spent)
}

/// A difference of squares that is a smaller share of them is for the most part rounding.
const CANCELLED: f64 = 1e-14;

/// `R⁻¹`, with the columns of spent ones zero.
fn inverse(r: &KrylovSquare, spent: &[bool; KRYLOV_WIDTH]) -> KrylovSquare {
    let mut inverse = [[0.0; KRYLOV_WIDTH]; KRYLOV_WIDTH];
    for k in (0..KRYLOV_WIDTH).filter(|&k| !spent[k]) {
        inverse[k][k] = r[k][k].recip();
        for i in (0..k).rev().filter(|&i| !spent[i]) {
            let sum: f64 = (i + 1..=k).map(|j| r[i][j] * inverse[j][k]).sum();
            inverse[i][k] = -sum / r[i][i];
        }
    }
    inverse
}

/// Brings every column to unit length, by the products of the block with itself.
fn scale(block: &mut [KrylovRow], gram: &KrylovSquare) {
    let factors: KrylovRow = std::array::from_fn(|k| if gram[k][k] > 0.0 { gram[k][k].sqrt().recip() } else { 0.0 });
    block.iter_mut().for_each(|row| row.iter_mut().zip(&factors).for_each(|(x, factor)| *x *= factor));
}

fn transposed(a: &KrylovSquare) -> KrylovSquare {
    std::array::from_fn(|j| std::array::from_fn(|k| a[k][j]))
}

fn symmetric(a: &KrylovSquare) -> KrylovSquare {
    std::array::from_fn(|j| std::array::from_fn(|k| 0.5 * (a[j][k] + a[k][j])))
}

fn times(a: &KrylovSquare, b: &KrylovSquare) -> KrylovSquare {
    std::array::from_fn(|j| std::array::from_fn(|k| (0..KRYLOV_WIDTH).map(|i| a[j][i] * b[i][k]).sum()))
}

/// The largest entry of `|A − I|`.
fn defect(a: &KrylovSquare) -> f64 {
    let entry = |j: usize, k: usize| (a[j][k] - f64::from(u8::from(j == k))).abs();
    (0..KRYLOV_WIDTH).flat_map(|j| (0..KRYLOV_WIDTH).map(move |k| entry(j, k))).fold(0.0, f64::max)
}

fn largest(a: &KrylovSquare) -> f64 {
    a.iter().flatten().fold(0.0, |most, x| x.abs().max(most))
}

#[cfg(test)]
#[path = "lanczos_tests.rs"]
mod tests;
