//! The inverse of a sum of energies from the factor of another one, whose weights are not far: what a slider takes from one place to the next.
//!
//! `K = α (K₀ + δ G)`, where `K₀` is factored and `G` is the Gram matrix of an alignment with weights per face. Where `δ` is zero the factor is that of `K` but for `α`. Elsewhere conjugate gradients are
//! preconditioned by it: with a weight of `G` that is `r` times that in `K₀`, all eigenvalues of `K₀⁻¹ K / α` lie between 1 and `r`, so that the number of steps does not depend on anything else.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use chladni_algebra::{FactorError, PANEL_WIDTH, SparseMatrix};

use super::pencil::{Pencil, SparseInverse, Sum};

/// How far the weight of an alignment may be from that of the factor, either way: at three, a step leaves a quarter of the error.
const FARTHEST: f64 = 3.0;

/// The error that is left, relative to the right-hand side in the norm of the factor, and the most steps.
const TOLERANCE: f64 = 1e-12;
const MOST_STEPS: usize = 40;

/// Ratios of weights that differ by less are equal.
const SAME: f64 = 1e-12;

/// `K⁻¹`, by the factor of `K` or of a sum nearby.
pub(super) struct Nearby {
    factor: Arc<SparseInverse>,
    /// `α`.
    scale: f64,
    /// `G` and `δ`.
    change: Option<(Arc<SparseMatrix>, f64)>,
}

/// The weights of a factor: harmonic, biharmonic, of the alignment.
type Weights = [f64; 3];

/// The last factor of an alignment, for as long as someone designs with it.
#[derive(Default, Clone)]
pub(super) struct LastFactor(Arc<Mutex<Option<Made>>>);

/// The weights of a factor, and the factor for as long as it is there.
type Made = (Weights, Weak<SparseInverse>);

impl std::fmt::Debug for LastFactor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("LastFactor")
    }
}

/// What was factored last is no part of what an alignment is.
impl PartialEq for LastFactor {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl LastFactor {
    /// The inverse of a sum of the energies of `pencil`, always the same one, and `weight` times `gram`, always the same.
    ///
    /// # Errors
    /// [`FactorError`], where a factor is made.
    pub fn inverse(
        &self,
        pencil: &Pencil,
        gram: &Arc<SparseMatrix>,
        [harmonic, biharmonic, weight]: Weights,
    ) -> Result<Nearby, FactorError> {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((before, factor)) = last.and_then(|(before, factor)| Some((before, factor.upgrade()?)))
            && let Some((scale, change)) = between(before, [harmonic, biharmonic, weight])
        {
            let change = (change != 0.0).then(|| (gram.clone(), change));
            return Ok(Nearby { factor, scale, change });
        }
        let sum = Sum { harmonic, biharmonic, uniform: 0.0, grams: vec![(gram, weight)] };
        let factor = Arc::new(pencil.factor(&sum)?);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(([harmonic, biharmonic, weight], Arc::downgrade(&factor)));
        Ok(factor.into())
    }
}

/// `α` and `δ` that bring the weights of a factor to others; `None` where they are too far, or of another kind.
fn between(from: Weights, to: Weights) -> Option<(f64, f64)> {
    let scale = (0..3).find(|&i| from[i] > 0.0).map(|i| to[i] / from[i]).filter(|s| *s > 0.0 && s.is_finite())?;
    // The energies belong together: their ratio is that of the factor.
    if (0..2).any(|i| (to[i] - scale * from[i]).abs() > SAME * to[i]) {
        return None;
    }
    let ratio = to[2] / scale / from[2];
    let near = (ratio - 1.0).abs() <= SAME;
    (1.0 / FARTHEST..=FARTHEST).contains(&ratio).then(|| (scale, if near { 0.0 } else { (ratio - 1.0) * from[2] }))
}

impl From<Arc<SparseInverse>> for Nearby {
    fn from(factor: Arc<SparseInverse>) -> Self {
        Self { factor, scale: 1.0, change: None }
    }
}

impl Nearby {
    /// Whether the factor is that of another inverse.
    #[cfg(test)]
    pub fn shares_its_factor(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.factor, &other.factor)
    }

    /// About the bytes of the factor, which others may hold too.
    pub fn bytes(&self) -> u64 {
        self.factor.bytes()
    }

    /// `X ← K⁻¹ X` for `d × k` numbers, column after column.
    pub fn apply(&self, vectors: &mut [f64]) {
        vectors.iter_mut().for_each(|x| *x /= self.scale);
        match &self.change {
            None => self.factor.apply(vectors),
            Some((gram, change)) => {
                for columns in vectors.chunks_mut(self.factor.size().max(1) * PANEL_WIDTH) {
                    self.corrected(gram, *change, columns);
                }
            }
        }
    }

    /// `X ← (K₀ + δ G)⁻¹ X`.
    fn corrected(&self, gram: &SparseMatrix, change: f64, x: &mut [f64]) {
        let d = self.factor.size().max(1);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let inner = |a: &[f64], b: &[f64]| -> Vec<f64> {
            a.chunks_exact(d).zip(b.chunks_exact(d)).map(|(a, b)| dot(a, b)).collect()
        };
        let mut residual = x.to_vec();
        x.fill(0.0);
        let mut scaled = residual.clone();
        self.factor.apply(&mut scaled);
        // Of each direction what the factor's matrix makes of it is known without a product.
        let (mut direction, mut image) = (scaled.clone(), residual.clone());
        let mut squares = inner(&residual, &scaled);
        let goals: Vec<f64> = squares.iter().map(|square| TOLERANCE * TOLERANCE * square).collect();
        for _ in 0..MOST_STEPS {
            let mut moving = false;
            for column in 0..squares.len() {
                let own = column * d..(column + 1) * d;
                let p = &direction[own.clone()];
                let mut product = gram.multiply(p);
                product.iter_mut().zip(&image[own.clone()]).for_each(|(q, i)| *q = i + change * *q);
                let curvature = dot(p, &product);
                let step =
                    if curvature > 0.0 && squares[column] > goals[column] { squares[column] / curvature } else { 0.0 };
                moving |= step != 0.0;
                x[own.clone()].iter_mut().zip(p).for_each(|(x, p)| *x += step * p);
                residual[own].iter_mut().zip(&product).for_each(|(r, q)| *r -= step * q);
            }
            if !moving {
                break;
            }
            scaled.copy_from_slice(&residual);
            self.factor.apply(&mut scaled);
            let next = inner(&residual, &scaled);
            for (column, (next, square)) in next.iter().zip(&squares).enumerate() {
                let keep = if *square > 0.0 { next / square } else { 0.0 };
                let own = column * d..(column + 1) * d;
                let along = |to: &mut [f64], from: &[f64]| {
                    to.iter_mut().zip(from).for_each(|(to, from)| *to = from + keep * *to);
                };
                along(&mut direction[own.clone()], &scaled[own.clone()]);
                along(&mut image[own.clone()], &residual[own]);
            }
            squares = next;
        }
    }

    /// `M̄⁻¹ S̄ x` for `x = K⁻¹ f`, whose `S̄ x` is `image`; `None` for a full biharmonic energy.
    pub fn laplacian(&self, f: &[f64], x: &[f64], image: &[f64]) -> Option<Vec<f64>> {
        let mut own: Vec<f64> = f.iter().map(|f| f / self.scale).collect();
        if let Some((gram, change)) = &self.change {
            own.iter_mut().zip(gram.multiply(x)).for_each(|(f, g)| *f -= change * g);
        }
        self.factor.laplacian(&own, image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_that_are_scaled_alike_are_those_of_the_factor() {
        assert_eq!(between([1.0, 0.05, 2.0], [4.0, 0.2, 8.0]), Some((4.0, 0.0)));
        let (scale, change) = between([1.0, 0.05, 2.0], [1.0, 0.05, 3.0]).unwrap();
        assert!(scale == 1.0 && (change - 1.0).abs() < 1e-12);
        // Too far, another ratio of the energies, and one that is not there.
        assert_eq!(between([1.0, 0.05, 2.0], [1.0, 0.05, 6.1]), None);
        assert_eq!(between([1.0, 0.05, 2.0], [1.0, 0.06, 2.0]), None);
        assert_eq!(between([1.0, 0.0, 2.0], [1.0, 0.05, 2.0]), None);
        assert_eq!(between([0.0, 0.05, 2.0], [1.0, 0.05, 2.0]), None);
    }
}
