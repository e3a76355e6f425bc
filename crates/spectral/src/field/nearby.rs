//! The inverse of a sum of energies from the factor of another one, whose weights are not far: what a slider takes from
//! one place to the next.
//!
//! `K = α (K₀ + δ G)`, where `K₀` is factored and `G` is the Gram matrix of an alignment with weights per face. Where
//! `δ` is zero the factor is that of `K` but for `α`. Elsewhere conjugate gradients are preconditioned by it: with a
//! weight of `G` that is `r` times that in `K₀`, all eigenvalues of `K₀⁻¹ K / α` lie between 1 and `r`, so that the
//! number of steps does not depend on anything else. Where rounding has it otherwise and the steps do not converge, `K`
//! is factored itself.

use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use chladni_algebra::{FactorError, PANEL_WIDTH, SparseMatrix};
use chladni_base::made_once;

use super::pencil::{Pencil, Sum};
use super::pencil_inverse::SparseInverse;

/// How far the weight of an alignment may be from that of the factor, either way: at three, a step leaves a quarter of
/// the error.
const FARTHEST: f64 = 3.0;

/// The error that is left, relative to the right-hand side in the norm of the factor, and the most steps: where weights
/// are three times apart, some twenty lead there.
const TOLERANCE: f64 = 1e-12;
const MOST_STEPS: usize = 40;

/// Ratios of weights that differ by less are equal.
const SAME: f64 = 1e-12;

/// `K⁻¹`, by the factor of `K` or of a sum nearby.
pub(super) struct Nearby {
    factor: Arc<SparseInverse>,
    /// `α`.
    scale: f64,
    change: Option<Change>,
}

/// What `K` has beside the matrix of the factor.
struct Change {
    /// `G`.
    gram: Arc<SparseMatrix>,
    /// `δ`.
    by: f64,
    pencil: Arc<Pencil>,
    /// Those of `K`.
    weights: Weights,
    /// The factor of `K`, made where steps on the other one did not converge.
    own: OnceLock<Result<SparseInverse, FactorError>>,
}

impl Change {
    /// The factor of `K`.
    fn own(&self) -> Result<&SparseInverse, FactorError> {
        let made = made_once(&self.own, || self.pencil.factor(&sum(&self.gram, self.weights)));
        made.as_ref().map_err(Clone::clone)
    }

    /// The same where it was made.
    fn made(&self) -> Option<&SparseInverse> {
        self.own.get()?.as_ref().ok()
    }
}

/// The sum of the energies and an alignment.
fn sum(gram: &SparseMatrix, [harmonic, biharmonic, weight]: Weights) -> Sum<'_> {
    Sum { harmonic, biharmonic, uniform: 0.0, grams: vec![(gram, weight)] }
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
    /// The inverse of a sum of the energies of `pencil`, always the same one, and `weight` times `gram`, always the
    /// same.
    ///
    /// # Errors
    /// [`FactorError`], where a factor is made.
    pub fn inverse(
        &self,
        pencil: &Arc<Pencil>,
        gram: &Arc<SparseMatrix>,
        weights: Weights,
    ) -> Result<Nearby, FactorError> {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((before, factor)) = last.and_then(|(before, factor)| Some((before, factor.upgrade()?)))
            && let Some((scale, by)) = between(before, weights)
        {
            let (gram, pencil) = (gram.clone(), pencil.clone());
            let change = (by != 0.0).then(|| Change { gram, by, pencil, weights, own: OnceLock::new() });
            return Ok(Nearby { factor, scale, change });
        }
        let factor = Arc::new(pencil.factor(&sum(gram, weights))?);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((weights, Arc::downgrade(&factor)));
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

    /// The factor, where it is that of the sum itself.
    pub fn alone(&self) -> Option<&SparseInverse> {
        (self.change.is_none() && self.scale == 1.0).then_some(&self.factor)
    }

    /// About the bytes of the factors, one of which others may hold too.
    pub fn bytes(&self) -> u64 {
        let own = self.change.as_ref().and_then(Change::made);
        self.factor.bytes() + own.map_or(0, SparseInverse::bytes)
    }

    /// `X ← K⁻¹ X` for `d × k` numbers, column after column.
    ///
    /// # Errors
    /// [`FactorError`], where steps on a factor nearby do not converge and `K` has none of its own.
    pub fn apply(&self, vectors: &mut [f64]) -> Result<(), FactorError> {
        let Some(change) = &self.change else {
            vectors.iter_mut().for_each(|x| *x /= self.scale);
            self.factor.apply(vectors);
            return Ok(());
        };
        if change.own.get().is_none() {
            let mut found: Vec<f64> = vectors.iter().map(|x| x / self.scale).collect();
            let columns = self.factor.size().max(1) * PANEL_WIDTH;
            if found.chunks_mut(columns).all(|columns| self.corrected(change, columns)) {
                vectors.copy_from_slice(&found);
                return Ok(());
            }
        }
        change.own()?.apply(vectors);
        Ok(())
    }

    /// `X ← (K₀ + δ G)⁻¹ X`; says whether the steps converged.
    fn corrected(&self, Change { gram, by: change, .. }: &Change, x: &mut [f64]) -> bool {
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
        squares.iter().zip(&goals).all(|(square, goal)| square <= goal)
    }

    /// `M̄⁻¹ S̄ x` for `x = K⁻¹ f`, whose `S̄ x` is `image`; `None` for a full biharmonic energy.
    pub fn laplacian(&self, f: &[f64], x: &[f64], image: &[f64]) -> Option<Vec<f64>> {
        if let Some(own) = self.change.as_ref().and_then(Change::made) {
            return own.laplacian(f, image);
        }
        let mut own: Vec<f64> = f.iter().map(|f| f / self.scale).collect();
        if let Some(Change { gram, by, .. }) = &self.change {
            own.iter_mut().zip(gram.multiply(x)).for_each(|(f, g)| *f -= by * g);
        }
        self.factor.laplacian(&own, image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::basis::restricted;
    use crate::field::{FieldParameters, FieldSurface, field_basis};
    use crate::operator::transport::FieldKind;
    use chladni_base::{SplitMix64, Unwatched};
    use chladni_mesh::shape::{Shape, generate};

    /// The inverse for the first weights from the factor for the second, however far that is, a right-hand side, and
    /// the solution by a factor of its own.
    fn from_afar(weights: Weights, factored: Weights) -> (Nearby, Vec<f64>, Vec<f64>) {
        let surface = FieldSurface::new(generate(Shape::Torus, 800).unwrap()).unwrap();
        let basis = field_basis(&surface, &FieldParameters::new(FieldKind::NVector { n: 4 }, 120), &Unwatched).unwrap();
        // The alignment holds one part of the surface.
        let areas = surface.frames().areas().iter().enumerate();
        let masses: Vec<f64> = areas.map(|(face, area)| if face % 3 == 0 { *area } else { 0.0 }).collect();
        let gram = Arc::new(restricted(&basis.space, &masses, &Unwatched).unwrap());
        let pencil = Arc::new(Pencil::new(&basis));
        let factor = Arc::new(pencil.factor(&sum(&gram, factored)).unwrap());
        let mut random = SplitMix64::new(7);
        let right: Vec<f64> = (0..2 * pencil.size()).map(|_| random.signed_unit()).collect();
        let mut exact = right.clone();
        pencil.factor(&sum(&gram, weights)).unwrap().apply(&mut exact);
        let scale = weights[0] / factored[0];
        let by = weights[2] / scale - factored[2];
        let change = Some(Change { gram, by, pencil, weights, own: OnceLock::new() });
        (Nearby { factor, scale, change }, right, exact)
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
        norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
    }

    #[test]
    fn steps_on_a_factor_nearby_lead_to_the_solution() {
        for weight in [2.0 / FARTHEST, 3.0, 2.0 * FARTHEST] {
            let (nearby, mut x, exact) = from_afar([2.0, 0.1, 2.0 * weight], [1.0, 0.05, 2.0]);
            nearby.apply(&mut x).unwrap();
            assert!(distance(&x, &exact) < 1e-9, "{weight}: {}", distance(&x, &exact));
            assert!(nearby.change.unwrap().own.get().is_none(), "{weight}: factored again");
        }
    }

    #[test]
    fn steps_that_do_not_converge_give_way_to_a_factor_of_the_sum_itself() {
        let (nearby, right, exact) = from_afar([1.0, 0.05, 1e7], [1.0, 0.05, 1e-1]);
        let change = nearby.change.as_ref().unwrap();
        // This far away the steps are too few.
        let mut x = right.clone();
        assert!(!nearby.corrected(change, &mut x) && distance(&x, &exact) > 1e-6, "{}", distance(&x, &exact));
        // Twice, since the factor is kept.
        for _ in 0..2 {
            let mut x = right.clone();
            nearby.apply(&mut x).unwrap();
            assert_eq!(x, exact);
        }
        assert!(nearby.bytes() > nearby.factor.bytes());
    }

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
