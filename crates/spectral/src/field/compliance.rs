//! By how much constraints give way to pulls.

use chladni_algebra::DenseMatrix;

use super::constraints::{Condition, Slack, values_of};
use super::slack::{self, Yield};

/// Constraints without repetitions, and what a reduced space has them move by.
pub(super) struct Compliance {
    pub faces: Vec<u32>,
    /// The numbers that are wanted, `block` for each face.
    pub values: Vec<f64>,
    /// The inverses of the weights, 0 of those that are met exactly.
    pub slacks: Vec<f64>,
    /// What unit pulls at the numbers move them by, without what has no energy.
    pub moved: DenseMatrix,
    /// The places of those that are held by a strength, with the share that each misses.
    strengths: Vec<(usize, f64)>,
}

impl Compliance {
    /// Of conditions whose numbers unit pulls move by `moved`.
    pub fn new(conditions: &[Condition], moved: DenseMatrix, b: usize) -> Self {
        let hard = |c: &Condition| matches!(c.slack, Slack::Share(_));
        let slacks = slacks(&moved, conditions, b).into_iter().enumerate();
        let slacks = slacks.map(|(i, slack)| if hard(&conditions[i / b]) { 0.0 } else { slack }).collect();
        let faces = conditions.iter().map(|c| c.face).collect();
        let values = values_of(conditions, b);
        let strength = |(at, condition): (usize, &Condition)| match condition.slack {
            Slack::Own(share) => Some((at, share)),
            Slack::Weight(_) | Slack::Share(_) => None,
        };
        let strengths = conditions.iter().enumerate().filter_map(strength).collect();
        Self { faces, values, slacks, moved, strengths }
    }

    /// Strengths by what all fields of a surface resist with, where `yields` tells what unit pulls at some faces move
    /// there.
    ///
    /// # Errors
    /// Those of `yields`.
    pub fn measure<E>(
        &mut self,
        b: usize,
        yields: impl FnOnce(&[u32]) -> Result<Option<Vec<Yield>>, E>,
    ) -> Result<(), E> {
        let faces: Vec<u32> = self.strengths.iter().map(|&(at, _)| self.faces[at]).collect();
        if faces.is_empty() {
            return Ok(());
        }
        let Some(found) = yields(&faces)? else { return Ok(()) };
        let mean = found.iter().map(|own| slack::mean(own, b)).sum::<f64>() / found.len() as f64;
        for (own, &(at, share)) in found.iter().zip(&self.strengths) {
            let mut value = [0.0; 3];
            value[..b].copy_from_slice(&self.values[b * at..b * (at + 1)]);
            self.slacks[b * at..b * (at + 1)].fill(slack::of_share(own, b, &value, share, mean));
        }
        Ok(())
    }
}

/// What a unit pull moves a number by on average.
pub(super) fn mean_of_diagonal(moved: &DenseMatrix) -> f64 {
    let k = moved.columns();
    (0..k).map(|i| moved.column(i)[i]).sum::<f64>() / k.max(1) as f64
}

/// By how much each number of conditions gives way to a unit pull, where pulls move them by `moved`.
pub(super) fn slacks(moved: &DenseMatrix, conditions: &[Condition], b: usize) -> Vec<f64> {
    let mean = mean_of_diagonal(moved);
    let slack = |(at, condition): (usize, &Condition)| match condition.slack {
        Slack::Weight(slack) => slack,
        Slack::Share(share) => share * mean,
        Slack::Own(share) => {
            let entry = |i, j| if i < b && j < b { moved.column(b * at + j)[b * at + i] } else { 0.0 };
            let own = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
            slack::of_share(&own, b, &condition.value, share, mean)
        }
    };
    conditions.iter().enumerate().flat_map(|one| std::iter::repeat_n(slack(one), b)).collect()
}
