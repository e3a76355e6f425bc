//! What rounding may have done to a factor: how far an inertia count can be trusted.

use chladni_base::parallel::*;

use super::factor::{Factor, Node, Pivoting};
use super::multifrontal::{larger, magnitudes};
use super::{MassMatrix, SparseMatrix};

/// The error of a row over its lumped mass, by its number, its sum of `|L| |D| |Lᵀ|` and its number of entries of `L`.
pub(super) fn row_error(a: &SparseMatrix, b: &MassMatrix, shift: f64) -> impl Fn(usize, f64, u32) -> f64 + Sync {
    let lumped = b.lumped();
    let terms_of_mass = b.terms();
    let unit = 0.5 * f64::EPSILON;
    move |row, sum, terms| {
        let entries: f64 = a.row(row).1.iter().map(|value| value.abs()).sum();
        let formed = 2.0 * (entries + terms_of_mass * (shift * lumped[row]).abs());
        unit * ((f64::from(terms) + 4.0) * sum + formed) / lumped[row]
    }
}

/// What the largest error of a row over its lumped mass does to an eigenvalue.
pub(super) fn enclosed(b: &MassMatrix, most: f64) -> f64 {
    if most.is_finite() { b.lumped_ratio() * most } else { f64::INFINITY }
}

impl Factor<'_> {
    /// How far the eigenvalues of the pencil may lie from those of the pencil that this is the exact factor of: the
    /// [count](Self::eigenvalues_below) at the shift `μ` is at least the number of eigenvalues below `μ` less this, and
    /// at most the number below `μ` plus this. In the units of the shift.
    ///
    /// `a`, `b` and `shift` are what was factored. Rounding errors of the factor are at most `γ |L| |D| |Lᵀ|` entry by
    /// entry, with `γ` by the number of terms that a row sums (Higham 2002, theorem 11.3), and those of the shifted
    /// matrix a few units of its terms; row sums over the lumped mass bound what they do to an eigenvalue.
    pub fn uncertainty(&self, a: &SparseMatrix, b: &MassMatrix, shift: f64) -> f64 {
        let n = self.symbolic.size();
        if a.rows() != n || b.size() != n {
            return f64::INFINITY;
        }
        enclosed(b, self.row_errors(a, b, shift).into_iter().fold(0.0, larger))
    }

    /// For each row `i` a bound `ρ_i` of the sum of the magnitudes of its rounding errors, over its lumped mass: with
    /// the errors `E`, which are symmetric, `|xᵀE x| ≤ Σ_i ρ_i m_i x_i²` for every `x`. `a`, `b` and `shift` are what
    /// was factored.
    ///
    /// # Panics
    /// Where the matrices have another number of rows than the factor.
    pub fn row_errors(&self, a: &SparseMatrix, b: &MassMatrix, shift: f64) -> Vec<f64> {
        let ratio = row_error(a, b, shift);
        let over = |sums: &[f64], terms: &[u32]| -> Vec<f64> {
            (0..self.symbolic.size()).into_par_iter().map(|row| ratio(row, sums[row], terms[row])).collect()
        };
        match (&self.symbolic.plan, &self.pivoting) {
            (Some(plan), None) => over(&magnitudes(self.symbolic, plan, &self.values), self.symbolic.terms()),
            _ => {
                let (sums, terms) = self.magnitudes();
                over(&sums, &terms)
            }
        }
    }

    /// The row sums of `|L| |D| |Lᵀ|`, and how many entries each row of `L` has.
    fn magnitudes(&self) -> (Vec<f64>, Vec<u32>) {
        let n = self.symbolic.size();
        let (mut sums, mut terms) = (vec![0.0; n], vec![0u32; n]);
        let mut scaled: Vec<f64> = Vec::new();
        for node in &self.symbolic.nodes {
            let (rows, columns) = (node.columns + node.pattern.1, node.columns);
            let values = &self.values[node.values..node.values + rows * columns];
            let below = &self.symbolic.patterns[node.pattern.0..node.pattern.0 + node.pattern.1];
            let lengths: Vec<f64> = (0..columns)
                .map(|column| {
                    1.0 + values[column * rows + column + 1..(column + 1) * rows].iter().map(|l| l.abs()).sum::<f64>()
                })
                .collect();
            scaled.clear();
            for column in 0..columns {
                let mut sum = values[column * rows + column].abs() * lengths[column];
                if let Some(pivoting) = &self.pivoting {
                    let at = node.start + column;
                    // The blocks of D itself follow from those of its inverse.
                    let off_diagonal = |k: usize| self.off_diagonal(pivoting, node, k);
                    sum += off_diagonal(at).abs() * lengths.get(column + 1).copied().unwrap_or(0.0);
                    if column > 0 {
                        sum += off_diagonal(at - 1).abs() * lengths[column - 1];
                    }
                }
                scaled.push(sum);
            }
            for (column, &sum) in scaled.iter().enumerate() {
                let entries = &values[column * rows..(column + 1) * rows];
                let place = |k: usize| match &self.pivoting {
                    Some(pivoting) => pivoting.order[node.start + k] as usize,
                    None => node.start + k,
                };
                sums[place(column)] += sum;
                terms[place(column)] += 1;
                for (k, l) in entries.iter().enumerate().take(columns).skip(column + 1) {
                    sums[place(k)] += l.abs() * sum;
                    terms[place(k)] += 1;
                }
                for (&row, l) in below.iter().zip(&entries[columns..]) {
                    sums[row as usize] += l.abs() * sum;
                }
            }
            below.iter().for_each(|&row| terms[row as usize] += columns as u32);
        }
        (sums, terms)
    }

    /// The entry of `D` at `(k + 1, k)`: that of its inverse times minus the determinant of the block.
    fn off_diagonal(&self, pivoting: &Pivoting, node: &Node, k: usize) -> f64 {
        let inverse = pivoting.off_diagonal[k];
        if inverse == 0.0 || k + 1 >= node.start + node.columns {
            return 0.0;
        }
        let determinant = self.inverse[k] * self.inverse[k + 1] - inverse * inverse;
        -inverse / determinant
    }
}
