//! Small meshes that are hard on an eigensolver, and what is asked of it on them, drawn at random from a seed.

use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_spectral::operator::{Boundary, MassKind, OperatorKind, Potential};
use chladni_spectral::spectrum::hsim::Variant;

/// The generator of Steele, Lea and Flood: a stream of numbers for each seed.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x5bd1_e995);
        (0..4).for_each(|_| {
            random.next();
        });
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `0..bound`.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }

    /// In `0.0..1.0`.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// A power of ten between two exponents.
    pub fn power(&mut self, least: f64, most: f64) -> f64 {
        10f64.powf(least + (most - least) * self.unit())
    }
}

/// A mesh and an operator on it.
pub struct Case {
    pub name: String,
    pub mesh: TriangleMesh,
    pub operator: OperatorKind,
    pub mass: MassKind,
    pub boundary: Boundary,
}

/// What is asked about a case.
#[derive(Debug, Clone, Copy)]
pub struct Question {
    pub wanted: Request,
    pub tolerance: f64,
    pub variant: Variant,
    pub seed: u64,
}

/// Which pairs are asked for.
#[derive(Debug, Clone, Copy)]
pub enum Request {
    Count(usize),
    /// All below a bound, in the units of the input.
    Below(f64),
}

/// A case, the same for the same seed.
pub fn case(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let (name, mut mesh) = mesh(&mut random);
    let mut name = name;
    if random.below(4) == 0 {
        let scale = random.power(-6.0, 6.0);
        mesh.positions.iter_mut().flatten().for_each(|x| *x *= scale);
        name += &format!(" scaled by {scale:.1e}");
    }
    let area =
        chladni_spectral::operator::laplace::assemble(&mesh, MassKind::Barycentric).map_or(1.0, |problem| problem.area);
    let operator = match random.below(12) {
        0 => potential(&mut random, &mesh, area, &mut name),
        1 => OperatorKind::Robust,
        2 => OperatorKind::Auto,
        3 => OperatorKind::Extrinsic { t: random.unit() },
        _ => OperatorKind::Laplace,
    };
    let mass = random.pick(&[MassKind::Barycentric, MassKind::Voronoi, MassKind::Consistent]);
    let boundary = random.pick(&[Boundary::Neumann, Boundary::Neumann, Boundary::Dirichlet]);
    let operator_name = match &operator {
        OperatorKind::Hamiltonian { .. } => "hamiltonian".to_owned(),
        other => format!("{other:?}"),
    };
    name += &format!(", {operator_name}, {mass:?}, {boundary:?}");
    Case { name, mesh, operator, mass, boundary }
}

fn potential(random: &mut Random, mesh: &TriangleMesh, area: f64, name: &mut String) -> OperatorKind {
    let n = mesh.positions.len();
    let size = random.power(-9.0, 11.0) / area;
    let (kind, values): (_, Vec<f64>) = match random.below(4) {
        0 => ("constant", vec![size; n]),
        1 => ("negative constant", vec![-size; n]),
        2 => ("random", (0..n).map(|_| size * (random.unit() - 0.3)).collect()),
        _ => ("half", (0..n).map(|k| if 2 * k < n { size } else { 0.0 }).collect()),
    };
    *name += &format!(" with a {kind} potential of {:.1e} per area", size * area);
    OperatorKind::Hamiltonian { potential: Potential::Values(values) }
}

/// The question number `index` about a case with these eigenvalues, in the units of the input.
pub fn question(seed: u64, index: usize, values: &[f64]) -> Question {
    let mut random = Random::new(seed ^ (0x00c0_ffee + ((index as u64) << 40)));
    let n = values.len();
    let variant = random.pick(&[Variant::Sliced, Variant::Sliced, Variant::Sliced, Variant::Random, Variant::Bathe]);
    let tolerance = random.pick(&[0.1, 1e-2, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10]);
    let wanted = if random.below(5) < 2 {
        // On an eigenvalue, beside it, or anywhere.
        let value = values[random.below(n)];
        Request::Below(match random.below(4) {
            0 => value,
            1 => value.next_up(),
            2 => value + random.power(-13.0, -3.0) * (random.unit() - 0.5) * value.abs(),
            _ => value + random.unit() * (values[n - 1] - value) / n as f64,
        })
    } else {
        Request::Count(match random.below(4) {
            0 => 1 + random.below(n.min(12)),
            1 => n - random.below(n.min(20)),
            _ => 1 + random.below(n),
        })
    };
    Question { wanted, tolerance, variant, seed: random.below(1000) as u64 }
}

fn mesh(random: &mut Random) -> (String, TriangleMesh) {
    let base = |random: &mut Random, most: usize| match random.below(9) {
        0 => ("octahedron".to_owned(), octahedron()),
        1 => shape(random, Shape::Sphere, 12, 60),
        2 | 3 => shape(random, Shape::Sphere, 42, most),
        4 => shape(random, Shape::Torus, 48, most),
        5 => shape(random, Shape::Disk, 7, most),
        6 => shape(random, Shape::Rectangle, 9, most),
        7 => {
            let (width, height) = (2 + random.below(21), 2 + random.below(20));
            (format!("grid {width} × {height}"), grid(width, height))
        }
        _ => shape(random, Shape::Genus(1), 400, 450),
    };
    match random.below(8) {
        0 => {
            let (name, one) = base(random, 100);
            let count = 2 + random.below((400 / one.positions.len()).clamp(1, 96));
            (format!("{count} copies of {name}"), copies(&one, count))
        }
        1 => {
            let (name, mut mesh) = base(random, 300);
            let (count, height) = (1 + random.below(14), random.power(-10.0, -2.0));
            for _ in 0..count {
                let face = random.below(mesh.faces.len());
                needle(&mut mesh, face, height);
            }
            (format!("{name} with {count} needles of height {height:.1e}"), mesh)
        }
        2 => {
            let (name, one) = base(random, 200);
            let width = random.power(-9.0, -2.0);
            (format!("two times {name}, joined by a hair of {width:.1e}"), haired(&one, width))
        }
        3 => {
            let (name, mesh) = base(random, 400);
            let noise = 0.05 + 0.25 * random.unit();
            let seed = random.below(1000) as u64;
            (format!("{name} with noise"), noisy(&mesh, noise, seed).unwrap_or(mesh))
        }
        _ => base(random, 400),
    }
}

fn shape(random: &mut Random, shape: Shape, least: usize, most: usize) -> (String, TriangleMesh) {
    let vertices = least + random.below(most - least + 1);
    let mesh = generate(shape, vertices).expect("shapes of so many vertices can be made");
    (format!("{shape:?} of {}", mesh.positions.len()), mesh)
}

/// Six vertices, eigenvalues 0, 2, 2, 2, 3, 3 times a number.
pub fn octahedron() -> TriangleMesh {
    let positions =
        vec![[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    TriangleMesh { positions, faces, ..Default::default() }
}

/// A flat grid of right triangles, `width × height` vertices.
pub fn grid(width: usize, height: usize) -> TriangleMesh {
    let positions = (0..width * height).map(|k| [(k % width) as f64, (k / width) as f64, 0.0]).collect();
    let mut faces = Vec::new();
    for y in 0..height as u32 - 1 {
        for x in 0..width as u32 - 1 {
            let at = y * width as u32 + x;
            faces.push([at, at + 1, at + 1 + width as u32]);
            faces.push([at, at + 1 + width as u32, at + width as u32]);
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

/// So many copies side by side, not joined.
pub fn copies(one: &TriangleMesh, count: usize) -> TriangleMesh {
    let n = one.positions.len() as u32;
    let mut mesh = TriangleMesh { positions: Vec::new(), faces: Vec::new(), ..Default::default() };
    for copy in 0..count as u32 {
        mesh.positions.extend(one.positions.iter().map(|p| [p[0] + 10.0 * f64::from(copy), p[1], p[2]]));
        mesh.faces.extend(one.faces.iter().map(|face| face.map(|v| v + copy * n)));
    }
    mesh
}

/// Splits a face by a vertex at this relative height above the middle of its first edge.
pub fn needle(mesh: &mut TriangleMesh, face: usize, height: f64) {
    let [a, b, c] = mesh.faces[face];
    let at = |v: u32| mesh.positions[v as usize];
    let (p, q, r) = (at(a), at(b), at(c));
    let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
    let new = mesh.positions.len() as u32;
    mesh.positions.push(std::array::from_fn(|k| middle[k] + height * (r[k] - middle[k])));
    mesh.faces[face] = [a, b, new];
    mesh.faces.push([b, c, new]);
    mesh.faces.push([c, a, new]);
}

/// Two copies that one thin triangle joins.
fn haired(one: &TriangleMesh, width: f64) -> TriangleMesh {
    let mut mesh = copies(one, 2);
    let (a, b) = (0u32, one.positions.len() as u32);
    let new = mesh.positions.len() as u32;
    let p = mesh.positions[a as usize];
    mesh.positions.push([p[0], p[1] + width, p[2] + 0.5 * width]);
    mesh.faces.push([a, b, new]);
    mesh
}
