//! What has no energy is to be no longer than it may: where a sparse factor does not know it, and where something else
//! holds it.

use chladni_algebra::{DefiniteFactor, DenseMatrix, dot_in_order, solve_definite};
use chladni_base::made_once;

use super::super::alignment::Alignment;
use super::super::compliance::slacks;
use super::super::constraints::{Condition, values_of};
use super::super::design::{Design, DesignError};
use super::super::idle::{self, Idle, Kernel};
use super::super::idle_parts::{FaceComponents, IdlePart, Parts, norm};
use super::super::pencil::{Sum, floor};
use super::{LONGEST_IDLE, Pull, WeightedModel, times};
use crate::basis::FieldBasis;

/// Steps of bisection, and the orders of magnitude that they are over.
const STEPS: usize = 60;
const ORDERS: i32 = 14;

/// What was shortened is as long as it may be but for rounding.
const REACHED: f64 = 1.0 - 1e-6;

/// The longest value that a field asks for where it has weights per face, its mean length where it has none.
fn asked_by(alignment: &Alignment, b: usize) -> f64 {
    let Some(masses) = &alignment.masses else { return alignment.constant.max(0.0).sqrt() };
    let one = |(force, &mass): (&[f64], &f64)| if mass > 0.0 { norm(force) / mass } else { 0.0 };
    alignment.force.chunks(b.max(1)).zip(masses.iter()).map(one).fold(0.0, f64::max)
}

/// Fields without energy that something else holds.
enum HeldIdle<'a> {
    /// The first Ritz coordinates.
    Coordinates(usize),
    Fields(&'a [Idle]),
}

impl WeightedModel {
    /// Whether something but the energies holds fields.
    pub(super) fn is_held(&self) -> bool {
        self.prescription.is_some() || !self.alignments.is_empty()
    }

    /// The components of the surface, where they are known.
    fn components(&self) -> Option<&FaceComponents> {
        self.model.components.as_deref()
    }

    /// Fields without energy by component, beside conditions.
    pub(super) fn parts<'a>(&'a self, basis: &FieldBasis, kernel: Kernel<'_>, conditions: &[Condition]) -> Parts<'a> {
        let faces = conditions.iter().map(|condition| condition.face);
        Parts::new(self.idle_parts(basis, kernel), self.components(), faces)
    }

    /// Fields without energy by component.
    fn idle_parts(&self, basis: &FieldBasis, kernel: Kernel<'_>) -> &[IdlePart] {
        let of = |fields: &[Vec<f64>]| IdlePart::of_space(self.components(), basis, &basis.mass, fields);
        match kernel {
            Kernel::Fields(idle) => made_once::<Vec<IdlePart>>(&self.idle_parts, || {
                let fields: Vec<Vec<f64>> = idle.iter().map(|one| one.field.clone()).collect();
                of(&fields)
            }),
            Kernel::Coordinates(at) => made_once::<Vec<IdlePart>>(&self.model.idle_parts.0, || {
                let field = |&k: &usize| self.model.eigenfield(k).into_iter().map(f64::from).collect();
                of(&at.iter().map(field).collect::<Vec<Vec<f64>>>())
            }),
        }
    }

    /// The fields of next to no energy, where a sparse factor was solved with that does not know them, and where there
    /// is more of them in a field than conditions may ask for. They are looked for where the field is as long as that.
    pub(super) fn too_long(&self, basis: &FieldBasis, conditions: &[Condition], field: &[f64]) -> Option<&[Idle]> {
        let pencil = self.pencil.as_ref()?;
        if self.is_short(basis, conditions, &times(&pencil.mass, field), field) {
            return None;
        }
        let idle = self.idle()?;
        let parts = self.parts(basis, Kernel::Fields(idle), conditions);
        let amounts: Vec<f64> = idle.iter().map(|one| dot_in_order(&one.image, field)).collect();
        let b = basis.space.block();
        (parts.times_asked(&amounts, &values_of(conditions, b), b) > LONGEST_IDLE).then_some(idle)
    }

    /// Whether a field is so short that nothing can be too long in it, on whatever component it is.
    fn is_short(&self, basis: &FieldBasis, conditions: &[Condition], image: &[f64], field: &[f64]) -> bool {
        let length = image.iter().zip(field).map(|(a, b)| a * b).sum::<f64>().max(0.0).sqrt();
        let b = basis.space.block();
        let unit = |condition: &Condition| self.components().map_or(1.0, |all| all.unit(condition.face));
        let least = |condition: &Condition| unit(condition) * (self.asked_beside(b).max(norm(&condition.value)));
        length <= LONGEST_IDLE * conditions.iter().map(least).fold(f64::INFINITY, f64::min)
    }

    /// The first Ritz coordinates, which have no energy of their own, whatever alignments give them.
    fn idle_coordinates(&self) -> usize {
        let least = self.model.least_value();
        self.model.values().iter().take_while(|value| **value <= least).count()
    }

    /// What alignments ask for: lengths, as constraints do.
    fn asked_beside(&self, b: usize) -> f64 {
        let aligned = self.alignments.iter().map(|(one, _)| asked_by(one, b));
        aligned.chain(self.prescription.iter().map(|(one, _)| asked_by(&one.along, b))).fold(0.0, f64::max)
    }

    /// How long each part may be, as amounts of its fields.
    fn most(&self, parts: &Parts<'_>, conditions: &[Condition], b: usize) -> Vec<f64> {
        let (beside, values) = (self.asked_beside(b), values_of(conditions, b));
        parts.list.iter().map(|part| LONGEST_IDLE * part.unit * beside.max(parts.asked(part, &values, b))).collect()
    }

    /// The parts of the first Ritz coordinates.
    fn coordinate_parts<'a>(&'a self, basis: &FieldBasis, conditions: &[Condition]) -> Parts<'a> {
        let all: Vec<usize> = (0..self.idle_coordinates()).collect();
        self.parts(basis, Kernel::Coordinates(&all), conditions)
    }

    /// Whether what has no energy is longer than it may be in a design, or as long where it was shortened.
    pub(super) fn exceeds(&self, basis: &FieldBasis, conditions: &[Condition], ritz: &[f64]) -> bool {
        let (f, b) = (self.idle_coordinates(), basis.space.block());
        let parts = self.coordinate_parts(basis, conditions);
        let idle = &ritz[..f.min(ritz.len())];
        if self.is_held() {
            return self.reaches(parts, conditions, idle).is_some();
        }
        parts.times_asked(idle, &values_of(conditions, b), b) > LONGEST_IDLE
    }

    /// Whether a design beside alignments is as long as it may be: then it is none of least energy without a bound.
    /// Gives its length in units of what is asked for.
    pub(in super::super) fn is_bounded(
        &self,
        basis: &FieldBasis,
        conditions: &[Condition],
        design: &Design,
    ) -> Option<f64> {
        if !self.is_held() {
            return None;
        }
        let f = self.idle_coordinates();
        if self.model.has_ritz() {
            let known = f > 0 && design.ritz.len() >= f;
            return known
                .then(|| self.reaches(self.coordinate_parts(basis, conditions), conditions, &design.ritz[..f]))?;
        }
        // Where nothing was long enough to look for them, nothing was shortened.
        let idle = self.idle.get()?;
        let along = |one: &Idle| one.image.iter().zip(&design.coefficients).map(|(m, &x)| m * f64::from(x)).sum();
        let amounts: Vec<f64> = idle.iter().map(along).collect();
        let parts = self.parts(basis, Kernel::Fields(idle), conditions);
        self.reaches(parts, conditions, &amounts)
    }

    fn reaches(&self, parts: Parts<'_>, conditions: &[Condition], amounts: &[f64]) -> Option<f64> {
        let b = self.model.kind.block();
        let most = self.most(&parts, conditions, b);
        let reached = parts.list.iter().zip(&most).any(|(part, most)| {
            let length = norm(&part.amounts(amounts));
            parts.has_conditions(part) && length > 0.0 && length >= REACHED * *most
        });
        reached.then(|| parts.times_asked(amounts, &values_of(conditions, b), b))
    }

    /// Fields without energy that something else holds, where a field is long enough that there may be too much of
    /// them.
    fn held_idle(
        &self,
        basis: &FieldBasis,
        conditions: &[Condition],
        field: &[f64],
    ) -> Result<Option<HeldIdle<'_>>, DesignError> {
        let Some(pencil) = &self.pencil else {
            let count = self.idle_coordinates();
            return Ok((count > 0).then_some(HeldIdle::Coordinates(count)));
        };
        if self.is_short(basis, conditions, &times(&pencil.mass, field), field) {
            return Ok(None);
        }
        let idle = match self.idle.get() {
            Some(known) => known,
            None if self.model.has_ritz() => {
                let one = |k: usize| {
                    let field: Vec<f64> = self.model.eigenfield(k).into_iter().map(f64::from).collect();
                    Idle { image: times(&pencil.mass, &field), field }
                };
                made_once(&self.idle, || (0..self.idle_coordinates()).map(one).collect())
            }
            None => {
                // The factor of the sum holds them: that of the energies alone tells what they are.
                let (harmonic, biharmonic) = (self.weights.harmonic, self.weights.biharmonic);
                let alone = pencil.factor(&Sum { harmonic, biharmonic, uniform: 0.0, grams: Vec::new() })?;
                let found = idle::find(|x| alone.apply(x), &pencil.mass, floor(harmonic, biharmonic));
                self.idle.get_or_init(|| found)
            }
        };
        Ok((!idle.is_empty()).then_some(HeldIdle::Fields(idle)))
    }

    /// Beside alignments what has no energy of its own is no kernel: where there is more of it in a field than may be,
    /// the least `m` is looked for, one for each component, with which `m |idle part|²` in the energy makes it as long
    /// as it may be.
    ///
    /// With `J` the images of such fields, `K⁻¹` gives way to `K⁻¹ − K⁻¹J (D⁻¹ + O)⁻¹ JᵀK⁻¹`, where `O = JᵀK⁻¹J` and
    /// `D` has the `m` of each field. What pulls at constraints move is split into what they move without such fields,
    /// `R`, which has one factor, and `A (O + ODO)⁻¹ Aᵀ` with `A = CK⁻¹J`: nothing is subtracted from what is nearly
    /// free, and a step of bisection takes systems of the number of such fields alone.
    pub(super) fn shorten(
        &self,
        basis: &FieldBasis,
        (rows, conditions): (&DenseMatrix, &[Condition]),
        start: &Pull,
        found: &mut Pull,
    ) -> Result<(), DesignError> {
        let b = basis.space.block();
        let Some(idle) = self.held_idle(basis, conditions, &found.field)? else { return Ok(()) };
        let parts = match idle {
            HeldIdle::Coordinates(_) => self.coordinate_parts(basis, conditions),
            HeldIdle::Fields(fields) => self.parts(basis, Kernel::Fields(fields), conditions),
        };
        let idle = MixedIdle::new(&idle, &parts, self.model.dimension());
        let most = self.most(&parts, conditions, b);
        let lengths = idle.lengths(&idle.along(&found.field));
        let long = |at: usize| parts.has_conditions(&parts.list[at]) && lengths[at] > most[at];
        if !(0..most.len()).any(long) {
            return Ok(());
        }
        let Some(held) = Held::new(self, (rows, conditions, b), &idle, start)? else { return Ok(()) };
        let scale = (0..idle.count()).map(|j| held.own.column(j)[j]).fold(f64::MIN_POSITIVE, f64::max).recip();
        let mut low = vec![scale * 10f64.powi(-ORDERS); most.len()];
        let mut high = vec![scale * 10f64.powi(ORDERS); most.len()];
        let weights = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            idle.part.iter().map(|&at| if long(at) { of(at) } else { 0.0 }).collect()
        };
        for _ in 0..STEPS {
            let middle: Vec<f64> = low.iter().zip(&high).map(|(low, high)| (low * high).sqrt()).collect();
            let lengths = idle.lengths(&held.answer(&weights(&|at| middle[at]))?.left);
            for (at, &middle) in middle.iter().enumerate() {
                *(if lengths[at] > most[at] { &mut low[at] } else { &mut high[at] }) = middle;
            }
        }
        let answer = held.answer(&weights(&|at| high[at]))?;
        *found = start.clone();
        let pulled = (0..answer.y.len()).map(|i| (answer.y[i], rows.column(i), held.solved.column(i)));
        let shorter = (0..idle.count()).map(|j| (-answer.pulls[j], idle.images.column(j), held.moved.column(j)));
        for (amount, force, field) in pulled.chain(shorter) {
            found.force.iter_mut().zip(force).for_each(|(x, own)| *x += amount * own);
            found.field.iter_mut().zip(field).for_each(|(x, own)| *x += amount * own);
        }
        found.laplacian = None;
        Ok(())
    }
}

/// Fields without energy, mixed by component.
struct MixedIdle {
    /// `J`, `d × f`: their images, in the coordinates of the inverse.
    images: DenseMatrix,
    /// `d × f`: themselves.
    fields: DenseMatrix,
    /// The part that each is of.
    part: Vec<usize>,
    parts: usize,
}

impl MixedIdle {
    fn new(idle: &HeldIdle<'_>, parts: &Parts<'_>, d: usize) -> Self {
        let count = match idle {
            HeldIdle::Coordinates(count) => *count,
            HeldIdle::Fields(fields) => fields.len(),
        };
        let (mut images, mut fields) = (DenseMatrix::zeros(d, count), DenseMatrix::zeros(d, count));
        let mut part = Vec::with_capacity(count);
        for (at, own) in parts.list.iter().enumerate() {
            for k in 0..own.count(count) {
                let mut mixture = vec![0.0; own.count(count)];
                mixture[k] = 1.0;
                let mut amounts = vec![0.0; count];
                own.add_to(&mixture, &mut amounts);
                let column = part.len();
                match idle {
                    HeldIdle::Coordinates(_) => {
                        images.column_mut(column)[..count].copy_from_slice(&amounts);
                        fields.column_mut(column)[..count].copy_from_slice(&amounts);
                    }
                    HeldIdle::Fields(all) => {
                        for (one, &amount) in all.iter().zip(&amounts).filter(|(_, amount)| **amount != 0.0) {
                            let add = |into: &mut [f64], own: &[f64]| {
                                into.iter_mut().zip(own).for_each(|(x, own)| *x += amount * own);
                            };
                            add(images.column_mut(column), &one.image);
                            add(fields.column_mut(column), &one.field);
                        }
                    }
                }
                part.push(at);
            }
        }
        Self { images, fields, part, parts: parts.list.len() }
    }

    fn count(&self) -> usize {
        self.part.len()
    }

    /// How much there is of each in a field.
    fn along(&self, field: &[f64]) -> Vec<f64> {
        (0..self.count()).map(|j| dot_in_order(self.images.column(j), field)).collect()
    }

    /// The length of each part.
    fn lengths(&self, amounts: &[f64]) -> Vec<f64> {
        let mut squares = vec![0.0; self.parts];
        self.part.iter().zip(amounts).for_each(|(&part, amount)| squares[part] += amount * amount);
        squares.into_iter().map(f64::sqrt).collect()
    }
}

/// What constraints and fields without energy do to each other where something else holds these.
struct Held {
    /// `K⁻¹ Cᵀ` and `K⁻¹ J`.
    solved: DenseMatrix,
    moved: DenseMatrix,
    /// `O` and `A`.
    own: DenseMatrix,
    at: DenseMatrix,
    /// `R⁻¹A`, `AᵀR⁻¹A`, and `R⁻¹` of what is missing at constraints.
    answered: DenseMatrix,
    product: DenseMatrix,
    missing: Vec<f64>,
    /// How much there is of each field without constraints.
    before: Vec<f64>,
}

/// The pulls at constraints, those that shorten fields without energy, and how much of these is left.
struct Shortened {
    y: Vec<f64>,
    pulls: Vec<f64>,
    left: Vec<f64>,
}

impl Held {
    /// `None` where constraints do not hold what has energy, so that it has no factor.
    fn new(
        model: &WeightedModel,
        (rows, conditions, b): (&DenseMatrix, &[Condition], usize),
        idle: &MixedIdle,
        start: &Pull,
    ) -> Result<Option<Self>, DesignError> {
        let (f, k) = (idle.count(), rows.columns());
        let mut moved = idle.images.clone();
        model.inverse.apply(moved.values_mut())?;
        let own = idle.images.transposed_times(&moved);
        // `R` and `K⁻¹Cᵀ`: constraints are freed of idle fields before they pull, so that nothing large is subtracted.
        let along = idle.fields.transposed_times(rows);
        let mut freed = rows.clone();
        subtract(&mut freed, &idle.images, &along);
        let mut solved = freed.clone();
        model.inverse.apply(solved.values_mut())?;
        let mut mixed = idle.images.transposed_times(&solved);
        solve_definite(own.clone(), &mut mixed).map_err(DesignError::Factor)?;
        let mut alone = solved.clone();
        subtract(&mut alone, &moved, &mixed);
        let mut rest = freed.transposed_times(&alone);
        let halves = rest.clone();
        for j in 0..k {
            for i in 0..k {
                rest.column_mut(j)[i] = 0.5 * (halves.column(j)[i] + halves.column(i)[j]);
            }
        }
        let slacks = slacks(&rest, conditions, b);
        slacks.iter().enumerate().for_each(|(i, slack)| rest.column_mut(i)[i] += slack);
        let Ok(rest) = DefiniteFactor::new(rest) else { return Ok(None) };
        let mut back = along;
        back.values_mut().iter_mut().for_each(|x| *x = -*x);
        subtract(&mut solved, &moved, &back);
        let at = rows.transposed_times(&moved);
        let mut answered = DenseMatrix::zeros(k, 1 + f);
        for (i, missing) in answered.column_mut(0).iter_mut().enumerate() {
            *missing = conditions[i / b].value[i % b] - dot_in_order(rows.column(i), &start.field);
        }
        (0..f).for_each(|j| answered.column_mut(1 + j).copy_from_slice(at.column(j)));
        rest.solve(&mut answered).map_err(DesignError::Factor)?;
        let missing = answered.column(0).to_vec();
        let answered = DenseMatrix::from_columns(k, f, answered.values()[k..].to_vec());
        let product = at.transposed_times(&answered);
        let before = idle.along(&start.field);
        Ok(Some(Self { solved, moved, own, at, answered, product, missing, before }))
    }

    /// With so much in the energy for each field's square.
    fn answer(&self, weights: &[f64]) -> Result<Shortened, DesignError> {
        let f = weights.len();
        let roots: Vec<f64> = weights.iter().map(|m| m.sqrt()).collect();
        let mut bent = DenseMatrix::zeros(f, f);
        for j in 0..f {
            for i in 0..f {
                bent.column_mut(j)[i] = roots[i] * self.own.column(j)[i] * roots[j];
            }
            bent.column_mut(j)[j] += 1.0;
        }
        let bent = DefiniteFactor::new(bent).map_err(DesignError::Factor)?;
        // `(D⁻¹ + O)⁻¹ x`, and `D⁻¹` of it.
        let shortened = |x: &[f64]| -> Result<(Vec<f64>, Vec<f64>), DesignError> {
            let mut inner = column(x.iter().zip(&roots).map(|(x, r)| r * x));
            bent.solve(&mut inner).map_err(DesignError::Factor)?;
            let pulls: Vec<f64> = inner.column(0).iter().zip(&roots).map(|(x, r)| r * x).collect();
            let left = (0..f).map(|j| if weights[j] > 0.0 { pulls[j] / weights[j] } else { x[j] });
            let mut left: Vec<f64> = left.collect();
            for j in (0..f).filter(|&j| weights[j] == 0.0) {
                left[j] -= (0..f).map(|i| self.own.column(i)[j] * pulls[i]).sum::<f64>();
            }
            Ok((pulls, left))
        };
        let (first, _) = shortened(&self.before)?;
        let mut weighed = self.own.clone();
        for (j, m) in weights.iter().enumerate() {
            for i in 0..f {
                weighed.column_mut(i)[j] *= m;
            }
        }
        // `O + ODO`.
        let mut stiff = self.own.transposed_times(&weighed);
        stiff.values_mut().iter_mut().zip(self.own.values()).for_each(|(x, own)| *x += own);
        let mut system = stiff.clone();
        system.values_mut().iter_mut().zip(self.product.values()).for_each(|(x, own)| *x += own);
        let known = |j: usize| {
            let missing = dot_in_order(self.at.column(j), &self.missing);
            missing + (0..f).map(|i| self.product.column(i)[j] * first[i]).sum::<f64>()
        };
        let mut t = column((0..f).map(known));
        solve_definite(system, &mut t).map_err(DesignError::Factor)?;
        let t = t.column(0);
        let mut y = self.missing.clone();
        for j in 0..f {
            let amount = first[j] - t[j];
            y.iter_mut().zip(self.answered.column(j)).for_each(|(y, own)| *y += amount * own);
        }
        let gained = |j: usize| (0..f).map(|i| stiff.column(i)[j] * t[i]).sum::<f64>();
        let amounts: Vec<f64> = (0..f).map(|j| self.before[j] + gained(j)).collect();
        let (pulls, left) = shortened(&amounts)?;
        Ok(Shortened { y, pulls, left })
    }
}

/// `X −= Y Z`.
fn subtract(x: &mut DenseMatrix, y: &DenseMatrix, z: &DenseMatrix) {
    for k in 0..z.columns() {
        for (j, &amount) in z.column(k).iter().enumerate().filter(|(_, amount)| **amount != 0.0) {
            x.column_mut(k).iter_mut().zip(y.column(j)).for_each(|(x, y)| *x -= amount * y);
        }
    }
}

fn column(values: impl Iterator<Item = f64>) -> DenseMatrix {
    let values: Vec<f64> = values.collect();
    DenseMatrix::from_columns(values.len(), 1, values)
}
