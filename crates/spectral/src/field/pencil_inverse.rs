//! Inverses of sums of restricted matrices by sparse factors, whole and by halves.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use chladni_algebra::{FactorNumbers, HalfSolved, PANEL_WIDTH, Sides};
use chladni_base::parallel::*;

use super::pencil::{Structure, Sum};
use super::roots::Roots;

/// The larger root is at least this, on unit area: the more eigenvalues of the space lie above it, and the farther, the
/// more digits the difference loses.
const LEAST_ROOT: f64 = 1.0;

/// How much larger it is than the smaller one.
const APART: f64 = 2.0;

/// Halves of solves are kept up to this share of the bytes of the factors.
const HALVES: u64 = 4;

/// The roots of a sum of both energies and a multiple of the mass, where they are so far apart that the difference of
/// the two inverses keeps its digits.
pub(super) fn split(sum: &Sum<'_>) -> Option<Roots> {
    if !(sum.grams.is_empty() && sum.harmonic > 0.0 && sum.biharmonic > 0.0) {
        return None;
    }
    let roots = Roots::of(sum.harmonic, sum.biharmonic, sum.uniform)?;
    (roots.large >= LEAST_ROOT.max(APART * roots.small)).then_some(roots)
}

/// A factor of the system, or of its part of second order.
pub(super) struct Factored {
    pub structure: Arc<Structure>,
    pub numbers: FactorNumbers,
    pub rows: usize,
    /// Where `x` and `y` of each column are in the system; `u32::MAX` where there is no `y`.
    pub places: Vec<(u32, u32)>,
    pub root: f64,
}

/// `K⁻¹`.
pub(super) struct SparseInverse {
    first: Factored,
    second: Option<(Factored, Roots)>,
    half_solves: Mutex<HalfSolveCache>,
}

/// Half of a solve with a few right-hand sides.
pub(super) struct FewHalves {
    first: HalfSolved,
    second: Option<HalfSolved>,
    scale: f64,
}

/// Half of a solve in the order of elimination.
#[derive(Clone)]
pub(super) struct Half {
    first: Vec<f64>,
    second: Option<Vec<f64>>,
}

/// Halves of solves for unit pulls by the faces that pull, with the bytes that they take.
#[derive(Default)]
struct HalfSolveCache {
    of: HashMap<u32, Arc<FewHalves>>,
    bytes: u64,
}

impl Factored {
    fn bytes(&self) -> u64 {
        8 * self.structure.symbolic.entries() as u64 + 16 * self.places.len() as u64
    }

    /// `X ← A⁻¹ X` for `d × k` numbers, column after column, of the first part of the unknowns.
    fn apply(&self, vectors: &mut [f64]) {
        let d = self.places.len();
        if vectors.len() == d {
            let mut x = vec![0.0; self.rows];
            vectors.iter().zip(&self.places).for_each(|(&value, &(at, _))| x[at as usize] = value);
            self.structure.tree.solve(&self.structure.symbolic, &self.numbers, &mut x);
            vectors.iter_mut().zip(&self.places).for_each(|(value, &(at, _))| *value = x[at as usize]);
            return;
        }
        vectors.par_chunks_mut(d.max(1) * PANEL_WIDTH).for_each(|columns| {
            let mut panel = vec![0.0; self.rows * PANEL_WIDTH];
            for (k, column) in columns.chunks_exact(d).enumerate() {
                for (&value, &(x, _)) in column.iter().zip(&self.places) {
                    panel[x as usize * PANEL_WIDTH + k] = value;
                }
            }
            self.structure.symbolic.solve_panel(&self.numbers, &mut panel);
            for (k, column) in columns.chunks_exact_mut(d).enumerate() {
                for (value, &(x, _)) in column.iter_mut().zip(&self.places) {
                    *value = panel[x as usize * PANEL_WIDTH + k];
                }
            }
        });
    }

    fn halves(&self, sides: &[Sides]) -> Vec<HalfSolved> {
        let mut sides = sides.to_vec();
        for (row, _, _) in sides.iter_mut().flat_map(|side| &mut side.entries) {
            *row = self.places[*row as usize].0;
        }
        self.structure.reach.eliminate(&self.structure.symbolic, &self.numbers, &sides)
    }

    fn eliminated(&self, f: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; self.rows];
        f.iter().zip(&self.places).for_each(|(&value, &(at, _))| x[at as usize] = value);
        self.structure.tree.eliminate(&self.structure.symbolic, &self.numbers, &mut x);
        x
    }

    /// All unknowns.
    fn substituted(&self, mut half: Vec<f64>) -> Vec<f64> {
        self.structure.tree.substitute(&self.structure.symbolic, &self.numbers, &mut half);
        half
    }

    fn x(&self, all: &[f64]) -> Vec<f64> {
        self.places.iter().map(|&(at, _)| all[at as usize]).collect()
    }
}

impl SparseInverse {
    /// By one factor.
    pub fn new(first: Factored) -> Self {
        Self { first, second: None, half_solves: Mutex::default() }
    }

    /// By the factors of `S̄ + αM̄` and `S̄ + βM̄`.
    pub fn difference(small: Factored, large: Factored, split: Roots) -> Self {
        Self { first: small, second: Some((large, split)), half_solves: Mutex::default() }
    }

    /// `d`.
    pub fn size(&self) -> usize {
        self.first.places.len()
    }

    /// Whether it is that of two inverses.
    #[cfg(test)]
    pub fn is_difference(&self) -> bool {
        self.second.is_some()
    }

    /// About the bytes of the factors and of the halves of solves that are kept.
    pub fn bytes(&self) -> u64 {
        let factors = self.bytes_of_factors();
        factors + factors / HALVES
    }

    fn bytes_of_factors(&self) -> u64 {
        self.first.bytes() + self.second.as_ref().map_or(0, |(second, _)| second.bytes())
    }

    /// `X ← K⁻¹ X` for `d × k` numbers, column after column.
    pub fn apply(&self, vectors: &mut [f64]) {
        let Some((second, split)) = &self.second else { return self.first.apply(vectors) };
        let mut other = vectors.to_vec();
        rayon::join(|| self.first.apply(vectors), || second.apply(&mut other));
        vectors.iter_mut().zip(other).for_each(|(x, other)| *x = split.scale * (*x - other));
    }

    /// Halves of the solves for right-hand sides of a few entries, whose rows are columns of the space.
    fn few_halves(&self, sides: &[Sides]) -> Vec<FewHalves> {
        match &self.second {
            None => {
                let own = self.first.halves(sides).into_iter();
                own.map(|first| FewHalves { first, second: None, scale: 1.0 }).collect()
            }
            Some((second, split)) => {
                let (own, other) = rayon::join(|| self.first.halves(sides), || second.halves(sides));
                let both = own.into_iter().zip(other);
                both.map(|(first, other)| FewHalves { first, second: Some(other), scale: split.scale }).collect()
            }
        }
    }

    /// Those for unit pulls at faces, of which `sides` tells the rows of the space; they are kept, as most faces stay
    /// while one is dragged.
    pub fn halves_of_faces(&self, faces: &[u32], sides: impl Fn(u32) -> Sides) -> Vec<Arc<FewHalves>> {
        let lock = || self.half_solves.lock().unwrap_or_else(PoisonError::into_inner);
        // Taken along now: whoever else designs may clear what is kept before the others are made.
        let mut found: HashMap<u32, Arc<FewHalves>> = {
            let cache = lock();
            faces.iter().filter_map(|face| Some((*face, cache.of.get(face)?.clone()))).collect()
        };
        let mut wanted: Vec<u32> = faces.iter().copied().filter(|face| !found.contains_key(face)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let sides: Vec<Sides> = wanted.iter().map(|&face| sides(face)).collect();
        let made: Vec<(u32, Arc<FewHalves>)> =
            wanted.into_iter().zip(self.few_halves(&sides).into_iter().map(Arc::new)).collect();
        found.extend(made.iter().cloned());
        let more: u64 = made.iter().map(|half| half.1.bytes()).sum();
        let mut cache = lock();
        if cache.bytes + more > self.bytes_of_factors() / HALVES {
            *cache = HalfSolveCache::default();
        }
        if more <= self.bytes_of_factors() / HALVES {
            cache.bytes += more;
            cache.of.extend(made);
        }
        faces.iter().map(|face| found[face].clone()).collect()
    }

    /// Half of the solve for `f`, `d` numbers.
    pub fn eliminated(&self, f: &[f64]) -> Half {
        let second = self.second.as_ref().map(|(second, _)| second.eliminated(f));
        Half { first: self.first.eliminated(f), second }
    }

    /// Half of the solve for nothing.
    pub fn no_half(&self) -> Half {
        let second = self.second.as_ref().map(|(second, _)| vec![0.0; second.rows]);
        Half { first: vec![0.0; self.first.rows], second }
    }

    /// The other half: `x = K⁻¹ f`, and `M̄⁻¹ S̄ x` where it comes with it.
    pub fn substituted(&self, half: Half) -> (Vec<f64>, Option<Vec<f64>>) {
        if let (Some((second, split)), Some(other)) = (&self.second, half.second) {
            let solve = |factor: &Factored, half: Vec<f64>| factor.x(&factor.substituted(half));
            let (own, other) = rayon::join(|| solve(&self.first, half.first), || solve(second, other));
            return split.taken_together(&own, &other);
        }
        let all = self.first.substituted(half.first);
        let laplacian = || self.first.places.iter().map(|&(_, at)| all[at as usize] / self.first.root).collect();
        (self.first.x(&all), (self.first.root > 0.0).then(laplacian))
    }

    /// `M̄⁻¹ S̄ x` for `x = K⁻¹ f`, whose `S̄ x` is `image`; `None` for a full biharmonic energy, whose system does not
    /// hold it.
    pub fn laplacian(&self, f: &[f64], image: &[f64]) -> Option<Vec<f64>> {
        if let Some((second, split)) = &self.second {
            let (mut own, mut other) = (f.to_vec(), f.to_vec());
            rayon::join(|| self.first.apply(&mut own), || second.apply(&mut other));
            return split.taken_together(&own, &other).1;
        }
        let Factored { structure, numbers, rows, places, root } = &self.first;
        let mut both = vec![0.0; *rows];
        for (at, &(x, y)) in places.iter().enumerate() {
            if y == u32::MAX {
                return None;
            }
            if *root > 0.0 {
                both[x as usize] = f[at];
            } else {
                both[y as usize] = -image[at];
            }
        }
        structure.tree.solve(&structure.symbolic, numbers, &mut both);
        let scale = if *root > 0.0 { 1.0 / root } else { 1.0 };
        Some(places.iter().map(|&(_, y)| scale * both[y as usize]).collect())
    }
}

impl Roots {
    /// `x = K⁻¹ f` and `M̄⁻¹ S̄ x` of both solutions: `S̄ (S̄ + γM̄)⁻¹ f = f − γ M̄ (S̄ + γM̄)⁻¹ f`.
    fn taken_together(&self, own: &[f64], other: &[f64]) -> (Vec<f64>, Option<Vec<f64>>) {
        let x = own.iter().zip(other).map(|(a, b)| self.scale * (a - b)).collect();
        let curved = own.iter().zip(other).map(|(a, b)| self.scale * (self.large * b - self.small * a)).collect();
        (x, Some(curved))
    }
}

impl FewHalves {
    fn bytes(&self) -> u64 {
        self.first.bytes() + self.second.as_ref().map_or(0, HalfSolved::bytes)
    }

    /// `Cᵀ K⁻¹ C'` with those of another half of the same inverse, row after row.
    pub fn product(&self, other: &Self) -> Vec<f64> {
        let less = self.second.as_ref().zip(other.second.as_ref()).map(|(own, other)| own.product(other));
        self.scaled(self.first.product(&other.first), less)
    }

    /// `Cᵀ K⁻¹ b` from half of the solve for `b`.
    pub fn product_with(&self, half: &Half) -> Vec<f64> {
        let less = self.second.as_ref().zip(half.second.as_ref()).map(|(own, half)| own.product_with(half));
        self.scaled(self.first.product_with(&half.first), less)
    }

    fn scaled(&self, mut products: Vec<f64>, less: Option<Vec<f64>>) -> Vec<f64> {
        for (own, less) in products.iter_mut().zip(less.iter().flatten()) {
            *own = self.scale * (*own - less);
        }
        products
    }

    /// `half += L⁻¹ C y`.
    pub fn add_to(&self, y: &[f64], half: &mut Half) {
        self.first.add_to(y, &mut half.first);
        if let Some((own, half)) = self.second.as_ref().zip(half.second.as_mut()) {
            own.add_to(y, half);
        }
    }
}

impl Half {
    /// `self += factor · other`.
    pub fn add(&mut self, other: &Self, factor: f64) {
        let add = |into: &mut [f64], from: &[f64]| into.iter_mut().zip(from).for_each(|(h, o)| *h += factor * o);
        add(&mut self.first, &other.first);
        if let Some((own, other)) = self.second.as_mut().zip(other.second.as_ref()) {
            add(own, other);
        }
    }
}
