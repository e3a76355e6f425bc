//! The restricted matrices, factored for any weights: what designs in spaces too large for a dense eigenproblem, and
//! wherever a sum is not diagonal in Ritz coordinates.
//!
//! `K = A + μ S̄ M̄⁻¹ S̄` is never formed: its second part is dense. With `y = √μ M̄⁻¹ S̄ x` the system `K x = f`
//! becomes `[A, √μ S̄; √μ S̄, −M̄] (x, y) = (f, 0)`, which is sparse, and quasi-definite if `A` is definite: `LDLᵀ`
//! exists in every order (Vanderbei 1995).
//!
//! Where nothing has weights per face, `K` is a product of second order, `μ (S̄ + αM̄) M̄⁻¹ (S̄ + βM̄)`, and its
//! inverse the difference of two inverses: both factors together have half of the entries of that of the system.

use std::sync::{Arc, OnceLock};

use chladni_algebra::{
    ColumnTree, FactorError, MassMatrix, Ordering, ReachTree, SparseMatrix, SymbolicFactor, fill_reducing_order,
};
use chladni_base::made_once;

use super::pencil_inverse::{Factored, SparseInverse, split};
use crate::basis::FieldBasis;

/// What is added to make `A` definite, as a weight of `M̄`: far below the lowest positive eigenvalue of a surface of
/// unit area.
const FLOOR: f64 = 1e-6;

/// What holds fields of norm 1 without energy, for weights of the energies.
pub(super) fn floor(harmonic: f64, biharmonic: f64) -> f64 {
    FLOOR * (harmonic + biharmonic)
}

/// From so many unknowns on, an order by nested dissection saves more than it costs.
const LARGE: usize = 6000;

/// A factor has at most so many entries for each of its matrix and each halving of its nodes. A test holds spaces of
/// surfaces to a third of it.
const FILL: f64 = 3.0;

/// Factors below this are small, whatever they fill in.
const SMALL_FACTOR: usize = 1 << 23;

/// Whether a factor fills in as those of surfaces do, which nested dissection keeps to `O(n log n)` entries. Designs
/// are promised no memory beforehand: this is theirs, and the numbers of the factor are not computed beyond it.
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
    /// That of `S̄ + γM̄` alone.
    second_order: OnceLock<Result<Arc<Structure>, FactorError>>,
}

/// The order of the unknowns and the pattern that every sum of the matrices lies in.
#[derive(Debug)]
pub(super) struct Structure {
    /// Unknowns of the system for each column: `x` and `y`, or `x` alone.
    copies: usize,
    /// Where the unknowns of each node begin in the system.
    places: Vec<u32>,
    /// The nodes in their order, with the neighbours of each, itself included, in that order.
    nodes: Vec<(u32, Vec<u32>)>,
    offsets: Vec<usize>,
    indices: Vec<u32>,
    pub symbolic: SymbolicFactor,
    /// How a single right-hand side is shared out among threads.
    pub tree: ColumnTree,
    /// What right-hand sides of a few entries reach.
    pub reach: ReachTree,
}

impl PartialEq for Pencil {
    fn eq(&self, other: &Self) -> bool {
        (self.block, self.groups, &self.stiffness, &self.mass, &self.full_biharmonic)
            == (other.block, other.groups, &other.stiffness, &other.mass, &other.full_biharmonic)
    }
}

/// What is added up: `A = harmonic S̄ + biharmonic B̄ + Σ weight G`, besides `biharmonic S̄ M̄⁻¹ S̄` without a full
/// `B̄`.
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
        let [structure, second_order] = [OnceLock::new(), OnceLock::new()];
        Self { block, groups, stiffness, mass, full_biharmonic: None, structure, second_order }
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

    fn structure(&self) -> Result<Arc<Structure>, FactorError> {
        let copies = if self.full_biharmonic.is_some() { 1 } else { 2 };
        made_once(&self.structure, || self.analyse(copies).map(Arc::new)).clone()
    }

    fn second_order(&self) -> Result<Arc<Structure>, FactorError> {
        made_once(&self.second_order, || self.analyse(1).map(Arc::new)).clone()
    }

    fn analyse(&self, copies: usize) -> Result<Structure, FactorError> {
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
            next += (copies * self.columns(node as usize).len()) as u32;
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
            for _ in 0..copies * self.columns(*node as usize).len() {
                for &other in neighbours {
                    let place = places[other as usize];
                    indices.extend(place..place + (copies * self.columns(other as usize).len()) as u32);
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
        Ok(Structure { copies, places, nodes: ordered, offsets, indices, symbolic, tree, reach })
    }

    /// The system for some weights, or the part of it that is of second order. Matrices of `sum` that reach beyond the
    /// pattern of the pencil lose what lies outside.
    fn assemble(&self, structure: &Structure, sum: &Sum<'_>) -> SparseMatrix {
        let size = structure.offsets.len() - 1;
        let mut values = vec![0.0; structure.indices.len()];
        let root = sum.biharmonic.sqrt();
        let mut slots = vec![u32::MAX; self.node(self.size())];
        for (node, neighbours) in &structure.nodes {
            let own = self.columns(*node as usize);
            let mut slot = 0;
            for &other in neighbours {
                slots[other as usize] = slot;
                slot += (structure.copies * self.columns(other as usize).len()) as u32;
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
                add((0, 0), &self.mass, sum.uniform);
                for &(gram, weight) in &sum.grams {
                    add((0, 0), gram, weight);
                }
                match &self.full_biharmonic {
                    Some(full) => add((0, 0), full, sum.biharmonic),
                    None if structure.copies == 1 => {}
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
        let uniform = sum.uniform + floor(sum.harmonic, sum.biharmonic);
        let sum = Sum { uniform, grams: sum.grams.clone(), ..*sum };
        if let Some(roots) = split(&sum).filter(|_| self.full_biharmonic.is_none()) {
            let structure = self.second_order()?;
            let shifted = |gamma: f64| {
                let sum = Sum { harmonic: 1.0, biharmonic: 0.0, uniform: gamma, grams: Vec::new() };
                self.factored(&structure, &sum)
            };
            return Ok(SparseInverse::difference(shifted(roots.small)?, shifted(roots.large)?, roots));
        }
        let structure = self.structure()?;
        Ok(SparseInverse::new(self.factored(&structure, &sum)?))
    }

    fn factored(&self, structure: &Arc<Structure>, sum: &Sum<'_>) -> Result<Factored, FactorError> {
        let matrix = self.assemble(structure, sum);
        let factor = structure.symbolic.factor(&matrix, &MassMatrix::Diagonal(vec![0.0; matrix.rows()]), 0.0)?;
        let both = structure.copies == 2;
        let place = |column: usize| {
            let node = self.node(column);
            let own = self.columns(node);
            let x = structure.places[node] + (column - own.start) as u32;
            (x, if both { x + own.len() as u32 } else { u32::MAX })
        };
        let root = if both { sum.biharmonic.sqrt() } else { 0.0 };
        let numbers = factor.into_numbers();
        let places = (0..self.size()).map(place).collect();
        Ok(Factored { structure: structure.clone(), numbers, rows: matrix.rows(), places, root })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{FieldParameters, FieldSurface, field_basis, whole_space};
    use crate::operator::hodge::FieldBoundary;
    use crate::operator::transport::FieldKind;
    use chladni_algebra::{DenseMatrix, Sides, solve_definite};
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

    /// `K⁻¹ f` and `M̄⁻¹ S̄ K⁻¹ f` by dense factors.
    fn dense_solution(pencil: &Pencil, sum: &Sum<'_>, f: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let d = pencil.size();
        let mut curved = pencil.stiffness.to_dense();
        solve_definite(pencil.mass.to_dense(), &mut curved).unwrap();
        let bending = pencil.stiffness.multiply_dense(&curved);
        let (stiffness, mass) = (pencil.stiffness.to_dense(), pencil.mass.to_dense());
        let held = sum.uniform + floor(sum.harmonic, sum.biharmonic);
        let mut matrix = bending.clone();
        for ((k, s), m) in matrix.values_mut().iter_mut().zip(stiffness.values()).zip(mass.values()) {
            *k = sum.biharmonic * *k + sum.harmonic * s + held * m;
        }
        let mut x = DenseMatrix::zeros(d, 1);
        x.column_mut(0).copy_from_slice(f);
        solve_definite(matrix, &mut x).unwrap();
        let mut y = DenseMatrix::zeros(d, 1);
        y.column_mut(0).copy_from_slice(&pencil.stiffness.multiply(x.column(0)));
        solve_definite(mass, &mut y).unwrap();
        (x.column(0).to_vec(), y.column(0).to_vec())
    }

    #[test]
    fn the_difference_of_two_inverses_is_the_inverse_whole_and_by_halves() {
        let surface = FieldSurface::new(generate(Shape::Sphere, 642).unwrap()).unwrap();
        for (kind, d) in [(FieldKind::NVector { n: 4 }, 120), (FieldKind::Tensor {}, 90)] {
            let basis = field_basis(&surface, &FieldParameters::new(kind, d), &Unwatched).unwrap();
            let pencil = Pencil::new(&basis);
            let mut random = SplitMix64::new(5);
            let f: Vec<f64> = (0..d).map(|_| random.signed_unit()).collect();
            let held = if kind == (FieldKind::Tensor {}) { 1.0 } else { 0.0 };
            // The last have no roots that are apart: one factor of the whole system serves them.
            let cases =
                [(1.0, 0.05, held, true), (3.0, 1e-4, held, true), (1.0, 0.05, 40.0, false), (0.1, 1.0, 1.0, false)];
            for (harmonic, biharmonic, uniform, split) in cases {
                let sum = Sum { harmonic, biharmonic, uniform, grams: Vec::new() };
                let inverse = pencil.factor(&sum).unwrap();
                assert_eq!(inverse.is_difference(), split);
                let (x, y) = dense_solution(&pencil, &sum, &f);
                let off = |a: &[f64], b: &[f64]| {
                    let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
                    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
                };
                let mut own = f.clone();
                inverse.apply(&mut own);
                assert!(off(&own, &x) < 1e-8, "{kind:?} {harmonic} {biharmonic}: {}", off(&own, &x));
                let mut several = [f.clone(), vec![1.0; d], f.clone()].concat();
                inverse.apply(&mut several);
                assert!(off(&several[..d], &x) < 1e-8 && off(&several[2 * d..], &x) < 1e-8);
                let curved = inverse.laplacian(&f, &pencil.stiffness.multiply(&own)).unwrap();
                assert!(off(&curved, &y) < 1e-6, "{kind:?} {harmonic} {biharmonic}: {}", off(&curved, &y));
                let (whole, curved) = inverse.substituted(inverse.eliminated(&f));
                assert!(off(&whole, &x) < 1e-8 && off(&curved.unwrap(), &y) < 1e-6);
                // What a pull at a face moves there, and everywhere.
                let b = kind.block();
                let side = |face: u32| {
                    let entries = (0..b as u32).map(|i| (face * b as u32 + i, i, 1.0)).collect();
                    Sides { width: b, entries }
                };
                let halves = inverse.halves_of_faces(&[3, 7, 3], side);
                let again = inverse.halves_of_faces(&[7], |_| unreachable!("it is kept"));
                let mut unit = vec![0.0; d];
                unit[7 * b] = 1.0;
                let (moved, _) = dense_solution(&pencil, &sum, &unit);
                for (at, face) in [3, 7, 3].into_iter().enumerate() {
                    let product = again[0].product(&halves[at]);
                    assert!((0..b).all(|j| (product[j] - moved[face * b + j]).abs() < 1e-8 * moved[7 * b]));
                }
                let mut half = inverse.no_half();
                let mut pull = vec![0.0; b];
                pull[0] = 1.0;
                halves[1].add_to(&pull, &mut half);
                assert!(off(&inverse.substituted(half.clone()).0, &moved) < 1e-8);
                half.add(&inverse.eliminated(&unit), -1.0);
                assert!(inverse.substituted(half).0.iter().all(|x| x.abs() < 1e-9 * moved[7 * b]));
                let with = again[0].product_with(&inverse.eliminated(&f))[0];
                assert!((with - x[7 * b]).abs() < 1e-8 * x[7 * b].abs().max(1e-3));
            }
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
        let [structure, second_order] = [OnceLock::new(), OnceLock::new()];
        let pencil = Pencil { block, groups, stiffness, mass, full_biharmonic: None, structure, second_order };
        let refused = pencil.structure().unwrap_err();
        assert!(matches!(refused, FactorError::Promise { bytes, promised, .. } if bytes > promised), "{refused}");
    }
}
