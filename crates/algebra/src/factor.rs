//! Sparse symmetric indefinite factorisation of a shifted pencil, `A − μB = L D Lᵀ`, with its inertia.

use std::sync::OnceLock;

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMatRef};
use faer::{MatRef, Side};

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, Unwatched};

use super::factor_symbolic::{Lower, NOWHERE, supernodes};
use super::multifrontal::{self, Plan};
use super::{MassMatrix, SparseMatrix, WeightedMass};

/// Why a matrix was not factored.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// The matrices are not square or not of one size.
    #[error("a {rows}×{columns} matrix and a mass of size {mass} do not form a pencil")]
    Shape {
        /// Rows of the matrix.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// The size of the mass matrix.
        mass: usize,
    },
    /// There are more entries than the ordering can count.
    #[error("{entries} entries are too many to be ordered")]
    TooLarge {
        /// Entries of the matrix.
        entries: usize,
    },
    /// No order was found.
    #[error("no fill-reducing order: {reason}")]
    Ordering {
        /// What the ordering said.
        reason: String,
    },
    /// There is not enough memory.
    #[error("could not allocate {bytes} bytes for a factorisation")]
    Memory {
        /// About how much was needed.
        bytes: usize,
    },
    /// The factors fill in more than was promised for all of the work.
    #[error(
        "factors of {entries} entries need about {bytes} bytes of memory, and the work was promised {promised}: the mesh fills in more than \
         surfaces do"
    )]
    Promise {
        /// Entries of one factor.
        entries: usize,
        /// About how much is needed.
        bytes: u64,
        /// What was promised.
        promised: u64,
    },
    /// The shifted matrix is singular, as far as rounding lets one tell: the shift lies on an eigenvalue.
    #[error("the matrix is singular at pivot {pivot}")]
    Singular {
        /// The first pivot that is zero or not finite.
        pivot: usize,
    },
    /// The monitor asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// One supernode: columns with the same pattern below.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Node {
    /// The first column.
    pub start: usize,
    /// The number of columns.
    pub columns: usize,
    /// Where its rows below begin in `patterns`, and how many they are.
    pub pattern: (usize, usize),
    /// Where its values begin: `(columns + rows below) × columns`, column after column.
    pub values: usize,
}

/// The structure of the factors of `A − μB` for every `μ`; the matrices are already in a fill-reducing order.
pub struct SymbolicFactor {
    pub(super) lower: Lower,
    pub(super) nodes: Vec<Node>,
    pub(super) patterns: Vec<u32>,
    entries: usize,
    /// How the factor is computed by fronts, where that takes little memory.
    pub(super) plan: Option<Plan>,
    /// The same structure as faer has it, which exchanges rows where that is needed.
    other: OnceLock<SymbolicCholesky<usize>>,
    /// How many entries each row of `L` has, once that was asked.
    pub(super) terms: OnceLock<Vec<u32>>,
}

impl std::fmt::Debug for SymbolicFactor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SymbolicFactor").field("size", &self.size()).field("entries", &self.entries()).finish()
    }
}

impl SymbolicFactor {
    /// Analyses the pencil `(a, b)`, both symmetric with both triangles stored.
    ///
    /// # Errors
    /// [`FactorError`]: sizes that do not fit, or no memory.
    pub fn new(a: &SparseMatrix, b: &MassMatrix) -> Result<Self, FactorError> {
        let n = a.rows();
        if a.columns() != n || b.size() != n {
            return Err(FactorError::Shape { rows: n, columns: a.columns(), mass: b.size() });
        }
        if u32::try_from(a.entries()).is_err() {
            return Err(FactorError::TooLarge { entries: a.entries() });
        }
        let lower = Lower::new(a, b)?;
        let other = OnceLock::new();
        let (nodes, patterns) = match supernodes(&lower) {
            Some(found) => found,
            None => {
                let analysed = analysed(&lower)?;
                supernodes_of(other.get_or_init(|| analysed))
            }
        };
        let entries = nodes.iter().map(|node| node.columns * (node.columns + node.pattern.1)).sum();
        let plan = Plan::new(&nodes, &patterns).filter(|plan| plan.held <= entries as u64);
        Ok(Self { lower, nodes, patterns, entries, plan, other, terms: OnceLock::new() })
    }

    /// The same where `factors` of them at once, by their own count, take no more memory than `monitor` promises for
    /// all of the work. Estimates beforehand know the size of a mesh and not how it is connected: triangles at random
    /// fill in twenty times as much as a surface.
    ///
    /// # Errors
    /// [`FactorError::Promise`].
    pub fn within(self, factors: usize, monitor: &dyn Monitor) -> Result<Self, FactorError> {
        let entries = self.entries();
        // Eight bytes for the entry, two for its place in the pattern; and what the fronts of one factor hold while it
        // is computed.
        let held = self.plan.as_ref().map_or(0, |plan| 8 * plan.held);
        let bytes = (10 * entries as u64).saturating_mul(factors as u64).saturating_add(held);
        match monitor.promised_bytes() {
            Some(promised) if bytes > promised => Err(FactorError::Promise { entries, bytes, promised }),
            _ => Ok(self),
        }
    }

    /// The size `n` of the matrix.
    pub fn size(&self) -> usize {
        self.lower.offsets.len() - 1
    }

    /// The entries of `L`, explicit zeros in supernodes included; eight bytes each is the memory of a factor.
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// About the multiplications that its numbers take, each with an addition.
    pub fn operations(&self) -> f64 {
        let cube = |x: usize| (x as f64).powi(3);
        self.nodes.iter().map(|node| (cube(node.columns + node.pattern.1) - cube(node.pattern.1)) / 6.0).sum()
    }

    /// Factors `a − shift · b`. Without pivoting first, and where that lets the factors grow, with Bunch–Kaufman
    /// pivoting inside supernodes.
    ///
    /// # Errors
    /// [`FactorError::Singular`] where the shift lies on an eigenvalue, [`FactorError::Memory`].
    pub fn factor(&self, a: &SparseMatrix, b: &MassMatrix, shift: f64) -> Result<Factor<'_>, FactorError> {
        self.factor_in(a, b, shift, Vec::new())
    }

    /// The same in the [storage](Factor::into_storage) of a factor that is no longer needed: fresh memory costs a third
    /// of the time.
    ///
    /// # Errors
    /// As for [`factor`](Self::factor).
    pub fn factor_in(
        &self,
        a: &SparseMatrix,
        b: &MassMatrix,
        shift: f64,
        storage: Vec<f64>,
    ) -> Result<Factor<'_>, FactorError> {
        self.factor_watched(a, b, shift, storage, &Unwatched)
    }

    /// The same, given up within a supernode where the monitor asks for it, unless pivots are needed.
    ///
    /// # Errors
    /// As for [`factor`](Self::factor), and [`FactorError::Cancelled`].
    pub fn factor_watched(
        &self,
        a: &SparseMatrix,
        b: &MassMatrix,
        shift: f64,
        storage: Vec<f64>,
        monitor: &dyn Monitor,
    ) -> Result<Factor<'_>, FactorError> {
        // Room for a factor is cleared before anything else is asked.
        monitor.checkpoint()?;
        let (shifted, largest) = self.shifted(a, b, shift);
        let plain = match &self.plan {
            Some(plan) => self.by_fronts(plan, &shifted, largest, storage, monitor),
            None => self.plain(&shifted, largest, storage),
        };
        monitor.checkpoint()?;
        match plain {
            Ok(factor) if factor.growth <= LARGEST_GROWTH => Ok(factor),
            Ok(factor) => self.pivoted(&shifted, largest, factor.into_storage()),
            Err(FactorError::Singular { .. }) => self.pivoted(&shifted, largest, Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// As [`factor_in`](Self::factor_in), with pivots from the beginning: slower, and its
    /// [uncertainty](Factor::uncertainty) may be far smaller, since small pivots that others do well with make large
    /// entries.
    ///
    /// # Errors
    /// As for [`factor`](Self::factor).
    pub fn pivoted_factor(
        &self,
        a: &SparseMatrix,
        b: &MassMatrix,
        shift: f64,
        storage: Vec<f64>,
    ) -> Result<Factor<'_>, FactorError> {
        let (shifted, largest) = self.shifted(a, b, shift);
        self.pivoted(&shifted, largest, storage)
    }

    /// The entries of the lower triangle of `a − shift · b`, and the largest magnitude.
    pub(super) fn shifted(&self, a: &SparseMatrix, b: &MassMatrix, shift: f64) -> (Vec<f64>, f64) {
        let of_mass = match b {
            MassMatrix::Diagonal(b) => &b[..],
            MassMatrix::Sparse(b) | MassMatrix::Weighted(WeightedMass { matrix: b, .. }) => b.values(),
        };
        let value = |&(in_a, in_b): &(u32, u32)| {
            let value = if in_a == NOWHERE { 0.0 } else { a.values()[in_a as usize] };
            if in_b == NOWHERE { value } else { value - shift * of_mass[in_b as usize] }
        };
        let mut shifted = vec![0.0; self.lower.sources.len()];
        let parts = shifted.par_chunks_mut(SHIFTED).zip(self.lower.sources.par_chunks(SHIFTED));
        let largest = parts.map(|(shifted, sources)| {
            let pairs = shifted.iter_mut().zip(sources);
            pairs.fold(0f64, |most, (shifted, source)| {
                *shifted = value(source);
                most.max(shifted.abs())
            })
        });
        let largest = largest.reduce(|| 0.0, f64::max);
        (shifted, largest)
    }

    /// The structure as faer has it, with supernodes and patterns that are the same.
    pub(super) fn other(&self) -> Result<&SymbolicCholesky<usize>, FactorError> {
        if let Some(other) = self.other.get() {
            return Ok(other);
        }
        let analysed = analysed(&self.lower)?;
        let (nodes, patterns) = supernodes_of(&analysed);
        if nodes != self.nodes || patterns != self.patterns {
            return Err(FactorError::Ordering { reason: "two analyses of one matrix disagree".to_owned() });
        }
        Ok(self.other.get_or_init(|| analysed))
    }

    /// Without pivoting, column after column on one thread.
    fn plain(&self, shifted: &[f64], largest: f64, storage: Vec<f64>) -> Result<Factor<'_>, FactorError> {
        let (n, par, symbolic) = (self.size(), Par::Seq, self.other()?);
        let mut values = self.storage(storage)?;
        let rows = self.lower.wide_rows();
        let lower = SymbolicSparseColMatRef::new_checked(n, n, &self.lower.offsets, None, &rows);
        let request = symbolic.factorize_numeric_ldlt_scratch::<f64>(par, Default::default());
        let mut buffer = memory(request)?;
        let done = symbolic.factorize_numeric_ldlt(
            &mut values,
            SparseColMatRef::new(lower, shifted),
            Side::Lower,
            LdltRegularization::default(),
            par,
            MemStack::new(&mut buffer),
            Default::default(),
        );
        drop(buffer);
        if done.is_err() {
            return Err(FactorError::Singular { pivot: 0 });
        }
        let mut factor = Factor { symbolic: self, values, inverse: Vec::new(), pivoting: None, below: 0, growth: 0.0 };
        factor.inverse.reserve_exact(self.size());
        for node in &self.nodes {
            for column in 0..node.columns {
                let d = factor.pivot(node, column);
                if !(d.is_finite() && d != 0.0) {
                    return Err(FactorError::Singular { pivot: node.start + column });
                }
                factor.below += usize::from(d < 0.0);
                factor.inverse.push(d.recip());
            }
        }
        factor.growth = factor.growth_over(largest);
        Ok(factor)
    }

    /// The same by our own fronts, on all threads.
    fn by_fronts(
        &self,
        plan: &Plan,
        lower: &[f64],
        largest: f64,
        storage: Vec<f64>,
        monitor: &dyn Monitor,
    ) -> Result<Factor<'_>, FactorError> {
        let mut values = self.storage(storage)?;
        let mut inverse = vec![0.0; self.size()];
        let found = multifrontal::factor(self, plan, lower, (&mut values, &mut inverse), monitor);
        monitor.checkpoint()?;
        let found = found.map_err(|_| FactorError::Singular { pivot: 0 })?;
        let growth = if largest > 0.0 { found.growth / largest } else { found.growth };
        Ok(Factor { symbolic: self, values, inverse, pivoting: None, below: found.below, growth })
    }

    fn pivoted(&self, shifted: &[f64], largest: f64, storage: Vec<f64>) -> Result<Factor<'_>, FactorError> {
        let (n, symbolic) = (self.size(), self.other()?);
        let mut values = self.storage(storage)?;
        let rows = self.lower.wide_rows();
        let lower = SymbolicSparseColMatRef::new_checked(n, n, &self.lower.offsets, None, &rows);
        let (mut off_diagonal, mut order, mut position) = (vec![0.0; n], vec![0usize; n], vec![0usize; n]);
        let request = symbolic.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Default::default());
        let mut buffer = memory(request)?;
        symbolic.factorize_numeric_intranode_lblt(
            &mut values,
            &mut off_diagonal,
            &mut order,
            &mut position,
            SparseColMatRef::new(lower, shifted),
            Side::Lower,
            Par::Seq,
            MemStack::new(&mut buffer),
            Default::default(),
        );
        drop(buffer);
        let mut factor =
            Factor { symbolic: self, values, inverse: vec![0.0; n], pivoting: None, below: 0, growth: 0.0 };
        for node in &self.nodes {
            let mut column = 0;
            while column < node.columns {
                let at = node.start + column;
                let (d, e) = (factor.pivot(node, column), off_diagonal[at]);
                if e == 0.0 {
                    if !(d.is_finite() && d != 0.0) {
                        return Err(FactorError::Singular { pivot: at });
                    }
                    factor.below += usize::from(d < 0.0);
                    factor.inverse[at] = d.recip();
                    column += 1;
                } else {
                    if column + 1 == node.columns {
                        return Err(FactorError::Singular { pivot: at });
                    }
                    let next = factor.pivot(node, column + 1);
                    let determinant = d * next - e * e;
                    if !(determinant.is_finite() && determinant != 0.0) {
                        return Err(FactorError::Singular { pivot: at });
                    }
                    factor.below += if determinant < 0.0 { 1 } else { 2 * usize::from(d < 0.0) };
                    factor.inverse[at] = next / determinant;
                    factor.inverse[at + 1] = d / determinant;
                    off_diagonal[at] = -e / determinant;
                    column += 2;
                }
            }
        }
        factor.growth = factor.growth_over(largest);
        let order = order.into_iter().map(|row| row as u32).collect();
        factor.pivoting = Some(Pivoting { order, off_diagonal });
        Ok(factor)
    }

    fn storage(&self, mut values: Vec<f64>) -> Result<Vec<f64>, FactorError> {
        let entries = self.entries();
        values
            .try_reserve_exact(entries.saturating_sub(values.len()))
            .map_err(|_| FactorError::Memory { bytes: 8 * entries })?;
        values.truncate(entries);
        values.par_extend(rayon::iter::repeat_n(0.0, entries - values.len()));
        Ok(values)
    }
}

/// The structure as faer has it.
fn analysed(lower: &Lower) -> Result<SymbolicCholesky<usize>, FactorError> {
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    };
    let n = lower.offsets.len() - 1;
    // By columns it is given the upper triangle, which is the lower one by rows.
    let mut offsets = vec![0usize; n + 1];
    lower.rows.iter().for_each(|&row| offsets[row as usize + 1] += 1);
    (0..n).for_each(|row| offsets[row + 1] += offsets[row]);
    let (mut columns, mut next) = (vec![0usize; lower.rows.len()], offsets.clone());
    for column in 0..n {
        for &row in lower.column(column) {
            columns[next[row as usize]] = column;
            next[row as usize] += 1;
        }
    }
    let upper = SymbolicSparseColMatRef::new_checked(n, n, &offsets, None, &columns);
    factorize_symbolic_cholesky(upper, Side::Upper, SymmetricOrdering::Identity, parameters).map_err(
        |error| match error {
            FaerError::OutOfMemory => FactorError::Memory { bytes: 32 * columns.len() },
            _ => FactorError::TooLarge { entries: columns.len() },
        },
    )
}

fn supernodes_of(symbolic: &SymbolicCholesky<usize>) -> (Vec<Node>, Vec<u32>) {
    let (mut nodes, mut patterns) = (Vec::new(), Vec::new());
    if let SymbolicCholeskyRaw::Supernodal(supernodal) = symbolic.raw() {
        let mut values = 0;
        for node in 0..supernodal.n_supernodes() {
            let node = supernodal.supernode(node);
            let (start, below) = (node.start(), node.pattern());
            let columns = supernodal.supernode_end()[nodes.len()] - start;
            nodes.push(Node { start, columns, pattern: (patterns.len(), below.len()), values });
            patterns.extend(below.iter().map(|&row| row as u32));
            values += (columns + below.len()) * columns;
        }
    }
    (nodes, patterns)
}

fn memory(request: StackReq) -> Result<MemBuffer, FactorError> {
    MemBuffer::try_new(request).map_err(|_| FactorError::Memory { bytes: request.unaligned_bytes_required() })
}

/// Entries of a shifted matrix that one task computes.
const SHIFTED: usize = 1 << 15;

/// Element growth up to which factors without pivoting are accepted: rounding errors relative to the matrix stay below
/// this times 1e-16.
pub(super) const LARGEST_GROWTH: f64 = 1e6;

/// Pivoting inside supernodes.
pub(super) struct Pivoting {
    /// The row that comes `k`-th; a permutation of the rows of each supernode.
    pub order: Vec<u32>,
    /// Entry `k`: the inverse of `D` at `(k + 1, k)`.
    pub off_diagonal: Vec<f64>,
}

/// `A − μB = L D Lᵀ` in the order that the matrices were given in.
pub struct Factor<'a> {
    pub(super) symbolic: &'a SymbolicFactor,
    pub(super) values: Vec<f64>,
    /// The diagonal of `D⁻¹`.
    pub(super) inverse: Vec<f64>,
    pub(super) pivoting: Option<Pivoting>,
    below: usize,
    growth: f64,
}

impl std::fmt::Debug for Factor<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut entry = f.debug_struct("Factor");
        entry.field("size", &self.symbolic.size()).field("below", &self.below).field("growth", &self.growth).finish()
    }
}

/// The numbers of a factor without the structure that they belong to: to be kept where a factor cannot borrow. `L` may
/// be in single precision; arithmetic is not.
pub struct FactorNumbers<T = f64> {
    pub(super) values: Vec<T>,
    pub(super) inverse: Vec<f64>,
    pub(super) pivoting: Option<Pivoting>,
}

impl FactorNumbers {
    /// The same with `L` rounded to single precision: half of the memory, which is what the time of a solve for one
    /// right-hand side goes into. It is the factor of a matrix whose entries differ by some `6e-8` of the products that
    /// they are sums of.
    pub fn into_single(self) -> FactorNumbers<f32> {
        let Self { values, inverse, pivoting } = self;
        FactorNumbers { values: values.into_iter().map(|value| value as f32).collect(), inverse, pivoting }
    }
}

impl<T> FactorNumbers<T> {
    /// Sets the solution to zero in a row that none after it depends on by elimination, such as the last of a
    /// component, instead of dividing by its pivot: where that is next to nothing since the matrix is singular but for
    /// rounding. Nothing changes in a factor whose rows were exchanged.
    pub fn ground(&mut self, row: usize) {
        if let (None, Some(inverse)) = (&self.pivoting, self.inverse.get_mut(row)) {
            *inverse = 0.0;
        }
    }
}

impl Factor<'_> {
    /// A copy of its numbers.
    #[cfg(test)]
    pub(crate) fn numbers(&self) -> FactorNumbers {
        let pivoting = self.pivoting.as_ref();
        let pivoting =
            pivoting.map(|own| Pivoting { order: own.order.clone(), off_diagonal: own.off_diagonal.clone() });
        FactorNumbers { values: self.values.clone(), inverse: self.inverse.clone(), pivoting }
    }

    /// Its numbers, without its structure: [`SymbolicFactor::solve_panel`] solves with them.
    pub fn into_numbers(self) -> FactorNumbers {
        let Self { values, inverse, pivoting, .. } = self;
        FactorNumbers { values, inverse, pivoting }
    }

    /// How many eigenvalues of the pencil lie below the shift, with multiplicity (Sylvester's law of inertia), if `B`
    /// is positive definite.
    pub fn eigenvalues_below(&self) -> usize {
        self.below
    }

    /// The first row whose pivot is negative, in the order of elimination; the first of two where they were eliminated
    /// together.
    pub fn first_below(&self) -> Option<usize> {
        let negative = self.inverse.iter().position(|&inverse| inverse < 0.0)?;
        Some(self.pivoting.as_ref().map_or(negative, |pivoting| pivoting.order[negative] as usize))
    }

    /// The largest `l²|d|` over the largest entry of the shifted matrix: rounding errors of the factors are about 1e-16
    /// times this.
    pub fn growth(&self) -> f64 {
        self.growth
    }

    /// The memory of the factor, for the next one.
    pub fn into_storage(self) -> Vec<f64> {
        self.values
    }

    /// Whether rows were exchanged.
    pub fn is_pivoted(&self) -> bool {
        self.pivoting.is_some()
    }

    fn node_values(&self, node: &Node) -> MatRef<'_, f64> {
        let rows = node.columns + node.pattern.1;
        MatRef::from_column_major_slice(
            &self.values[node.values..node.values + rows * node.columns],
            rows,
            node.columns,
        )
    }

    fn pivot(&self, node: &Node, column: usize) -> f64 {
        self.node_values(node)[(column, column)]
    }

    fn growth_over(&self, largest: f64) -> f64 {
        let mut growth = 0f64;
        for node in &self.symbolic.nodes {
            let rows = node.columns + node.pattern.1;
            let values = &self.values[node.values..node.values + rows * node.columns];
            for (column, values) in values.chunks_exact(rows).enumerate() {
                let most = values[column + 1..].iter().fold(1f64, |most, l| most.max(l.abs()));
                growth = growth.max(most * most * values[column].abs());
            }
        }
        if largest > 0.0 { growth / largest } else { growth }
    }
}

#[cfg(test)]
#[path = "factor_tests.rs"]
pub(super) mod tests;
