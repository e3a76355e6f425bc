//! Solving for fields: a model with weights, and what constraints add to it.

mod bounded;
mod halves;
mod measured;
mod multipliers;
mod whole;

use std::sync::{Arc, OnceLock};

use chladni_algebra::{DenseMatrix, FactorError, SparseMatrix};
use chladni_base::made_once;
use chladni_base::parallel::*;

use crate::basis::FieldBasis;
use crate::operator::frames::Complex64;

use super::alignment::{Alignment, Prescription};
use super::constraints::{Condition, Slack, check, conditions, near, residuals, without_repetitions};
use super::design::{Constraint, Design, DesignError, DesignModel, EnergyWeights, MOST_DIMENSIONS, add_row, length};
use super::idle::{self, Idle, Kernel};
use super::idle_parts::IdlePart;
use super::many::{Many, Setting};
use super::nearby::Nearby;
use super::pencil::{Pencil, Sum, floor};

pub(super) use multipliers::{LONGEST_IDLE, System};

/// Ritz values below this share of the largest count as zero, or below so much on unit area: a space that has fields
/// without energy alone has no other values than what rounding leaves of these.
const KERNEL_SHARE: f64 = 1e-10;
const LEAST: f64 = 1e-7;

/// Spaces with more fields without energy, as those of many components, take all constraints into one system, however
/// many there are: what holds such fields in the matrix of the energies would outweigh all else where a component has
/// nothing but them.
const MOST_IDLE: usize = 24;

/// What the faces around a prescribed singularity give way, as such a share. A space is hardly able to give them all
/// what they should have: forced to, it gets other singularities. Where a field does not have the singularity yet, its
/// faces give way less.
const AROUND: f64 = 1e-3;

/// So often at most faces around singularities are made to give way less.
const ROUNDS: usize = 7;

/// The least length of a field around a prescribed singularity, as a share of what it would have if it grew to 1 over
/// the distance of two samples.
const LEAST_GROWTH: f64 = 0.3;

/// `K⁻¹` for one choice of weights: diagonal in Ritz coordinates, or a sparse factor. Keep it as long as weights do not
/// change.
pub struct WeightedModel {
    model: DesignModel,
    pencil: Option<Arc<Pencil>>,
    weights: EnergyWeights,
    alignments: Vec<(Arc<Alignment>, f64)>,
    prescription: Option<(Arc<Prescription>, f64)>,
    inverse: Inverse,
    /// What alignments pull with, and where the field goes without constraints.
    free: Pull,
    /// The same for the prescribed field, and for it turned by 90°.
    turned: Option<[Pull; 2]>,
    /// Ritz coordinates of no energy.
    kernel: Vec<usize>,
    /// Fields of next to no energy, where the inverse is a sparse factor: found when they are needed, and by component.
    idle: OnceLock<Vec<Idle>>,
    idle_parts: OnceLock<Vec<IdlePart>>,
    /// What those cost to be left out of halves of solves.
    idle_halves: OnceLock<halves::IdleHalves>,
    many: Many,
}

/// A right-hand side and its solution, in the coordinates of the inverse.
#[derive(Clone)]
struct Pull {
    force: Vec<f64>,
    field: Vec<f64>,
    /// `M̄⁻¹ S̄` times the solution, where it came with it.
    laplacian: Option<Vec<f64>>,
}

enum Inverse {
    /// In Ritz coordinates; zero in the kernel.
    Ritz(Vec<f64>),
    /// In the coefficients of the space.
    Sparse(Box<Nearby>),
}

impl DesignModel {
    /// Makes the model ready for some weights. Free of cost in Ritz coordinates; a sparse factorisation where the space
    /// has none, or the alignment has weights per face. One alignment with weights per face goes on with the factor of
    /// the last model that is still there, where both energies and their alignment are up to three times apart from
    /// what they are in that.
    ///
    /// # Errors
    /// [`DesignError`]: weights that are negative or all zero.
    pub fn weighted(
        &self,
        weights: EnergyWeights,
        alignment: Option<(Arc<Alignment>, f64)>,
    ) -> Result<WeightedModel, DesignError> {
        self.weighted_with(weights, alignment.into_iter().collect(), None)
    }

    /// The same with several fields to stay close to, and one with prescribed singularities. Its weight is that of
    /// [`Alignment`]s without weights per face: the larger it is against the energies, the closer the design is to it,
    /// and the fewer other singularities it has.
    ///
    /// # Errors
    /// As for [`weighted`](Self::weighted).
    pub fn weighted_with(
        &self,
        weights: EnergyWeights,
        mut alignments: Vec<(Arc<Alignment>, f64)>,
        prescription: Option<(Arc<Prescription>, f64)>,
    ) -> Result<WeightedModel, DesignError> {
        let mut given = vec![("harmonic", weights.harmonic), ("biharmonic", weights.biharmonic)];
        given.extend(alignments.iter().map(|a| ("alignment", a.1)));
        given.extend(prescription.iter().map(|p| ("prescribed singularities", p.1)));
        if let Some(&(name, value)) = given.iter().find(|w| !(w.1 >= 0.0 && w.1.is_finite())) {
            return Err(DesignError::Weight { name, value });
        }
        if given.iter().all(|w| w.1 == 0.0) {
            return Err(DesignError::NoEnergy);
        }
        alignments.retain(|a| a.1 > 0.0);
        let prescription = prescription.filter(|p| p.1 > 0.0);
        let uniform = alignments.iter().filter(|a| a.0.gram.is_none()).map(|a| a.1).sum::<f64>()
            + prescription.as_ref().map_or(0.0, |p| p.1);
        let full = self.pencil.as_ref().is_some_and(|pencil| pencil.full_biharmonic.is_some());
        let diagonal = self.has_ritz() && !full && alignments.iter().all(|a| a.0.gram.is_none());
        let (inverse, kernel, pencil) = if diagonal {
            let (inverse, kernel) = self.diagonal_inverse(weights, uniform);
            (Inverse::Ritz(inverse), kernel, None)
        } else {
            let (inverse, pencil) = self.sparse_inverse(weights, uniform, &alignments)?;
            (Inverse::Sparse(Box::new(inverse)), Vec::new(), Some(pencil))
        };
        let d = self.dimension();
        let pull = |fields: &[(&Alignment, f64)]| {
            let mut force = vec![0.0; d];
            for (field, weight) in fields {
                let own = if diagonal { &field.projected } else { &field.reduced };
                force.iter_mut().zip(own).for_each(|(f, p)| *f += weight * p);
            }
            let mut field = force.clone();
            if !fields.is_empty() {
                inverse.apply(&mut field)?;
            }
            Ok::<_, DesignError>(Pull { force, field, laplacian: None })
        };
        let free = pull(&alignments.iter().map(|(field, weight)| (&**field, *weight)).collect::<Vec<_>>())?;
        let turned = match &prescription {
            Some((p, weight)) => Some([pull(&[(&p.along, *weight)])?, pull(&[(&p.across, *weight)])?]),
            None => None,
        };
        let model = self.clone();
        Ok(WeightedModel {
            model,
            pencil,
            weights,
            alignments,
            prescription,
            inverse,
            free,
            turned,
            kernel,
            idle: OnceLock::new(),
            idle_parts: OnceLock::new(),
            idle_halves: OnceLock::new(),
            many: Many::default(),
        })
    }

    /// Ritz values up to this one count as zero.
    fn least_value(&self) -> f64 {
        (KERNEL_SHARE * self.values().last().copied().unwrap_or(0.0)).max(LEAST)
    }

    /// `K⁻¹` in Ritz coordinates, and those that have no energy.
    fn diagonal_inverse(&self, weights: EnergyWeights, uniform: f64) -> (Vec<f64>, Vec<usize>) {
        let values = self.values();
        let least = self.least_value();
        let mut kernel = Vec::new();
        let one = |(i, &value): (usize, &f64)| {
            if uniform == 0.0 && value <= least {
                kernel.push(i);
                0.0
            } else {
                1.0 / (weights.harmonic * value + weights.biharmonic * value * value + uniform)
            }
        };
        (values.iter().enumerate().map(one).collect(), kernel)
    }

    /// `K⁻¹` by a sparse factor, where there is one alignment with weights per face by one nearby if there is one; and
    /// the matrices that it is made of.
    fn sparse_inverse(
        &self,
        weights: EnergyWeights,
        uniform: f64,
        alignments: &[(Arc<Alignment>, f64)],
    ) -> Result<(Nearby, Arc<Pencil>), DesignError> {
        let known = self.pencil.clone().or_else(|| alignments.iter().find_map(|a| a.0.pencil.clone()));
        let missing = || DesignError::Dimension { dimension: self.dimension(), most: MOST_DIMENSIONS };
        let known = known.ok_or_else(missing)?;
        if let ([(one, weight)], true) = (alignments, uniform == 0.0)
            && one.pencil.as_ref().is_some_and(|own| Arc::ptr_eq(own, &known))
            && let Some(inverse) = one.inverse(weights, *weight)?
        {
            return Ok((inverse, known));
        }
        let of = |a: &(Arc<Alignment>, f64)| Some((a.0.gram.clone()?, a.1));
        let grams: Vec<(Arc<SparseMatrix>, f64)> = alignments.iter().filter_map(of).collect();
        let grams = grams.iter().map(|(gram, weight)| (&**gram, *weight)).collect();
        let sum = Sum { harmonic: weights.harmonic, biharmonic: weights.biharmonic, uniform, grams };
        Ok((Arc::new(known.factor(&sum)?).into(), known))
    }
}

impl Inverse {
    fn apply(&self, vectors: &mut [f64]) -> Result<(), FactorError> {
        match self {
            Self::Ritz(diagonal) => {
                for vector in vectors.chunks_mut(diagonal.len().max(1)) {
                    vector.iter_mut().zip(diagonal).for_each(|(x, d)| *x *= d);
                }
                Ok(())
            }
            Self::Sparse(inverse) => inverse.apply(vectors),
        }
    }
}

/// `A x` on all threads, to the same bits on any number of them.
fn times(matrix: &SparseMatrix, x: &[f64]) -> Vec<f64> {
    let row = |row: usize| {
        let (columns, values) = matrix.row(row);
        columns.iter().zip(values).map(|(&column, value)| value * x[column as usize]).sum()
    };
    (0..matrix.rows()).into_par_iter().with_min_len(1024).map(row).collect()
}

impl WeightedModel {
    /// The field of least energy under the constraints. With prescribed singularities the faces around them are
    /// constrained too: to the direction that they prescribe, and to the length that the field has there without.
    ///
    /// # Errors
    /// [`DesignError`] names the constraint that cannot be used or met.
    pub fn solve(&self, basis: &FieldBasis, constraints: &[Constraint]) -> Result<Design, DesignError> {
        self.solve_with(basis, constraints, true)
    }

    /// The same without coefficients, which take a product of the square of the dimension: whether there is such a
    /// field, and its energies.
    ///
    /// # Errors
    /// As for [`solve`](Self::solve).
    pub fn solve_briefly(&self, basis: &FieldBasis, constraints: &[Constraint]) -> Result<Design, DesignError> {
        self.solve_with(basis, constraints, false)
    }

    fn solve_with(
        &self,
        basis: &FieldBasis,
        constraints: &[Constraint],
        coefficients: bool,
    ) -> Result<Design, DesignError> {
        let b = basis.space.block();
        length("the space", basis.space.dimension(), self.model.dimension())?;
        check(basis, self.model.kind, constraints)?;
        let kept = without_repetitions(constraints);
        if kept.is_empty() && self.alignments.is_empty() && self.prescription.is_none() {
            return Err(DesignError::NoData);
        }
        if let Some(design) = self.solve_many(basis, &kept, constraints)? {
            return Ok(design);
        }
        let mut conditions = conditions(&kept, constraints);
        let turn = self.prescription.as_ref().map(|(p, _)| p.turn(constraints, &self.alignments));
        let start = match (turn, &self.turned) {
            (Some(turn), Some([along, across])) => {
                let mix = |free: &[f64], a: &[f64], b: &[f64]| -> Vec<f64> {
                    free.iter().zip(a.iter().zip(b)).map(|(f, (a, b))| f + turn.re * a + turn.im * b).collect()
                };
                Pull {
                    force: mix(&self.free.force, &along.force, &across.force),
                    field: mix(&self.free.field, &along.field, &across.field),
                    laplacian: None,
                }
            }
            _ => self.free.clone(),
        };
        let mut rows = self.rows(basis, &conditions);
        let mut found = start.clone();
        self.satisfy(basis, &rows, &conditions, &mut found)?;
        if let (Some(turn), Some((prescription, _))) = (turn, &self.prescription) {
            let own = conditions.len();
            conditions.extend(self.around(basis, prescription, turn, &found.field));
            rows = self.rows(basis, &conditions);
            for _ in 0..ROUNDS {
                found = start.clone();
                self.satisfy(basis, &rows, &conditions, &mut found)?;
                let mut at = own;
                let mut met = true;
                for fan in prescription.field.fans() {
                    let range = at..at + fan.len();
                    at = range.end;
                    if !range.clone().all(|c| near(&rows, &conditions[c], b * c..b * (c + 1), &found.field)) {
                        met = false;
                        conditions[range].iter_mut().for_each(Condition::stiffen);
                    }
                }
                if met {
                    break;
                }
            }
        }
        let own = &found.field;
        let number = |at: usize, i: usize| rows.column(b * at + i).iter().zip(own).map(|(r, z)| r * z).sum();
        let residuals = residuals(&kept, constraints, b, number);
        self.finish(found, turn, residuals, (!coefficients).then(Vec::new))
    }

    /// The same in the space itself, where there are many constraints; `None` where there are not, or where that cannot
    /// be.
    fn solve_many(
        &self,
        basis: &FieldBasis,
        kept: &[usize],
        constraints: &[Constraint],
    ) -> Result<Option<Design>, DesignError> {
        let Inverse::Ritz(inverse) = &self.inverse else { return Ok(None) };
        let uniform = self.alignments.iter().map(|alignment| alignment.1).sum();
        let (model, weights) = (&self.model, self.weights);
        let setting = Setting { model, basis, weights, uniform, inverse, kernel: &self.kernel };
        let few_idle = self.kernel.len() <= MOST_IDLE;
        if self.prescription.is_some() || !few_idle || !model.has_many(kept.len()) {
            return Ok(None);
        }
        let mut force = vec![0.0; model.dimension()];
        for (field, weight) in &self.alignments {
            force.iter_mut().zip(&field.reduced).for_each(|(f, r)| *f += weight * r);
        }
        let own: Vec<Constraint> = kept.iter().map(|&c| constraints[c]).collect();
        let Some(field) = self.many.solve(&setting, &own, &force)? else { return Ok(None) };
        let mut reached = vec![[0.0; 3]; own.len()];
        for (constraint, reached) in own.iter().zip(&mut reached) {
            basis.space.row_entries(constraint.face as usize, |column, u| {
                reached.iter_mut().zip(u).for_each(|(sum, u)| *sum += u * field[column]);
            });
        }
        let residuals = residuals(kept, constraints, basis.space.block(), |at, i| reached[at][i]);
        let image = basis.mass.multiply(&field);
        let found = Pull { force: Vec::new(), field: model.project(&image), laplacian: None };
        if self.exceeds(basis, &conditions(kept, constraints), &found.field) {
            // Too much of what costs nothing: one system of all constraints bounds it.
            return Ok(None);
        }
        let coefficients = field.iter().map(|&x| x as f32).collect();
        self.finish(found, None, residuals, Some(coefficients)).map(Some)
    }

    /// The rows of the space at conditions, in the coordinates of the inverse: `d × b k`.
    fn rows(&self, basis: &FieldBasis, conditions: &[Condition]) -> DenseMatrix {
        let (b, d) = (basis.space.block(), self.model.dimension());
        let mut rows = DenseMatrix::zeros(d, b * conditions.len());
        for (at, condition) in conditions.iter().enumerate() {
            basis.space.row_entries(condition.face as usize, |column, u| {
                for (i, &u) in u.iter().enumerate() {
                    let into = rows.column_mut(b * at + i);
                    match &self.inverse {
                        Inverse::Ritz(_) => add_row(into, &self.model.ritz.vectors[d * column..d * (column + 1)], u),
                        Inverse::Sparse(_) => into[column] += u,
                    }
                }
            });
        }
        rows
    }

    /// The conditions around prescribed singularities, their lengths read from a field.
    fn around(
        &self,
        basis: &FieldBasis,
        prescription: &Prescription,
        turn: Complex64,
        field: &[f64],
    ) -> Vec<Condition> {
        let (b, target) = (basis.space.block(), &prescription.field);
        let spacing = (basis.space.groups().max(1) as f64).sqrt();
        let mut all = Vec::new();
        for ((fan, distance), singularity) in target.fans().iter().zip(target.distances()).zip(target.prescribed()) {
            let growth = (distance * spacing).min(1.0).powi(singularity.numerator.unsigned_abs() as i32);
            let mut conditions: Vec<Condition> = fan
                .iter()
                .map(|&(face, size)| Condition {
                    face,
                    value: target.value(face as usize, turn).map(|v| v * size),
                    slack: Slack::Share(AROUND),
                })
                .collect();
            let rows = self.rows(basis, &conditions);
            let (mut product, mut square) = (0.0, 0.0);
            for (at, condition) in conditions.iter().enumerate() {
                for i in 0..b {
                    let own: f64 = rows.column(b * at + i).iter().zip(field).map(|(r, z)| r * z).sum();
                    product += own * condition.value[i];
                    square += condition.value[i] * condition.value[i];
                }
            }
            let length = (product / square.max(f64::MIN_POSITIVE)).max(LEAST_GROWTH * growth);
            conditions.iter_mut().for_each(|c| c.value = c.value.map(|v| v * length));
            all.extend(conditions);
        }
        all
    }

    /// Changes a field so that it meets conditions.
    fn satisfy(
        &self,
        basis: &FieldBasis,
        rows: &DenseMatrix,
        conditions: &[Condition],
        found: &mut Pull,
    ) -> Result<(), DesignError> {
        if conditions.is_empty() {
            return Ok(());
        }
        let kernel = self.free(conditions);
        if self.is_held() {
            let start = found.clone();
            self.satisfy_with(basis, (rows, kernel), conditions, found)?;
            return self.shorten(basis, (rows, conditions), &start, found);
        }
        let before = (kernel.count() == 0 && self.pencil.is_some()).then(|| found.clone());
        self.satisfy_with(basis, (rows, kernel), conditions, found)?;
        if let Some(before) = before
            && let Some(idle) = self.too_long(basis, conditions, &found.field)
        {
            *found = before;
            self.satisfy_with(basis, (rows, Kernel::Fields(idle)), conditions, found)?;
        }
        Ok(())
    }

    fn satisfy_with(
        &self,
        basis: &FieldBasis,
        (rows, kernel): (&DenseMatrix, Kernel<'_>),
        conditions: &[Condition],
        found: &mut Pull,
    ) -> Result<(), DesignError> {
        if let Some(inverse) = self.for_halves(conditions) {
            return self.satisfy_by_halves((inverse, basis), (rows, kernel), conditions, found);
        }
        let solved = self.moved_by(rows, kernel)?;
        let compliance = self.compliance_of(rows, &solved);
        let y = self.multipliers(rows, compliance, conditions, (basis, kernel), &mut found.field)?;
        for (column, &y) in y.iter().enumerate() {
            found.field.iter_mut().zip(solved.column(column)).for_each(|(z, s)| *z += y * s);
            found.force.iter_mut().zip(rows.column(column)).for_each(|(f, r)| *f += y * r);
        }
        Ok(())
    }

    /// What unit pulls at rows move, without what has no energy.
    fn moved_by(&self, rows: &DenseMatrix, kernel: Kernel<'_>) -> Result<DenseMatrix, FactorError> {
        let mut moved = rows.clone();
        match kernel {
            Kernel::Fields(idle) => idle::without(idle, moved.values_mut(), |x| self.inverse.apply(x))?,
            Kernel::Coordinates(_) => self.inverse.apply(moved.values_mut())?,
        }
        Ok(moved)
    }

    /// What has no energy and is to be told apart from what yields: strengths are measured by the latter. Ritz
    /// coordinates know it; with a sparse factor it is looked for once.
    fn free(&self, conditions: &[Condition]) -> Kernel<'_> {
        if let Inverse::Ritz(_) = self.inverse {
            return Kernel::Coordinates(&self.kernel);
        }
        if self.is_held() || !conditions.iter().any(|c| matches!(c.slack, Slack::Own(_))) {
            return Kernel::Coordinates(&[]);
        }
        self.idle().map_or(Kernel::Coordinates(&[]), Kernel::Fields)
    }

    /// Fields of next to no energy, where the inverse is a sparse factor of the energies: beside an alignment there are
    /// none.
    fn idle(&self) -> Option<&[Idle]> {
        let (Inverse::Sparse(inverse), Some(pencil)) = (&self.inverse, &self.pencil) else { return None };
        let factor = inverse.alone()?;
        let floor = floor(self.weights.harmonic, self.weights.biharmonic);
        Some(made_once::<Vec<Idle>>(&self.idle, || idle::find(|x| factor.apply(x), &pencil.mass, floor)))
    }

    /// Whether designs stay close to prescribed singularities.
    pub(super) fn is_prescribed(&self) -> bool {
        self.prescription.is_some()
    }

    /// About the bytes that it takes beside the model, without what it keeps of many constraints.
    pub fn bytes(&self) -> u64 {
        let inverse = match &self.inverse {
            Inverse::Ritz(diagonal) => 8 * diagonal.len() as u64,
            Inverse::Sparse(inverse) => inverse.bytes(),
        };
        inverse + 48 * self.model.dimension() as u64
    }

    /// What is kept of many constraints.
    #[cfg(test)]
    pub(super) fn last_factor_of_many(&self) -> (usize, usize) {
        self.many.last_factor()
    }

    /// Whether both designs are solved by one sparse factor.
    #[cfg(test)]
    pub(super) fn shares_its_factor(&self, other: &Self) -> bool {
        match (&self.inverse, &other.inverse) {
            (Inverse::Sparse(own), Inverse::Sparse(other)) => own.shares_its_factor(other),
            _ => false,
        }
    }

    /// The weights it was made for.
    pub fn weights(&self) -> EnergyWeights {
        self.weights
    }
}
