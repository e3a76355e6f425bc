//! Constraints as they are given: whether they can be used, and which say the same.

use super::design::{Constraint, DesignError};
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
