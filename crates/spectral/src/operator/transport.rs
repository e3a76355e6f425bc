//! The weighted transport Laplacian of n-fields (Brandt et al. 2018) and symmetric tensor fields (thesis, appendix
//! 3.A).
//!
//! Card. Energy `Σ_e w_e |u_i − P u_j|²` over interior edges, `w_e = 3 |e|² / (A_i + A_j)`, mass = face area. Symmetric
//! positive semi-definite; the boundary is natural. Weights are independent of scale, so eigenvalues are in 1/length².
//! On equal triangles `w` is twice the weight of the finite-volume Laplacian: this is the sum of a non-conforming
//! divergence and a non-conforming curl energy, each of which is consistent by itself. So eigenvalues are about twice
//! those of the connection Laplacian on fair triangles, and where triangles are stretched or all point one way they
//! depend on the direction, however fine the mesh.

use chladni_algebra::{Block, BlockMatrix};
use chladni_mesh::dual::{DualGraph, NO_FACE};

use super::frames::{Complex64, FaceFrames, Turn};

/// What is stored in a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FieldKind {
    /// A tangent vector, with the Hodge–Laplacian.
    Vector {},
    /// `n` vectors, equal up to turns by 360°/n, as one representation vector: its angle is `n` times theirs. For
    /// `n = 1` a tangent vector. The operator carries vectors from face to face and weighs what differs as the thesis
    /// does; it is no discretisation of the connection Laplacian: on equal triangles its eigenvalues are twice those,
    /// and where triangles point one way they differ by direction.
    NVector {
        /// How many, from 1.
        #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 64, example = 4))]
        n: u32,
    },
    /// A symmetric 2 × 2 tensor as `(a₁₁, a₂₂, √2 a₁₂)`.
    Tensor {},
}

impl FieldKind {
    /// Numbers per face: 2 or 3.
    pub fn block(self) -> usize {
        match self {
            Self::Tensor {} => 3,
            Self::Vector {} | Self::NVector { .. } => 2,
        }
    }

    /// The power of a rotation by which stored numbers turn; for tensors that of their deviator.
    pub fn order(self) -> u32 {
        match self {
            Self::Vector {} => 1,
            Self::NVector { n } => n,
            Self::Tensor {} => 2,
        }
    }
}

/// The largest `n` of n-vectors: beyond it, transport over a few faces has turned through all angles.
pub const MOST_VECTORS: u32 = 64;

/// The block that carries stored numbers of the given kind from a neighbour into a face; `turn` is
/// [`FaceFrames::carry`] to the power [`FieldKind::order`].
///
/// For tensors this is `P` of (3.18), written in the cosine and sine of twice the angle. Between faces of opposite
/// orientation the last of the numbers changes its sign first.
///
/// # Panics
/// Unless `B` is [`FieldKind::block`].
pub fn transport_block<const B: usize>(kind: FieldKind, turn: Turn) -> Block<B> {
    assert_eq!(B, kind.block(), "numbers of a block, numbers per face");
    let Complex64 { re: c, im: s } = turn.by;
    let mut block: Block<B> = match kind {
        FieldKind::Tensor {} => {
            let (cc, ss, cs) = (0.5 * (1.0 + c), 0.5 * (1.0 - c), 0.5 * s * std::f64::consts::SQRT_2);
            sized([[cc, ss, -cs], [ss, cc, cs], [cs, -cs, c]])
        }
        FieldKind::Vector {} | FieldKind::NVector { .. } => sized([[c, -s], [s, c]]),
    };
    if turn.mirrored {
        block.iter_mut().for_each(|row| row[B - 1] = -row[B - 1]);
    }
    block
}

/// A block of the size that its kind is known to have.
fn sized<const B: usize, const N: usize>(block: Block<N>) -> Block<B> {
    std::array::from_fn(|i| std::array::from_fn(|j| block[i][j]))
}

/// The turn of stored numbers across edge `k` of a face, or `None` at a boundary.
pub fn turn(kind: FieldKind, dual: &DualGraph, frames: &FaceFrames, face: usize, k: usize) -> Option<Turn> {
    frames.carry(dual, face, k).map(|turn| turn.power(kind.order()))
}

/// `w = 3 |e|² / (A_i + A_j)`, of edge `k` of a face.
pub fn edge_weight(dual: &DualGraph, frames: &FaceFrames, face: usize, k: usize) -> f64 {
    let edge = frames.edges(face)[k];
    let neighbour = dual.neighbours(face)[k] as usize;
    3.0 * edge.norm_sqr() / (frames.areas()[face] + frames.areas().get(neighbour).copied().unwrap_or(0.0))
}

/// What joins a face `i` to the one across its edge `k`: that face `j`, the weight `w_e`, and the turn `r_ij` that
/// carries the stored numbers of `j` into `i`. `None` at a boundary.
fn link(kind: FieldKind, dual: &DualGraph, frames: &FaceFrames, i: usize, k: usize) -> Option<(u32, f64, Turn)> {
    let j = dual.neighbours(i)[k];
    if j == NO_FACE {
        return None;
    }
    // From the lower face, so that both triangles agree to the last bit.
    let (from, at) = if i < j as usize { (i, k) } else { (j as usize, dual.slot(j, dual.edges(i)[k])) };
    let r = turn(kind, dual, frames, from, at)?;
    Some((j, edge_weight(dual, frames, from, at), if from == i { r } else { r.inverse() }))
}

/// The stiffness of the transport Laplacian, `F × F` blocks.
///
/// The energy `E(u) = Σ_e w_e |u_i − r_ij u_j|²` has at `(i, j)` the entry `−w_e r_ij` and at `(i, i)` the sum of the
/// weights: the matrix of a connection Laplacian as in Knöppel et al. (2013), with faces for vertices and `u` the n-th
/// powers of directions. A complex entry is a real block.
pub fn transport_stiffness<const B: usize>(kind: FieldKind, dual: &DualGraph, frames: &FaceFrames) -> BlockMatrix<B> {
    BlockMatrix::from_rows(dual.faces(), dual.faces(), |i, entries| {
        let mut sum = 0.0;
        for (j, w, r) in (0..3).filter_map(|k| link(kind, dual, frames, i, k)) {
            sum += w;
            add(entries, j, transport_block::<B>(kind, r).map(|row| row.map(|x| -w * x)));
        }
        let own = std::array::from_fn(|a| std::array::from_fn(|b| if a == b { sum } else { 0.0 }));
        entries.push((i as u32, own));
    })
}

/// Adds a block to a row: two faces may share two edges.
fn add<const B: usize>(row: &mut Vec<(u32, Block<B>)>, column: u32, block: Block<B>) {
    match row.iter_mut().find(|entry| entry.0 == column) {
        Some((_, sum)) => {
            sum.as_flattened_mut().iter_mut().zip(block.as_flattened()).for_each(|(sum, x)| *sum += x);
        }
        None => row.push((column, block)),
    }
}
