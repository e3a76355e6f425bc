//! How precise the factors of the heat method have to be, and for how long heat has to flow: judged by the residuals of heat from two sources,
//! and of its potential (`docs/decisions/0109-heat-that-does-not-get-across.md`).

use chladni_algebra::{ColumnTree, Factor, FactorNumbers, MassMatrix, SparseMatrix, SymbolicFactor};
use chladni_base::Monitor;

use super::super::error::AnalysisError;
use super::super::unit_gradients::UnitGradients;
use super::Numbers;

/// What is added to the stiffness, as a share of the mass, to make it definite while it is factored in single and in double precision. Potentials are
/// zero at the last vertex of each component then, so that nothing is divided by the pivot which is all of that.
const FLOOR: f64 = 1e-9;
const FLOOR_OF_DOUBLE: f64 = 1e-13;

/// The largest share of heat, next to what flows in and out, and of a potential that single precision may miss.
const PRECISE: f64 = 3e-5;

/// The least heat that is known to all its digits, next to the most.
const LEAST_HEAT: f64 = 1e-280;

/// Where heat differs by less than this share of itself across a component, its differences are rounding: by a factor in single and in double precision.
const SAME: f64 = 1e-4;
const SAME_IN_DOUBLE: f64 = 1e-9;

/// By which factor heat flows longer where it does not get across the surface, and how often that is tried.
const LONGER: f64 = 4.0;
const MOST_TIMES: usize = 20;

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
    /// A factor by which heat gets across every component in the `given` time, or in the `usual` one, which is made longer until it does; and the
    /// heat of a source in each component that is far from others.
    pub fn heat_for(
        &self,
        given: Option<f64>,
        usual: f64,
        area: f64,
        monitor: &dyn Monitor,
    ) -> Result<(Numbers, Vec<f64>), AnalysisError> {
        let mut time = given.unwrap_or(usual) / area;
        for _ in 0..MOST_TIMES {
            let factor = || self.symbolic.factor(self.stiffness, self.mass, -1.0 / time).map(Factor::into_numbers);
            monitor.checkpoint()?;
            let single = Numbers::Single(factor()?.into_single());
            if let Some(flowed) = self.across(&single, time) {
                return Ok((single, flowed));
            }
            monitor.checkpoint()?;
            let double = Numbers::Double(factor()?);
            if let Some(flowed) = self.across(&double, time) {
                return Ok((double, flowed));
            }
            if given.is_some() {
                break;
            }
            time *= LONGER;
        }
        // Above the usual time heat gets across, and what is left of its differences is rounding.
        let expected = match given.is_some_and(|given| given > usual) {
            true => "so short that heat is not the same everywhere but for rounding",
            false => "so long that heat gets across the surface",
        };
        Err(AnalysisError::Parameter { parameter: "time", value: time * area, expected })
    }

    /// Heat of a source in each component, far from another, if a factor knows it everywhere.
    fn across(&self, heat: &Numbers, time: f64) -> Option<Vec<f64>> {
        let n = self.place.len();
        // The least vertex of a component is its number.
        let first: Vec<usize> = (0..n).filter(|&v| self.component[v] as usize == v).collect();
        let flowed = self.flow(heat, &first, time)?;
        let mut coldest: Vec<usize> = self.component.iter().map(|&component| component as usize).collect();
        let at = |v: usize| flowed[self.place[v] as usize];
        for v in 0..n {
            let own = &mut coldest[self.component[v] as usize];
            if at(v) < at(*own) {
                *own = v;
            }
        }
        let far: Vec<usize> = first.into_iter().map(|v| coldest[v]).collect();
        let flowed = self.flow(heat, &far, time)?;
        let same = if matches!(heat, Numbers::Single(_)) { SAME } else { SAME_IN_DOUBLE };
        // The hottest and the coldest of each component, and how many there are, by its number.
        let mut range = vec![(0.0f64, f64::INFINITY, 0usize); n];
        for (&component, &place) in self.component.iter().zip(self.place) {
            let (most, least, count) = &mut range[component as usize];
            let own = flowed[place as usize];
            (*most, *least, *count) = (most.max(own), least.min(own), *count + 1);
        }
        let differs = |&(most, least, count): &(f64, f64, usize)| count < 2 || most - least > same * most;
        range.iter().all(differs).then_some(flowed)
    }

    /// Heat of some sources, if a factor knows it everywhere.
    fn flow(&self, heat: &Numbers, sources: &[usize], time: f64) -> Option<Vec<f64>> {
        let mut source = vec![0.0; self.place.len()];
        sources.iter().for_each(|&v| source[self.place[v] as usize] = 1.0);
        let mut flowed = source.clone();
        heat.solve(self.symbolic, self.tree, &mut flowed, 1);
        self.is_heat(&flowed, &source, time).then_some(flowed)
    }

    /// Whether `(S + M / t) u = δ` to [`PRECISE`] of what each row adds up, with every `u` far enough from the least of all numbers.
    fn is_heat(&self, flowed: &[f64], source: &[f64], time: f64) -> bool {
        let (mass, least) = (self.mass.lumped(), LEAST_HEAT * flowed.iter().fold(0.0f64, |most, u| most.max(u.abs())));
        (0..flowed.len()).all(|row| {
            let own = mass[row] / time * flowed[row];
            let (mut sum, mut size) = (own - source[row], own.abs() + source[row]);
            let (columns, entries) = self.stiffness.row(row);
            for (&column, entry) in columns.iter().zip(entries) {
                let part = entry * flowed[column as usize];
                (sum, size) = (sum + part, size + part.abs());
            }
            flowed[row] > least && sum.abs() <= PRECISE * size
        })
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
        let factor = |floor: f64| -> Result<FactorNumbers, AnalysisError> {
            let mut poisson = self.symbolic.factor(self.stiffness, self.mass, -floor)?.into_numbers();
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

    /// By which share of the largest potential of its component a factor misses that of a divergence, at most: by what the residual asks for.
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
