//! Thin shells: membrane and bending energy of a triangle mesh, at rest.
//!
//! Membrane: linear triangles in plane stress. Bending: the changes of the three dihedral angles of a face tell the change `δT` of its curvature
//! tensor, and the energy is that of a plate, `D/2 ∫ ν tr² + (1 − ν) |δT|²`. The tensor is that of the quadratic function through the corners of the
//! face and the three apexes beyond its edges, unfolded into its plane, so constant curvature is exact on every mesh. Where the six points do not
//! determine it, it is that of the mid-edge normals, `δT = Σ_k (l_k / 2A) δθ_k n_k n_kᵀ` (Grinspun et al. 2006; Oñate and Zárate 2000): on
//! equilateral triangles the two agree. The sum over edges of squared angles (Grinspun et al. 2003), which the thesis' source takes, has a Poisson's
//! ratio of its own, −1/3 on equilateral triangles, another on others, and gives a free plate the wrong frequencies. At a free edge no angle is
//! known, and no moment acts: the angle that costs least energy is taken, which is that very condition. The same holds where the ends of the edge are
//! held, as by a hinge. Where rotations are held as well, a clamp, the shell goes on beyond the edge as its mirror image, which moves as it does: the
//! angle is then twice that by which the face itself turns.

use chladni_algebra::Block;
use chladni_mesh::TriangleMesh;

use super::{
    Elements, Incidence, Material, NOBODY, OperatorError, Vector, cross, dot, minus, strain_block, times, within,
};

/// A face whose area is at most this share of the square of its longest edge is flat: its angles are noise.
const FLAT: f64 = 1e-7;

/// What is known of one face, lengths over `L`.
#[derive(Clone)]
struct Face {
    /// Its corners, then the apexes beyond edges 0, 1, 2 (edge k is opposite to corner k); [`NOBODY`] where there is none.
    stencil: [u32; 6],
    area: f64,
    /// Gradients of the hat functions of its corners.
    gradients: [Vector; 3],
    /// In its plane.
    projection: Block<3>,
    /// Of the three angles, with respect to the stencil.
    bends: [[Vector; 6]; 3],
    /// The energy of the three angles, `½ θᵀ Q θ`.
    energy: Block<3>,
}

pub(super) fn elements<'a>(
    mesh: &'a TriangleMesh,
    thickness: f64,
    material: &Material,
    held: &[bool],
) -> Result<Elements<'a>, OperatorError> {
    let n = mesh.positions.len();
    for (face, corners) in mesh.faces.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= n) {
            return Err(OperatorError::VertexOutOfRange { face, vertex, vertices: n });
        }
    }
    let sound: Vec<bool> = mesh.faces.iter().map(|face| doubled_area(mesh, face).is_some()).collect();
    let (mut area, mut masses, mut centre) = (0.0, vec![0.0; n], [0.0; 3]);
    for (corners, _) in mesh.faces.iter().zip(&sound).filter(|(_, sound)| **sound) {
        let size = 0.5 * doubled_area(mesh, corners).unwrap_or(0.0);
        area += size;
        for &v in corners {
            masses[v as usize] += size / 3.0;
            (0..3).for_each(|k| centre[k] += size / 3.0 * mesh.positions[v as usize][k]);
        }
    }
    if !(area > 0.0 && area.is_finite()) {
        return Err(OperatorError::NoArea);
    }
    masses.iter_mut().for_each(|m| *m /= area);
    let length = area.sqrt();
    within("thickness", thickness, SLENDEREST * length, length)?;

    let (beyond, held_edges) = apexes(mesh, &sound, held);
    let faces: Vec<Face> = {
        use rayon::prelude::*;
        let poisson = material.poisson;
        let bending = (thickness / length).powi(2) / (12.0 * (1.0 - poisson * poisson));
        mesh.faces
            .par_iter()
            .zip(&beyond)
            .zip(&sound)
            .filter(|(_, sound)| **sound)
            .map(|((corners, beyond), _)| measured(mesh, *corners, *beyond, 1.0 / length, bending, poisson))
            .collect()
    };
    let incidence = Incidence::new(n, faces.iter().enumerate().map(|(f, face)| (f as u32, face.stencil)));
    let poisson = material.poisson;
    // Plane stress.
    let (lambda, mu) = (poisson / (1.0 - poisson * poisson), 0.5 / (1.0 + poisson));
    let flat = sound.iter().filter(|&&sound| !sound).count();
    let row = move |vertex: u32, entries: &mut Vec<(u32, Block<3>)>| {
        for &(face, place) in incidence.on(vertex) {
            let face = &faces[face as usize];
            let i = place as usize;
            for (j, &other) in face.stencil.iter().enumerate().filter(|(_, v)| **v != NOBODY) {
                let mut block = [[0.0; 3]; 3];
                if i < 3 && j < 3 {
                    let (p, q) = (face.gradients[i], face.gradients[j]);
                    block = strain_block(face.area * lambda, face.area * mu, p, q, &face.projection);
                }
                // Always from the lower to the higher place, so that the matrix is symmetric to the last bit.
                let (low, high) = (i.min(j), i.max(j));
                for a in 0..3 {
                    for b in 0..3 {
                        let (a, b) = if i <= j { (a, b) } else { (b, a) };
                        let mut sum = 0.0;
                        for k in 0..3 {
                            for l in 0..3 {
                                sum += face.energy[k][l] * (face.bends[k][low][a] * face.bends[l][high][b]);
                            }
                        }
                        let (a, b) = if i <= j { (a, b) } else { (b, a) };
                        block[a][b] += sum;
                    }
                }
                if i == j {
                    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                        block[b][a] = block[a][b];
                    }
                }
                entries.push((other, block));
            }
        }
    };
    Ok(Elements {
        masses,
        row: Box::new(row),
        length,
        centre: times(1.0 / area, centre),
        total_mass: material.density * thickness * area,
        flat,
        held_edges,
    })
}

/// The least thickness over the root of the area: below it, bending drowns in the rounding errors of the membrane.
const SLENDEREST: f64 = 1e-5;

/// Twice the area of a face, if it is not flat.
fn doubled_area(mesh: &TriangleMesh, corners: &[u32; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
    let (u, v) = (minus(b, a), minus(c, a));
    let normal = cross(u, v);
    let doubled = dot(normal, normal).sqrt();
    let w = minus(c, b);
    let longest = dot(u, u).max(dot(v, v)).max(dot(w, w));
    (doubled > 2.0 * FLAT * longest).then_some(doubled)
}

/// For each face the corner of its neighbour beyond each edge, or [`MIRRORED`] where both ends of the edge are held; and how many edges these are.
/// Where an edge has several neighbours, each face looks at the next, in the order of their numbers.
fn apexes(mesh: &TriangleMesh, sound: &[bool], held: &[bool]) -> (Vec<[u32; 3]>, usize) {
    let mut edges: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * mesh.faces.len());
    for (f, face) in mesh.faces.iter().enumerate().filter(|(f, _)| sound[*f]) {
        for k in 0..3 {
            let (a, b) = (face[(k + 1) % 3], face[(k + 2) % 3]);
            edges.push(([a.min(b), a.max(b)], f as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut beyond = vec![[NOBODY; 3]; mesh.faces.len()];
    let is_held = |v: u32| held.get(v as usize).copied().unwrap_or(false);
    let mut held_edges = 0;
    for around in edges.chunk_by(|a, b| a.0 == b.0) {
        if around[0].0.into_iter().all(is_held) {
            held_edges += 1;
            around.iter().for_each(|&(_, f, k)| beyond[f as usize][k as usize] = MIRRORED);
            continue;
        }
        if around.len() == 1 {
            continue;
        }
        for (at, &(_, f, k)) in around.iter().enumerate() {
            let (_, other, there) = around[(at + 1) % around.len()];
            beyond[f as usize][k as usize] = mesh.faces[other as usize][there as usize];
        }
    }
    (beyond, held_edges)
}

/// Stands for the mirror image of a face's own corner; a mesh has fewer vertices.
const MIRRORED: u32 = NOBODY - 1;

fn measured(mesh: &TriangleMesh, corners: [u32; 3], beyond: [u32; 3], scale: f64, bending: f64, poisson: f64) -> Face {
    let origin = mesh.positions[corners[0] as usize];
    let at = |v: u32| times(scale, minus(mesh.positions[v as usize], origin));
    let p = corners.map(at);
    let normal = cross(minus(p[1], p[0]), minus(p[2], p[0]));
    let doubled = dot(normal, normal).sqrt();
    let unit = times(1.0 / doubled, normal);
    let edges: [Vector; 3] = std::array::from_fn(|k| minus(p[(k + 2) % 3], p[(k + 1) % 3]));
    let mut face = Face {
        stencil: [corners[0], corners[1], corners[2], beyond[0], beyond[1], beyond[2]],
        area: 0.5 * doubled,
        gradients: edges.map(|e| times(1.0 / doubled, cross(unit, e))),
        projection: std::array::from_fn(|a| std::array::from_fn(|b| f64::from(u8::from(a == b)) - unit[a] * unit[b])),
        bends: [[[0.0; 3]; 6]; 3],
        energy: [[0.0; 3]; 3],
    };
    let hinges: [Option<Hinge>; 3] = std::array::from_fn(|k| {
        let apex = beyond[k];
        let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
        let there = match apex {
            NOBODY => return None,
            MIRRORED => mirrored(a, b, p[k]),
            apex => at(apex),
        };
        Hinge::new(a, b, p[k], there)
    });
    let curvatures = curvatures(&edges, unit, &hinges);
    for k in 0..3 {
        for l in 0..3 {
            let ([a, b, c], [d, e, f]) = (curvatures[k], curvatures[l]);
            let energy = a * d + b * e + poisson * (a * e + b * d) + 2.0 * (1.0 - poisson) * (c * f);
            face.energy[k][l] = bending * face.area * energy;
        }
    }
    for (k, hinge) in hinges.iter().enumerate() {
        match hinge {
            Some(hinge) => {
                let gradients = hinge.gradients();
                face.bends[k][(k + 1) % 3] = gradients[0];
                face.bends[k][(k + 2) % 3] = gradients[1];
                face.bends[k][k] = gradients[2];
                if beyond[k] == MIRRORED {
                    // The image is at the same height, and both ends stay where they are.
                    face.bends[k][k] = times(2.0, gradients[2]);
                    face.stencil[3 + k] = NOBODY;
                } else {
                    face.bends[k][3 + k] = gradients[3];
                }
            }
            None => {
                // No moment about this edge.
                face.stencil[3 + k] = NOBODY;
                eliminate(&mut face.energy, k);
            }
        }
    }
    face
}

/// The mirror image of `c` beyond the line through `a` and `b`, in the plane of the three.
fn mirrored(a: Vector, b: Vector, c: Vector) -> Vector {
    let (e, u) = (minus(b, a), minus(c, a));
    let foot = dot(u, e) / dot(e, e);
    std::array::from_fn(|k| a[k] + 2.0 * foot * e[k] - u[k])
}

/// For each of the three angles the change of the curvature tensor, (xx, yy, xy) in the plane of the face, that a unit change of the angle stands
/// for.
fn curvatures(edges: &[Vector; 3], unit: Vector, hinges: &[Option<Hinge>; 3]) -> [Vector; 3] {
    let x = times(1.0 / dot(edges[2], edges[2]).sqrt(), edges[2]);
    let y = cross(unit, x);
    let flat = edges.map(|e| [dot(e, x), dot(e, y)]);
    let doubled = (flat[0][0] * flat[1][1] - flat[0][1] * flat[1][0]).abs();
    if let [Some(first), Some(second), Some(third)] = hinges {
        // Angles of the three quadratic functions, lengths over the root of twice the area.
        let scale = doubled.sqrt();
        let rows = [first.angles(flat[0]), second.angles(flat[1]), third.angles(flat[2])];
        if let Some(inverse) = inverse(rows.map(|row| times(1.0 / scale, row))) {
            return std::array::from_fn(|k| std::array::from_fn(|q| inverse[q][k] / scale));
        }
    }
    std::array::from_fn(|k| {
        let [ex, ey] = flat[k];
        let length = (ex * ex + ey * ey).sqrt();
        times(1.0 / (length * doubled), [ey * ey, ex * ex, -ex * ey])
    })
}

/// Patches whose matrix has a larger condition do not determine a quadratic function well.
const WORST_CONDITION: f64 = 40.0;

/// The inverse of a matrix of condition (in the Frobenius norm) at most [`WORST_CONDITION`].
fn inverse(m: Block<3>) -> Option<Block<3>> {
    let minors = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let determinant = dot(m[0], minors[0]);
    let inverse: Block<3> = std::array::from_fn(|i| std::array::from_fn(|j| minors[j][i] / determinant));
    let norm = |m: &Block<3>| m.iter().map(|row| dot(*row, *row)).sum::<f64>().sqrt();
    (norm(&m) * norm(&inverse) <= WORST_CONDITION).then_some(inverse)
}

/// Takes the value of one angle that costs least energy.
fn eliminate(energy: &mut Block<3>, k: usize) {
    let pivot = energy[k][k];
    if pivot > 0.0 {
        let row = energy[k];
        for i in 0..3 {
            for j in 0..3 {
                energy[i][j] -= row[i] * row[j] / pivot;
            }
        }
    }
    for i in 0..3 {
        (energy[i][k], energy[k][i]) = (0.0, 0.0);
    }
}

/// Two faces at the edge from `a` to `b`, with apexes `c` and `d`.
struct Hinge {
    /// Unit normals of the faces of `c` and `d`, where these lie left and right of the edge.
    normals: [Vector; 2],
    /// Their distances from the line of the edge.
    heights: [f64; 2],
    /// Where the feet of the perpendiculars stand: 0 at `a`, 1 at `b`.
    feet: [f64; 2],
}

impl Hinge {
    /// `None` where a face is flat.
    fn new(a: Vector, b: Vector, c: Vector, d: Vector) -> Option<Self> {
        let e = minus(b, a);
        let square = dot(e, e);
        let (m, n) = (cross(e, minus(c, a)), cross(minus(d, a), e));
        let sizes = [m, n].map(|normal| dot(normal, normal).sqrt());
        let length = square.sqrt();
        let sound = sizes.iter().all(|&size| size > 0.0);
        sound.then(|| Self {
            normals: [times(1.0 / sizes[0], m), times(1.0 / sizes[1], n)],
            heights: sizes.map(|size| size / length),
            feet: [dot(minus(c, a), e) / square, dot(minus(d, a), e) / square],
        })
    }

    /// The gradients of the angle with respect to `a`, `b`, `c`, `d`: neither a translation nor a rotation changes it.
    fn gradients(&self) -> [Vector; 4] {
        let [c, d] = [0, 1].map(|side| times(-1.0 / self.heights[side], self.normals[side]));
        let share = |weights: [f64; 2]| std::array::from_fn(|k| -weights[0] * c[k] - weights[1] * d[k]);
        [share(self.feet.map(|foot| 1.0 - foot)), share(self.feet), c, d]
    }

    /// The angles of the surfaces `x²/2`, `y²/2` and `x y` over the patch unfolded into the plane; `edge` runs from `a` to `b`, with `c` to its left.
    fn angles(&self, edge: [f64; 2]) -> Vector {
        // Wherever the origin lies: linear functions have no angle.
        let a = [0.0, 0.0];
        let length = (edge[0] * edge[0] + edge[1] * edge[1]).sqrt();
        let left = [-edge[1] / length, edge[0] / length];
        let point = |foot: f64, height: f64| [0, 1].map(|k| a[k] + foot * edge[k] + height * left[k]);
        let [c, d] = [point(self.feet[0], self.heights[0]), point(self.feet[1], -self.heights[1])];
        let b = [a[0] + edge[0], a[1] + edge[1]];
        let quadratic = |[x, y]: [f64; 2]| [0.5 * x * x, 0.5 * y * y, x * y];
        let [fa, fb, fc, fd] = [a, b, c, d].map(quadratic);
        std::array::from_fn(|q| {
            let side = |apex: f64, side: usize| {
                (apex - (1.0 - self.feet[side]) * fa[q] - self.feet[side] * fb[q]) / self.heights[side]
            };
            -side(fc[q], 0) - side(fd[q], 1)
        })
    }
}
