//! How a face of a shell bends: its curvature as a linear function of displacements.
//!
//! The curvature of a face is constant, and tells how far the surface turns about its three edges:
//! `S = Σ_k (l_k / A) ψ_k n_k n_kᵀ`, where `ψ_k` is the angle between the normal of the face and that at the midpoint
//! of edge `k` (Morley 1968; as a shape operator, Grinspun, Gingold, Reisman and Zorin 2006). Both faces of an edge
//! share the normal there, so that moments pass from one to the other whatever the triangulation: their two angles sum
//! up to the change of the dihedral angle. How it is shared out is not left to further unknowns, but told by the
//! quadratic function that fits the changes at the edge and at the four others of its two faces, least squares in the
//! patch unfolded into the plane: `ψ = θ / 2 ± ξ`, with `ξ` linear in those five. Quadratic functions are their own
//! fit, so that a constant curvature has exactly its energy, and no curvature less than that of Morley's element, which
//! has no motions without energy but rigid ones.
//!
//! At a free edge no angle is known, and no moment acts: the angle that costs least energy is taken, which is that very
//! condition. The same holds where the ends of an edge at the border are held, as by a hinge. In a clamp the normal at
//! the edge stays: the angle is that by which the face turns.

use chladni_algebra::Block;
use chladni_base::Vector3;
use chladni_mesh::TriangleMesh;

use super::NOBODY;

/// The vertices that the curvature of a face depends on, at most: its corners, the apexes of its neighbours, and those
/// of theirs.
pub(super) const STENCIL: usize = 12;

/// What is beyond an edge of a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beyond {
    /// Nothing, and no moment.
    Nothing,
    /// A clamp: the normal at the edge stays.
    Clamp,
    /// A face.
    Face {
        /// Which.
        face: u32,
        /// The place of its corner that is not on the edge.
        corner: u8,
        /// Whether the edge has no third face.
        only: bool,
    },
}

/// A mesh, and how its faces hang together.
pub(super) struct Surroundings<'a> {
    pub mesh: &'a TriangleMesh,
    /// For each face what is beyond its edges; edge k is opposite to corner k.
    pub beyond: &'a [[Beyond; 3]],
    /// Lengths are multiplied by it.
    pub scale: f64,
    pub poisson: f64,
}

/// A face in its own plane.
pub(super) struct Flat {
    /// Its corners.
    pub corners: [u32; 3],
    pub area: f64,
    /// Its edges, counterclockwise.
    pub edges: [[f64; 2]; 3],
}

/// Three combinations of the curvatures of a face, the sum of whose squares is twice its energy.
pub(super) struct Curvatures {
    /// The corners first; [`NOBODY`] where there is none.
    pub stencil: [u32; STENCIL],
    /// The gradients of the three with respect to each vertex of the stencil.
    pub gradients: [[Vector3; 3]; STENCIL],
}

impl Curvatures {
    fn add(&mut self, weights: Vector3, vertex: u32, gradient: Vector3) {
        let place = self.stencil.iter().position(|&v| v == vertex || v == NOBODY);
        if let Some(place) = place {
            self.stencil[place] = vertex;
            for (sum, weight) in self.gradients[place].iter_mut().zip(weights.0) {
                *sum += weight * gradient;
            }
        }
    }
}

/// The ridge of a fit, as a share of the sum of squares. Where angles are too few to tell a quadratic function, as in a
/// strip of faces, that of least energy is taken among those that fit; where they do, this changes the energy by the
/// square of its share alone, since the angles sought are those of least energy. Beside needles, twists that are to be
/// told are seen by as little as the square of width over length.
const RIDGE: f64 = 1e-6;

/// How much more than the angle at the edge itself the angles that are shared out may amplify displacements, by the
/// squares of their gradients: shares are cut to that. Of a twist the long edges of needles know next to nothing, and
/// the short ones, that do, have to be multiplied by length over width. On triangles of the usual quality it is .2.
const MOST_AMPLIFIED: f64 = 9.0;

impl Surroundings<'_> {
    /// The curvature of a face, for a `rigidity` over `1 − ν²` times the area.
    pub fn curvatures(&self, face: u32, flat: &Flat, rigidity: f64) -> Curvatures {
        let mut stencil = [NOBODY; STENCIL];
        stencil[..3].copy_from_slice(&flat.corners);
        let mut curvatures = Curvatures { stencil, gradients: [[Vector3::ZERO; 3]; STENCIL] };
        let beyond = self.beyond[face as usize];
        let weights = self.weights(flat, rigidity, beyond);
        let origin = self.mesh.point(flat.corners[0]);
        let hinges: [Option<Hinge>; 3] = std::array::from_fn(|k| {
            let [a, b, c] = [1, 2, 0].map(|step| flat.corners[(k + step) % 3]);
            self.hinge(origin, [a, b, c], beyond[k], flat.edges[k])
        });
        for (k, hinge) in hinges.iter().enumerate() {
            let Some(hinge) = hinge else { continue };
            let Some(back) = &hinge.back else {
                // A clamp.
                hinge.each(|vertex, gradient| curvatures.add(weights[k], vertex, gradient));
                continue;
            };
            let mut shares = [0.0; 5];
            let mut data = [Some(hinge), hinges[(k + 1) % 3].as_ref(), hinges[(k + 2) % 3].as_ref(), None, None];
            let there = match beyond[k] {
                Beyond::Face { face, only: true, .. } => self.others(origin, face, hinge, back, flat.edges[k]),
                _ => [None, None],
            };
            if let Beyond::Face { only: true, .. } = beyond[k] {
                [data[3], data[4]] = there.each_ref().map(Option::as_ref);
                let edge = flat.edges[k];
                let (own, other) = (hinge.front.quadratics(edge), back.quadratics(edge.map(|x| -x)));
                shares = shared(&data, 0.5 * (own - other), self.poisson);
            }
            shares[0] += 0.5;
            for (hinge, share) in data.iter().zip(shares) {
                if let Some(hinge) = hinge {
                    hinge.each(|vertex, gradient| curvatures.add(weights[k], vertex, share * gradient));
                }
            }
        }
        curvatures
    }

    /// What a unit angle at each edge adds to the three combinations; those of free edges are chosen for the least
    /// energy.
    fn weights(&self, flat: &Flat, rigidity: f64, beyond: [Beyond; 3]) -> [Vector3; 3] {
        let (size, poisson) = ((rigidity * flat.area).sqrt(), self.poisson);
        let (second, third) = ((1.0 - poisson * poisson).sqrt(), (2.0 * (1.0 - poisson)).sqrt());
        let mut weights = flat.edges.map(|[x, y]| {
            let factor = size / (flat.area * (x * x + y * y).sqrt());
            factor * Vector3::new(y * y + poisson * x * x, second * x * x, -third * x * y)
        });
        for k in (0..3).filter(|&k| beyond[k] == Beyond::Nothing) {
            let free = std::mem::take(&mut weights[k]);
            let square = free.norm_squared();
            if square > 0.0 {
                weights.iter_mut().for_each(|own| *own -= own.dot(free) / square * free);
            }
        }
        weights
    }

    /// The edge from `a` to `b` of a face, with its apex `c` to the left.
    fn hinge(&self, origin: Vector3, [a, b, c]: [u32; 3], beyond: Beyond, edge: [f64; 2]) -> Option<Hinge> {
        let leaf = |corners: [u32; 3]| Leaf::new(corners, corners.map(|v| self.scale * (self.mesh.point(v) - origin)));
        let back = match beyond {
            Beyond::Nothing => return None,
            Beyond::Clamp => None,
            Beyond::Face { face, corner, .. } => Some(leaf([b, a, self.mesh.faces[face as usize][corner as usize]])),
        };
        let front = leaf([a, b, c]);
        let mut quadratics = front.quadratics(edge);
        if let Some(back) = &back {
            quadratics += back.quadratics(edge.map(|x| -x));
        }
        Some(Hinge { front, back, quadratics })
    }

    /// The two other edges of the face beyond an edge of that direction.
    fn others(&self, origin: Vector3, face: u32, hinge: &Hinge, back: &Leaf, edge: [f64; 2]) -> [Option<Hinge>; 2] {
        let [a, b, _] = hinge.front.corners;
        let apex = back.corners[2];
        let corners = self.mesh.faces[face as usize];
        let opposite = |v: u32| {
            let place = corners.iter().position(|&corner| corner == v);
            place.map_or(Beyond::Nothing, |place| self.beyond[face as usize][place])
        };
        // From b, at which the foot of the apex is 0.
        let [x, y] = edge;
        let length = (x * x + y * y).sqrt();
        let along = -back.foot;
        let there = [along * x + back.height * y / length, along * y - back.height * x / length];
        [
            self.hinge(origin, [a, apex, b], opposite(b), [x + there[0], y + there[1]]),
            self.hinge(origin, [apex, b, a], opposite(a), [-there[0], -there[1]]),
        ]
    }
}

/// The share of each of the angles in the value `target` of the quadratic function that fits them, `target` being that
/// of its three coefficients.
fn shared(data: &[Option<&Hinge>; 5], target: Vector3, poisson: f64) -> [f64; 5] {
    let mut square: Block<3> = [[0.0; 3]; 3];
    for hinge in data.iter().flatten() {
        for (row, x) in square.iter_mut().zip(hinge.quadratics.0) {
            row.iter_mut().zip(hinge.quadratics.0).for_each(|(sum, y)| *sum += x * y);
        }
    }
    // The third coefficient stands for two entries of a tensor: the same in every frame.
    let ridge = RIDGE * (square[0][0] + square[1][1] + 0.5 * square[2][2]);
    let plate = [[1.0, poisson, 0.0], [poisson, 1.0, 0.0], [0.0, 0.0, 2.0 * (1.0 - poisson)]];
    for (row, more) in square.iter_mut().zip(plate) {
        row.iter_mut().zip(more).for_each(|(sum, x)| *sum += ridge * x);
    }
    let [a, b, c] = square.map(Vector3);
    let [x, y, z] = target.0;
    let solution = (b.cross(c) * x + c.cross(a) * y + a.cross(b) * z) / a.dot(b.cross(c));
    let mut shares = data.map(|hinge| hinge.map_or(0.0, |hinge| hinge.quadratics.dot(solution)));
    let amplified = |(hinge, share): (&Option<&Hinge>, f64)| {
        hinge.map_or(0.0, |hinge: &Hinge| share * share * hinge.amplification())
    };
    let all: f64 = data.iter().zip(shares).map(amplified).sum();
    let most = (MOST_AMPLIFIED * amplified((&data[0], 1.0)) / all).sqrt();
    if most < 1.0 {
        shares.iter_mut().for_each(|share| *share *= most);
    }
    shares
}

/// An edge, about which its two faces turn against each other; or one face alone, in a clamp.
struct Hinge {
    front: Leaf,
    back: Option<Leaf>,
    /// The angles of the surfaces `x²/2`, `y²/2` and `x y` over the patch unfolded into the plane.
    quadratics: Vector3,
}

impl Hinge {
    /// The sum of the squares of the gradients of the angle by its two leaves.
    fn amplification(&self) -> f64 {
        self.front.amplification() + self.back.as_ref().map_or(0.0, Leaf::amplification)
    }

    /// The gradient of the angle.
    fn each(&self, mut add: impl FnMut(u32, Vector3)) {
        for leaf in [Some(&self.front), self.back.as_ref()].into_iter().flatten() {
            leaf.gradients().into_iter().for_each(|(vertex, gradient)| add(vertex, gradient));
        }
    }
}

/// A face that turns about an edge.
struct Leaf {
    /// Two ends of the edge, and the apex to the left of it.
    corners: [u32; 3],
    unit: Vector3,
    /// The distance of the apex from the edge.
    height: f64,
    /// Where the foot of the perpendicular stands: 0 at the first end, 1 at the second.
    foot: f64,
}

impl Leaf {
    fn new(corners: [u32; 3], [a, b, c]: [Vector3; 3]) -> Self {
        let (edge, up) = (b - a, c - a);
        let (normal, square) = (edge.cross(up), edge.norm_squared());
        let doubled = normal.norm();
        Self { corners, unit: 1.0 / doubled * normal, height: doubled / square.sqrt(), foot: up.dot(edge) / square }
    }

    /// The gradient of the angle by which it turns: neither a translation nor, together with the other face, a rotation
    /// changes it.
    fn gradients(&self) -> [(u32, Vector3); 3] {
        let up = 1.0 / self.height * self.unit;
        let [a, b, c] = self.corners;
        [(a, (self.foot - 1.0) * up), (b, -self.foot * up), (c, up)]
    }

    /// The sum of the squares of the gradient.
    fn amplification(&self) -> f64 {
        let (there, here) = (self.foot, 1.0 - self.foot);
        (here * here + there * there + 1.0) / (self.height * self.height)
    }

    /// The angles between the surfaces `x²/2`, `y²/2` and `x y` at the midpoint of the edge, where they are level, and
    /// their linear functions on the face.
    fn quadratics(&self, [x, y]: [f64; 2]) -> Vector3 {
        let length = (x * x + y * y).sqrt();
        let along = self.foot - 0.5;
        let (u, v) = (along * x - self.height * y / length, along * y + self.height * x / length);
        // Both ends are at the same height.
        let level = Vector3::new(0.125 * x * x, 0.125 * y * y, 0.25 * x * y);
        1.0 / self.height * (Vector3::new(0.5 * u * u, 0.5 * v * v, u * v) - level)
    }
}
