//! Constraints as they are given, whether they can be used and which say the same; and as the conditions that they
//! become.

use chladni_algebra::DenseMatrix;

use super::design::{Constraint, DesignError, FIRM, Hold};
use crate::basis::FieldBasis;
use crate::operator::transport::FieldKind;

/// That every constraint names a face and a direction, and no two hard ones contradict each other.
pub(super) fn check(basis: &FieldBasis, kind: FieldKind, constraints: &[Constraint]) -> Result<(), DesignError> {
    let (b, faces) = (basis.space.block(), basis.space.faces());
    for (constraint, c) in constraints.iter().enumerate() {
        if c.face as usize >= faces {
            return Err(DesignError::Face { constraint, face: c.face, faces });
        }
        let value = &c.value[..b];
        let nothing = kind != FieldKind::Tensor {} && value.iter().all(|&v| v == 0.0);
        if nothing || !value.iter().all(|v| v.is_finite()) {
            return Err(DesignError::Direction { constraint, face: c.face });
        }
        if let Some(value) = c.hold.softness().filter(|w| !(*w > 0.0 && w.is_finite())) {
            return Err(DesignError::Weight { name: "constraint", value });
        }
    }
    let mut hard: Vec<&Constraint> = constraints.iter().filter(|c| c.hold.is_exact()).collect();
    hard.sort_by_key(|c| c.face);
    match hard.windows(2).find(|w| w[0].face == w[1].face && !same(w[0], w[1])) {
        Some(pair) => Err(DesignError::Contradiction { face: pair[0].face }),
        None => Ok(()),
    }
}

/// Two hard constraints that say the same.
pub(super) fn same(a: &Constraint, b: &Constraint) -> bool {
    a.hold.is_exact() && b.hold.is_exact() && a.face == b.face && a.value == b.value
}

/// The constraints without hard ones that say again what an earlier one says.
pub(super) fn without_repetitions(constraints: &[Constraint]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..constraints.len()).collect();
    order.sort_by_key(|&c| (constraints[c].face, !constraints[c].hold.is_exact(), c));
    let mut kept: Vec<usize> = Vec::with_capacity(order.len());
    for &c in &order {
        if !kept.last().is_some_and(|&last| same(&constraints[last], &constraints[c])) {
            kept.push(c);
        }
    }
    kept
}

/// What hard constraints may give way, as a share of what a unit pull moves them by: what rounding needs and no more.
pub(super) const HARD: f64 = 1e-12;

/// The numbers that conditions ask for, `b` of each.
pub(super) fn values_of(conditions: &[Condition], b: usize) -> Vec<f64> {
    conditions.iter().flat_map(|condition| condition.value.into_iter().take(b)).collect()
}

/// By what the share is divided that a condition may be missed by.
const HARDER: f64 = 10.0;

/// The cosine of the largest angle between a field and what is prescribed around a singularity.
const NEAR: f64 = 0.3;

/// What a face is to carry, and by how much it may deviate.
pub(super) struct Condition {
    pub face: u32,
    pub value: [f64; 3],
    pub slack: Slack,
}

/// By how much a condition may be missed.
#[derive(Clone, Copy)]
pub(super) enum Slack {
    /// The inverse of a weight.
    Weight(f64),
    /// A share of what a unit pull moves.
    Share(f64),
    /// So that alone the condition misses about this share of its length, what has no energy left out: see
    /// [`super::slack`].
    Own(f64),
}

impl From<Hold> for Slack {
    fn from(hold: Hold) -> Self {
        match hold {
            Hold::Strength(strength) => Self::Own(1.0 / (FIRM * strength)),
            Hold::Weight(weight) => Self::Weight(1.0 / weight),
            Hold::Exact => Self::Share(HARD),
        }
    }
}

/// The conditions that the constraints in `kept` become.
pub(super) fn conditions(kept: &[usize], constraints: &[Constraint]) -> Vec<Condition> {
    let condition = |&c: &usize| {
        let Constraint { face, value, hold } = constraints[c];
        Condition { face, value, slack: hold.into() }
    };
    kept.iter().map(condition).collect()
}

impl Condition {
    /// Lets a share give way less.
    pub fn stiffen(&mut self) {
        if let Slack::Share(share) = &mut self.slack {
            *share /= HARDER;
        }
    }
}

/// Whether a field has about the direction of a condition; `columns` are its rows.
pub(super) fn near(rows: &DenseMatrix, condition: &Condition, columns: std::ops::Range<usize>, field: &[f64]) -> bool {
    let (mut product, mut own, mut wanted) = (0.0, 0.0, 0.0);
    for (column, value) in columns.zip(condition.value) {
        let u: f64 = rows.column(column).iter().zip(field).map(|(r, z)| r * z).sum();
        product += u * value;
        own += u * u;
        wanted += value * value;
    }
    product > NEAR * (own * wanted).sqrt()
}

/// For each constraint the length of what is missing; `number` tells the numbers of the field at those without
/// repetitions.
pub(super) fn residuals(
    kept: &[usize],
    constraints: &[Constraint],
    b: usize,
    number: impl Fn(usize, usize) -> f64,
) -> Vec<f64> {
    let mut places = vec![None; constraints.len()];
    kept.iter().enumerate().for_each(|(at, &c)| places[c] = Some(at));
    let residual = |c: usize| {
        // Repeated hard constraints share the numbers of the first.
        let at = places[c].or_else(|| kept.iter().position(|&k| same(&constraints[k], &constraints[c])));
        let deviation = |at: usize, i: usize| number(at, i) - constraints[c].value[i];
        at.map_or(0.0, |at| (0..b).map(|i| deviation(at, i).powi(2)).sum::<f64>().sqrt())
    };
    (0..constraints.len()).map(residual).collect()
}
