//! The field of least energy among all fields of a surface, by sparse factors.
//!
//! Where the sum of the energies is a product, `K = μ (S + αM) M⁻¹ (S + βM)`, its inverse is a difference,
//! `((S + αM)⁻¹ − (S + βM)⁻¹) / μ(β − α)`. What constraints move at each other's faces then takes half of a solve with
//! either factor on the few supernodes that they reach, and the field itself one substitution with either. Fields
//! without energy are taken out of the right-hand sides before they are solved for.

use std::sync::Arc;

use chladni_algebra::{DenseMatrix, HalfSolved, dot_in_order};
use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::design::{Constraint, Design, DesignError};
use super::direct::{Direct, IdleSolves, ShiftedFactor};
use super::idle_parts::Parts;
use super::kernel::{Kernel, Own};
use super::refine::{FullSpace, Inner, RefineError, Refined};
use super::refine_response::{FullOperator, Response, Sum, add};
use super::roots::Roots;
use super::slack::Yield;
use super::weighted::{System, WeightedModel};
use crate::basis::FieldBasis;

/// More constraints are met by conjugate gradients on their pulls.
const MOST_CONSTRAINTS: usize = 256;

/// Faces whose halves of solves are held at once where only what each moves by itself is asked for.
const MEASURED_TOGETHER: usize = 64;

/// Where the sum is no product, what a face resists with takes solves by conjugate gradients: of no more faces than
/// this, and to this tolerance, whose square is the error.
const MOST_MEASURED: usize = 32;
const MEASURED: f64 = 1e-2;

/// How much closer together both inverses may be than either is large: their difference loses as many digits.
const MOST_CANCELLED: f64 = 1e6;

/// From here on the field is found by one inverse after the other instead of their difference, in a half more of the
/// time.
const CANCELLED: f64 = 100.0;

/// Hard constraints are met to this share of the largest that is asked for; it takes so many corrections at most.
const MET: f64 = 1e-9;
const CORRECTIONS: usize = 6;

/// How closely what alignments pull is answered.
const CLOSE: f64 = 1e-10;

/// The inverse as a difference: `scale · ((S + αM)⁻¹ − (S + βM)⁻¹)`, or the first of them alone.
struct Difference {
    small: f64,
    large: Option<f64>,
    scale: f64,
}

impl Difference {
    /// Of a sum with real roots that are not the same.
    fn of(sum: &Sum) -> Option<Self> {
        if sum.masses.is_some() {
            return None;
        }
        if sum.biharmonic <= 0.0 {
            let some = sum.harmonic > 0.0;
            return some.then(|| Self { small: sum.uniform / sum.harmonic, large: None, scale: 1.0 / sum.harmonic });
        }
        let Roots { small, large, scale } = Roots::of(sum.harmonic, sum.biharmonic, sum.uniform)?;
        (large <= super::refine_response::MOST_SHIFT).then_some(Self { small, large: Some(large), scale })
    }
}

/// A [`Difference`] with its factors.
struct Factors<'a> {
    difference: Difference,
    /// Fields without energy that nothing in the sum holds, where there are any.
    kernel: Option<&'a Kernel>,
    first: Arc<ShiftedFactor>,
    second: Option<Arc<ShiftedFactor>>,
}

/// What pulls move at the constrained numbers, `factor` times.
fn add_products<const B: usize>(halves: &[Arc<HalfSolved>], factor: f64, into: &mut DenseMatrix) {
    let pairs: Vec<(usize, usize)> = (0..halves.len()).flat_map(|j| (0..=j).map(move |i| (i, j))).collect();
    let products: Vec<Vec<f64>> = pairs.par_iter().map(|&(i, j)| halves[i].product(&halves[j])).collect();
    for ((i, j), product) in pairs.into_iter().zip(products) {
        for (at, value) in product.into_iter().enumerate() {
            let (row, column) = (B * i + at / B, B * j + at % B);
            into.column_mut(column)[row] += factor * value;
            if i != j {
                into.column_mut(row)[column] += factor * value;
            }
        }
    }
}

impl FullSpace {
    /// The field of least energy among all fields under the constraints of a design of the same model, by sparse
    /// factors that are kept; strengths of constraints are measured by what all fields of the surface resist with, so
    /// that the field depends on the reduced space in nothing. Its coefficients are those of the field of the space
    /// that is nearest to it, where the model has Ritz coordinates, and so is its distance.
    ///
    /// `None` where that is for [`refine`](Self::refine): on surfaces whose factors do not fit, beside alignments with
    /// weights per face or that outweigh the energies, and under more than 256 constraints.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn least(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: &Design,
        monitor: &dyn Monitor,
    ) -> Result<Option<Refined>, RefineError> {
        Self::check_bound(weighted, basis, constraints, design)?;
        self.least_with(weighted, basis, constraints, Some(design), monitor)
    }

    /// The same without what there is to say of the reduced space: coefficients are missing, and the distance is no
    /// number.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn least_field(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        monitor: &dyn Monitor,
    ) -> Result<Option<Refined>, RefineError> {
        self.least_with(weighted, basis, constraints, None, monitor)
    }

    /// A field with the coefficients of the field of the space that is nearest to it, and how far that is; as it is,
    /// where the model has no Ritz coordinates.
    ///
    /// # Errors
    /// [`RefineError::Design`]: the space is of another surface.
    pub fn with_nearest(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        found: Refined,
    ) -> Result<Refined, RefineError> {
        self.check(weighted, basis)?;
        match &self.inner {
            Inner::Two(whole) => whole.with_nearest(weighted, basis, found),
            Inner::Three(whole) => whole.with_nearest(weighted, basis, found),
        }
    }

    fn least_with(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: Option<&Design>,
        monitor: &dyn Monitor,
    ) -> Result<Option<Refined>, RefineError> {
        self.check(weighted, basis)?;
        match &self.inner {
            Inner::Two(whole) => whole.least(weighted, basis, constraints, design, monitor),
            Inner::Three(whole) => whole.least(weighted, basis, constraints, design, monitor),
        }
    }
}

impl<const B: usize> FullOperator<B> {
    /// The field of least energy under the constraints of a design of the same model, the strength of each measured by
    /// what all fields of the surface resist with; `None` where the sum of the energies is no such product, or where
    /// there are too many constraints or fields without energy.
    pub(super) fn least(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: Option<&Design>,
        monitor: &dyn Monitor,
    ) -> Result<Option<Refined>, RefineError> {
        let (sum, force) = weighted.whole_sum(B * self.mass.len());
        let Some(direct) = &self.direct else { return Ok(None) };
        let conditions = weighted.conditions(basis, constraints)?;
        if conditions.len() > MOST_CONSTRAINTS {
            return Ok(None);
        }
        let Some(factors) = self.factors(direct, &sum, monitor)? else { return Ok(None) };
        let Factors { difference, kernel, first, second } = &factors;
        let kernel = *kernel;
        let mut field = match force {
            Some(force) => Response::new(self, sum, kernel)?.apply(&force, CLOSE, monitor)?,
            None => vec![0.0; B * self.mass.len()],
        };
        if !conditions.is_empty() {
            let faces: Vec<u32> = conditions.iter().map(|condition| condition.face).collect();
            let halves = direct.halves(first, &faces);
            let others = second.as_ref().map(|factor| direct.halves(factor, &faces));
            let size = B * faces.len();
            let (mut moved, mut less) = (DenseMatrix::zeros(size, size), DenseMatrix::zeros(size, size));
            add_products::<B>(&halves, difference.scale, &mut moved);
            others.iter().for_each(|halves| add_products::<B>(halves, -difference.scale, &mut less));
            let idle = IdleHalves::new(self, direct, first, kernel, &faces, &halves);
            idle.take_out(difference.scale, &mut moved);
            let trace = |matrix: &DenseMatrix| (0..size).map(|i| matrix.column(i)[i].abs()).sum::<f64>();
            let before = trace(&moved);
            moved.values_mut().iter_mut().zip(less.values()).for_each(|(m, l)| *m += l);
            if let Some(second) = second {
                idle.take_out_of_second(difference.scale / second.gamma, &mut moved);
            }
            let after = trace(&moved);
            if !(before <= MOST_CANCELLED * after) {
                return Ok(None);
            }
            let mut right = DenseMatrix::zeros(size, 1 + idle.own.len());
            for (i, missing) in right.column_mut(0).iter_mut().enumerate() {
                let condition = &conditions[i / B];
                *missing = condition.value[i % B] - field[B * condition.face as usize + i % B];
            }
            for k in 0..idle.own.len() {
                right.column_mut(1 + k).iter_mut().zip(&idle.values).for_each(|(r, values)| *r = values[k]);
            }
            let system = match System::new(moved, &conditions, B, (&right, 0.0)) {
                // Constraints at different faces depend on each other by rounding alone.
                Err(DesignError::Dependent { .. }) => return Ok(None),
                made => made?,
            };
            let answer = |y: &[f64]| {
                let mut half = vec![0.0; B * self.mass.len()];
                halves.iter().zip(y.chunks_exact(B)).for_each(|(own, y)| own.add_to(y, &mut half));
                idle.take_out_of_half(direct, y, &mut half);
                let Some((second, others)) = second.as_ref().zip(others.as_ref()) else {
                    return (direct.substituted(first, half), difference.scale);
                };
                if before > CANCELLED * after {
                    // One inverse after the other, of which nothing is subtracted.
                    let mut own = direct.substituted(first, half);
                    kernel.iter().for_each(|kernel| kernel.take_out(self, &mut own));
                    let between = second.gamma - difference.small;
                    return (direct.solve(second, &self.weighed(&own)), difference.scale * between);
                }
                let mut other = vec![0.0; B * self.mass.len()];
                others.iter().zip(y.chunks_exact(B)).for_each(|(own, y)| own.add_to(y, &mut other));
                let (mut own, other) =
                    rayon::join(|| direct.substituted(first, half), || direct.substituted(second, other));
                add(&mut own, &other, -1.0);
                (own, difference.scale)
            };
            let wanted = conditions.iter().flat_map(|condition| &condition.value[..B]);
            let wanted = wanted.fold(0.0f64, |most, value| most.max(value.abs()));
            let mut pulls = vec![0.0; size];
            let parts = match kernel {
                Some(kernel) => kernel.parts(&idle.own, &self.mass, &faces),
                None => Parts::on(Vec::new(), Vec::new()),
            };
            let mut yielding = Vec::new();
            for step in 0.. {
                let (y, amounts) = system.pulls(&right, &conditions, (B, &parts), &mut yielding)?;
                let (mut own, scale) = answer(&y);
                kernel.iter().for_each(|kernel| kernel.take_out(self, &mut own));
                add(&mut field, &own, scale);
                kernel.iter().for_each(|kernel| kernel.add_to::<B>(&idle.own, &amounts, &mut field));
                pulls.iter_mut().zip(&y).for_each(|(sum, y)| *sum += y);
                let values = faces.iter().flat_map(|&face| &field[B * face as usize..B * (face as usize + 1)]);
                let (missing, most) = system.missing(values.copied(), &conditions, B, &pulls);
                if most <= MET * wanted {
                    break;
                }
                monitor.checkpoint()?;
                if step == CORRECTIONS {
                    // Digits are lost that no correction brings back.
                    return Ok(None);
                }
                right.column_mut(0).copy_from_slice(&missing);
            }
        }
        let nearest = |design: &Design| {
            let found = weighted.nearest(basis, &self.weighed(&field));
            found.unwrap_or_else(|| design.coefficients.clone())
        };
        let coefficients = design.map(nearest);
        self.measured(weighted, basis, constraints, coefficients, field, 0).map(Some)
    }

    /// The inverse of a sum as a difference, with the factors that it takes; `None` where it is none, or fields without
    /// energy are not known.
    fn factors(
        &self,
        direct: &Direct<B>,
        sum: &Sum,
        monitor: &dyn Monitor,
    ) -> Result<Option<Factors<'_>>, RefineError> {
        let Some(difference) = Difference::of(sum) else { return Ok(None) };
        let factor = |gamma: f64| -> Result<_, RefineError> {
            monitor.checkpoint()?;
            Ok(direct.factor(&self.stiffness, &self.mass, gamma).map_err(DesignError::Sparse)?)
        };
        let kernel = match (sum.uniform > 0.0, self.kernel.get()) {
            (true, _) => None,
            (false, Some(known)) if known.is_empty() || known.is_complete() => Some(known),
            (false, Some(_)) => return Ok(None),
            (false, None) => match self.idle(direct, &*factor(difference.small)?, monitor)? {
                Some(kernel) => Some(kernel),
                None => return Ok(None),
            },
        };
        let kernel = kernel.filter(|kernel| !kernel.is_empty());
        let first = match kernel {
            None => factor(difference.small)?,
            Some(kernel) => {
                monitor.checkpoint()?;
                direct.grounded(&self.stiffness, || kernel.to_ground(&self.stiffness)).map_err(DesignError::Sparse)?
            }
        };
        let second = difference.large.map(factor).transpose()?;
        Ok(Some(Factors { difference, kernel, first, second }))
    }

    /// What unit pulls at each of some faces move there, without fields that have no energy; `None` where neither
    /// factors nor few enough solves tell.
    pub(super) fn yields(
        &self,
        response: &Response<'_, B>,
        faces: &[u32],
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Yield>>, RefineError> {
        let Some(direct) = &self.direct else { return Ok(None) };
        let empty = [[0.0; 3]; 3];
        if let Some(Factors { difference, kernel, first, second }) = self.factors(direct, response.sum(), monitor)? {
            let mut found = Vec::with_capacity(faces.len());
            for faces in faces.chunks(MEASURED_TOGETHER) {
                monitor.checkpoint()?;
                let halves = direct.halves(&first, faces);
                let others = second.as_ref().map(|factor| direct.halves(factor, faces));
                let size = B * faces.len();
                let mut moved = DenseMatrix::zeros(size, size);
                for (at, own) in halves.iter().enumerate() {
                    let mut product = own.product(own);
                    if let Some(other) = others.as_ref().map(|others| &others[at]) {
                        product.iter_mut().zip(other.product(other)).for_each(|(own, other)| *own -= other);
                    }
                    for (k, value) in product.into_iter().enumerate() {
                        moved.column_mut(B * at + k % B)[B * at + k / B] = difference.scale * value;
                    }
                }
                let idle = IdleHalves::new(self, direct, &first, kernel, faces, &halves);
                idle.take_out(difference.scale, &mut moved);
                if let Some(second) = &second {
                    idle.take_out_of_second(difference.scale / second.gamma, &mut moved);
                }
                for at in 0..faces.len() {
                    let entry = |i: usize, j: usize| moved.column(B * at + j)[B * at + i];
                    let mut own = empty;
                    (0..B).for_each(|i| (0..B).for_each(|j| own[i][j] = 0.5 * (entry(i, j) + entry(j, i))));
                    found.push(own);
                }
            }
            return Ok(Some(found));
        }
        if faces.len() > MOST_MEASURED {
            return Ok(None);
        }
        let mut found = Vec::with_capacity(faces.len());
        for &face in faces {
            let mut own = empty;
            let place = B * face as usize;
            for j in 0..B {
                let mut pull = vec![0.0; B * self.mass.len()];
                pull[place + j] = 1.0;
                let moved = response.apply(&pull, MEASURED, monitor)?;
                (0..B).for_each(|i| own[i][j] = moved[place + i]);
            }
            let mirrored = own;
            (0..B).for_each(|i| (0..B).for_each(|j| own[i][j] = 0.5 * (mirrored[i][j] + mirrored[j][i])));
            found.push(own);
        }
        Ok(Some(found))
    }

    fn with_nearest(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        mut found: Refined,
    ) -> Result<Refined, RefineError> {
        if let Some(coefficients) = weighted.nearest(basis, &self.weighed(&found.field)) {
            found.distance = self.apart(basis, &coefficients, &found.field)?;
            found.coefficients = coefficients;
        }
        Ok(found)
    }

    fn weighed(&self, field: &[f64]) -> Vec<f64> {
        let mut image = field.to_vec();
        self.weigh(&mut image);
        image
    }
}

/// What fields without energy have at the constrained numbers, and what is needed to take them out of the first
/// inverse.
struct IdleHalves<'a> {
    /// Those of the components that have constraints.
    own: Vec<Own>,
    /// For each number those of all of them.
    values: Vec<Vec<f64>>,
    /// For each number the products of half of its solve with those for `M z`.
    products: Vec<Vec<f64>>,
    /// `(M z)ᵀ (S + αM)⁻¹ M z'`.
    square: Vec<Vec<f64>>,
    kept: Option<(&'a Kernel, &'a IdleSolves)>,
}

impl<'a> IdleHalves<'a> {
    fn new<const B: usize>(
        whole: &FullOperator<B>,
        direct: &Direct<B>,
        factor: &'a ShiftedFactor,
        kernel: Option<&'a Kernel>,
        faces: &[u32],
        halves: &[Arc<HalfSolved>],
    ) -> Self {
        let Some(kernel) = kernel else {
            let none = || vec![Vec::new(); B * faces.len()];
            return Self { own: Vec::new(), values: none(), products: none(), square: Vec::new(), kept: None };
        };
        let kept = direct.idle_halves(factor, || kernel.images(whole), |a, b| kernel.squares::<B>(a, b));
        let own = kernel.at(faces);
        let numbers = faces.iter().flat_map(|&face| (0..B).map(move |i| (face, i)));
        let values =
            numbers.map(|(face, i)| own.iter().map(|&own| kernel.value::<B>(own, face, i)).collect()).collect();
        let with = |(half, &face): (&Arc<HalfSolved>, &u32)| {
            let component = kernel.component(face);
            let all: Vec<Vec<f64>> = kept.halves.iter().map(|idle| half.product_with(idle)).collect();
            let of = |own: &Own, i: usize| if own.component == component { all[own.slot][i] } else { 0.0 };
            (0..B).map(|i| own.iter().map(|own| of(own, i)).collect::<Vec<f64>>()).collect::<Vec<_>>()
        };
        let products = halves.par_iter().zip(faces).flat_map_iter(with).collect();
        let entry = |a: &Own, b: &Own| {
            if a.component == b.component { kept.squares[a.slot][b.slot][a.component] } else { 0.0 }
        };
        let square = own.iter().map(|a| own.iter().map(|b| entry(a, b)).collect()).collect();
        Self { own, values, products, square, kept: Some((kernel, kept)) }
    }

    /// From `Cᵀ A⁻¹ C` to `(PC)ᵀ A⁻¹ PC`, where `P` takes the images of idle fields out of pulls.
    fn take_out(&self, scale: f64, moved: &mut DenseMatrix) {
        if self.own.is_empty() {
            return;
        }
        for (j, (value, product)) in self.values.iter().zip(&self.products).enumerate() {
            let turned: Vec<f64> = self.square.iter().map(|row| dot_in_order(row, value)).collect();
            for (i, into) in moved.column_mut(j).iter_mut().enumerate() {
                let both = dot_in_order(&self.values[i], &turned)
                    - dot_in_order(&self.products[i], value)
                    - dot_in_order(&self.values[i], product);
                *into += scale * both;
            }
        }
    }

    /// The same of the second inverse, `−scale · γ (S + γM)⁻¹`, in which idle fields are eigenvectors of `1 / γ`.
    fn take_out_of_second(&self, scale: f64, moved: &mut DenseMatrix) {
        for (j, value) in self.values.iter().enumerate() {
            let column = moved.column_mut(j).iter_mut().zip(&self.values);
            column.for_each(|(into, own)| *into += scale * dot_in_order(own, value));
        }
    }

    fn take_out_of_half<const B: usize>(&self, direct: &Direct<B>, y: &[f64], half: &mut [f64]) {
        let Some((kernel, kept)) = self.kept else { return };
        let share = |k: usize| self.values.iter().zip(y).map(|(values, y)| values[k] * y).sum::<f64>();
        let shares: Vec<f64> = (0..self.own.len()).map(share).collect();
        kernel.take_shares_out::<B>((&self.own, &shares), &kept.halves, direct.order(), half);
    }
}

impl System {
    /// What pulls at each constrained number, and how much there is of each field without energy: `right` has what is
    /// missing, and then the values of those fields; `yielding` is what the first step of several says about these.
    fn pulls(
        &self,
        right: &DenseMatrix,
        conditions: &[super::constraints::Condition],
        (b, parts): (usize, &Parts<'_>),
        yielding: &mut Vec<f64>,
    ) -> Result<(Vec<f64>, Vec<f64>), DesignError> {
        let mut solutions = right.clone();
        self.factor.solve(&mut solutions).map_err(DesignError::Factor)?;
        let mut y = solutions.column(0).to_vec();
        self.refine(right.column(0), conditions, b, &mut y)?;
        if right.columns() == 1 {
            return Ok((y, Vec::new()));
        }
        let shares = self.shares_of_kernel(right, &solutions, (b, parts), yielding)?;
        for (j, amount) in shares.taken.iter().enumerate() {
            y.iter_mut().zip(solutions.column(1 + j)).for_each(|(y, t)| *y -= amount * t);
        }
        Ok((y, shares.amounts))
    }
}
