//! Problems whose eigenvalues are multiple, and counts that cut them anywhere: copies of one thing, many components,
//! symmetric shapes and graphs.

use chladni_algebra::{MassMatrix, SparseMatrix};
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::operator::{Boundary, EigenProblem, MassKind, OperatorKind, OperatorParameters, assemble};
use chladni_spectral::spectrum::hsim::Variant;

use super::cases::{Question, Random, Request, copies, grid, octahedron};

/// Copies of one problem.
pub struct Copies {
    pub name: String,
    /// One of them: a dense solve of it tells the eigenvalues of all.
    pub one: EigenProblem,
    pub count: usize,
    /// All of them as one problem.
    pub all: EigenProblem,
    /// What all of them lie on; of a graph, so many vertices anywhere.
    pub mesh: TriangleMesh,
    /// Whether the rows lie on no surface.
    pub graph: bool,
}

/// The most unknowns of one copy, and of all.
const MOST: usize = 700;
const MOST_OF_ALL: usize = 4000;

/// The most pairs that are asked for, but where all are.
const MOST_PAIRS: usize = 300;

/// A problem, the same for the same seed.
pub fn case(seed: u64) -> Copies {
    let mut random = Random::new(seed ^ 0x51de_cafe);
    if random.below(3) == 0 { of_graph(&mut random) } else { of_surface(&mut random) }
}

/// So many copies that they are not too large.
fn how_many(random: &mut Random, size: usize) -> usize {
    let most = (MOST_OF_ALL / size.max(1)).clamp(1, 64);
    random.pick(&[1, 1, 2, 3, 5, 8, 13, 24, 64]).min(most)
}

fn of_surface(random: &mut Random) -> Copies {
    let sphere = |vertices| generate(Shape::Sphere, vertices).expect("there are such spheres");
    let (name, one) = match random.below(7) {
        0 => {
            let vertices = random.pick(&[12, 42, 92, 162, 252, 362, 492, 642]);
            (format!("sphere of {vertices}"), sphere(vertices))
        }
        1 => {
            let level = random.below(5);
            (format!("octahedron of level {level}"), subdivided(octahedron(), level, true))
        }
        2 => {
            let level = random.below(5);
            (format!("tetrahedron of level {level}"), subdivided(tetrahedron(), level, false))
        }
        3 => {
            let cells = 1 + random.below(9);
            (format!("cube of {cells} cells"), cube(cells))
        }
        4 => {
            let vertices = 48 + random.below(600);
            (format!("torus of {vertices}"), generate(Shape::Torus, vertices).expect("there are such tori"))
        }
        5 => {
            let side = 2 + random.below(22);
            (format!("square grid of {side}"), grid(side, side))
        }
        _ => {
            let vertices = 7 + random.below(500);
            (format!("disk of {vertices}"), generate(Shape::Disk, vertices).expect("there are such disks"))
        }
    };
    let count = how_many(random, one.positions.len());
    let mesh = copies(&one, count);
    let graph = random.below(3) == 0;
    let mass = random.pick(&[MassKind::Barycentric, MassKind::Voronoi, MassKind::Consistent]);
    let boundary = random.pick(&[Boundary::Neumann, Boundary::Neumann, Boundary::Neumann, Boundary::Dirichlet]);
    let parameters = if graph {
        OperatorParameters { operator: OperatorKind::Graph, ..OperatorParameters::default() }
    } else {
        OperatorParameters { operator: OperatorKind::Laplace, mass, boundary }
    };
    let problem = |mesh: &TriangleMesh, parameters: &OperatorParameters| {
        assemble(mesh, parameters, &Unwatched).map(|operator| operator.problem)
    };
    // A closed surface has no boundary, and a small one with boundary nothing else.
    let free = OperatorParameters { boundary: Boundary::Neumann, ..parameters.clone() };
    let (parameters, one) = match problem(&one, &parameters) {
        Ok(problem) => (parameters, problem),
        Err(_) => (free.clone(), problem(&one, &free).expect("these surfaces have an operator")),
    };
    let all = problem(&mesh, &parameters).expect("copies have the operator of one");
    let operator = if graph { "graph".to_owned() } else { format!("{:?}, {:?}", parameters.mass, parameters.boundary) };
    Copies { name: format!("{count} copies of {name}, {operator}"), one, count, all, mesh, graph }
}

fn of_graph(random: &mut Random) -> Copies {
    let (name, size, edges) = match random.below(8) {
        0 => {
            let n = 3 + random.below(MOST - 3);
            (format!("star of {n}"), n, (1..n).map(|k| (0, k)).collect())
        }
        1 => {
            let n = 2 + random.below(60);
            (format!("complete graph of {n}"), n, (0..n).flat_map(|k| (0..k).map(move |j| (j, k))).collect())
        }
        2 => {
            let (a, b) = (1 + random.below(20), 2 + random.below(200));
            let edges = (0..a).flat_map(|i| (0..b).map(move |j| (i, a + j))).collect();
            (format!("complete bipartite graph of {a} and {b}"), a + b, edges)
        }
        3 => {
            let d = 1 + random.below(9);
            let edges = (0..1 << d).flat_map(|k: usize| (0..d).map(move |bit| (k, k ^ (1 << bit))));
            (format!("hypercube of dimension {d}"), 1 << d, edges.filter(|(a, b)| a < b).collect())
        }
        4 => {
            let n = 3 + random.below(MOST - 3);
            (format!("cycle of {n}"), n, (0..n).map(|k| (k.min((k + 1) % n), k.max((k + 1) % n))).collect())
        }
        5 => {
            let (m, n) = (3 + random.below(22), 3 + random.below(22));
            let edges = (0..m * n).flat_map(|k| {
                let (i, j) = (k / n, k % n);
                let pair = |other: usize| (k.min(other), k.max(other));
                [pair((i + 1) % m * n + j), pair(i * n + (j + 1) % n), pair((i + 1) % m * n + (j + 1) % n)]
            });
            (format!("torus grid of {m} × {n}"), m * n, edges.collect())
        }
        6 => (format!("{} vertices without edges", 1), 1, Vec::new()),
        _ => (format!("{} joined", 2), 2, vec![(0, 1)]),
    };
    let most = (MOST_OF_ALL / size).max(1);
    let count = if size <= 2 { 1 + random.below(1500.min(most)) } else { how_many(random, size) };
    let all: Vec<(usize, usize)> =
        (0..count).flat_map(|copy| edges.iter().map(move |&(a, b)| (a + copy * size, b + copy * size))).collect();
    let n = count * size;
    Copies {
        name: format!("{count} copies of {name}"),
        one: laplacian(size, &edges),
        count,
        all: laplacian(n, &all),
        mesh: TriangleMesh { positions: vec![[0.0; 3]; n], faces: Vec::new(), ..Default::default() },
        graph: true,
    }
}

/// The combinatorial Laplacian of a graph, as [`OperatorKind::Graph`] has it; `edges` may repeat.
fn laplacian(n: usize, edges: &[(usize, usize)]) -> EigenProblem {
    let mut rows = vec![std::collections::BTreeMap::<u32, f64>::new(); n];
    for &(a, b) in edges {
        rows[a].insert(b as u32, -1.0);
        rows[b].insert(a as u32, -1.0);
    }
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for (k, row) in rows.iter_mut().enumerate() {
        row.insert(k as u32, row.len() as f64);
        indices.extend(row.keys());
        values.extend(row.values());
        offsets.push(indices.len());
    }
    EigenProblem {
        stiffness: SparseMatrix::from_sorted_parts(n, n, offsets, indices, values),
        mass: MassMatrix::Diagonal(vec![1.0 / n as f64; n]),
        area: n as f64,
        unknowns: None,
    }
}

/// A question about a problem with these eigenvalues, ascending: mostly a count that cuts a cluster, or does not quite.
pub fn question(seed: u64, index: usize, values: &[f64], graph: bool) -> Question {
    let mut random = Random::new(seed ^ (0x0bad_5eed + ((index as u64) << 40)));
    let n = values.len();
    let few = n.min(MOST_PAIRS);
    // The places where a cluster of equal values ends.
    let scale = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let ends: Vec<usize> = (1..few).filter(|&k| values[k] - values[k - 1] > 1e-9 * scale).collect();
    let end = ends.get(random.below(ends.len())).copied().unwrap_or(1);
    let count = match random.below(8) {
        0 => 1 + random.below(few.min(12)),
        1 | 2 => end + 1,
        3 => end.saturating_sub(1),
        4 => end,
        5 if n <= 2 * MOST_PAIRS => n - random.below(n.min(3)),
        _ => 1 + random.below(few),
    };
    // Of graphs a number of pairs is asked for, and ours is the method.
    let variant = random.pick(&[Variant::Sliced, Variant::Sliced, Variant::Sliced, Variant::Random]);
    let below = !graph && random.below(6) == 0;
    let value = values[random.below(few)];
    let bound = random.pick(&[value, value.next_up(), value * (1.0 + 1e-9), value * 1.01]);
    Question {
        wanted: if below { Request::Below(bound) } else { Request::Count(count.clamp(1, n)) },
        tolerance: random.pick(&[0.1, 1e-2, 1e-2, 1e-4, 1e-6, 1e-8]),
        variant: if graph { Variant::Sliced } else { variant },
        seed: random.below(1000) as u64,
    }
}

fn tetrahedron() -> TriangleMesh {
    let positions = vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    TriangleMesh { positions, faces: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], ..Default::default() }
}

/// Every face cut in four, so often; onto the unit sphere if it is to be `round`.
fn subdivided(mut mesh: TriangleMesh, levels: usize, round: bool) -> TriangleMesh {
    for _ in 0..levels {
        let mut middles = std::collections::BTreeMap::new();
        let TriangleMesh { positions, faces, .. } = &mut mesh;
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (p, q) = (positions[a as usize], positions[b as usize]);
                let mut point: [f64; 3] = std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
                if round {
                    let length = point.iter().map(|x| x * x).sum::<f64>().sqrt();
                    point = point.map(|x| x / length);
                }
                positions.push(point);
                positions.len() as u32 - 1
            })
        };
        let cut = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        *faces = faces.iter().flat_map(cut).collect();
    }
    mesh
}

/// The surface of a cube, each side of `cells × cells` squares that are cut in two.
fn cube(cells: usize) -> TriangleMesh {
    let mut places = std::collections::BTreeMap::new();
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    let mut at = |place: [usize; 3]| {
        *places.entry(place).or_insert_with(|| {
            positions.push(place.map(|x| x as f64));
            positions.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        for side in [0, cells] {
            for i in 0..cells {
                for j in 0..cells {
                    let mut corner = |di: usize, dj: usize| {
                        let mut place = [0; 3];
                        place[axis] = side;
                        (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (i + di, j + dj);
                        at(place)
                    };
                    let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    if side == 0 {
                        faces.extend([[a, c, b], [a, d, c]]);
                    } else {
                        faces.extend([[a, b, c], [a, c, d]]);
                    }
                }
            }
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}
