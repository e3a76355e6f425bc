//! Sparse factors of `S + γM` on all faces: on surfaces of up to [`MOST_FACES`] faces they take the place of multigrid cycles, and a field is designed
//! among all in the time of two substitutions (see [`super::least`]).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use chladni_algebra::{
    BlockMatrix, ColumnTree, FactorError, FactorNumbers, HalfSolved, MassMatrix, Ordering, ReachTree, Sides,
    SparseMatrix, SymbolicFactor, fill_reducing_order,
};

use super::pencil::within_surfaces;

/// The most faces of a surface whose operators are factored: beyond, factors take more memory than a server keeps for fields by default.
pub const MOST_FACES: usize = 100_000;

/// From so many faces on, an order by nested dissection saves more than it costs.
const LARGE: usize = 6000;

/// The least shift: `S` itself may be singular. Far below the lowest positive eigenvalue of a surface of unit area.
pub(super) const FLOOR: f64 = 1e-7;

/// So many shifts have their factors kept: those of two choices of weights.
const KEPT: usize = 4;

/// Of so many faces the halves of solves are kept, for each shift.
const KEPT_HALVES: usize = 512;

/// The structure of the factors, and those that were made last.
pub(super) struct Direct<const B: usize> {
    /// The faces in the order of elimination.
    order: Vec<u32>,
    /// Where the numbers of each face are in that order.
    places: Vec<u32>,
    symbolic: SymbolicFactor,
    tree: ColumnTree,
    reach: ReachTree,
    factors: Mutex<Vec<Arc<ShiftedFactor>>>,
}

/// A factor of `S + γM`.
pub(super) struct ShiftedFactor {
    pub gamma: f64,
    numbers: FactorNumbers,
    halves: Mutex<HashMap<u32, Arc<HalfSolved>>>,
    /// Halves of the solves for the images of fields without energy.
    idle: OnceLock<Vec<Vec<f64>>>,
}

impl<const B: usize> Direct<B> {
    /// Analyses an operator; `None` where the surface is too large, or fills in more than surfaces do.
    pub fn new(stiffness: &BlockMatrix<B>) -> Option<Self> {
        let faces = stiffness.rows();
        if faces > MOST_FACES {
            return None;
        }
        let (mut offsets, mut indices) = (vec![0usize], Vec::with_capacity(stiffness.entries()));
        for face in 0..faces {
            indices.extend_from_slice(stiffness.row(face).0);
            offsets.push(indices.len());
        }
        let values = vec![1.0; indices.len()];
        let graph = SparseMatrix::from_sorted_parts(faces, faces, offsets, indices, values);
        let ordering = if faces > LARGE { Ordering::NestedDissection } else { Ordering::Amd };
        let order = fill_reducing_order(&graph, ordering).ok()?;
        let mut places = vec![0u32; faces];
        order.iter().enumerate().for_each(|(at, &face)| places[face as usize] = (B * at) as u32);
        let zeros = MassMatrix::Diagonal(vec![0.0; B * faces]);
        let pattern = ordered(stiffness, &order, &places);
        let symbolic = SymbolicFactor::new(&pattern, &zeros).ok()?;
        within_surfaces(symbolic.entries(), pattern.entries(), faces).ok()?;
        let (tree, reach) = (ColumnTree::new(&symbolic), ReachTree::new(&symbolic));
        Some(Self { order, places, symbolic, tree, reach, factors: Mutex::default() })
    }

    /// About the bytes that it takes, with two factors: what one choice of weights takes.
    pub fn bytes(&self) -> u64 {
        (18 * self.symbolic.entries() + 64 * self.symbolic.size()) as u64
    }

    /// The factor for a shift, which is kept.
    ///
    /// # Errors
    /// [`FactorError`].
    pub fn factor(
        &self,
        stiffness: &BlockMatrix<B>,
        mass: &[f64],
        gamma: f64,
    ) -> Result<Arc<ShiftedFactor>, FactorError> {
        let gamma = gamma.max(FLOOR);
        let lock = || self.factors.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut kept = lock();
            if let Some(at) = kept.iter().position(|factor| factor.gamma == gamma) {
                kept[..=at].rotate_right(1);
                return Ok(kept[0].clone());
            }
        }
        let matrix = ordered(stiffness, &self.order, &self.places);
        let masses = self.order.iter().flat_map(|&face| std::iter::repeat_n(mass[face as usize], B)).collect();
        let factor = self.symbolic.factor(&matrix, &MassMatrix::Diagonal(masses), -gamma)?;
        let numbers = factor.into_numbers();
        let made = Arc::new(ShiftedFactor { gamma, numbers, halves: Mutex::default(), idle: OnceLock::new() });
        let mut kept = lock();
        kept.insert(0, made.clone());
        kept.truncate(KEPT);
        Ok(made)
    }

    /// The numbers of all faces in the order of elimination.
    pub fn ordered(&self, x: &[f64]) -> Vec<f64> {
        self.order.iter().flat_map(|&face| x[B * face as usize..B * (face as usize + 1)].iter().copied()).collect()
    }

    /// The numbers of the faces in their own order.
    fn unordered(&self, x: &[f64]) -> Vec<f64> {
        let own = |&place: &u32| x[place as usize..place as usize + B].iter().copied();
        self.places.iter().flat_map(own).collect()
    }

    /// `(S + γM)⁻¹ f`.
    pub fn solve(&self, factor: &ShiftedFactor, f: &[f64]) -> Vec<f64> {
        let mut x = self.ordered(f);
        self.tree.solve(&self.symbolic, &factor.numbers, &mut x);
        self.unordered(&x)
    }

    /// Half of a solve, in the order of elimination.
    pub fn eliminated(&self, factor: &ShiftedFactor, f: &[f64]) -> Vec<f64> {
        let mut x = self.ordered(f);
        self.tree.eliminate(&self.symbolic, &factor.numbers, &mut x);
        x
    }

    /// The other half.
    pub fn substituted(&self, factor: &ShiftedFactor, mut half: Vec<f64>) -> Vec<f64> {
        self.tree.substitute(&self.symbolic, &factor.numbers, &mut half);
        self.unordered(&half)
    }

    /// Halves of the solves for unit pulls at faces.
    pub fn halves(&self, factor: &ShiftedFactor, faces: &[u32]) -> Vec<Arc<HalfSolved>> {
        let lock = || factor.halves.lock().unwrap_or_else(PoisonError::into_inner);
        // Taken along now: whoever else designs may clear what is kept before the others are made.
        let mut found: HashMap<u32, Arc<HalfSolved>> = {
            let kept = lock();
            faces.iter().filter_map(|face| Some((*face, kept.get(face)?.clone()))).collect()
        };
        let mut wanted: Vec<u32> = faces.iter().copied().filter(|face| !found.contains_key(face)).collect();
        wanted.sort_unstable_by_key(|&face| self.places[face as usize]);
        wanted.dedup();
        let side = |&face: &u32| {
            let place = self.places[face as usize];
            Sides { width: B, entries: (0..B as u32).map(|i| (place + i, i, 1.0)).collect() }
        };
        let sides: Vec<Sides> = wanted.iter().map(side).collect();
        let made = self.reach.eliminate(&self.symbolic, &factor.numbers, &sides);
        let made: Vec<(u32, Arc<HalfSolved>)> = wanted.into_iter().zip(made.into_iter().map(Arc::new)).collect();
        found.extend(made.iter().cloned());
        let mut kept = lock();
        if kept.len() + made.len() > KEPT_HALVES {
            kept.clear();
        }
        kept.extend(made);
        faces.iter().map(|face| found[face].clone()).collect()
    }

    /// Halves of the solves for `M z` of each field without energy, once.
    pub fn idle_halves<'f>(&self, factor: &'f ShiftedFactor, images: &[Vec<f64>]) -> &'f [Vec<f64>] {
        factor.idle.get_or_init(|| images.iter().map(|image| self.eliminated(factor, image)).collect())
    }
}

/// A matrix of blocks in an order of its rows.
fn ordered<const B: usize>(matrix: &BlockMatrix<B>, order: &[u32], places: &[u32]) -> SparseMatrix {
    let size = B * order.len();
    let entries = B * B * matrix.entries();
    let (mut offsets, mut indices, mut values) =
        (Vec::with_capacity(size + 1), Vec::with_capacity(entries), Vec::with_capacity(entries));
    offsets.push(0);
    let mut sorted: Vec<(u32, usize)> = Vec::new();
    for &face in order {
        let (columns, blocks) = matrix.row(face as usize);
        sorted.clear();
        sorted.extend(columns.iter().enumerate().map(|(at, &column)| (places[column as usize], at)));
        sorted.sort_unstable();
        for i in 0..B {
            for &(place, at) in &sorted {
                for (j, &value) in blocks[at][i].iter().enumerate() {
                    indices.push(place + j as u32);
                    values.push(value);
                }
            }
            offsets.push(indices.len());
        }
    }
    SparseMatrix::from_sorted_parts(size, size, offsets, indices, values)
}
