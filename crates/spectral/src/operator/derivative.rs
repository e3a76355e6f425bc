//! What quadratic forms of stiffness and mass gain when vertices move.
//!
//! On an element of volume `V` (of a triangle its area) with the gradients `h_i` of its hat functions, `S_ij = V h_i · h_j` and `M_ij = V q_ij` with constants `q`. Moving a vertex by
//! `v` deforms the element by `∇v = v ⊗ h_i`, and with `K = Σ w x xᵀ` on its corners
//!
//! `∂⟨K, S⟩ / ∂p_i = V (tr T h_i − 2 T h_i)`, `T = Σ_ij K_ij h_i ⊗ h_j`, and `∂⟨N, M⟩ / ∂p_i = V ⟨N, q⟩ h_i`.
//!
//! Triangles in space are no other: to first order a motion out of their plane changes neither.

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::intrinsic::TriangleShape;
use chladni_mesh::{TetMesh, TriangleMesh};
use rayon::prelude::*;

use super::MassKind;
use super::frames::{cross, dot, minus};
use super::volume::shape;
use chladni_algebra::vectorized;

/// What an operator was assembled of.
#[derive(Debug, Clone, Copy)]
pub enum Elements<'a> {
    /// A surface.
    Triangles(&'a TriangleMesh),
    /// A solid.
    Tetrahedra(&'a TetMesh),
}

impl Elements<'_> {
    /// The vertices, `n`.
    pub fn vertices(&self) -> usize {
        match self {
            Self::Triangles(mesh) => mesh.positions.len(),
            Self::Tetrahedra(mesh) => mesh.positions.len(),
        }
    }
}

/// Functions whose forms are added up.
pub(crate) struct Forms<'a> {
    /// The values of `k` functions at each vertex, vertex after vertex: `n × k`.
    pub rows: &'a [f64],
    /// What `xᵀ S x` of each counts.
    pub stiffness: &'a [f64],
    /// What `xᵀ M x` of each counts.
    pub mass: &'a [f64],
}

/// Elements of a task. Fixed, so that results do not depend on the number of threads.
const ELEMENTS_PER_TASK: usize = 4096;

/// Sums that are carried side by side, so that they fit vectors.
const LANES: usize = 8;

/// The gradient of `Σ_k stiffness_k x_kᵀ S x_k + mass_k x_kᵀ M x_k` by the positions of vertices is added to `gradient`. The functions stay as they are. Masses are consistent, or lumped
/// with equal shares of each element.
pub(crate) fn add_gradient(
    elements: Elements<'_>,
    mass: MassKind,
    forms: &Forms<'_>,
    gradient: &mut [[f64; 3]],
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let k = forms.stiffness.len();
    assert_eq!(
        (forms.mass.len(), forms.rows.len()),
        (k, k * elements.vertices()),
        "a value of each function at each vertex"
    );
    assert_eq!(gradient.len(), elements.vertices(), "vertices");
    let consistent = mass == MassKind::Consistent;
    match elements {
        Elements::Triangles(mesh) => {
            add::<3>(&mesh.faces, consistent, forms, gradient, |corners| triangle(&mesh.positions, corners), monitor)
        }
        Elements::Tetrahedra(mesh) => {
            let hats = |corners: &[u32; 4]| tetrahedron(&mesh.positions, corners);
            add::<4>(&mesh.tetrahedra, consistent, forms, gradient, hats, monitor)
        }
    }
}

/// The volume of an element and the gradients of its hat functions; `None` where it has no volume, and no part in the operator.
type Hats<const C: usize> = Option<(f64, [[f64; 3]; C])>;

fn add<const C: usize>(
    elements: &[[u32; C]],
    consistent: bool,
    forms: &Forms<'_>,
    gradient: &mut [[f64; 3]],
    hats: impl Fn(&[u32; C]) -> Hats<C> + Sync,
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let parts = elements.par_chunks(ELEMENTS_PER_TASK).map(|elements| {
        monitor.checkpoint()?;
        let of = |corners: &[u32; C]| {
            hats(corners)
                .map_or([[0.0; 3]; C], |(volume, hats)| of_element(corners, (volume, &hats), consistent, forms))
        };
        Ok(elements.iter().map(of).collect())
    });
    let parts: Vec<Vec<[[f64; 3]; C]>> = parts.collect::<Result<_, Cancelled>>()?;
    for (corners, parts) in elements.iter().zip(parts.into_iter().flatten()) {
        for (&vertex, part) in corners.iter().zip(parts) {
            let sum = &mut gradient[vertex as usize];
            (0..3).for_each(|axis| sum[axis] += part[axis]);
        }
    }
    Ok(())
}

fn of_element<const C: usize>(
    corners: &[u32; C],
    (volume, hats): (f64, &[[f64; 3]; C]),
    consistent: bool,
    forms: &Forms<'_>,
) -> [[f64; 3]; C] {
    let k = forms.stiffness.len();
    let rows = corners.map(|v| &forms.rows[v as usize * k..(v as usize + 1) * k]);
    // T = Σ_ij K_ij h_i ⊗ h_j, symmetric.
    let mut tensor = [[0.0; 3]; 3];
    let mut masses = 0.0;
    for i in 0..C {
        for j in i..C {
            let (stiff, massive) = sums((forms.stiffness, forms.mass), (rows[i], rows[j]));
            let both = if i == j { 1.0 } else { 2.0 };
            for (a, row) in tensor.iter_mut().enumerate() {
                for (b, entry) in row.iter_mut().enumerate() {
                    *entry += 0.5 * both * stiff * (hats[i][a] * hats[j][b] + hats[j][a] * hats[i][b]);
                }
            }
            masses += massive * share::<C>(i == j, consistent) * both;
        }
    }
    let trace = tensor[0][0] + tensor[1][1] + tensor[2][2];
    hats.map(|hat| {
        let turned = tensor.map(|row| row[0] * hat[0] + row[1] * hat[1] + row[2] * hat[2]);
        [0, 1, 2].map(|axis| volume * ((trace + masses) * hat[axis] - 2.0 * turned[axis]))
    })
}

/// An entry of the mass of an element with `C` corners, over its volume.
fn share<const C: usize>(diagonal: bool, consistent: bool) -> f64 {
    let c = C as f64;
    match (consistent, diagonal) {
        (true, true) => 2.0 / (c * (c + 1.0)),
        (true, false) => 1.0 / (c * (c + 1.0)),
        (false, true) => 1.0 / c,
        (false, false) => 0.0,
    }
}

/// `Σ w a b` with either weights.
fn sums(weights: (&[f64], &[f64]), functions: (&[f64], &[f64])) -> (f64, f64) {
    vectorized(
        (weights, functions),
        #[inline(always)]
        |((s, m), (a, b))| {
            let (mut stiff, mut massive) = ([0.0; LANES], [0.0; LANES]);
            let (s, a, b, m) =
                (s.as_chunks::<LANES>(), a.as_chunks::<LANES>(), b.as_chunks::<LANES>(), m.as_chunks::<LANES>());
            for (((s, m), a), b) in s.0.iter().zip(m.0).zip(a.0).zip(b.0) {
                for lane in 0..LANES {
                    let product = a[lane] * b[lane];
                    stiff[lane] += s[lane] * product;
                    massive[lane] += m[lane] * product;
                }
            }
            for (lane, (((s, m), a), b)) in s.1.iter().zip(m.1).zip(a.1).zip(b.1).enumerate() {
                stiff[lane] += s * a * b;
                massive[lane] += m * a * b;
            }
            (stiff.iter().sum(), massive.iter().sum())
        },
    )
}

fn triangle(positions: &[[f64; 3]], corners: &[u32; 3]) -> Hats<3> {
    let p = corners.map(|v| positions[v as usize]);
    // What the operator takes for flat has no part in it.
    let area = TriangleShape::of_corners(p).area;
    let edges = [0, 1, 2].map(|k| minus(p[(k + 2) % 3], p[(k + 1) % 3]));
    let normal = cross(edges[0], edges[1]);
    let square = dot(normal, normal);
    (area > 0.0 && square > 0.0).then(|| (area, edges.map(|edge| cross(normal, edge).map(|x| x / square))))
}

fn tetrahedron(positions: &[[f64; 3]], corners: &[u32; 4]) -> Hats<4> {
    let p = corners.map(|v| positions[v as usize]);
    let (six, gradients) = shape(p);
    // The gradients are those over six volumes with their sign, which products of two have not.
    let signed = dot(minus(p[1], p[0]), gradients[1]);
    (six > 0.0).then(|| (six / 6.0, gradients.map(|gradient| gradient.map(|x| x / signed))))
}
