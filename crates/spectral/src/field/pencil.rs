//! The restricted matrices, factored for any weights: what designs in spaces too large for a dense eigenproblem, and wherever a sum is not diagonal
//! in Ritz coordinates.
//!
//! `K = A + μ S̄ M̄⁻¹ S̄` is never formed: its second part is dense. With `y = √μ M̄⁻¹ S̄ x` the system `K x = f` becomes
//! `[A, √μ S̄; √μ S̄, −M̄] (x, y) = (f, 0)`, which is sparse, and quasi-definite if `A` is definite: `LDLᵀ` exists in every order (Vanderbei 1995).

use std::sync::{Arc, OnceLock};

use chladni_algebra::{
    ColumnTree, FactorError, FactorNumbers, HalfSolved, MassMatrix, Ordering, PANEL_WIDTH, ReachTree, Sides,
    SparseMatrix, SymbolicFactor, fill_reducing_order,
};
use rayon::prelude::*;

use crate::basis::FieldBasis;

/// What is added to make `A` definite, as a weight of `M̄`: far below the lowest positive eigenvalue of a surface of unit area.
const FLOOR: f64 = 1e-6;

/// What holds fields of norm 1 without energy, for weights of the energies.
pub(super) fn floor(harmonic: f64, biharmonic: f64) -> f64 {
    FLOOR * (harmonic + biharmonic)
}

/// From so many unknowns on, an order by nested dissection saves more than it costs.
const LARGE: usize = 6000;

/// A factor has at most so many entries for each of its matrix and each halving of its nodes. A test holds spaces of surfaces to a third of it.
const FILL: f64 = 3.0;

/// Factors below this are small, whatever they fill in.
const SMALL_FACTOR: usize = 1 << 23;

/// Whether a factor fills in as those of surfaces do, which nested dissection keeps to `O(n log n)` entries. Designs are promised no memory
/// beforehand: this is theirs, and the numbers of the factor are not computed beyond it.
pub(super) fn within_surfaces(entries: usize, nonzeros: usize, nodes: usize) -> Result<(), FactorError> {
    let most = (FILL * nonzeros as f64 * (nodes.max(2) as f64).log2()) as usize;
    let most = most.max(SMALL_FACTOR);
    // Eight bytes for the entry, two for its place in the pattern.
    let bytes = |entries: usize| 10 * entries as u64;
    if entries > most {
        return Err(FactorError::Promise { entries, bytes: bytes(entries), promised: bytes(most) });
    }
    Ok(())
}

/// `S̄`, `M̄`, and `B̄` where the biharmonic energy is the full one.
#[derive(Debug, Clone)]
pub(super) struct Pencil {
    block: usize,
    groups: usize,
    pub stiffness: SparseMatrix,
    pub mass: SparseMatrix,
    pub full_biharmonic: Option<SparseMatrix>,
    structure: OnceLock<Result<Arc<Structure>, FactorError>>,
}

/// The order of the unknowns and the pattern that every sum of the matrices lies in.
#[derive(Debug)]
struct Structure {
    /// Where the unknowns of each node begin in the system.
    places: Vec<u32>,
    /// The nodes in their order, with the neighbours of each, itself included, in that order.
    nodes: Vec<(u32, Vec<u32>)>,
    offsets: Vec<usize>,
    indices: Vec<u32>,
    symbolic: SymbolicFactor,
    /// How a single right-hand side is shared out among threads.
    tree: ColumnTree,
    /// What right-hand sides of a few entries reach.
    reach: ReachTree,
}

impl PartialEq for Pencil {
    fn eq(&self, other: &Self) -> bool {
        (self.block, self.groups, &self.stiffness, &self.mass, &self.full_biharmonic)
            == (other.block, other.groups, &other.stiffness, &other.mass, &other.full_biharmonic)
    }
}

/// What is added up: `A = harmonic S̄ + biharmonic B̄ + Σ weight G`, besides `biharmonic S̄ M̄⁻¹ S̄` without a full `B̄`.
pub(super) struct Sum<'a> {
    pub harmonic: f64,
    pub biharmonic: f64,
    pub uniform: f64,
    pub grams: Vec<(&'a SparseMatrix, f64)>,
}

impl Pencil {
    /// The matrices of a basis: groups of columns, and dense columns after them.
    pub fn new(basis: &FieldBasis) -> Self {
        let (block, groups) = (basis.space.block(), basis.space.groups());
        let (stiffness, mass) = (basis.stiffness.clone(), basis.mass.clone());
        Self { block, groups, stiffness, mass, full_biharmonic: None, structure: OnceLock::new() }
    }

    /// The same with a biharmonic energy of its own.
    pub fn with_full_biharmonic(self, energy: SparseMatrix) -> Self {
        Self { full_biharmonic: Some(energy), structure: OnceLock::new(), ..self }
    }

    pub fn size(&self) -> usize {
        self.stiffness.rows()
    }

    /// A node is a group of columns, or one dense column.
    fn node(&self, column: usize) -> usize {
        let local = self.block * self.groups;
        if column < local { column / self.block } else { self.groups + column - local }
    }

    fn columns(&self, node: usize) -> std::ops::Range<usize> {
        if node < self.groups {
            return node * self.block..(node + 1) * self.block;
        }
        let column = self.block * self.groups + node - self.groups;
        column..column + 1
    }

    /// Unknowns of the system for each column: `x` and `y`, or `x` alone.
    fn copies(&self) -> usize {
        if self.full_biharmonic.is_some() { 1 } else { 2 }
    }

    fn structure(&self) -> Result<Arc<Structure>, FactorError> {
        self.structure.get_or_init(|| self.analyse().map(Arc::new)).clone()
    }

    fn analyse(&self) -> Result<Structure, FactorError> {
        let nodes = self.node(self.size());
        let matrices = [Some(&self.stiffness), Some(&self.mass), self.full_biharmonic.as_ref()];
        let (mut offsets, mut indices, mut row) = (vec![0usize], Vec::new(), Vec::new());
        for node in 0..nodes {
            row.clear();
            row.push(node as u32);
            for column in self.columns(node) {
                for matrix in matrices.into_iter().flatten() {
                    row.extend(matrix.row(column).0.iter().map(|&c| self.node(c as usize) as u32));
                }
            }
            row.sort_unstable();
            row.dedup();
            indices.extend_from_slice(&row);
            offsets.push(indices.len());
        }
        let values = vec![1.0; indices.len()];
        let graph = SparseMatrix::from_sorted_parts(nodes, nodes, offsets, indices, values);
        let ordering = if nodes > LARGE { Ordering::NestedDissection } else { Ordering::Amd };
        let order = fill_reducing_order(&graph, ordering)?;
        let mut position = vec![0u32; nodes];
        let mut places = vec![0u32; nodes];
        let mut next = 0;
        for (at, &node) in order.iter().enumerate() {
            position[node as usize] = at as u32;
            places[node as usize] = next;
            next += (self.copies() * self.columns(node as usize).len()) as u32;
        }
        let ordered: Vec<(u32, Vec<u32>)> = order
            .iter()
            .map(|&node| {
                let mut neighbours = graph.row(node as usize).0.to_vec();
                neighbours.sort_unstable_by_key(|&n| position[n as usize]);
                (node, neighbours)
            })
            .collect();
        let (mut offsets, mut indices) = (vec![0usize], Vec::new());
        for (node, neighbours) in &ordered {
            for _ in 0..self.copies() * self.columns(*node as usize).len() {
                for &other in neighbours {
                    let place = places[other as usize];
                    indices.extend(place..place + (self.copies() * self.columns(other as usize).len()) as u32);
                }
                offsets.push(indices.len());
            }
        }
        let size = offsets.len() - 1;
        let values = vec![1.0; indices.len()];
        let pattern = SparseMatrix::from_sorted_parts(size, size, offsets.clone(), indices.clone(), values);
        let symbolic = SymbolicFactor::new(&pattern, &MassMatrix::Diagonal(vec![0.0; size]))?;
        within_surfaces(symbolic.entries(), pattern.values().len(), nodes)?;
        let (tree, reach) = (ColumnTree::new(&symbolic), ReachTree::new(&symbolic));
        Ok(Structure { places, nodes: ordered, offsets, indices, symbolic, tree, reach })
    }

    /// The system for some weights. Matrices of `sum` that reach beyond the pattern of the pencil lose what lies outside.
    fn assemble(&self, structure: &Structure, sum: &Sum<'_>) -> SparseMatrix {
        let size = structure.offsets.len() - 1;
        let mut values = vec![0.0; structure.indices.len()];
        let root = sum.biharmonic.sqrt();
        let floor = floor(sum.harmonic, sum.biharmonic);
        let mut slots = vec![u32::MAX; self.node(self.size())];
        for (node, neighbours) in &structure.nodes {
            let own = self.columns(*node as usize);
            let mut slot = 0;
            for &other in neighbours {
                slots[other as usize] = slot;
                slot += (self.copies() * self.columns(other as usize).len()) as u32;
            }
            for (i, column) in own.clone().enumerate() {
                let first = structure.places[*node as usize] as usize + i;
                let mut add = |copy: (usize, usize), matrix: &SparseMatrix, factor: f64| {
                    let start = structure.offsets[first + copy.0 * own.len()];
                    let (columns, numbers) = matrix.row(column);
                    for (&c, &value) in columns.iter().zip(numbers) {
                        let other = self.node(c as usize);
                        if slots[other] != u32::MAX {
                            let there = self.columns(other);
                            let at = slots[other] as usize + copy.1 * there.len() + (c as usize - there.start);
                            values[start + at] += factor * value;
                        }
                    }
                };
                add((0, 0), &self.stiffness, sum.harmonic);
                add((0, 0), &self.mass, sum.uniform + floor);
                for &(gram, weight) in &sum.grams {
                    add((0, 0), gram, weight);
                }
                match &self.full_biharmonic {
                    Some(full) => add((0, 0), full, sum.biharmonic),
                    None => {
                        add((0, 1), &self.stiffness, root);
                        add((1, 0), &self.stiffness, root);
                        add((1, 1), &self.mass, -1.0);
                    }
                }
            }
            neighbours.iter().for_each(|&other| slots[other as usize] = u32::MAX);
        }
        SparseMatrix::from_sorted_parts(size, size, structure.offsets.clone(), structure.indices.clone(), values)
    }

    /// Factors the system for some weights.
    pub fn factor(&self, sum: &Sum<'_>) -> Result<SparseInverse, FactorError> {
        let structure = self.structure()?;
        let matrix = self.assemble(&structure, sum);
        let factor = structure.symbolic.factor(&matrix, &MassMatrix::Diagonal(vec![0.0; matrix.rows()]), 0.0)?;
        let place = |column: usize| {
            let node = self.node(column);
            let own = self.columns(node);
            let x = structure.places[node] + (column - own.start) as u32;
            (x, if self.copies() == 2 { x + own.len() as u32 } else { u32::MAX })
        };
        let root = if self.copies() == 2 { sum.biharmonic.sqrt() } else { 0.0 };
        let numbers = factor.into_numbers();
        let places = (0..self.size()).map(place).collect();
        Ok(SparseInverse { structure: structure.clone(), numbers, rows: matrix.rows(), places, root })
    }
}

/// `K⁻¹`.
pub(super) struct SparseInverse {
    structure: Arc<Structure>,
    numbers: FactorNumbers,
    rows: usize,
    /// Where `x` and `y` of each column are in the system; `u32::MAX` where there is no `y`.
    places: Vec<(u32, u32)>,
    root: f64,
}

impl SparseInverse {
    /// `d`.
    pub fn size(&self) -> usize {
        self.places.len()
    }

    /// About the bytes that the factor takes.
    pub fn bytes(&self) -> u64 {
        8 * self.structure.symbolic.entries() as u64 + 16 * self.places.len() as u64
    }

    /// `X ← K⁻¹ X` for `d × k` numbers, column after column.
    pub fn apply(&self, vectors: &mut [f64]) {
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

    /// Halves of the solves for right-hand sides of a few entries, whose rows are columns of the space.
    pub fn halves(&self, mut sides: Vec<Sides>) -> Vec<HalfSolved> {
        for (row, _, _) in sides.iter_mut().flat_map(|side| &mut side.entries) {
            *row = self.places[*row as usize].0;
        }
        self.structure.reach.eliminate(&self.structure.symbolic, &self.numbers, &sides)
    }

    /// Half of the solve for `f`, `d` numbers, in the order of elimination.
    pub fn eliminated(&self, f: &[f64]) -> Vec<f64> {
        let mut x = self.no_half();
        f.iter().zip(&self.places).for_each(|(&value, &(at, _))| x[at as usize] = value);
        self.structure.tree.eliminate(&self.structure.symbolic, &self.numbers, &mut x);
        x
    }

    /// Half of the solve for nothing.
    pub fn no_half(&self) -> Vec<f64> {
        vec![0.0; self.rows]
    }

    /// The other half: `x = K⁻¹ f`, and `M̄⁻¹ S̄ x` where the system holds it.
    pub fn substituted(&self, mut half: Vec<f64>) -> (Vec<f64>, Option<Vec<f64>>) {
        self.structure.tree.substitute(&self.structure.symbolic, &self.numbers, &mut half);
        let x = self.places.iter().map(|&(at, _)| half[at as usize]).collect();
        let laplacian = || self.places.iter().map(|&(_, at)| half[at as usize] / self.root).collect();
        (x, (self.root > 0.0).then(laplacian))
    }

    /// `M̄⁻¹ S̄ x` for `x = K⁻¹ f`, whose `S̄ x` is `image`; `None` for a full biharmonic energy, whose system does not hold it.
    pub fn laplacian(&self, f: &[f64], image: &[f64]) -> Option<Vec<f64>> {
        let mut both = vec![0.0; self.rows];
        for (at, &(x, y)) in self.places.iter().enumerate() {
            if y == u32::MAX {
                return None;
            }
            if self.root > 0.0 {
                both[x as usize] = f[at];
            } else {
                both[y as usize] = -image[at];
            }
        }
        self.structure.tree.solve(&self.structure.symbolic, &self.numbers, &mut both);
        let scale = if self.root > 0.0 { 1.0 / self.root } else { 1.0 };
        Some(self.places.iter().map(|&(_, y)| scale * both[y as usize]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{FieldParameters, FieldSurface, field_basis, whole_space};
    use crate::operator::hodge::FieldBoundary;
    use crate::operator::transport::FieldKind;
    use chladni_base::{SplitMix64, Unwatched};
    use chladni_mesh::shape::{Shape, generate};

    /// Entries of the factor for each of the matrix and each halving of the nodes.
    fn fill(basis: &FieldBasis) -> f64 {
        let pencil = Pencil::new(basis);
        let structure = pencil.structure().unwrap();
        let nodes = pencil.node(pencil.size()) as f64;
        structure.symbolic.entries() as f64 / structure.indices.len() as f64 / nodes.log2()
    }

    #[test]
    fn spaces_of_surfaces_fill_in_far_less_than_they_may() {
        let surface = FieldSurface::new(generate(Shape::Torus, 2000).unwrap()).unwrap();
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
            let found = fill(&whole_space(&surface, kind, FieldBoundary::default()).unwrap());
            assert!(found < FILL / 3.0, "{kind:?}, all fields: {found}");
            let small = fill(&field_basis(&surface, &FieldParameters::new(kind, 400), &Unwatched).unwrap());
            assert!(small < FILL / 3.0, "{kind:?}, 400 dimensions: {small}");
        }
    }

    #[test]
    fn a_space_that_is_of_no_surface_is_refused_before_its_factor_is_computed() {
        // 6,000 columns, each beside eight others at random.
        let n = 6000;
        let mut random = SplitMix64::new(3);
        let mut entries: Vec<(u32, u32)> = (0..n).map(|v| (v, v)).collect();
        for v in 0..n {
            for _ in 0..4 {
                let w = random.below(n as usize) as u32;
                entries.extend([(v, w), (w, v)]);
            }
        }
        entries.sort_unstable();
        entries.dedup();
        let mut offsets = vec![0usize; n as usize + 1];
        entries.iter().for_each(|entry| offsets[entry.0 as usize + 1] += 1);
        (0..n as usize).for_each(|v| offsets[v + 1] += offsets[v]);
        let (indices, values) = (entries.iter().map(|entry| entry.1).collect(), vec![1.0; entries.len()]);
        let matrix = SparseMatrix::from_sorted_parts(n as usize, n as usize, offsets, indices, values);
        let (stiffness, mass) = (matrix.clone(), matrix);
        let (block, groups) = (2, n as usize / 2);
        let pencil = Pencil { block, groups, stiffness, mass, full_biharmonic: None, structure: OnceLock::new() };
        let refused = pencil.structure().unwrap_err();
        assert!(matches!(refused, FactorError::Promise { bytes, promised, .. } if bytes > promised), "{refused}");
    }
}
