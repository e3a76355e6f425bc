//! How precise the factors of the heat method have to be, and for how long heat has to flow: judged by the residuals of
//! heat from two sources, and of its potential (`docs/decisions/0109-heat-that-does-not-get-across.md`).

use std::cmp::Ordering;

use chladni_algebra::{ColumnTree, Factor, FactorNumbers, MassMatrix, SparseMatrix, SymbolicFactor};
use chladni_base::Monitor;

use super::super::error::AnalysisError;
use super::super::unit_gradients::UnitGradients;
use super::Numbers;

/// What is added to the stiffness, of each component's mass of one, to make it definite while it is factored in single
/// and in double precision. Potentials are zero at the last vertex of each component then, so that nothing is divided
/// by the pivot which is all of that.
const FLOOR: f64 = 1e-9;
const FLOOR_OF_DOUBLE: f64 = 1e-13;

/// The largest share of heat, next to what flows in and out, and of a potential that single precision may miss.
const PRECISE: f64 = 3e-5;

/// The least heat that is known to all its digits, next to the most.
const LEAST_HEAT: f64 = 1e-280;

/// Where heat differs by less than this share of itself across a component, its differences are rounding: by a factor
/// in single and in double precision.
const SAME: f64 = 1e-4;
const SAME_IN_DOUBLE: f64 = 1e-9;

/// By which factor heat flows longer where it does not get across the surface, and how often that is tried.
const LONGER: f64 = 4.0;
const MOST_TIMES: usize = 20;

/// That heat does not flow in a time as it should.
fn unsuitable(time: f64, same: bool) -> AnalysisError {
    let expected = match same {
        true => "so short that heat is not the same everywhere but for rounding",
        false => "so long that heat gets across the surface",
    };
    AnalysisError::Parameter { parameter: "time", value: time, expected }
}

/// What is there when it is decided how precise the factors have to be.
pub(super) struct Probe<'a> {
    pub stiffness: &'a SparseMatrix,
    pub mass: &'a MassMatrix,
    pub symbolic: &'a SymbolicFactor,
    pub tree: &'a ColumnTree,
    pub component: &'a [u32],
    pub place: &'a [u32],
}

impl Probe<'_> {
    /// A factor by which heat gets across every component in the `given` time, or in its `usual` one, which is made
    /// longer until it does; and the heat of a source in each component that is far from others. `usual` has a time for
    /// each component, in length², by its number.
    pub fn heat_for(
        &self,
        given: Option<f64>,
        usual: &[f64],
        area: f64,
        monitor: &dyn Monitor,
    ) -> Result<(Numbers, Vec<f64>), AnalysisError> {
        let mut times: Vec<f64> = usual.iter().map(|usual| given.unwrap_or(*usual) / area).collect();
        for _ in 0..MOST_TIMES {
            let mass = self.mass_of_each(|component, mass| mass / times[component]);
            let factor = || self.symbolic.factor(self.stiffness, &mass, -1.0).map(Factor::into_numbers);
            monitor.checkpoint()?;
            let single = Numbers::Single(factor()?.into_single());
            if let Ok(flowed) = self.across(&single, &mass) {
                return Ok((single, flowed));
            }
            monitor.checkpoint()?;
            let double = Numbers::Double(factor()?);
            let failed = match self.across(&double, &mass) {
                Ok(flowed) => return Ok((double, flowed)),
                Err(failed) => failed,
            };
            if let Some(time) = given {
                // Above the usual time heat gets across, and what is left of its differences is rounding.
                let same = failed.iter().zip(usual).any(|(&failed, &usual)| failed && time > usual);
                return Err(unsuitable(time, same));
            }
            times.iter_mut().zip(&failed).filter(|(_, failed)| **failed).for_each(|(time, _)| *time *= LONGER);
        }
        Err(unsuitable(times.iter().fold(0.0f64, |most, &time| most.max(time)) * area, false))
    }

    /// A lumped mass of the number and the mass of each row's component.
    fn mass_of_each(&self, mass: impl Fn(usize, f64) -> f64) -> MassMatrix {
        let mut own = self.mass.lumped();
        for (&component, &place) in self.component.iter().zip(self.place) {
            own[place as usize] = mass(component as usize, own[place as usize]);
        }
        MassMatrix::Diagonal(own)
    }

    /// Heat of a source in each component, far from another, if a factor knows it everywhere; else which components it
    /// does not know it in.
    fn across(&self, heat: &Numbers, mass: &MassMatrix) -> Result<Vec<f64>, Vec<bool>> {
        let n = self.place.len();
        // The least vertex of a component is its number.
        let first: Vec<usize> = (0..n).filter(|&v| self.component[v] as usize == v).collect();
        let mut failed = vec![false; n];
        let flowed = self.flow(heat, &first, mass, &mut failed);
        let mut coldest: Vec<usize> = self.component.iter().map(|&component| component as usize).collect();
        let at = |v: usize| flowed[self.place[v] as usize];
        for v in 0..n {
            let own = &mut coldest[self.component[v] as usize];
            if at(v) < at(*own) {
                *own = v;
            }
        }
        let far: Vec<usize> = first.iter().map(|&v| coldest[v]).collect();
        let flowed = self.flow(heat, &far, mass, &mut failed);
        let same = if matches!(heat, Numbers::Single(_)) { SAME } else { SAME_IN_DOUBLE };
        // The hottest and the coldest of each component, and how many there are, by its number.
        let mut range = vec![(0.0f64, f64::INFINITY, 0usize); n];
        for (&component, &place) in self.component.iter().zip(self.place) {
            let (most, least, count) = &mut range[component as usize];
            let own = flowed[place as usize];
            (*most, *least, *count) = (most.max(own), least.min(own), *count + 1);
        }
        for (failed, &(most, least, count)) in failed.iter_mut().zip(&range) {
            *failed |= count > 1 && (most - least).partial_cmp(&(same * most)) != Some(Ordering::Greater);
        }
        if failed.contains(&true) { Err(failed) } else { Ok(flowed) }
    }

    /// Heat of some sources, one in each component; those that the factor does not know it in are marked.
    fn flow(&self, heat: &Numbers, sources: &[usize], mass: &MassMatrix, failed: &mut [bool]) -> Vec<f64> {
        let mut source = vec![0.0; self.place.len()];
        sources.iter().for_each(|&v| source[self.place[v] as usize] = 1.0);
        let mut flowed = source.clone();
        heat.solve(self.symbolic, self.tree, &mut flowed, 1);
        let mut hottest = vec![0.0f64; self.place.len()];
        for (&component, &place) in self.component.iter().zip(self.place) {
            let own = &mut hottest[component as usize];
            *own = own.max(flowed[place as usize].abs());
        }
        let mass = mass.lumped();
        for (&component, &place) in self.component.iter().zip(self.place) {
            let least = LEAST_HEAT * hottest[component as usize];
            if !self.is_heat(place as usize, &flowed, &source, &mass, least) {
                failed[component as usize] = true;
            }
        }
        flowed
    }

    /// Whether `(S + M / t) u = δ` in a row to [`PRECISE`] of what it adds up, with `u` far enough from the least of
    /// all numbers.
    fn is_heat(&self, row: usize, flowed: &[f64], source: &[f64], mass: &[f64], least: f64) -> bool {
        let own = mass[row] * flowed[row];
        let (mut sum, mut size) = (own - source[row], own.abs() + source[row]);
        let (columns, entries) = self.stiffness.row(row);
        for (&column, entry) in columns.iter().zip(entries) {
            let part = entry * flowed[column as usize];
            (sum, size) = (sum + part, size + part.abs());
        }
        flowed[row] > least && sum.abs() <= PRECISE * size
    }

    /// A factor of the stiffness that is precise enough for the potential of this heat.
    pub fn poisson_for(
        &self,
        gradients: &UnitGradients,
        flowed: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<Numbers, AnalysisError> {
        let mut last = vec![0; self.place.len()];
        for (&component, &place) in self.component.iter().zip(self.place) {
            let own = &mut last[component as usize];
            *own = place.max(*own);
        }
        // Of a component that is next to nothing beside others its share of all mass would be lost in rounding.
        let mut whole = vec![0.0; self.place.len()];
        let mass = self.mass.lumped();
        self.component.iter().zip(self.place).for_each(|(&c, &place)| whole[c as usize] += mass[place as usize]);
        let mass = self.mass_of_each(|component, mass| mass / whole[component]);
        let factor = |floor: f64| -> Result<FactorNumbers, AnalysisError> {
            let mut poisson = self.symbolic.factor(self.stiffness, &mass, -floor)?.into_numbers();
            self.component.iter().for_each(|&component| poisson.ground(last[component as usize] as usize));
            Ok(poisson)
        };
        monitor.checkpoint()?;
        let single = Numbers::Single(factor(FLOOR)?.into_single());
        monitor.checkpoint()?;
        match self.changes(&single, &gradients.divergence(flowed, 1, 1)) <= PRECISE {
            true => Ok(single),
            false => factor(FLOOR_OF_DOUBLE).map(Numbers::Double),
        }
    }

    /// By which share of the largest potential of its component a factor misses that of a divergence, at most: by what
    /// the residual asks for.
    fn changes(&self, poisson: &Numbers, divergence: &[f64]) -> f64 {
        let mut potential = divergence.to_vec();
        poisson.solve(self.symbolic, self.tree, &mut potential, 1);
        let mut rest = self.stiffness.multiply(&potential);
        rest.iter_mut().zip(divergence).for_each(|(product, wanted)| *product = wanted - *product);
        poisson.solve(self.symbolic, self.tree, &mut rest, 1);
        let mut largest = vec![(0.0f64, 0.0f64); self.place.len()];
        for (&component, &place) in self.component.iter().zip(self.place) {
            let (size, missed) = &mut largest[component as usize];
            *size = size.max(potential[place as usize].abs());
            *missed = missed.max(rest[place as usize].abs());
        }
        let shares = largest.iter().filter(|(size, _)| *size > 0.0).map(|(size, missed)| missed / size);
        // NaN is no share that would do.
        shares.fold(0.0, |most, share| if share <= most { most } else { share })
    }
}
