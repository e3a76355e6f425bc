//! The same norms from some rows at a time, which need nothing of the others.
//!
//! Take away the triangles that have corners in several parts: their matrices are positive semi-definite, so that what
//! is left, `Ã`, is below `A`, and `‖r‖_{A⁻¹} ≤ ‖r‖_{Ã⁻¹}`. `Ã` falls apart into the parts, and every sum of the
//! enclosure into one for each. The residual `r` is the true one: rows of the stiffness are taken whole, with the
//! values at their neighbours in other parts. So bounds hold as before, and are wider only by what a residual beside a
//! cut weighs more.

use std::collections::HashMap;
use std::sync::OnceLock;

use chladni_base::parallel::*;

use super::rows::{PairResidual, rounding_weights};
use super::{Energy, Forest, KernelAndGoal, Measure, Obtuse, measure_of, over_panels, sigma};
use crate::basis::NUMBERS_OF_SHARE;
use crate::operator::{EigenProblem, laplace};
use chladni_algebra::gpu::{EnclosureSums, ResidualSums};
use chladni_algebra::{
    CYCLE_WIDTH, DenseMatrix, LIFT_WIDTH, MassMatrix, Multigrid, MultigridError, PATCH_ROWS, RowLifter, SparseMatrix,
    compact_order,
};
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::TriangleShape;

/// What the rows of one part say of a pair.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::spectrum) struct PairShare {
    pub residual: ResidualSums,
    pub enclosure: EnclosureSums,
}

impl PairShare {
    /// As they are written down.
    pub fn numbers(&self) -> [f64; NUMBERS_OF_SHARE] {
        let ResidualSums { residual, dual, stiffness, square, mass, energy, rounding, lowest, highest } = self.residual;
        let EnclosureSums { below, size, excess, rounding: of_y, mass: mass_of_y } = self.enclosure;
        [
            residual, dual, stiffness, square, mass, energy, rounding, lowest, highest, below, size, excess, of_y,
            mass_of_y,
        ]
    }

    /// What [`numbers`](Self::numbers) gave.
    pub fn of_numbers(numbers: &[f64; NUMBERS_OF_SHARE]) -> Self {
        let [
            residual,
            dual,
            stiffness,
            square,
            mass,
            energy,
            rounding,
            lowest,
            highest,
            below,
            size,
            excess,
            of_y,
            mass_of_y,
        ] = *numbers;
        Self {
            residual: ResidualSums { residual, dual, stiffness, square, mass, energy, rounding, lowest, highest },
            enclosure: EnclosureSums { below, size, excess, rounding: of_y, mass: mass_of_y },
        }
    }

    /// With what other rows say.
    pub fn add(&mut self, other: &Self) {
        let (mut sums, others) = (self.numbers(), other.numbers());
        for (at, (sum, other)) in sums.iter_mut().zip(others).enumerate() {
            *sum = match at {
                7 => sum.min(other),
                8 => sum.max(other),
                _ => *sum + other,
            };
        }
        *self = Self::of_numbers(&sums);
    }
}

/// A pair gains at most this many times `‖r‖²_{A⁻¹}`, as estimated. Beside a cut a correction holds what is constant on
/// its part, which of the whole it would not; by itself that looks like a pair that misses what lies just above its
/// value, and gains six times as much.
const MOST_GAINED: f64 = 2.0;

/// What is known of pairs whose shares of all parts are summed up, on unit area, of an operator without negative
/// eigenvalues and with a lumped mass.
pub(in crate::spectrum) fn measures(sums: &[PairShare], ritz: &[f64], kernel: f64) -> Vec<Measure> {
    let limits = KernelAndGoal { kernel, goal: None };
    let one = |(at, (share, &theta)): (usize, (&PairShare, &f64))| {
        let group = &ritz[at / CYCLE_WIDTH * CYCLE_WIDTH..ritz.len().min((at / CYCLE_WIDTH + 1) * CYCLE_WIDTH)];
        let residual = PairResidual::new(&share.residual, theta);
        let mut measure = measure_of(&residual, &share.enclosure, theta, sigma(group, 0.0, limits), (0.0, 1.0));
        let most = MOST_GAINED * measure.below * measure.below / measure.sums.mass.max(f64::MIN_POSITIVE);
        measure.estimate = measure.estimate.min(most);
        measure
    };
    sums.iter().zip(ritz).enumerate().map(one).collect()
}

impl<'a> Energy<'a> {
    /// Prepares the rows of one part; `part_of` tells that of each row. The mass is lumped, and the stiffness that of
    /// the cotangents of `mesh`.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(in crate::spectrum) fn of_part(
        mesh: &TriangleMesh,
        problem: &'a EigenProblem,
        part_of: &[u32],
        part: u32,
        monitor: &dyn Monitor,
    ) -> Result<Self, MultigridError> {
        let loose = Loose::new(mesh, problem, part_of, part);
        monitor.checkpoint()?;
        let Loose { rows, own, coupled, stiffness } = loose;
        let obtuse = Obtuse::of(mesh, problem, &rows[..own]);
        let masses = problem.mass.lumped();
        // Rows of other parts have no share in anything; a mass of zero would divide by it.
        let lumped: Vec<f64> =
            rows.iter().enumerate().map(|(at, &row)| if at < own { masses[row as usize] } else { 1.0 }).collect();
        drop(masses);
        let mass = MassMatrix::Diagonal(lumped.clone());
        let hierarchy = Multigrid::new(&stiffness, &mass, 0.0, monitor)?;
        let mut rounding = rounding_weights(&coupled, &lumped);
        let of_loose = rounding_weights(&stiffness, &lumped);
        rounding.iter_mut().zip(of_loose).for_each(|(weight, other)| *weight = weight.max(other));
        Ok(Self {
            problem,
            order: rows,
            mass,
            forest: Forest::below(&stiffness, &lumped, 0.0, hierarchy.patches(), Some(&obtuse)),
            lumped,
            rounding,
            floor: 0.0,
            hierarchy,
            ordered: OnceLock::new(),
            own,
            coupled: Some(coupled),
        })
    }

    /// The shares of the rows of this part in the sums of all pairs with Ritz values `ritz`, ascending, and vectors
    /// `space · coefficients`; the rows of `space` are those that [`in_order`](Self::in_order) picks of the whole.
    ///
    /// # Errors
    /// [`Cancelled`], when asked to stop.
    pub(in crate::spectrum) fn shares(
        &self,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        ritz: &[f64],
        kernel: f64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<PairShare>, Cancelled> {
        let lifter = RowLifter::new(space, coefficients);
        let limits = KernelAndGoal { kernel, goal: None };
        let panels = ritz.len().div_ceil(LIFT_WIDTH);
        let done = std::sync::atomic::AtomicUsize::new(0);
        let parts = over_panels(self, panels, |panel, workspace| {
            monitor.checkpoint()?;
            let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
            let residuals = self.residuals(&lifter, panel, theta, workspace);
            let mut shares = Vec::with_capacity(LIFT_WIDTH);
            for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
                monitor.checkpoint()?;
                let sigma = sigma(theta, 0.0, limits);
                let (enclosed, _) = self.enclosed(workspace, half, theta, &residuals[half], sigma);
                let share = |k: usize| PairShare { residual: residuals[half].pairs[k].sums, enclosure: enclosed.of(k) };
                shares.extend((0..theta.len()).map(share));
            }
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            monitor.progress(done as f64 / panels as f64);
            Ok(shares)
        })?;
        Ok(parts.into_iter().flatten().collect())
    }
}

/// The rows of a part, cut loose from the others.
struct Loose {
    /// Its rows in a compact order, then those of other parts next to them.
    rows: Vec<u32>,
    /// How many of them are its own.
    own: usize,
    /// The stiffness of its own rows, with all entries; the others have a one on the diagonal.
    coupled: SparseMatrix,
    /// The stiffness of triangles in this part alone, on the same places.
    stiffness: SparseMatrix,
}

/// Of no part, or not numbered.
const NONE: u32 = u32::MAX;

impl Loose {
    fn new(mesh: &TriangleMesh, problem: &EigenProblem, part_of: &[u32], part: u32) -> Self {
        let whole = &problem.stiffness;
        let owned: Vec<u32> = (0..problem.size() as u32).filter(|&row| part_of[row as usize] == part).collect();
        let mut places = vec![NONE; problem.size()];
        owned.iter().zip(0..).for_each(|(&row, place)| places[row as usize] = place);
        // Rows beside others, and those others.
        let mut beside: Vec<u32> = Vec::new();
        let mut others: Vec<u32> = Vec::new();
        for &row in &owned {
            let before = others.len();
            others.extend(whole.row(row as usize).0.iter().filter(|&&column| part_of[column as usize] != part));
            if others.len() > before {
                beside.push(row);
            }
        }
        others.sort_unstable();
        others.dedup();
        let rim = Rim::new(mesh, problem, part_of, part, &beside);
        // Ordered by what is left, so that patches do not reach across a cut.
        let inner = SparseMatrix::from_rows(
            owned.len(),
            owned.len(),
            || (),
            |(), at, entries| {
                rim.row(whole, owned[at], |column, value| {
                    if part_of[column as usize] == part {
                        entries.push((places[column as usize], value));
                    }
                });
            },
        );
        let order = compact_order(&inner, PATCH_ROWS);
        drop(inner);
        let own = owned.len();
        let mut rows: Vec<u32> = order.iter().map(|&at| owned[at as usize]).collect();
        rows.extend(&others);
        rows.iter().zip(0..).for_each(|(&row, place)| places[row as usize] = place);
        let of = |loose: bool| {
            SparseMatrix::from_rows(
                rows.len(),
                rows.len(),
                || (),
                |(), at, entries| {
                    if at >= own {
                        entries.push((at as u32, 1.0));
                        return;
                    }
                    let row = rows[at];
                    if loose {
                        rim.row(whole, row, |column, value| entries.push((places[column as usize], value)));
                    } else {
                        let (columns, values) = whole.row(row as usize);
                        entries.extend(columns.iter().zip(values).map(|(&c, &value)| (places[c as usize], value)));
                    }
                    entries.sort_unstable_by_key(|entry| entry.0);
                },
            )
        };
        let (coupled, stiffness) = (of(false), of(true));
        Self { rows, own, coupled, stiffness }
    }
}

/// What triangles with all unknown corners in the part leave of the rows that have others beside them.
struct Rim {
    /// Whether a row has.
    places: Vec<u32>,
    diagonal: Vec<f64>,
    /// By row and column.
    entries: HashMap<(u32, u32), f64>,
}

impl Rim {
    fn new(mesh: &TriangleMesh, problem: &EigenProblem, part_of: &[u32], part: u32, beside: &[u32]) -> Self {
        let mut places = vec![NONE; problem.size()];
        beside.iter().zip(0..).for_each(|(&row, place)| places[row as usize] = place);
        // Held vertices are no rows.
        let mut row_of = Vec::new();
        if let Some(unknowns) = &problem.unknowns {
            row_of = vec![NONE; mesh.positions.len()];
            unknowns.iter().zip(0..).for_each(|(&vertex, row)| row_of[vertex as usize] = row);
        }
        let row = |vertex: u32| if row_of.is_empty() { vertex } else { row_of[vertex as usize] };
        let concerns = |face: &&[u32; 3]| {
            let rows = face.map(row);
            let inside = rows.iter().all(|&row| row == NONE || part_of[row as usize] == part);
            inside && rows.iter().any(|&row| row != NONE && places[row as usize] != NONE)
        };
        let faces: Vec<&[u32; 3]> = mesh.faces.par_iter().filter(concerns).collect();
        let scale = laplace::power_of_two_scale(&mesh.positions).unwrap_or(1.0);
        let mut diagonal = vec![0.0; beside.len()];
        let mut entries = HashMap::new();
        for face in faces {
            let shape = TriangleShape::of_corners(mesh.corners(face).map(|p| p * scale));
            if shape.area == 0.0 {
                continue;
            }
            let rows = face.map(row);
            for (k, &own) in rows.iter().enumerate().filter(|(_, row)| **row != NONE && places[**row as usize] != NONE)
            {
                for (other, opposite) in [((k + 1) % 3, (k + 2) % 3), ((k + 2) % 3, (k + 1) % 3)] {
                    let weight = shape.half_cotangents[opposite];
                    diagonal[places[own as usize] as usize] += weight;
                    if rows[other] != NONE {
                        *entries.entry((own, rows[other])).or_insert(0.0) -= weight;
                    }
                }
            }
        }
        Self { places, diagonal, entries }
    }

    /// What is left of a row, entry by entry in the places of the whole.
    fn row(&self, whole: &SparseMatrix, row: u32, mut each: impl FnMut(u32, f64)) {
        let (columns, values) = whole.row(row as usize);
        let place = self.places[row as usize];
        for (&column, &value) in columns.iter().zip(values) {
            let left = match place {
                NONE => value,
                place if column == row => self.diagonal[place as usize],
                _ => self.entries.get(&(row, column)).copied().unwrap_or(0.0),
            };
            each(column, left);
        }
    }
}

#[cfg(test)]
#[path = "part_tests.rs"]
mod tests;
