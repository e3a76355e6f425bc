//! The sphere from an icosahedron, at any frequency.

use chladni_base::Vector3;

use crate::TriangleMesh;

/// The golden ratio: corners of the icosahedron are the cyclic permutations of `(0, ±1, ±φ)`.
const GOLDEN: f64 = 1.618_033_988_749_895;

const CORNERS: [[f64; 3]; 12] = [
    [-1.0, GOLDEN, 0.0],
    [1.0, GOLDEN, 0.0],
    [-1.0, -GOLDEN, 0.0],
    [1.0, -GOLDEN, 0.0],
    [0.0, -1.0, GOLDEN],
    [0.0, 1.0, GOLDEN],
    [0.0, -1.0, -GOLDEN],
    [0.0, 1.0, -GOLDEN],
    [GOLDEN, 0.0, -1.0],
    [GOLDEN, 0.0, 1.0],
    [-GOLDEN, 0.0, -1.0],
    [-GOLDEN, 0.0, 1.0],
];

const FACES: [[usize; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// The unit sphere with `10 f² + 2` vertices, `f` chosen so that this is nearest to `vertices`.
pub(super) fn sphere(vertices: usize) -> TriangleMesh {
    let low = ((vertices.saturating_sub(2) as f64 / 10.0).sqrt() as usize).max(1);
    let count = |frequency: usize| 10 * frequency * frequency + 2;
    let f = if count(low + 1).abs_diff(vertices) < count(low).abs_diff(vertices) { low + 1 } else { low };

    // First the corners, then the inner points of each edge (from its lower corner), then the inner points of each
    // face.
    let mut edges: Vec<[usize; 2]> =
        FACES.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(|[a, b]| a < b).collect();
    edges.sort_unstable();
    let mut edge_of = [[0; 12]; 12];
    for (e, &[a, b]) in edges.iter().enumerate() {
        edge_of[a][b] = e;
        edge_of[b][a] = e;
    }
    let on_edges = 12 + edges.len() * (f - 1);
    let in_face = (f - 1) * f.saturating_sub(2) / 2;

    let mut positions = Vec::with_capacity(count(f));
    positions.extend((0..12).map(|corner| blend(f, &[(corner, f)])));
    for &[a, b] in &edges {
        positions.extend((1..f).map(|i| blend(f, &[(a, f - i), (b, i)])));
    }
    for &[a, b, c] in &FACES {
        for i in 1..f {
            positions.extend((1..f - i).map(|j| blend(f, &[(a, f - i - j), (b, i), (c, j)])));
        }
    }

    // The point of face k that is i steps towards its second corner and j towards its third.
    let number = |k: usize, i: usize, j: usize| -> u32 {
        let [a, b, c] = FACES[k];
        let along = |from: usize, to: usize, step: usize| {
            let from_lower = if from < to { step } else { f - step };
            12 + edge_of[from][to] * (f - 1) + from_lower - 1
        };
        (match (i, j) {
            (0, 0) => a,
            _ if i == f => b,
            _ if j == f => c,
            (_, 0) => along(a, b, i),
            (0, _) => along(a, c, j),
            _ if i + j == f => along(b, c, j),
            // Row i' holds f - 1 - i' inner points.
            _ => on_edges + k * in_face + (i - 1) * (f - 1) - i * (i - 1) / 2 + j - 1,
        }) as u32
    };
    let mut faces = Vec::with_capacity(20 * f * f);
    for k in 0..FACES.len() {
        for i in 0..f {
            for j in 0..f - i {
                faces.push([number(k, i, j), number(k, i + 1, j), number(k, i, j + 1)]);
                if i + j + 1 < f {
                    faces.push([number(k, i + 1, j), number(k, i + 1, j + 1), number(k, i, j + 1)]);
                }
            }
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

/// A point of the sphere from integer weights that sum to `frequency`.
///
/// Weights go through `sin(w θ)`, θ the angle of an edge: spherical interpolation along edges, and triangles of nearly
/// equal area inside, where flat weights would make those in the middle twice as large as those at the corners.
fn blend(frequency: usize, weights: &[(usize, usize)]) -> [f64; 3] {
    let angle = 2f64.atan();
    let mut point = Vector3::ZERO;
    for &(corner, weight) in weights {
        let share = (weight as f64 / frequency as f64 * angle).sin();
        point += share * Vector3(CORNERS[corner]);
    }
    (point / point.norm()).into()
}
