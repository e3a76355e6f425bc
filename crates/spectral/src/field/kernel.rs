//! Fields without energy, of each component of a surface by itself.
//!
//! A surface of many components has as many of them as all components together, and none is any other's concern: kept
//! as fields of the whole surface they would take the square of their number, and whatever makes them orthogonal its
//! cube. So one list of fields holds those of all components: its first field has on each component the first one of
//! that, and nothing on components without.

use chladni_algebra::{BlockMatrix, DenseMatrix, lowest_symmetric};
use chladni_base::parallel::*;
use chladni_base::{Monitor, SplitMix64, Unwatched};

use super::design::DesignError;
use super::direct::{Direct, ShiftedFactor};
use super::idle_parts::{IdlePart, Parts};
use super::refine::{FullSpace, Inner, RefineError};
use super::refine_response::{FullOperator, IDLE, Sum, add, dot, product};
use super::weighted::WeightedModel;
use crate::basis::FieldBasis;

/// Fields without energy that are looked for on a component at first, and at most.
const FIRST: usize = 8;
const MOST: usize = 128;

/// Steps of subspace iteration: each leaves the least shift over the lowest positive eigenvalue of what is not idle.
const STEPS: usize = 3;

/// The faces of each component.
pub(super) struct Components {
    /// The component of each face.
    of: Vec<u32>,
    /// Ascending.
    faces: Vec<Vec<u32>>,
}

/// Fields without energy, orthonormal by area.
pub(super) struct Kernel {
    components: Components,
    /// Numbers of all faces.
    slots: Vec<Vec<f64>>,
    /// How many of them each component has.
    counts: Vec<usize>,
    /// Whether the surface has no others.
    complete: bool,
}

/// One field without energy: a component, and which of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Own {
    pub component: usize,
    pub slot: usize,
}

impl Components {
    /// Of faces that an operator couples.
    pub fn of<const B: usize>(matrix: &BlockMatrix<B>) -> Self {
        let mut of = vec![u32::MAX; matrix.rows()];
        let mut faces: Vec<Vec<u32>> = Vec::new();
        for start in 0..of.len() {
            if of[start] != u32::MAX {
                continue;
            }
            let number = faces.len() as u32;
            of[start] = number;
            let (mut own, mut at) = (vec![start as u32], 0);
            while at < own.len() {
                for &other in matrix.row(own[at] as usize).0 {
                    if of[other as usize] == u32::MAX {
                        of[other as usize] = number;
                        own.push(other);
                    }
                }
                at += 1;
            }
            own.sort_unstable();
            faces.push(own);
        }
        Self { of, faces }
    }

    /// Of a surface that is taken as one.
    pub fn one(faces: usize) -> Self {
        Self { of: vec![0; faces], faces: vec![(0..faces as u32).collect()] }
    }

    fn count(&self) -> usize {
        self.faces.len()
    }

    /// What fields have on a component, and its masses.
    fn part<const B: usize>(&self, component: usize, fields: &[Vec<f64>], mass: &[f64]) -> (Vec<Vec<f64>>, Vec<f64>) {
        let faces = &self.faces[component];
        let own = |field: &Vec<f64>| {
            faces.iter().flat_map(|&face| &field[B * face as usize..B * (face as usize + 1)]).copied().collect()
        };
        (fields.iter().map(own).collect(), faces.iter().map(|&face| mass[face as usize]).collect())
    }

    /// Puts what a component has into fields of the whole surface.
    fn put<const B: usize>(&self, component: usize, part: &[Vec<f64>], fields: &mut [Vec<f64>]) {
        for (own, field) in part.iter().zip(fields) {
            for (own, &face) in own.as_chunks::<B>().0.iter().zip(&self.faces[component]) {
                field[B * face as usize..B * (face as usize + 1)].copy_from_slice(own);
            }
        }
    }
}

impl Kernel {
    /// Fields that are orthonormal, on a surface whose components nobody looks at.
    pub fn of_one(fields: Vec<Vec<f64>>, faces: usize) -> Self {
        let counts = vec![fields.len()];
        Self { components: Components::one(faces), slots: fields, counts, complete: false }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.counts.iter().sum()
    }

    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Whether there are some, and all are known: numbers may then be [grounded](Self::to_ground).
    pub fn is_complete(&self) -> bool {
        self.complete && !self.is_empty()
    }

    /// How many fields of the whole surface they are kept as.
    pub fn slots(&self) -> usize {
        self.slots.len()
    }

    /// Those of the components that some faces are on.
    pub fn at(&self, faces: &[u32]) -> Vec<Own> {
        let mut components: Vec<usize> = faces.iter().map(|&face| self.component(face)).collect();
        components.sort_unstable();
        components.dedup();
        let own = |component: usize| (0..self.counts[component]).map(move |slot| Own { component, slot });
        components.into_iter().flat_map(own).collect()
    }

    /// Some of them by component, beside conditions on faces; `mass` is that of all faces.
    pub fn parts(&self, own: &[Own], mass: &[f64], faces: &[u32]) -> Parts<'static> {
        let components: Vec<usize> = own.iter().map(|one| one.component).collect();
        let shares = (self.components.count() > 1).then(|| {
            let mut shares = vec![0.0; self.components.count()];
            self.components.of.iter().zip(mass).for_each(|(&own, mass)| shares[own as usize] += mass);
            let all: f64 = shares.iter().sum();
            shares.into_iter().map(|share| share / all).collect::<Vec<f64>>()
        });
        let of = faces.iter().map(|&face| self.component(face) as u32).collect();
        Parts::on(IdlePart::of_components(&components, shares.as_deref()), of)
    }

    /// The component of a face.
    pub fn component(&self, face: u32) -> usize {
        self.components.of[face as usize] as usize
    }

    /// Number `i` of one of them on a face.
    pub fn value<const B: usize>(&self, own: Own, face: u32, i: usize) -> f64 {
        if self.component(face) == own.component { self.slots[own.slot][B * face as usize + i] } else { 0.0 }
    }

    /// The numbers of some of them on faces.
    pub fn values_at<const B: usize>(&self, own: &[Own], faces: &[u32]) -> Vec<Vec<f64>> {
        let numbers = || faces.iter().flat_map(|&face| (0..B).map(move |i| (face, i)));
        own.iter().map(|&own| numbers().map(|(face, i)| self.value::<B>(own, face, i)).collect()).collect()
    }

    /// The products of a field with each of a list, component by component.
    fn products<const B: usize>(&self, slot: &[f64], field: &[f64]) -> Vec<f64> {
        if self.components.count() == 1 {
            return vec![dot(slot, field)];
        }
        let mut sums = vec![0.0; self.components.count()];
        let faces = slot.as_chunks::<B>().0.iter().zip(field.as_chunks::<B>().0).zip(&self.components.of);
        faces.for_each(|((a, b), &own)| sums[own as usize] += (0..B).map(|i| a[i] * b[i]).sum::<f64>());
        sums
    }

    /// Adds a share of a list's field on each component.
    fn add_shares<const B: usize>(&self, shares: &[f64], slot: &[f64], field: &mut [f64]) {
        if let [share] = shares {
            return add(field, slot, *share);
        }
        let faces = field.as_chunks_mut::<B>().0.iter_mut().zip(slot.as_chunks::<B>().0).zip(&self.components.of);
        faces.for_each(|((x, z), &own)| (0..B).for_each(|i| x[i] += shares[own as usize] * z[i]));
    }

    /// Takes them out of a field.
    pub fn take_out<const B: usize>(&self, whole: &FullOperator<B>, field: &mut [f64]) {
        for z in &self.slots {
            let mut shares = match self.components.count() {
                1 => vec![whole.product(z, field)],
                _ => {
                    let mut image = field.to_vec();
                    whole.weigh(&mut image);
                    self.products::<B>(z, &image)
                }
            };
            shares.iter_mut().for_each(|share| *share = -*share);
            self.add_shares::<B>(&shares, z, field);
        }
    }

    /// Takes their images under the masses out of a force.
    pub fn take_out_of_force<const B: usize>(&self, whole: &FullOperator<B>, force: &mut [f64]) {
        let full = force.to_vec();
        for z in &self.slots {
            let mut image = z.clone();
            whole.weigh(&mut image);
            let shares: Vec<f64> = self.products::<B>(z, &full).into_iter().map(|share| -share).collect();
            self.add_shares::<B>(&shares, &image, force);
        }
    }

    /// Adds so much of each of some of them.
    pub fn add_to<const B: usize>(&self, own: &[Own], amounts: &[f64], field: &mut [f64]) {
        for (slot, z) in self.slots.iter().enumerate() {
            let mut shares = vec![0.0; self.components.count()];
            for (own, amount) in own.iter().zip(amounts).filter(|(own, _)| own.slot == slot) {
                shares[own.component] = *amount;
            }
            self.add_shares::<B>(&shares, z, field);
        }
    }

    /// The lists' fields under the masses.
    pub fn images<const B: usize>(&self, whole: &FullOperator<B>) -> Vec<Vec<f64>> {
        let image = |field: &Vec<f64>| {
            let mut image = field.clone();
            whole.weigh(&mut image);
            image
        };
        self.slots.iter().map(image).collect()
    }

    /// For all pairs of lists the products of their fields on each component.
    pub fn squares<const B: usize>(&self, left: &[Vec<f64>], right: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
        left.iter().map(|left| right.iter().map(|right| self.products::<B>(left, right)).collect()).collect()
    }

    /// Takes shares of fields `halves`, one for each list, out of another in an order of the faces.
    pub fn take_shares_out<const B: usize>(
        &self,
        (own, shares): (&[Own], &[f64]),
        halves: &[Vec<f64>],
        order: &[u32],
        half: &mut [f64],
    ) {
        if self.components.count() == 1 {
            return own.iter().zip(shares).for_each(|(own, share)| add(half, &halves[own.slot], -share));
        }
        for (slot, idle) in halves.iter().enumerate() {
            let mut of = vec![0.0; self.components.count()];
            own.iter().zip(shares).filter(|(own, _)| own.slot == slot).for_each(|(own, s)| of[own.component] = *s);
            let faces = half.as_chunks_mut::<B>().0.iter_mut().zip(idle.as_chunks::<B>().0).zip(order);
            faces.for_each(|((h, z), &face)| {
                let share = of[self.component(face)];
                (0..B).for_each(|i| h[i] -= share * z[i]);
            });
        }
    }

    /// As many numbers as there are fields without energy, at which no mixture of these vanishes, with what stiffness
    /// they have: by elimination with the largest number of each field as pivot.
    pub fn to_ground<const B: usize>(&self, stiffness: &BlockMatrix<B>) -> Vec<(usize, f64)> {
        let diagonal = stiffness.diagonal();
        let mut fields = self.slots.clone();
        let mut numbers = Vec::with_capacity(self.len());
        for at in 0..fields.len() {
            let (own, rest) = fields[at..].split_at_mut(1);
            let own = &own[0];
            let pivot = |(component, faces): (usize, &Vec<u32>)| {
                let numbers = faces.iter().flat_map(|&face| B * face as usize..B * (face as usize + 1));
                let larger = |best: usize, i: usize| if own[i].abs() > own[best].abs() { i } else { best };
                let there = self.counts[component] > at && !faces.is_empty();
                there.then(|| numbers.fold(B * faces[0] as usize, larger))
            };
            let pivots: Vec<Option<usize>> = self.components.faces.iter().enumerate().map(pivot).collect();
            for &pivot in pivots.iter().flatten() {
                let stiff = diagonal[pivot / B][pivot % B][pivot % B];
                numbers.push((pivot, if stiff > 0.0 { stiff } else { 1.0 }));
            }
            rest.par_iter_mut().for_each(|field| {
                let share = |pivot: &Option<usize>| pivot.map_or(0.0, |pivot| -field[pivot] / own[pivot]);
                let shares: Vec<f64> = pivots.iter().map(share).collect();
                self.add_shares::<B>(&shares, own, field);
            });
        }
        numbers
    }
}

impl FullSpace {
    /// About the multiplications that the first two factors take; none where they are there, or none are to be made.
    pub fn operations_of_making(&self) -> f64 {
        match &self.inner {
            Inner::Two(whole) => whole.direct.as_ref().map_or(0.0, Direct::operations_of_making),
            Inner::Three(whole) => whole.direct.as_ref().map_or(0.0, Direct::operations_of_making),
        }
    }

    /// How many fields without energy the surface has, which are kept from then on; `None` where there are no factors
    /// to find them by.
    ///
    /// # Errors
    /// [`RefineError`]: what factors answer, cancellation.
    pub fn count_idle(&self, monitor: &dyn Monitor) -> Result<Option<usize>, RefineError> {
        match &self.inner {
            Inner::Two(whole) => whole.count_idle(monitor),
            Inner::Three(whole) => whole.count_idle(monitor),
        }
    }
}

impl<const B: usize> FullOperator<B> {
    fn count_idle(&self, monitor: &dyn Monitor) -> Result<Option<usize>, RefineError> {
        let Some(direct) = &self.direct else { return Ok(None) };
        let factor = direct.factor(&self.stiffness, &self.mass, 0.0).map_err(DesignError::Sparse)?;
        Ok(self.idle(direct, &factor, monitor)?.map(Kernel::len))
    }

    /// The fields without energy that the reduced space knows about, exactly; none where the sum holds them.
    pub(super) fn kernel(
        &self,
        sum: &Sum,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        monitor: &dyn Monitor,
    ) -> Result<Option<&Kernel>, RefineError> {
        if self.mean_weight(sum) > 0.0 {
            return Ok(None);
        }
        if let Some(known) = self.kernel.get() {
            return Ok(Some(known));
        }
        if let Some(direct) = &self.direct {
            let factor = direct.factor(&self.stiffness, &self.mass, 0.0).map_err(DesignError::Sparse)?;
            if let Some(found) = self.idle(direct, &factor, monitor)? {
                return Ok(Some(found));
            }
        }
        let Some(about) = weighted.idle_fields(basis).map_err(DesignError::from)? else { return Ok(None) };
        let exact = Kernel::of_one(self.polished(about, monitor)?, self.mass.len());
        Ok(Some(self.kernel.get_or_init(|| exact)))
    }

    /// Fields without energy, by subspace iteration with the factor of the least shift; they are kept. `None` where a
    /// component may have more than are looked for.
    pub(super) fn idle(
        &self,
        direct: &Direct<B>,
        factor: &ShiftedFactor,
        monitor: &dyn Monitor,
    ) -> Result<Option<&Kernel>, RefineError> {
        if let Some(known) = self.kernel.get() {
            return Ok(Some(known));
        }
        let components = Components::of(&self.stiffness);
        let largest = components.faces.iter().map(Vec::len).max().unwrap_or(0);
        let size = B * self.mass.len();
        let mut count = FIRST.min(B * largest);
        let found = loop {
            let mut random = SplitMix64::new(1);
            let mut fields: Vec<Vec<f64>> =
                (0..count).map(|_| (0..size).map(|_| random.signed_unit()).collect()).collect();
            for _ in 0..STEPS {
                monitor.checkpoint()?;
                let weighed = |field: &Vec<f64>| {
                    let mut image = field.clone();
                    self.weigh(&mut image);
                    direct.solve(factor, &image)
                };
                fields = fields.par_iter().map(weighed).collect();
                let part = |component: usize| {
                    let (mut part, mass) = components.part::<B>(component, &fields, &self.mass);
                    part.truncate(B * mass.len());
                    orthonormalise::<B>(&mass, &mut part);
                    part
                };
                let parts: Vec<_> = (0..components.count()).into_par_iter().map(part).collect();
                parts
                    .iter()
                    .enumerate()
                    .for_each(|(component, part)| components.put::<B>(component, part, &mut fields));
            }
            let images: Vec<Vec<f64>> = fields.iter().map(|field| self.stiff(field)).collect();
            let lowest = |component: usize| -> Result<Option<Vec<Vec<f64>>>, DesignError> {
                let (fields, mass) = components.part::<B>(component, &fields, &self.mass);
                let (images, _) = components.part::<B>(component, &images, &self.mass);
                idle_of_part(&fields[..count.min(B * mass.len())], &images)
            };
            let parts: Result<Vec<_>, _> = (0..components.count()).into_par_iter().map(lowest).collect();
            let parts: Vec<Option<Vec<Vec<f64>>>> = parts?;
            if let Some(parts) = parts.into_iter().collect::<Option<Vec<_>>>() {
                let counts: Vec<usize> = parts.iter().map(Vec::len).collect();
                let mut slots = vec![vec![0.0; size]; counts.iter().copied().max().unwrap_or(0)];
                parts.iter().enumerate().for_each(|(component, part)| components.put::<B>(component, part, &mut slots));
                break Kernel { components, slots, counts, complete: true };
            }
            if count == MOST {
                return Ok(None);
            }
            count = (2 * count).min(MOST).min(B * largest);
        };
        Ok(Some(self.kernel.get_or_init(|| found)))
    }
}

/// The mixtures without energy of orthonormal fields of a component, whose images under the stiffness are known; `None`
/// where there may be more.
fn idle_of_part(fields: &[Vec<f64>], images: &[Vec<f64>]) -> Result<Option<Vec<Vec<f64>>>, DesignError> {
    let (count, size) = (fields.len(), fields.first().map_or(0, Vec::len));
    if count == 0 {
        return Ok(Some(Vec::new()));
    }
    let mut energies = DenseMatrix::zeros(count, count);
    for j in 0..count {
        for i in 0..count {
            energies.column_mut(j)[i] = 0.5 * (dot(&fields[i], &images[j]) + dot(&fields[j], &images[i]));
        }
    }
    let pairs = lowest_symmetric(energies, count, &Unwatched).map_err(DesignError::Eigen)?;
    let idle = pairs.values.iter().take_while(|value| **value < IDLE).count();
    if idle == count && count < size {
        return Ok(None);
    }
    let mixed = |k: usize| {
        let mut sum = vec![0.0; size];
        fields.iter().zip(pairs.vectors.column(k)).for_each(|(field, &share)| add(&mut sum, field, share));
        sum
    };
    Ok(Some((0..idle).map(mixed).collect()))
}

/// Gram–Schmidt by masses, each field twice.
pub(super) fn orthonormalise<const B: usize>(mass: &[f64], fields: &mut [Vec<f64>]) {
    for at in 0..fields.len() {
        let (before, rest) = fields.split_at_mut(at);
        let own = &mut rest[0];
        for _ in 0..2 {
            for other in before.iter() {
                let share = product::<B>(mass, other, own);
                add(own, other, -share);
            }
        }
        let size = product::<B>(mass, own, own).sqrt().max(f64::MIN_POSITIVE);
        own.iter_mut().for_each(|x| *x /= size);
    }
}
