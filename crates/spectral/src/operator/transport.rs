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

use super::frames::{FaceFrames, Turn};

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
/// orientation the last of the numbers changes its sign first. A block of a size that does not fit the kind is the
/// identity.
pub fn transport_block<const B: usize>(kind: FieldKind, turn: Turn) -> Block<B> {
    let mut block = [[0.0; B]; B];
    for i in 0..B {
        block[i][i] = 1.0;
    }
    let [c, s] = turn.by;
    match kind {
        FieldKind::Tensor {} if B == 3 => {
            let (cc, ss, cs) = (0.5 * (1.0 + c), 0.5 * (1.0 - c), 0.5 * s * std::f64::consts::SQRT_2);
            block[0] = std::array::from_fn(|j| [cc, ss, -cs][j]);
            block[1] = std::array::from_fn(|j| [ss, cc, cs][j]);
            block[2] = std::array::from_fn(|j| [cs, -cs, c][j]);
        }
        FieldKind::Vector {} | FieldKind::NVector { .. } if B == 2 => {
            block[0] = std::array::from_fn(|j| [c, -s][j]);
            block[1] = std::array::from_fn(|j| [s, c][j]);
        }
        _ => {}
    }
    if turn.mirrored && kind.block() == B {
        block.iter_mut().for_each(|row| row[B - 1] = -row[B - 1]);
    }
    block
}

/// The turn of stored numbers across edge `k` of a face, or `None` at a boundary.
pub fn turn(kind: FieldKind, dual: &DualGraph, frames: &FaceFrames, face: usize, k: usize) -> Option<Turn> {
    frames.carry(dual, face, k).map(|turn| turn.power(kind.order()))
}

/// `w = 3 |e|² / (A_i + A_j)`, of edge `k` of a face.
pub fn edge_weight(dual: &DualGraph, frames: &FaceFrames, face: usize, k: usize) -> f64 {
    let [x, y] = frames.edges(face)[k];
    let neighbour = dual.neighbours(face)[k] as usize;
    3.0 * (x * x + y * y) / (frames.areas()[face] + frames.areas().get(neighbour).copied().unwrap_or(0.0))
}

/// The stiffness of the transport Laplacian, `F × F` blocks.
pub fn transport_stiffness<const B: usize>(kind: FieldKind, dual: &DualGraph, frames: &FaceFrames) -> BlockMatrix<B> {
    BlockMatrix::from_rows(dual.faces(), dual.faces(), |face, entries| {
        let mut diagonal = 0.0;
        for (k, neighbour) in dual.neighbours(face).into_iter().enumerate() {
            if neighbour == NO_FACE {
                continue;
            }
            // From the lower face, so that both triangles agree to the last bit.
            let (from, at) = if face < neighbour as usize {
                (face, k)
            } else {
                (neighbour as usize, dual.slot(neighbour, dual.edges(face)[k]))
            };
            let w = edge_weight(dual, frames, from, at);
            diagonal += w;
            let Some(carried) = turn(kind, dual, frames, from, at) else { continue };
            let carried = if from == face { carried } else { carried.inverse() };
            let block = transport_block::<B>(kind, carried).map(|row| row.map(|x| -w * x));
            // Two faces may share two edges.
            match entries.iter_mut().find(|e| e.0 == neighbour) {
                Some(entry) => {
                    for i in 0..B {
                        for j in 0..B {
                            entry.1[i][j] += block[i][j];
                        }
                    }
                }
                None => entries.push((neighbour, block)),
            }
        }
        let mut own = [[0.0; B]; B];
        for i in 0..B {
            own[i][i] = diagonal;
        }
        entries.push((face as u32, own));
    })
}
