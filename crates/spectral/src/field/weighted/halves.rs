//! Few constraints by halves of solves with a sparse factor: what they move at each other's faces is known from
//! elimination on what they reach, and the field takes one substitution.

use std::sync::Arc;

use chladni_algebra::{DenseMatrix, Sides, dot_in_order};
use chladni_base::made_once;
use chladni_base::parallel::*;

use super::super::constraints::Condition;
use super::super::design::DesignError;
use super::super::idle::{Idle, Kernel};
use super::super::pencil_inverse::{FewHalves, Half, SparseInverse};
use super::{Inverse, Pull, WeightedModel};
use crate::basis::FieldBasis;

/// Of more constraints panels of whole solves take less than all products of halves.
const MOST_CONDITIONS: usize = 96;

/// Fields without energy with what takes them out of halves of solves.
pub(super) struct IdleHalves {
    /// Halves of the solves for `M̄ z`.
    halves: Vec<Half>,
    /// `(M̄ z)ᵀ K⁻¹ M̄ z'`.
    square: Vec<Vec<f64>>,
}

impl IdleHalves {
    fn new(inverse: &SparseInverse, idle: &[Idle]) -> Self {
        let halves: Vec<Half> = idle.iter().map(|one| inverse.eliminated(&one.image)).collect();
        let solved: Vec<Vec<f64>> = halves.iter().map(|half| inverse.substituted(half.clone()).0).collect();
        let square = idle.iter().map(|one| solved.iter().map(|x| dot_in_order(&one.image, x)).collect()).collect();
        Self { halves, square }
    }
}

impl WeightedModel {
    /// The factor, where halves of solves with it are the fastest way.
    pub(super) fn for_halves(&self, conditions: &[Condition]) -> Option<&SparseInverse> {
        match &self.inverse {
            Inverse::Sparse(inverse) if conditions.len() <= MOST_CONDITIONS => inverse.alone(),
            _ => None,
        }
    }

    /// Changes a field so that it meets conditions.
    pub(super) fn satisfy_by_halves(
        &self,
        (inverse, basis): (&SparseInverse, &FieldBasis),
        (rows, kernel): (&DenseMatrix, Kernel<'_>),
        conditions: &[Condition],
        found: &mut Pull,
    ) -> Result<(), DesignError> {
        let b = basis.space.block();
        let faces: Vec<u32> = conditions.iter().map(|condition| condition.face).collect();
        let halves = inverse.halves_of_faces(&faces, |face| {
            let mut entries = Vec::new();
            basis.space.row_entries(face as usize, |column, u| {
                entries.extend(u.iter().enumerate().map(|(i, &u)| (column as u32, i as u32, u)));
            });
            Sides { width: b, entries }
        });
        let mut compliance = DenseMatrix::zeros(rows.columns(), rows.columns());
        let pairs: Vec<(usize, usize)> = (0..halves.len()).flat_map(|j| (0..=j).map(move |i| (i, j))).collect();
        let products: Vec<Vec<f64>> = pairs.par_iter().map(|&(i, j)| halves[i].product(&halves[j])).collect();
        for ((i, j), product) in pairs.into_iter().zip(products) {
            for (at, value) in product.into_iter().enumerate() {
                compliance.column_mut(b * j + at % b)[b * i + at / b] = value;
                compliance.column_mut(b * i + at / b)[b * j + at % b] = value;
            }
        }
        let idle = match kernel {
            Kernel::Fields(idle) => idle,
            Kernel::Coordinates(_) => &[],
        };
        let none = IdleHalves { halves: Vec::new(), square: Vec::new() };
        let own = if idle.is_empty() { &none } else { made_once(&self.idle_halves, || IdleHalves::new(inverse, idle)) };
        // Of each constrained number those of the fields without energy, and their products with half of its solve.
        let (mut values, mut with): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        if !idle.is_empty() {
            values = (0..rows.columns())
                .map(|i| idle.iter().map(|one| dot_in_order(&one.field, rows.column(i))).collect())
                .collect();
            let products =
                |half: &Arc<FewHalves>| own.halves.iter().map(|idle| half.product_with(idle)).collect::<Vec<_>>();
            for all in halves.par_iter().map(products).collect::<Vec<_>>() {
                with.extend((0..b).map(|i| all.iter().map(|own| own[i]).collect::<Vec<f64>>()));
            }
            for j in 0..rows.columns() {
                let turned: Vec<f64> = own.square.iter().map(|row| dot_in_order(row, &values[j])).collect();
                for (i, entry) in compliance.column_mut(j).iter_mut().enumerate() {
                    *entry += dot_in_order(&values[i], &turned)
                        - dot_in_order(&with[i], &values[j])
                        - dot_in_order(&values[i], &with[j]);
                }
            }
        }
        let y = self.multipliers(rows, compliance, conditions, (basis, kernel), &mut found.field)?;
        let mut half = inverse.no_half();
        halves.iter().zip(y.chunks_exact(b)).for_each(|(own, y)| own.add_to(y, &mut half));
        for (k, idle) in own.halves.iter().enumerate() {
            let share: f64 = values.iter().zip(&y).map(|(values, y)| values[k] * y).sum();
            half.add(idle, -share);
        }
        let (mut moved, laplacian) = inverse.substituted(half);
        for one in idle {
            let share = dot_in_order(&one.image, &moved);
            moved.iter_mut().zip(&one.field).for_each(|(x, z)| *x -= share * z);
        }
        // Beside a field that is there already, its own would have to be known.
        found.laplacian = laplacian.filter(|_| self.alignments.is_empty() && self.prescription.is_none());
        found.field.iter_mut().zip(&moved).for_each(|(z, x)| *z += x);
        for (column, &y) in y.iter().enumerate() {
            found.force.iter_mut().zip(rows.column(column)).for_each(|(f, r)| *f += y * r);
        }
        Ok(())
    }
}
