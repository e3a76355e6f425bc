//! Designs under many constraints.
//!
//! A system of the size of the constraints grows with their cube, though a space of `d` dimensions cannot follow more
//! than `d` of them. Beyond a share of `d` they go into the matrix of the energies: `H = K + Σ w rᵀr`, `d × d`, with
//! the rows `r` of the space at their faces, which have a few dozen entries. `H` does not depend on the directions that
//! are asked for.
//!
//! While a stroke is dragged most constraints stay as they are. The factor of those that stay is kept; what is new or
//! has another weight is added by a system of its own size, `(W⁻¹ + R H⁻¹ Rᵀ) y = v − R H⁻¹ g`: with `v = 0` for soft
//! constraints, whose pull is part of `g`. Hard constraints are always added in this way. A row has entries in few
//! columns of the space, and what moves stays among few of them from one frame to the next, so that the columns of
//! `H⁻¹` that were needed are kept beside the factor.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use chladni_algebra::{DefiniteError, DefiniteFactor, DenseMatrix, SparseMatrix, solve_definite};
use chladni_base::parallel::*;

use super::constraints::HARD;
use super::design::{Constraint, DesignError, DesignModel, EnergyWeights, FIRM, Hold, add_row};
use super::slack::{self, Yield};
use crate::basis::FieldBasis;

/// Columns of an inverse, by their numbers.
type Columns = HashMap<usize, Arc<Vec<f64>>>;

/// Constrained numbers beyond this share of the dimension go into the matrix.
const MANY: f64 = 0.25;

/// So many are added to a factor that is kept; beyond, another is made.
const MOST_ADDED: f64 = 0.15;

/// Spaces of more dimensions have no dense matrices kept: five of them take 380 MB here, and the fields of a server
/// have half a gigabyte by default.
const MOST_DIMENSIONS: usize = 3072;

/// What fields of no energy resist with, as a share of what the constraints hold them with. Where these do not say how
/// much of such a field there is, it is as little as possible.
const IDLE: f64 = 1e-9;

/// Columns of the inverse are kept up to this share of the dimension; constraints that need more take solves of their
/// own.
const MOST_COLUMNS: f64 = 0.25;

/// What is kept for designs under many constraints, for one choice of weights.
#[derive(Default)]
pub(super) struct Many {
    /// `K`, on the coefficients of the space.
    energy: OnceLock<DenseMatrix>,
    /// What unit pulls on a face move there.
    moved: Mutex<HashMap<u32, Yield>>,
    /// Of designs before, the latest first: one for each hand that drags.
    kept: Mutex<Vec<CachedDesign>>,
}

/// Hands that may drag at once on one choice of weights before they cost each other a factor.
const MOST_KEPT: usize = 3;

/// What a design has left.
struct CachedDesign {
    /// Its soft constraints.
    last: Vec<SoftFace>,
    base: Arc<Base>,
}

/// A face that is held softly: the sum of the weights there.
#[derive(Clone, Copy, PartialEq)]
struct SoftFace {
    face: u32,
    weight: f64,
}

/// The factor of `H`.
struct Base {
    held: Vec<SoftFace>,
    factor: DefiniteFactor,
    /// Columns of its inverse.
    columns: Mutex<Columns>,
}

/// The entries of the rows of a face, column by column.
type FaceRows = Vec<(usize, [f64; 3])>;

/// The model that designs take place in.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    pub model: &'a DesignModel,
    pub basis: &'a FieldBasis,
    pub weights: EnergyWeights,
    /// The weight of alignments without weights per face.
    pub uniform: f64,
    /// `K⁻¹` in Ritz coordinates; zero in the kernel.
    pub inverse: &'a [f64],
    /// Ritz coordinates of no energy.
    pub kernel: &'a [usize],
}

impl DesignModel {
    /// Whether so many constraints are met by factors that a [`WeightedModel`](super::WeightedModel) keeps from one
    /// design to the next.
    pub fn has_many(&self, constraints: usize) -> bool {
        let d = self.dimension();
        self.has_ritz() && d <= MOST_DIMENSIONS && (self.kind.block() * constraints) as f64 > MANY * d as f64
    }

    /// About the bytes that those factors take in the end.
    pub fn bytes_of_many(&self) -> u64 {
        let d = self.dimension() as u64;
        // Two energies, and for each design that is kept a factor and columns of its inverse.
        8 * d * d * (2 + MOST_KEPT as u64) + 2 * d * d * MOST_KEPT as u64
    }
}

impl Setting<'_> {
    fn row(&self, face: u32) -> FaceRows {
        let mut entries = Vec::new();
        self.basis.space.row_entries(face as usize, |column, u| {
            let mut own = [0.0; 3];
            own[..u.len()].copy_from_slice(u);
            entries.push((column, own));
        });
        entries
    }

    /// `K = h S̄ + μ S̄ M̄⁻¹ S̄ + a M̄`, all of it.
    fn energy(&self) -> Result<DenseMatrix, DesignError> {
        let (stiffness, mass) = (&self.basis.stiffness, &self.basis.mass);
        let mut energy = DenseMatrix::zeros(stiffness.rows(), stiffness.rows());
        if self.weights.biharmonic > 0.0 {
            let bending = self.model.bending.of(self.basis)?;
            let into = energy.values_mut().iter_mut().zip(bending.values());
            into.for_each(|(to, value)| *to = self.weights.biharmonic * value);
        }
        add(&mut energy, stiffness, self.weights.harmonic);
        add(&mut energy, mass, self.uniform);
        Ok(energy)
    }

    /// What unit pulls on a face move there, fields of no energy left out.
    fn moved(&self, face: u32) -> Yield {
        let (b, d) = (self.basis.space.block(), self.model.dimension());
        let mut rows = vec![0.0; b * d];
        for (column, u) in self.row(face) {
            for (row, &u) in rows.chunks_exact_mut(d).zip(&u) {
                add_row(row, &self.model.ritz.vectors[d * column..d * (column + 1)], u);
            }
        }
        let row = |i: usize| &rows[i * d..(i + 1) * d];
        let product = |i: usize, j: usize| -> f64 {
            row(i).iter().zip(row(j)).zip(self.inverse).map(|((r, s), k)| r * s * k).sum()
        };
        let entry = |i: usize, j: usize| if i < b && j < b { product(i.max(j), i.min(j)) } else { 0.0 };
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    }

    /// `Σ w rᵀr` added to a matrix.
    fn hold(&self, held: &[SoftFace], matrix: &mut DenseMatrix) {
        let b = self.basis.space.block();
        for &SoftFace { face, weight } in held {
            let entries = self.row(face);
            for (j, right) in &entries {
                let column = matrix.column_mut(*j);
                for (i, left) in &entries {
                    column[*i] += weight * (0..b).map(|k| left[k] * right[k]).sum::<f64>();
                }
            }
        }
    }

    /// Fields of no energy, and their images under the mass.
    fn idle(&self) -> Vec<(Vec<f64>, Vec<f64>)> {
        let d = self.model.dimension();
        let field = |&k: &usize| {
            let field: Vec<f64> = (0..d).map(|row| f64::from(self.model.ritz.vectors[d * row + k])).collect();
            let image = self.basis.mass.multiply(&field);
            (field, image)
        };
        self.kernel.iter().map(field).collect()
    }

    /// The factor of `H`; `None` where it is not definite, as far as rounding lets one tell.
    fn base(&self, energy: &DenseMatrix, held: Vec<SoftFace>) -> Result<Option<Base>, DesignError> {
        let mut matrix = energy.clone();
        self.hold(&held, &mut matrix);
        if !self.kernel.is_empty() {
            let idle = self.idle();
            // What the constraints hold a field with.
            let form = |field: &[f64]| -> f64 {
                let square = |held: &SoftFace| {
                    let mut own = [0.0; 3];
                    for (column, u) in self.row(held.face) {
                        own.iter_mut().zip(u).for_each(|(sum, u)| *sum += u * field[column]);
                    }
                    held.weight * own.iter().map(|u| u * u).sum::<f64>()
                };
                held.iter().map(square).sum()
            };
            let resist = IDLE * idle.iter().map(|(field, _)| form(field)).fold(0.0, f64::max);
            if !(resist > 0.0) {
                // Nothing holds them: whether rounding lets the matrix pass for definite says nothing.
                return Ok(None);
            }
            for (_, image) in &idle {
                for (j, value) in image.iter().enumerate() {
                    let factor = resist * value;
                    matrix.column_mut(j).iter_mut().zip(image).for_each(|(a, b)| *a += factor * b);
                }
            }
        }
        match DefiniteFactor::new(matrix) {
            Ok(factor) => Ok(Some(Base { held, factor, columns: Mutex::default() })),
            Err(DefiniteError::NotPositiveDefinite { .. }) => Ok(None),
            Err(other) => Err(DesignError::Factor(other)),
        }
    }
}

impl Many {
    /// The constraints that the factor of the last design holds, and where that is in memory.
    #[cfg(test)]
    pub fn last_factor(&self) -> (usize, usize) {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.first().map_or((0, 0), |kept| (kept.base.held.len(), Arc::as_ptr(&kept.base) as usize))
    }

    /// The coefficients of least energy under constraints without repetitions, and the pull `force` of alignments.
    /// `None` where the matrix is not definite.
    ///
    /// # Errors
    /// [`DesignError`]: a hard constraint that the space cannot meet besides the others, or too little memory.
    pub fn solve(
        &self,
        setting: &Setting<'_>,
        constraints: &[Constraint],
        force: &[f64],
    ) -> Result<Option<Vec<f64>>, DesignError> {
        let b = setting.basis.space.block();
        let weights = self.weights(setting, constraints);
        let (mut held, mut pulls): (Vec<SoftFace>, Vec<f64>) = (Vec::new(), force.to_vec());
        for (constraint, weight) in constraints.iter().zip(&weights) {
            let Some(weight) = *weight else { continue };
            for (column, u) in setting.row(constraint.face) {
                pulls[column] += weight * (0..b).map(|k| u[k] * constraint.value[k]).sum::<f64>();
            }
            match held.last_mut().filter(|last| last.face == constraint.face) {
                Some(last) => last.weight += weight,
                None => held.push(SoftFace { face: constraint.face, weight }),
            }
        }
        let hard: Vec<&Constraint> = constraints.iter().filter(|c| c.hold.is_exact()).collect();
        let Some(base) = self.base(setting, &held)? else { return Ok(None) };
        // What the factor does not hold yet. Its pull is among the others already, so it is held to zero here.
        let added: Vec<SoftFace> = held.iter().filter(|own| !base.held.contains_face(own)).copied().collect();
        let faces: Vec<u32> = added.iter().map(|held| held.face).chain(hard.iter().map(|c| c.face)).collect();
        let rows: Vec<FaceRows> = faces.iter().map(|&face| setting.row(face)).collect();
        let more = More { faces, rows, added, hard, b, d: setting.model.dimension() };
        let found = match base.columns(&more)? {
            Some(columns) => more.by_columns(&base, &columns, &pulls)?,
            None => more.by_halves(&base, &pulls)?,
        };
        Ok(Some(found))
    }

    /// The weights of soft constraints, in the order of the constraints.
    fn weights(&self, setting: &Setting<'_>, constraints: &[Constraint]) -> Vec<Option<f64>> {
        let strengths = constraints.iter().any(|c| matches!(c.hold, Hold::Strength(_)));
        let b = setting.basis.space.block();
        let moved: Vec<Yield> = if strengths {
            let lock = || self.moved.lock().unwrap_or_else(PoisonError::into_inner);
            let known: Vec<Option<Yield>> = {
                let moved = lock();
                constraints.iter().map(|c| moved.get(&c.face).copied()).collect()
            };
            // Others may design meanwhile.
            let moved: Vec<Yield> = constraints
                .par_iter()
                .zip(&known)
                .map(|(c, known)| known.unwrap_or_else(|| setting.moved(c.face)))
                .collect();
            lock().extend(constraints.iter().zip(&moved).map(|(c, &moved)| (c.face, moved)));
            moved
        } else {
            vec![[[0.0; 3]; 3]; constraints.len()]
        };
        let mean = moved.iter().map(|own| slack::mean(own, b)).sum::<f64>() / moved.len().max(1) as f64;
        // To a power of two: it only bounds what the least yield, and its last digits change with every face that
        // moves. They would change all weights by rounding, and nothing would have stayed as it was.
        let mean = mean.log2().round().exp2();
        let weight = |(c, moved): (&Constraint, &Yield)| match c.hold {
            Hold::Strength(strength) => {
                Some(slack::of_share(moved, b, &c.value, 1.0 / (FIRM * strength), mean).recip())
            }
            Hold::Weight(weight) => Some(weight),
            Hold::Exact => None,
        };
        constraints.par_iter().zip(&moved).map(weight).collect()
    }

    /// A factor that holds most of some constraints, and nothing else: one that is kept, or one of what has stayed
    /// since the design before.
    fn base(&self, setting: &Setting<'_>, held: &[SoftFace]) -> Result<Option<Arc<Base>>, DesignError> {
        let most = (MOST_ADDED * setting.model.dimension() as f64) as usize / setting.basis.space.block();
        let fits =
            |base: &Base| base.held.iter().all(|own| held.contains_face(own)) && held.len() - base.held.len() <= most;
        let mut of = held.to_vec();
        {
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(at) = kept.iter().position(|kept| fits(&kept.base)) {
                let base = kept[at].base.clone();
                kept[at].last = held.to_vec();
                kept[..=at].rotate_right(1);
                return Ok(Some(base));
            }
            // What has stayed since a design before will stay: most of what is dragged has left its faces.
            let stayed = |kept: &CachedDesign| {
                held.iter().filter(|own| kept.last.contains_face(own)).copied().collect::<Vec<_>>()
            };
            let before = kept.iter().map(stayed).position(|stayed| held.len() - stayed.len() <= most);
            if let Some(at) = before {
                of = stayed(&kept.remove(at));
            }
        }
        let energy = match self.energy.get() {
            Some(energy) => energy,
            None => {
                let energy = setting.energy()?;
                self.energy.get_or_init(|| energy)
            }
        };
        let base = match setting.base(energy, of)? {
            None => setting.base(energy, held.to_vec())?,
            found => found,
        };
        let Some(base) = base.map(Arc::new) else { return Ok(None) };
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.insert(0, CachedDesign { last: held.to_vec(), base: base.clone() });
        kept.truncate(MOST_KEPT);
        Ok(Some(base))
    }
}

/// What is met on top of a factor.
struct More<'a> {
    faces: Vec<u32>,
    rows: Vec<FaceRows>,
    /// Soft constraints, first among the faces.
    added: Vec<SoftFace>,
    hard: Vec<&'a Constraint>,
    b: usize,
    d: usize,
}

impl More<'_> {
    /// The pulls at all numbers, where unit pulls move them by `moved`, and where they are `reached` without.
    fn pulls(&self, mut moved: DenseMatrix, reached: impl Fn(usize) -> f64) -> Result<Vec<f64>, DesignError> {
        let (b, k) = (self.b, moved.columns());
        let mean = (0..k).map(|i| moved.column(i)[i]).sum::<f64>() / k.max(1) as f64;
        let mut missing = DenseMatrix::zeros(k, 1);
        for i in 0..k {
            let (slack, value) = match self.added.get(i / b) {
                Some(held) => (1.0 / held.weight, 0.0),
                None => (HARD * mean, self.hard[i / b - self.added.len()].value[i % b]),
            };
            moved.column_mut(i)[i] += slack;
            missing.column_mut(0)[i] = value - reached(i);
        }
        solve_definite(moved, &mut missing).map_err(|error| match error {
            DefiniteError::NotPositiveDefinite { pivot } => DesignError::Dependent { face: self.faces[pivot / b] },
            other => DesignError::Factor(other),
        })?;
        Ok(missing.column(0).to_vec())
    }

    /// By half of the solve for each number.
    fn by_halves(&self, base: &Base, pulls: &[f64]) -> Result<Vec<f64>, DesignError> {
        let (b, d, k) = (self.b, self.d, self.b * self.faces.len());
        // `L⁻¹` of the rows, and of the pull.
        let mut halves = DenseMatrix::zeros(d, k + 1);
        for (at, row) in self.rows.iter().enumerate() {
            for (column, u) in row {
                (0..b).for_each(|i| halves.column_mut(b * at + i)[*column] += u[i]);
            }
        }
        halves.column_mut(k).copy_from_slice(pulls);
        base.factor.solve_lower(&mut halves).map_err(DesignError::Factor)?;
        let mut field = DenseMatrix::zeros(d, 1);
        field.column_mut(0).copy_from_slice(halves.column(k));
        if k > 0 {
            let rows = halves.slice_columns(0..k);
            let reached = |i: usize| rows.column(i).iter().zip(halves.column(k)).map(|(r, g)| r * g).sum();
            for (i, y) in self.pulls(rows.transposed_times(&rows), reached)?.into_iter().enumerate() {
                field.column_mut(0).iter_mut().zip(rows.column(i)).for_each(|(z, r)| *z += y * r);
            }
        }
        base.factor.solve_upper(&mut field).map_err(DesignError::Factor)?;
        Ok(field.column(0).to_vec())
    }

    /// By columns of the inverse that are known.
    fn by_columns(&self, base: &Base, columns: &Columns, pulls: &[f64]) -> Result<Vec<f64>, DesignError> {
        let (b, k) = (self.b, self.b * self.faces.len());
        let mut solved = DenseMatrix::zeros(self.d, 1);
        solved.column_mut(0).copy_from_slice(pulls);
        base.factor.solve(&mut solved).map_err(DesignError::Factor)?;
        let mut field = solved.column(0).to_vec();
        if k == 0 {
            return Ok(field);
        }
        let moved_by = |i: usize| {
            let mut sum = vec![0.0; self.d];
            for (column, u) in &self.rows[i / b] {
                sum.iter_mut().zip(columns[column].iter()).for_each(|(sum, x)| *sum += u[i % b] * x);
            }
            sum
        };
        let moved: Vec<Vec<f64>> = (0..k).into_par_iter().map(moved_by).collect();
        let mut system = DenseMatrix::zeros(k, k);
        for (j, moved) in moved.iter().enumerate() {
            for i in 0..=j {
                let own = along(&self.rows[i / b], i % b, moved);
                (system.column_mut(j)[i], system.column_mut(i)[j]) = (own, own);
            }
        }
        let y = self.pulls(system, |i| along(&self.rows[i / b], i % b, &field))?;
        for (y, moved) in y.into_iter().zip(&moved) {
            field.iter_mut().zip(moved).for_each(|(z, m)| *z += y * m);
        }
        Ok(field)
    }
}

impl Base {
    /// The columns of `H⁻¹` that some rows take, which are kept; `None` where there are too many.
    fn columns(&self, more: &More<'_>) -> Result<Option<Columns>, DesignError> {
        let mut wanted: Vec<usize> = more.rows.iter().flatten().map(|entry| entry.0).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let most = (MOST_COLUMNS * more.d as f64) as usize;
        if wanted.len() > most {
            return Ok(None);
        }
        let lock = || self.columns.lock().unwrap_or_else(PoisonError::into_inner);
        // Taken along now: whoever else designs may clear what is kept before the others are made.
        let mut found: Columns = {
            let kept = lock();
            wanted.iter().filter_map(|column| Some((*column, kept.get(column)?.clone()))).collect()
        };
        wanted.retain(|column| !found.contains_key(column));
        if wanted.is_empty() {
            return Ok(Some(found));
        }
        let mut made = DenseMatrix::zeros(more.d, wanted.len());
        wanted.iter().enumerate().for_each(|(at, &column)| made.column_mut(at)[column] = 1.0);
        self.factor.solve(&mut made).map_err(DesignError::Factor)?;
        let of = |(at, &column): (usize, &usize)| (column, Arc::new(made.column(at).to_vec()));
        let made: Vec<(usize, Arc<Vec<f64>>)> = wanted.iter().enumerate().map(of).collect();
        let mut kept = lock();
        if kept.len() + made.len() > most {
            kept.clear();
        }
        kept.extend(made.iter().cloned());
        found.extend(made);
        Ok(Some(found))
    }
}

/// What a field of the space has as number `i` of a face.
fn along(row: &[(usize, [f64; 3])], i: usize, field: &[f64]) -> f64 {
    row.iter().map(|(column, u)| u[i] * field[*column]).sum()
}

/// Lists of faces in ascending order.
trait Faces {
    /// Whether a face is held with the same weight.
    fn contains_face(&self, own: &SoftFace) -> bool;
}

impl Faces for [SoftFace] {
    fn contains_face(&self, own: &SoftFace) -> bool {
        self.binary_search_by_key(&own.face, |held| held.face).is_ok_and(|at| self[at] == *own)
    }
}

/// `A ← A + s B`.
fn add(a: &mut DenseMatrix, b: &SparseMatrix, s: f64) {
    for row in 0..b.rows() {
        let (columns, values) = b.row(row);
        for (&column, value) in columns.iter().zip(values) {
            a.column_mut(column as usize)[row] += s * value;
        }
    }
}
