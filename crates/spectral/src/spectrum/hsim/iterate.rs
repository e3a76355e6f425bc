//! Iterating a block of columns toward the lowest eigenvectors of one level.
//!
//! The first steps replace every column by its solve with the shifted matrix. A solve with the shift μ damps the part
//! of a column that belongs to the eigenvalue λ by |θ − μ| / |λ − μ|, so a shift near its Ritz value θ leaves next to
//! nothing of what is outside the subspace; what is inside, one Rayleigh–Ritz over all columns separates. Every group
//! of columns therefore has its own shift, guards are needed at the upper end only, and no group has to be made
//! orthogonal to another.
//!
//! What has not converged then is refined as in Davidson's method: solves with the residuals are new directions, and a
//! Rayleigh–Ritz over old and new ones finds what the start did not contain.

mod correct;

use chladni_algebra::{
    ColumnSums, Factor, FactorError, PanelMatrix, SymbolicFactor, Weight, apply_mass, gpu, inner_products,
    residual_sums, subtract_combinations,
};
use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::HsimError;
use super::columns::{defect, lengths, normalise};
use super::graded::sharpen;
use super::judge::{Count, NULL};
use super::kernel::Kernel;
use super::level::Level;
use super::ritz::ritz;
use super::segments::Cuts;
use super::shifts::{Group, Strays, count_near, factor_near, groups};
use super::stiff::Uncertain;
use super::tuning::TUNING;

/// How the columns of one level are iterated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    /// The pairs that must converge.
    pub wanted: usize,
    /// Their residual (4.6).
    pub tolerance: f64,
    /// Panels of 32 columns that share a shift.
    pub panels_per_shift: usize,
    /// Solves before each Rayleigh–Ritz of a replacing step.
    pub solves: usize,
    /// The most Rayleigh–Ritz steps.
    pub most_passes: usize,
}

/// Columns that span everything are made Ritz vectors so often.
const ON_ALL: usize = 3;

/// Columns that are being iterated on.
pub(super) struct Iteration<'a> {
    pub level: &'a Level,
    pub symbolic: &'a SymbolicFactor,
    /// What is known exactly and kept out of the columns.
    pub kernel: &'a Kernel<'a>,
    pub monitor: &'a dyn Monitor,
    /// `n × q`, `M`-orthonormal after the first step; columns are in the order of their values only after a replacing
    /// step.
    pub vectors: PanelMatrix,
    /// The Ritz value of each column.
    pub values: Vec<f64>,
    /// What the residual of each column sums up to.
    pub sums: Vec<ColumnSums>,
    /// The counts at the shifts that were factored.
    pub inertia: Vec<Count>,
    /// Factors that there was room to keep, with their shifts.
    kept: Vec<(f64, Factor<'a>)>,
    /// Memory of factors that were not kept.
    storage: Vec<Vec<f64>>,
    /// Rayleigh–Ritz steps so far.
    pub passes: usize,
    norm: f64,
    /// Whether the columns are the Ritz vectors of their span, which those of a refining step are only up to its
    /// tolerance.
    pub ritz: bool,
    /// Where they are so segment by segment only.
    pub cuts: Option<Cuts>,
    /// [`Level::spread`].
    pub spread: f64,
    /// What was taken off the eigenvalues of the problem.
    pub offset: f64,
}

impl<'a> Iteration<'a> {
    /// Starts from columns and estimates of their values, ascending.
    pub fn new(
        level: &'a Level,
        symbolic: &'a SymbolicFactor,
        kernel: &'a Kernel<'a>,
        mut vectors: PanelMatrix,
        values: Vec<f64>,
        monitor: &'a dyn Monitor,
    ) -> Self {
        let sums: Vec<f64> =
            (0..level.size()).map(|row| level.stiffness.row(row).1.iter().map(|value| value.abs()).sum()).collect();
        let norm = sums.iter().copied().fold(0.0, f64::max);
        let spread = level.spread();
        kernel.remove(&mut vectors);
        Self {
            level,
            symbolic,
            kernel,
            monitor,
            vectors,
            values,
            sums: Vec::new(),
            inertia: Vec::new(),
            kept: Vec::new(),
            storage: Vec::new(),
            passes: 0,
            norm,
            ritz: false,
            cuts: None,
            spread,
            offset: 0.0,
        }
    }

    /// The values of the columns and those of the kernel, ascending.
    pub fn all_values(&self) -> Vec<f64> {
        let mut values = vec![0.0; self.kernel.dimension()];
        values.extend_from_slice(&self.values);
        values.sort_by(f64::total_cmp);
        values
    }

    /// Counts the eigenvalues below a shift.
    pub fn count(&mut self, shift: f64) -> Result<Count, HsimError> {
        let count = count_near(self.level, self.symbolic, shift, self.spread, self.monitor)?;
        self.inertia.push(count);
        Ok(count)
    }

    /// Writes down the count of a factor that is not needed any more.
    fn counted(&mut self, shift: f64, factor: Factor<'_>) -> Count {
        let count = Count::of(self.level, shift, &factor);
        self.inertia.push(count);
        self.storage.push(factor.into_storage());
        count
    }

    /// The same at exactly this shift, with pivots from the beginning, which leaves less uncertain and takes longer.
    /// Where the next value lies within `reach` and that is not enough, and no eigenvalue is `negative`, stiff rows are
    /// told from the others. Nothing where the shift lies on an eigenvalue.
    pub fn count_closely(&mut self, shift: f64, reach: f64, negative: bool) -> Result<Option<Count>, HsimError> {
        let storage = self.storage();
        let (stiffness, mass) = (&self.level.stiffness, &self.level.mass);
        let factor = match self.symbolic.pivoted_factor(stiffness, mass, shift, storage) {
            Err(FactorError::Singular { .. }) => return Ok(None),
            factor => factor?,
        };
        let count = Count::of(self.level, shift, &factor);
        if negative || !(2.0 * count.radius >= reach) {
            return Ok(Some(self.counted(shift, factor)));
        }
        let errors = factor.row_errors(stiffness, mass, shift);
        let beside = Uncertain { shift, errors: &errors, reach };
        let (radius, storage) = beside.radius(self.level, self.symbolic, factor.into_storage(), self.monitor)?;
        let count = Count { radius: radius.map_or(count.radius, |radius| radius.min(count.radius)), ..count };
        self.inertia.push(count);
        self.storage.push(storage);
        Ok(Some(count))
    }

    /// The columns by ascending value.
    pub fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.values.len()).collect();
        order.sort_by(|&a, &b| self.values[a].total_cmp(&self.values[b]));
        order
    }

    /// The residual (4.6) of a column; one for a column that was not solved yet.
    pub fn residual(&self, column: usize) -> f64 {
        self.sums.get(column).map_or(1.0, |sums| self.residual_of(sums))
    }

    pub fn residual_of(&self, sums: &ColumnSums) -> f64 {
        let (part, whole) = if sums.stiffness <= (NULL * self.norm).powi(2) * sums.square {
            (sums.stiffness, self.norm * self.norm * sums.square)
        } else {
            (sums.residual, sums.stiffness)
        };
        if part == 0.0 { 0.0 } else { (part / whole).sqrt() }
    }

    /// Those of the lowest columns that have not converged, by ascending value.
    pub fn unconverged(&self, plan: &Plan) -> Vec<usize> {
        let mut order = self.order();
        order.truncate(plan.wanted);
        order.retain(|&column| !(self.residual(column) <= plan.tolerance));
        order
    }

    /// Iterates until the wanted pairs have converged or the steps are used up.
    pub fn run(&mut self, plan: &Plan) -> Result<(), HsimError> {
        if self.values.len() + self.kernel.dimension() >= self.level.size() {
            return self.run_on_all(plan);
        }
        let tuning = TUNING.iteration;
        let (mut last, mut least, mut vain) = (f64::INFINITY, (usize::MAX, f64::INFINITY), 0);
        while self.passes < plan.most_passes {
            let pending = self.unconverged(plan);
            if pending.is_empty() {
                return Ok(());
            }
            let (size, pass, open) = (self.level.size(), self.passes + 1, pending.len());
            self.monitor
                .detail(&format!("dimension {size}, iteration {pass}, {open} of {} pairs to converge", plan.wanted));
            self.monitor.progress(1.0 - open as f64 / plan.wanted.max(1) as f64);
            if self.sums.is_empty() || pending.len() as f64 > tuning.replace_share * self.values.len() as f64 {
                self.replace(plan)?;
            } else {
                let worst = pending.iter().map(|&column| self.residual(column)).fold(0.0, f64::max);
                let stalled = worst > tuning.stalled * last;
                last = worst;
                vain = if pending.len() < least.0 || worst < tuning.stalled * least.1 { 0 } else { vain + 1 };
                if vain == tuning.most_stalled {
                    return Ok(());
                }
                least = (least.0.min(pending.len()), least.1.min(worst));
                if stalled {
                    // What was left out as too weak a coupling, or a shift too far away, is what keeps the rest from
                    // converging.
                    self.release();
                    self.refine(&pending, tuning.strict * plan.tolerance)?;
                } else {
                    self.refine(&pending, plan.tolerance)?;
                }
            }
            self.passes += 1;
        }
        Ok(())
    }

    /// The same where the columns span everything there is: solves add nothing, and would turn columns of one shift
    /// into one another.
    fn run_on_all(&mut self, plan: &Plan) -> Result<(), HsimError> {
        for _ in 0..ON_ALL {
            if self.passes >= plan.most_passes || self.ritz && self.unconverged(plan).is_empty() {
                break;
            }
            self.orthonormalise()?;
            self.polish(plan.wanted, plan.tolerance)?;
            self.passes += 1;
        }
        Ok(())
    }

    /// One step that replaces every column by its solve.
    fn replace(&mut self, plan: &Plan) -> Result<(), HsimError> {
        let order = self.order();
        if order.iter().enumerate().any(|(place, &column)| place != column) {
            self.vectors = self.vectors.select(&order);
            self.values = order.iter().map(|&column| self.values[column]).collect();
        }
        let groups = groups(&self.values, plan);
        let mut vectors = std::mem::take(&mut self.vectors);
        self.solve(&groups, &mut vectors, plan.solves)?;
        self.rayleigh_ritz(vectors)
    }

    /// Replaces the block by the Ritz vectors in the span of some columns.
    fn rayleigh_ritz(&mut self, mut vectors: PanelMatrix) -> Result<(), HsimError> {
        let (level, monitor) = (self.level, self.monitor);
        let mut values = Vec::new();
        // Where columns were close to dependent, the first Rayleigh–Ritz loses digits, and a second one has them all.
        for _ in 0..2 {
            let accelerator = gpu::accelerator();
            let (stiffness, gram, resident) = accelerator.restrict(&level.stiffness, &level.mass, &vectors, monitor)?;
            let rotation;
            (values, rotation) = ritz(stiffness, gram, vectors.columns(), monitor)?;
            accelerator.rotate(&mut vectors, resident, &rotation, monitor)?;
            if defect(&vectors, &level.mass, monitor)? <= WORKING_DEFECT {
                break;
            }
        }
        sharpen(level, &mut vectors, &mut values, monitor)?;
        self.sums = residual_sums(&level.stiffness, &level.mass, &vectors, &values, monitor)?;
        (self.vectors, self.values, self.ritz, self.cuts) = (vectors, values, true, None);
        Ok(())
    }

    /// One step of plain subspace iteration with a single shift: inverse iterations for the columns from `done` on, and
    /// one Rayleigh–Ritz over all. Columns ascend by value before and after.
    pub fn step(&mut self, shift: f64, done: usize, solves: usize) -> Result<(), HsimError> {
        let (level, monitor, kernel) = (self.level, self.monitor, self.kernel);
        if !self.kept.iter().any(|kept| kept.0 == shift) {
            self.release();
            let storage = self.storage();
            let (at, factor) = factor_near(level, self.symbolic, shift, self.spread, storage, self.monitor)?;
            self.inertia.push(Count::of(level, at, &factor));
            self.kept.push((shift, factor));
        }
        let moving: Vec<usize> = (done..self.vectors.columns()).collect();
        let mut columns = self.vectors.select(&moving);
        let factor = &self.kept[0].1;
        columns.panels_mut().par_iter_mut().try_for_each_init(Vec::new, |scratch, panel| {
            for _ in 0..solves {
                monitor.checkpoint()?;
                apply_mass(&level.mass, panel, scratch);
                factor.solve_panel(panel);
                kernel.remove_from_panel(panel);
            }
            Ok::<(), HsimError>(())
        })?;
        normalise(&mut columns);
        let mut vectors = std::mem::take(&mut self.vectors);
        vectors.assign(&moving, &columns);
        drop(columns);
        self.rayleigh_ritz(vectors)
    }

    /// Adds orthonormal columns with their Ritz values to the block.
    pub fn append(&mut self, columns: &PanelMatrix, values: &[f64]) -> Result<(), HsimError> {
        let sums = residual_sums(&self.level.stiffness, &self.level.mass, columns, values, self.monitor)?;
        let before = self.values.len();
        (self.ritz, self.cuts) = (false, None);
        self.vectors.widen(before + values.len());
        self.vectors.assign(&(before..before + values.len()).collect::<Vec<_>>(), columns);
        self.values.extend_from_slice(values);
        self.sums.resize(before, ColumnSums::default());
        self.sums.extend(sums);
        Ok(())
    }

    /// Keeps some columns, in the given order.
    pub fn keep(&mut self, columns: Vec<usize>) {
        if columns.iter().enumerate().any(|(place, &column)| place != column) {
            self.vectors = self.vectors.select(&columns);
        } else {
            self.vectors.keep_columns(columns.len());
        }
        self.values = columns.iter().map(|&column| self.values[column]).collect();
        self.sums = columns.iter().map(|&column| self.sums[column]).collect();
    }

    /// Measures the residuals of columns that are Ritz vectors already.
    pub fn measure(&mut self) -> Result<(), HsimError> {
        let Self { level, vectors, values, .. } = self;
        self.sums = residual_sums(&level.stiffness, &level.mass, vectors, values, self.monitor)?;
        Ok(())
    }

    /// Replaces the values by the Rayleigh quotients of the columns. Those of a refining step leave out couplings that
    /// do not show in a residual, but the bounds by Kato and Temple hold for quotients only.
    pub fn take_quotients(&mut self) -> Result<(), HsimError> {
        let mut moved = false;
        for (value, sums) in self.values.iter_mut().zip(&self.sums) {
            let shift = if sums.mass > 0.0 { sums.product / sums.mass } else { 0.0 };
            moved |= shift.abs() > EXACT * value.abs();
            *value += shift;
        }
        if moved { self.measure() } else { Ok(()) }
    }

    /// Takes the kernel and the block off some columns and drops those of which next to nothing is left: where the
    /// block holds all there is, that is rounding errors, which look like vectors too.
    pub fn project(&self, columns: &mut PanelMatrix) -> Result<(), HsimError> {
        let (mass, monitor) = (&self.level.mass, self.monitor);
        let before = lengths(mass, columns);
        for _ in 0..2 {
            self.kernel.remove(columns);
            let products = inner_products(&self.vectors, Weight::Mass(mass), columns, monitor)?;
            subtract_combinations(columns, &self.vectors, &products, monitor)?;
        }
        let after = lengths(mass, columns);
        let kept: Vec<usize> = (0..before.len()).filter(|&k| after[k] > LOST * before[k]).collect();
        if kept.len() < before.len() {
            *columns = columns.select(&kept);
        }
        Ok(())
    }

    /// The counts below another one that can be trusted and that the values agree with, ascending; the last is that
    /// one. The kernel is among the columns, which ascend.
    pub fn counts(&self, last: Count) -> Vec<Count> {
        let values = &self.values;
        let agrees = |count: &Count| {
            count.shift < last.shift
                && count.is_clear_of(values)
                && values.partition_point(|&value| value < count.shift) == count.below
        };
        let mut counts: Vec<Count> = self.inertia.iter().copied().filter(agrees).collect();
        counts.push(last);
        counts.sort_by(|a, b| a.shift.total_cmp(&b.shift));
        counts.dedup();
        counts
    }

    /// Makes the columns orthonormal Ritz vectors again, without solves.
    pub fn orthonormalise(&mut self) -> Result<(), HsimError> {
        let vectors = std::mem::take(&mut self.vectors);
        self.rayleigh_ritz(vectors)
    }

    /// Inverse iterations for the panels of each group with its shift.
    fn solve(&mut self, groups: &[Group], columns: &mut PanelMatrix, iterations: usize) -> Result<(), HsimError> {
        let (level, symbolic, monitor, kernel) = (self.level, self.symbolic, self.monitor, self.kernel);
        let spread = self.spread;
        self.release();
        let apart = taken_out(groups.iter().flat_map(|group| group.strays.iter().cloned()), columns);
        let inverse_iterations = |factor: &Factor<'_>, panel: &mut Vec<f64>, scratch: &mut Vec<f64>| {
            for _ in 0..iterations {
                monitor.checkpoint()?;
                apply_mass(&level.mass, panel, scratch);
                factor.solve_panel(panel);
                kernel.remove_from_panel(panel);
            }
            Ok(())
        };
        let (width, size, pass) = (self.batch(), level.size(), self.passes + 1);
        for (k, batch) in groups.chunks(width).enumerate() {
            let done = k * width + 1;
            let storage: Vec<Vec<f64>> = batch.iter().map(|_| self.storage()).collect();
            monitor.detail(&format!("dimension {size}, iteration {pass}, slice {done} of {}", groups.len()));
            let factors: Vec<(f64, Factor<'a>)> = batch
                .par_iter()
                .zip(storage)
                .map(|(group, storage)| {
                    monitor.checkpoint()?;
                    factor_near(level, symbolic, group.shift, spread, storage, monitor)
                })
                .collect::<Result<_, HsimError>>()?;
            let range = batch[0].panels.start..batch[batch.len() - 1].panels.end;
            let mut panels = columns.panels_mut()[range].iter_mut();
            let mut tasks: Vec<(&mut Vec<f64>, &Factor<'_>)> = Vec::new();
            for (group, (_, factor)) in batch.iter().zip(&factors) {
                tasks.extend(panels.by_ref().take(group.panels.len()).map(|panel| (panel, factor)));
            }
            tasks
                .into_par_iter()
                .try_for_each_init(Vec::new, |scratch, (panel, factor)| inverse_iterations(factor, panel, scratch))?;
            self.record_inertia(factors);
        }
        self.solve_apart(apart, columns, inverse_iterations)
    }

    /// Puts solves of strays, each with its own shift, in the place of what the shifts of their groups made of them.
    fn solve_apart(
        &mut self,
        apart: Vec<(Strays, PanelMatrix)>,
        columns: &mut PanelMatrix,
        solve: impl Fn(&Factor<'_>, &mut Vec<f64>, &mut Vec<f64>) -> Result<(), HsimError>,
    ) -> Result<(), HsimError> {
        for (Strays { columns: range, shift }, mut own) in apart {
            self.monitor.checkpoint()?;
            let storage = self.storage();
            let (at, factor) = factor_near(self.level, self.symbolic, shift, self.spread, storage, self.monitor)?;
            let mut scratch = Vec::new();
            own.panels_mut().iter_mut().try_for_each(|panel| solve(&factor, panel, &mut scratch))?;
            columns.assign(&range.collect::<Vec<_>>(), &own);
            self.counted(at, factor);
        }
        Ok(())
    }

    /// Writes down the inertia of new factors, and keeps them as long as they take no more room than the columns.
    fn record_inertia(&mut self, factors: Vec<(f64, Factor<'a>)>) {
        let room = self.level.size() * self.values.len();
        for (shift, factor) in factors {
            self.inertia.push(Count::of(self.level, shift, &factor));
            if (self.kept.len() + 1) * self.symbolic.entries() <= room {
                self.kept.push((shift, factor));
            } else {
                self.storage.push(factor.into_storage());
            }
        }
    }

    /// Drops the factors that were kept, but not their memory.
    fn release(&mut self) {
        self.storage.extend(self.kept.drain(..).map(|(_, factor)| factor.into_storage()));
    }

    /// Keeps the memory of a factor for another.
    pub fn keep_storage(&mut self, factor: Factor<'_>) {
        self.storage.push(factor.into_storage());
    }

    /// Memory for a factor.
    pub fn storage(&mut self) -> Vec<f64> {
        self.storage.pop().unwrap_or_default()
    }

    /// How many factors are held at a time: one for each thread, as long as they take no more room than the columns.
    fn batch(&self) -> usize {
        let room = self.level.size() * self.values.len() / self.symbolic.entries().max(1);
        rayon::current_num_threads().min(room).max(1)
    }
}

/// Copies of the columns that have shifts of their own.
fn taken_out(strays: impl IntoIterator<Item = Strays>, columns: &PanelMatrix) -> Vec<(Strays, PanelMatrix)> {
    let copy = |strays: Strays| {
        let own = columns.select(&strays.columns.clone().collect::<Vec<_>>());
        (strays, own)
    };
    strays.into_iter().map(copy).collect()
}

/// Values that change by less than this share are Rayleigh quotients up to rounding.
const EXACT: f64 = 1e-12;

/// Columns that are farther from orthonormal are made so again.
const WORKING_DEFECT: f64 = 1e-10;

/// A column of which a projection leaves less than this share is lost in rounding errors.
const LOST: f64 = 1e-10;
