//! Sparse factors of `S + γM` on all faces: where there is room for them they take the place of multigrid cycles, and a
//! field is designed among all in the time of two substitutions (see [`super::least`]).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use chladni_algebra::{
    BlockMatrix, ColumnTree, FactorError, FactorNumbers, HalfSolved, MassMatrix, Ordering, ReachTree, Sides,
    SparseMatrix, SymbolicFactor, fill_reducing_order,
};
use chladni_base::made_once;
use chladni_base::parallel::*;

use super::pencil::within_surfaces;
use crate::operator::transport::FieldKind;

/// The bytes that factors may take where nobody says how many there are.
pub const USUAL_ROOM: u64 = 1 << 30;

/// Bytes of two factors and of what is kept beside them, for each face, number of a block squared and halving of the
/// surface: what scanned surfaces take, which fill in less than others. Operators that couple the faces around vertices
/// fill in more than four times as much as those that couple neighbours.
const EXPECTED: f64 = 18.0;
const EXPECTED_AROUND_VERTICES: f64 = 80.0;

/// Bytes for each face and number of a block squared that the operator takes beside them, with some fields without
/// energy.
const OPERATOR_BYTES: f64 = 75.0;

/// From so many faces on, an order by nested dissection saves more than it costs.
const LARGE: usize = 6000;

/// The least shift: `S` itself may be singular. Far below the lowest positive eigenvalue of a surface of unit area.
pub(super) const FLOOR: f64 = 1e-7;

/// So many shifts have their factors kept, those of two choices of weights, where there is room, and those of one where
/// there is not.
const MOST_KEPT: usize = 4;
const LEAST_KEPT: usize = 2;

/// Halves of solves are kept, for each shift, up to this share of the bytes of its factor.
const HALVES: u64 = 16;

/// About the bytes that all fields of a surface take at least that fills in as scans do, before anything is known of
/// it: an operator, two factors, and what is kept beside them.
pub(super) fn expected_bytes(kind: FieldKind, faces: usize) -> f64 {
    let (faces, block) = (faces.max(2) as f64, kind.block() as f64);
    let each = if kind == (FieldKind::Vector {}) { EXPECTED_AROUND_VERTICES } else { EXPECTED };
    block * block * faces * (each * faces.log2() + OPERATOR_BYTES)
}

/// The most faces of a surface of which all fields fit into so many bytes with two factors, by what is expected of
/// surfaces. Whether they do is known when they are analysed.
pub fn most_factored_faces(kind: FieldKind, room: u64) -> usize {
    let (mut fits, mut beyond) = (0usize, 1usize << 32);
    while beyond - fits > 1 {
        let middle = fits + (beyond - fits) / 2;
        if expected_bytes(kind, middle) <= room as f64 { fits = middle } else { beyond = middle }
    }
    fits
}

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
    /// How many of them are kept.
    kept: usize,
}

/// A factor of `S + γM`; where γ is 0, of `S` with some numbers [grounded](Direct::grounded).
pub(super) struct ShiftedFactor {
    pub gamma: f64,
    numbers: FactorNumbers,
    halves: Mutex<Halves>,
    idle: OnceLock<IdleSolves>,
}

/// What solves for the images of [fields without energy](super::kernel) leave.
pub(super) struct IdleSolves {
    /// Halves of them.
    pub halves: Vec<Vec<f64>>,
    /// What they have in common with the images, on each component.
    pub squares: Vec<Vec<Vec<f64>>>,
}

/// Halves of solves by the faces that pull, with the bytes that they take.
#[derive(Default)]
struct Halves {
    of: HashMap<u32, Arc<HalfSolved>>,
    bytes: u64,
}

impl<const B: usize> Direct<B> {
    /// Analyses an operator, beside which so many bytes are taken; `None` where two factors would take more than is
    /// left of `room` bytes, or the surface fills in more than surfaces do.
    pub fn new(kind: FieldKind, stiffness: &BlockMatrix<B>, beside: u64, room: u64) -> Option<Self> {
        let faces = stiffness.rows();
        if faces > most_factored_faces(kind, room) {
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
        let kept = (LEAST_KEPT..=MOST_KEPT).rev().find(|&kept| beside + bytes_of(&symbolic, kept) <= room)?;
        let (tree, reach) = (ColumnTree::new(&symbolic), ReachTree::new(&symbolic));
        Some(Self { order, places, symbolic, tree, reach, factors: Mutex::default(), kept })
    }

    /// About the bytes that it takes at most, with all factors and halves that are kept.
    pub fn bytes(&self) -> u64 {
        bytes_of(&self.symbolic, self.kept)
    }

    /// The same with the factors of one choice of weights.
    pub fn bytes_of_two(&self) -> u64 {
        bytes_of(&self.symbolic, LEAST_KEPT)
    }

    /// About the bytes that are held only while the first factors are made, until they are there: a matrix, and what
    /// fronts hand on.
    pub fn bytes_of_making(&self) -> u64 {
        if self.factors.lock().unwrap_or_else(PoisonError::into_inner).len() >= LEAST_KEPT {
            return 0;
        }
        4 * self.symbolic.entries() as u64 + 300 * self.symbolic.size() as u64
    }

    /// About the multiplications that the first two factors take; none once they are there.
    pub fn operations_of_making(&self) -> f64 {
        let made = self.factors.lock().unwrap_or_else(PoisonError::into_inner).len();
        LEAST_KEPT.saturating_sub(made) as f64 * self.symbolic.operations()
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
        if let Some(kept) = self.kept_factor(gamma) {
            return Ok(kept);
        }
        let masses = self.order.iter().flat_map(|&face| std::iter::repeat_n(mass[face as usize], B)).collect();
        self.made(stiffness, masses, gamma, -gamma)
    }

    /// A factor that is kept, and then the last to be given up.
    fn kept_factor(&self, gamma: f64) -> Option<Arc<ShiftedFactor>> {
        let mut kept = self.factors.lock().unwrap_or_else(PoisonError::into_inner);
        let at = kept.iter().position(|factor| factor.gamma == gamma)?;
        kept[..=at].rotate_right(1);
        Some(kept[0].clone())
    }

    /// The factor of `S` less `shift` times a diagonal in the order of elimination, which is kept by the name of a γ.
    fn made(
        &self,
        stiffness: &BlockMatrix<B>,
        diagonal: Vec<f64>,
        gamma: f64,
        shift: f64,
    ) -> Result<Arc<ShiftedFactor>, FactorError> {
        let matrix = ordered(stiffness, &self.order, &self.places);
        let factor = self.symbolic.factor(&matrix, &MassMatrix::Diagonal(diagonal), shift)?;
        let numbers = factor.into_numbers();
        let made = Arc::new(ShiftedFactor { gamma, numbers, halves: Mutex::default(), idle: OnceLock::new() });
        let mut kept = self.factors.lock().unwrap_or_else(PoisonError::into_inner);
        kept.insert(0, made.clone());
        kept.truncate(self.kept);
        Ok(made)
    }

    /// A factor of `S` where something is added to the diagonal at some numbers, as many as there are fields without
    /// energy and such that no mixture of these vanishes at all of them: where no such field has a part in `f`, the
    /// solution is zero at these numbers, and one of `S x = f`. No shift, however small, does that: fields without
    /// energy are in its solutions over the shift, and what is left of their digits is little.
    ///
    /// # Errors
    /// [`FactorError`].
    pub fn grounded(
        &self,
        stiffness: &BlockMatrix<B>,
        numbers: impl FnOnce() -> Vec<(usize, f64)>,
    ) -> Result<Arc<ShiftedFactor>, FactorError> {
        if let Some(kept) = self.kept_factor(0.0) {
            return Ok(kept);
        }
        // The factor that told which fields have no energy is done with: with it there would be three at once, where
        // there may be room for two.
        self.factors.lock().unwrap_or_else(PoisonError::into_inner).retain(|factor| factor.gamma > FLOOR);
        let mut added = vec![0.0; B * self.order.len()];
        for (number, add) in numbers() {
            added[self.places[number / B] as usize + number % B] = add;
        }
        self.made(stiffness, added, 0.0, -1.0)
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
            faces.iter().filter_map(|face| Some((*face, kept.of.get(face)?.clone()))).collect()
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
        let more: u64 = made.iter().map(|half| half.1.bytes()).sum();
        let mut kept = lock();
        if kept.bytes + more > 8 * self.symbolic.entries() as u64 / HALVES {
            *kept = Halves::default();
        }
        kept.bytes += more;
        kept.of.extend(made);
        faces.iter().map(|face| found[face].clone()).collect()
    }

    /// Halves of the solves for `M z` of fields without energy, and `(M z)ᵀ (S + γM)⁻¹ M z'` by `squares`, once.
    pub fn idle_halves<'f>(
        &self,
        factor: &'f ShiftedFactor,
        images: impl FnOnce() -> Vec<Vec<f64>>,
        squares: impl FnOnce(&[Vec<f64>], &[Vec<f64>]) -> Vec<Vec<Vec<f64>>>,
    ) -> &'f IdleSolves {
        made_once(&factor.idle, || {
            let images = images();
            let halves: Vec<Vec<f64>> = images.par_iter().map(|image| self.eliminated(factor, image)).collect();
            let solved: Vec<Vec<f64>> = halves.par_iter().map(|half| self.substituted(factor, half.clone())).collect();
            IdleSolves { squares: squares(&images, &solved), halves }
        })
    }

    /// The faces in the order of elimination.
    pub fn order(&self) -> &[u32] {
        &self.order
    }
}

/// Numbers of factors, their halves and their structure: patterns, and vectors of a few numbers a row.
fn bytes_of(symbolic: &SymbolicFactor, kept: usize) -> u64 {
    let (entries, size) = (symbolic.entries() as u64, symbolic.size() as u64);
    kept as u64 * (8 * entries + 8 * entries / HALVES) + 2 * entries + 64 * size
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
