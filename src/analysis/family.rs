//! A family of operators in one subspace (thesis, §2.6): the lowest pairs of any of them at interactive rates.
//!
//! With the columns of `U` fixed, every operator `(1 − t) S + t A + v V` restricts to `(1 − t) S̄ + t Ā + v V̄`. The family is kept in the Ritz
//! coordinates of the Laplacian, in which `M̄` is the identity and `S̄` diagonal. Then a query is one standard symmetric eigenproblem of size
//! `d`, of which only the lowest pairs are wanted.

use crate::algebra::{CpuSolver, DenseMatrix, EigenError, EigenPairs, SymmetricDefiniteSolver, orthonormalise};
use crate::basis::family::FamilyBasis;
use crate::monitor::Unwatched;

/// An operator of the family.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Member {
    /// `t`, from 0, the Laplacian, to 1, the operator that also follows the normals.
    pub extrinsic: f64,
    /// `v ≥ 0`, what multiplies the potential `κ₁² + κ₂²`.
    pub curvature: f64,
}

/// Why there is no spectrum.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FamilyError {
    /// A parameter is out of its range.
    #[error("{name}: {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// The restricted problem could not be solved.
    #[error(transparent)]
    Eigen(#[from] EigenError),
}

/// The lowest pairs of one operator.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Ascending, in 1/length² of the input.
    pub eigenvalues: Vec<f64>,
    /// `d × m`: eigenfunctions are `U` times these, orthonormal for the mass of the input.
    pub coefficients: DenseMatrix,
}

impl Member {
    /// Checks both parameters.
    ///
    /// # Errors
    /// [`FamilyError::Parameter`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), FamilyError> {
        let within = |name, value: f64, most: f64| {
            if (0.0..=most).contains(&value) {
                return Ok(());
            }
            Err(FamilyError::Parameter { name, reason: format!("must lie between 0 and {most}, not be {value}") })
        };
        within("extrinsic", self.extrinsic, 1.0)?;
        within("curvature", self.curvature, 1e6)
    }
}

/// Lowest Ritz coordinates that are solved densely, for each wanted pair; a potential that is large calls for more of them.
const CORES: [usize; 3] = [2, 3, 5];

/// Pairs beyond the wanted ones that are iterated along.
const GUARDS: usize = 8;

/// The residual over the largest wanted eigenvalue up to which a pair counts as solved: eigenvalues err by its square over a gap.
const TOLERANCE: f64 = 1e-7;

/// Rounds of corrections before the dense eigensolver is asked.
const ROUNDS: usize = 5;

/// The lowest Ritz value beyond the core must be this many times the largest wanted eigenvalue: then what couples with the core is a
/// small correction, and nothing below hides beyond it.
const CLEAR: f64 = 1.25;

/// The lowest `count` pairs of an operator of the family. On the threads of the pool it is called from.
///
/// In Ritz coordinates of the Laplacian, low eigenvectors lie nearly in the lowest coordinates, the core. Its dense eigenproblem gives a start,
/// which Davidson's corrections, with the diagonal as preconditioner, complete to a residual of 1e-7. Where that does not hold or
/// succeed, the dense eigensolver takes the whole problem.
///
/// # Errors
/// [`FamilyError`]: parameters out of range, more pairs than the family has dimensions.
pub fn spectrum(family: &FamilyBasis, member: Member, count: usize) -> Result<Spectrum, FamilyError> {
    member.check()?;
    let d = family.dimension();
    if !(1..=d).contains(&count) {
        let reason = format!("must lie between 1 and {d}, the dimension of the family, not be {count}");
        return Err(FamilyError::Parameter { name: "count", reason });
    }
    let matrix = family.combined(1.0 - member.extrinsic, member.extrinsic, member.curvature);
    let mut pairs = None;
    for core in CORES.map(|share| share * (count + GUARDS)) {
        if pairs.is_none() && 3 * core <= 2 * d {
            pairs = from_core(family, &matrix, core, count)?;
        }
    }
    let pairs = match pairs {
        Some(pairs) => pairs,
        None => CpuSolver.lowest(matrix, identity(d), count, &Unwatched)?,
    };
    let coefficients = family.coefficients.times(&pairs.vectors).unwrap_or_default();
    Ok(Spectrum { eigenvalues: pairs.values, coefficients })
}

fn identity(d: usize) -> DenseMatrix {
    let mut identity = DenseMatrix::zeros(d, d);
    (0..d).for_each(|k| identity.column_mut(k)[k] = 1.0);
    identity
}

/// `None` where the core is no good start, or corrections do not converge.
fn from_core(
    family: &FamilyBasis,
    matrix: &DenseMatrix,
    core: usize,
    count: usize,
) -> Result<Option<EigenPairs>, FamilyError> {
    let d = matrix.rows();
    let guarded = count + GUARDS;
    let mut block = DenseMatrix::zeros(core, core);
    for column in 0..core {
        block.column_mut(column).copy_from_slice(&matrix.column(column)[..core]);
    }
    let start = CpuSolver.lowest(block, identity(core), guarded, &Unwatched)?;
    if !(family.eigenvalues[core] >= CLEAR * start.values[count - 1]) {
        return Ok(None);
    }
    let mut values = start.values;
    let Some(mut images) = matrix.slice_columns(0..core).times(&start.vectors) else { return Ok(None) };
    let mut vectors = DenseMatrix::zeros(d, guarded);
    for column in 0..guarded {
        vectors.column_mut(column)[..core].copy_from_slice(start.vectors.column(column));
    }
    let scale = values[count - 1].abs().max(f64::MIN_POSITIVE);
    for _ in 0..=ROUNDS {
        let mut corrections = DenseMatrix::zeros(d, guarded);
        let mut worst = 0f64;
        for column in 0..guarded {
            let value = values[column];
            let (x, image) = (vectors.column(column), images.column(column));
            let into = corrections.column_mut(column);
            let mut square = 0.0;
            for row in 0..d {
                let residual = image[row] - value * x[row];
                square += residual * residual;
                let away = matrix.column(row)[row] - value;
                // Near its own value the diagonal says nothing.
                into[row] = residual / if away.abs() > 0.05 * scale { away } else { 0.05 * scale.copysign(away) };
            }
            if column < count {
                worst = worst.max(square.sqrt());
            }
            let norm = into.iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm > 0.0 {
                into.iter_mut().for_each(|x| *x /= norm);
            }
        }
        if worst <= TOLERANCE * scale {
            values.truncate(count);
            vectors.keep_columns(count);
            return Ok(Some(EigenPairs { values, vectors, computed_on: Default::default() }));
        }
        let Some(next) = rayleigh_ritz(matrix, &vectors, &images, corrections) else { return Ok(None) };
        (values, vectors, images) = next;
    }
    Ok(None)
}

/// The Ritz pairs of orthonormal vectors and corrections, as many as there are vectors, with the images of their vectors.
fn rayleigh_ritz(
    matrix: &DenseMatrix,
    vectors: &DenseMatrix,
    images: &DenseMatrix,
    mut corrections: DenseMatrix,
) -> Option<(Vec<f64>, DenseMatrix, DenseMatrix)> {
    let count = vectors.columns();
    // Twice is enough.
    for _ in 0..2 {
        let products = vectors.transposed_times(&corrections)?;
        let inside = vectors.times(&products)?;
        corrections.values_mut().iter_mut().zip(inside.values()).for_each(|(x, y)| *x -= y);
    }
    let gram = corrections.transposed_times(&corrections)?;
    orthonormalise(&mut corrections, gram).ok()?;
    let new_images = matrix.times(&corrections)?;
    let (upper, cross, lower) = (
        vectors.transposed_times(images)?,
        corrections.transposed_times(images)?,
        corrections.transposed_times(&new_images)?,
    );
    let mut reduced = DenseMatrix::zeros(2 * count, 2 * count);
    for column in 0..count {
        let into = reduced.column_mut(column);
        into[..count].copy_from_slice(upper.column(column));
        into[count..].copy_from_slice(cross.column(column));
        reduced.column_mut(count + column)[count..].copy_from_slice(lower.column(column));
    }
    let pairs = CpuSolver.lowest(reduced, identity(2 * count), count, &Unwatched).ok()?;
    let part = |rows: std::ops::Range<usize>| {
        let columns = (0..count).flat_map(|column| pairs.vectors.column(column)[rows.clone()].to_vec()).collect();
        DenseMatrix::from_columns(count, count, columns)
    };
    let (first, second) = (part(0..count)?, part(count..2 * count)?);
    let sum = |a: &DenseMatrix, b: &DenseMatrix| {
        let (mut sum, other) = (a.times(&first)?, b.times(&second)?);
        sum.values_mut().iter_mut().zip(other.values()).for_each(|(x, y)| *x += y);
        Some(sum)
    };
    Some((pairs.values.clone(), sum(vectors, &corrections)?, sum(images, &new_images)?))
}

#[cfg(test)]
#[path = "family_tests.rs"]
mod tests;
