//! Fields of next to no energy in a space that is designed in by a sparse factor, which does not know them.

use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver, dot_in_order};
use chladni_base::{SplitMix64, Unwatched};

/// More than this many are not looked for: harmonic fields of a few handles, and the identity of tensors.
const MOST: usize = 24;

/// What has no energy is held by the floor of the factor alone, but for rounding; all else by far more.
const GAP: f64 = 30.0;

/// A field of next to no energy, of norm 1 and orthogonal to the others.
pub(super) struct Idle {
    /// `u`.
    pub field: Vec<f64>,
    /// `M̄ u`.
    pub image: Vec<f64>,
}

/// The fields of no energy.
#[derive(Clone, Copy)]
pub(super) enum Kernel<'a> {
    /// Ritz coordinates.
    Coordinates(&'a [usize]),
    /// Coefficients in the space.
    Fields(&'a [Idle]),
}

impl Kernel<'_> {
    /// How many there are.
    pub fn count(self) -> usize {
        match self {
            Self::Coordinates(at) => at.len(),
            Self::Fields(idle) => idle.len(),
        }
    }

    /// What field `j` has at a row.
    pub fn along(self, j: usize, row: &[f64]) -> f64 {
        match self {
            Self::Coordinates(at) => row[at[j]],
            Self::Fields(idle) => dot_in_order(&idle[j].field, row),
        }
    }

    /// `z += amount · field j`.
    pub fn add(self, j: usize, amount: f64, z: &mut [f64]) {
        match self {
            Self::Coordinates(at) => z[at[j]] += amount,
            Self::Fields(idle) => z.iter_mut().zip(&idle[j].field).for_each(|(z, u)| *z += amount * u),
        }
    }
}

/// `X ← P K⁻¹ Pᵀ X` for `d × k` numbers, column after column, where `P` takes idle fields out: what is left of the
/// inverse moves nothing of them.
///
/// # Errors
/// That of the inverse.
pub(super) fn without<E>(
    idle: &[Idle],
    vectors: &mut [f64],
    inverse: impl Fn(&mut [f64]) -> Result<(), E>,
) -> Result<(), E> {
    let Some(d) = idle.first().map(|idle| idle.field.len()) else { return inverse(vectors) };
    let take = |vectors: &mut [f64], along: fn(&Idle) -> (&[f64], &[f64])| {
        for column in vectors.chunks_exact_mut(d.max(1)) {
            for one in idle {
                let (measure, out) = along(one);
                let share = dot_in_order(measure, column);
                column.iter_mut().zip(out).for_each(|(x, o)| *x -= share * o);
            }
        }
    };
    take(vectors, |idle| (&idle.field, &idle.image));
    inverse(vectors)?;
    take(vectors, |idle| (&idle.image, &idle.field));
    Ok(())
}

/// Looks for them by two steps of subspace iteration: `inverse` turns `d` numbers, column after column, into `K⁻¹`
/// times them, `floor` is what holds a field of norm 1 without energy.
pub(super) fn find(inverse: impl Fn(&mut [f64]), mass: &SparseMatrix, floor: f64) -> Vec<Idle> {
    let d = mass.rows();
    let count = MOST.min(d);
    let mut random = SplitMix64::new(1);
    let mut x: Vec<f64> = (0..d * count).map(|_| random.signed_unit()).collect();
    let times = |x: &[f64]| -> Vec<f64> { x.chunks_exact(d.max(1)).flat_map(|column| mass.multiply(column)).collect() };
    for _ in 0..2 {
        let mut image = times(&x);
        inverse(&mut image);
        x = image;
        orthonormalise(&mut x, mass);
    }
    // Rayleigh–Ritz for (K⁻¹ M̄)⁻¹: I v = κ T v with T = Xᵀ M̄ K⁻¹ M̄ X.
    let image = times(&x);
    let mut moved = image.clone();
    inverse(&mut moved);
    let (mut identity, mut products) = (DenseMatrix::zeros(count, count), DenseMatrix::zeros(count, count));
    for j in 0..count {
        identity.column_mut(j)[j] = 1.0;
        for i in 0..count {
            let form = |a: usize, b: usize| dot_in_order(&image[a * d..(a + 1) * d], &moved[b * d..(b + 1) * d]);
            products.column_mut(j)[i] = 0.5 * (form(i, j) + form(j, i));
        }
    }
    let Ok(pairs) = CpuSolver.lowest(identity, products, count, &Unwatched) else { return Vec::new() };
    let count = pairs.values.iter().take_while(|&&kappa| kappa < GAP * floor).count();
    (0..count)
        .map(|k| {
            let v = pairs.vectors.column(k);
            let size = dot_in_order(v, v).sqrt().max(f64::MIN_POSITIVE);
            let mut field = vec![0.0; d];
            for (column, &v) in x.chunks_exact(d).zip(v) {
                field.iter_mut().zip(column).for_each(|(u, x)| *u += v / size * x);
            }
            let image = mass.multiply(&field);
            Idle { field, image }
        })
        .collect()
}

/// Gram–Schmidt, each column twice.
fn orthonormalise(x: &mut [f64], mass: &SparseMatrix) {
    let d = mass.rows().max(1);
    for at in 0..x.len() / d {
        let (before, rest) = x.split_at_mut(at * d);
        let own = &mut rest[..d];
        for _ in 0..2 {
            let image = mass.multiply(own);
            let size = dot_in_order(&image, own).sqrt().max(f64::MIN_POSITIVE);
            let shares: Vec<f64> = before.chunks_exact(d).map(|column| dot_in_order(column, &image)).collect();
            for (column, share) in before.chunks_exact(d).zip(shares) {
                own.iter_mut().zip(column).for_each(|(x, c)| *x -= share * c);
            }
            own.iter_mut().for_each(|x| *x /= size);
        }
        let image = mass.multiply(own);
        let size = dot_in_order(&image, own).sqrt().max(f64::MIN_POSITIVE);
        own.iter_mut().for_each(|x| *x /= size);
    }
}
