use super::first;
use super::*;
use crate::analysis::fixtures::{chain, solved};
use crate::analysis::neighbours::COMPARED;
use crate::operator::{OperatorParameters, assemble};
use chladni_base::Unwatched;
use chladni_mesh::fixtures::{grid, sphere};

/// A shape with a head, two arms and two legs, alike under x → −x and under nothing else.
fn figure() -> TriangleMesh {
    let mut mesh = sphere(14);
    let ends = [([0.0, 0.3, 1.0], 0.7, 5.0), ([0.9, 0.2, 0.3], 0.8, 6.0), ([0.6, -0.3, -0.8], 1.1, 6.0)];
    for p in &mut mesh.positions {
        let mut radius = 1.0;
        for (end, height, narrow) in ends {
            for side in [1.0, -1.0] {
                let end: [f64; 3] = [side * end[0], end[1], end[2]];
                let square: f64 = p.iter().zip(end).map(|(a, b)| (a - b).powi(2)).sum();
                radius += height * (-narrow * square).exp() / if end[0] == 0.0 { 2.0 } else { 1.0 };
            }
        }
        *p = p.map(|x| radius * x);
    }
    mesh
}

/// The vertices in another order, and where each of them went.
fn shuffled(mesh: &TriangleMesh, seed: usize) -> (TriangleMesh, Vec<u32>) {
    let n = mesh.positions.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|&vertex| (vertex * 7919 + seed * 104_729) % 1_000_003 % 4099);
    let mut place = vec![0; n];
    order.iter().enumerate().for_each(|(at, &vertex)| place[vertex] = at as u32);
    let positions = order.iter().map(|&vertex| mesh.positions[vertex]).collect();
    let faces = mesh.faces.iter().map(|face| face.map(|vertex| place[vertex as usize])).collect();
    (TriangleMesh { positions, faces, ..Default::default() }, place)
}

fn basis(mesh: &TriangleMesh, count: usize) -> Basis {
    let operator = assemble(mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    solved(&operator, mesh.positions.len(), count, 1e-6)
}

fn request() -> CollectionRequest {
    CollectionRequest { start: 20, pairs: 50, step: 5, samples: 800, oriented: true, polish: true }
}

fn collection(meshes: &[TriangleMesh], request: &CollectionRequest) -> MapCollection {
    let bases: Vec<Basis> = meshes.iter().map(|mesh| basis(mesh, 60)).collect();
    let shapes: Vec<CollectionShape<'_>> =
        bases.iter().zip(meshes).map(|(basis, mesh)| CollectionShape { basis, mesh }).collect();
    map_collection(&shapes, request, &Unwatched).unwrap()
}

/// How far vertices of the target are matched from where they belong on the source, in the mean.
fn error(map: &CollectionMap, source: &TriangleMesh, belongs: impl Fn(usize) -> usize) -> f64 {
    let points = &map.to_source.points;
    let gap = |(vertex, &point): (usize, &u32)| {
        let [a, b] = [belongs(vertex), point as usize].map(|vertex| source.positions[vertex]);
        (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
    };
    points.iter().enumerate().map(gap).sum::<f64>() / points.len() as f64
}

#[test]
fn a_symmetric_shape_is_mapped_with_its_sides_whatever_the_order_of_its_vertices_and_its_size() {
    let first = figure();
    let (mut second, place) = shuffled(&first, 1);
    second.positions.iter_mut().for_each(|p| *p = [10.0 * p[1], 10.0 * p[2], 10.0 * p[0]]);
    let (third, other) = shuffled(&first, 2);
    let found = collection(&[first.clone(), second, third], &request());
    assert_eq!(found.maps.len(), 6);
    let back = |place: &[u32]| {
        let mut back = vec![0; place.len()];
        place.iter().enumerate().for_each(|(vertex, &at)| back[at as usize] = vertex);
        back
    };
    for (target, back) in [(1, back(&place)), (2, back(&other))] {
        let map = found.map(0, target).unwrap();
        assert_eq!((map.matrix.rows(), map.to_source.points.len()), (50, first.positions.len()));
        assert!(error(map, &first, |vertex| back[vertex]) < 0.02, "{}", error(map, &first, |vertex| back[vertex]));
        assert!(map.disagreement < 0.1 && map.to_source.matched.is_none());
        let defect = map.matrix.transposed_times(&map.matrix);
        assert!((0..30).all(|i| (defect.column(i)[i] - 1.0).abs() < 0.3));
    }
    let there = found.map(1, 0).unwrap();
    let exact = there.to_source.points.iter().zip(&place).filter(|(a, b)| a == b).count();
    assert!(exact as f64 > 0.95 * place.len() as f64, "{exact}");
    let bare = CollectionRequest { polish: false, ..request() };
    let latent = collection(&[first.clone(), shuffled(&first, 1).0], &bare);
    let map = latent.map(0, 1).unwrap();
    assert!(error(map, &first, |vertex| back(&place)[vertex]) < 0.02);
    assert!(found.cycles.pairs < 0.01 && found.cycles.triples.unwrap() < 0.01, "{:?}", found.cycles);
}

/// Seen in a mirror, with faces that are counter-clockwise again, the figure is the same: its right hand is where the
/// left one was.
#[test]
fn orientation_tells_left_from_right() {
    let figure = figure();
    let mirrored = |turn: bool| TriangleMesh {
        positions: figure.positions.iter().map(|p| [-p[0], p[1], p[2]]).collect(),
        faces: figure.faces.iter().map(|&[a, b, c]| if turn { [a, c, b] } else { [a, b, c] }).collect(),
        ..Default::default()
    };
    let opposite = |vertex: usize| {
        let p = figure.positions[vertex];
        let square = |q: &[f64; 3]| (q[0] + p[0]).powi(2) + (q[1] - p[1]).powi(2) + (q[2] - p[2]).powi(2);
        (0..figure.positions.len())
            .min_by(|&a, &b| square(&figure.positions[a]).total_cmp(&square(&figure.positions[b])))
            .unwrap()
    };
    // A mirrored surface whose faces were not turned has the orientation of the first, vertex by vertex.
    for (turn, belongs) in [(true, &opposite as &dyn Fn(usize) -> usize), (false, &|vertex| vertex)] {
        let found = collection(&[figure.clone(), mirrored(turn)], &request());
        let off = error(found.map(0, 1).unwrap(), &figure, belongs);
        assert!(off < 0.02, "turned {turn}: {off}");
        assert_eq!(found.cycles.triples, None);
    }
}

/// The system against its energy, summed term by term.
#[test]
fn the_system_of_a_first_map_is_the_energy_that_it_minimises() {
    let k = 4;
    let value = |seed: usize| ((seed * seed + 3 * seed) as f64 * 0.731).sin();
    let matrix = |seed: usize| DenseMatrix::from_columns(k, k, (0..k * k).map(|i| value(i + 100 * seed)).collect());
    let (xs, ys) = ([matrix(1), matrix(2)], [matrix(3), matrix(4)]);
    let mut system = DenseMatrix::zeros(k * k, k * k);
    first::commuting(&mut system, &xs, &ys, 1.0).unwrap();
    let energy = |c: &DenseMatrix| {
        let mut sum = 0.0;
        for (x, y) in xs.iter().zip(&ys) {
            let (cx, yc) = (c.times(x), y.times(c));
            sum += cx.values().iter().zip(yc.values()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        }
        sum
    };
    let quadratic = |c: &DenseMatrix| {
        let v = c.values();
        (0..k * k).map(|j| v[j] * (0..k * k).map(|i| v[i] * system.column(j)[i]).sum::<f64>()).sum::<f64>()
    };
    let (c, d) = (matrix(5), matrix(6));
    let factor = quadratic(&c) / energy(&c);
    assert!((quadratic(&d) / energy(&d) - factor).abs() < 1e-12 * factor);
    // Over all entries of the map the mean is 1.
    let mean = (0..k * k).map(|i| system.column(i)[i]).sum::<f64>() / (k * k) as f64;
    assert!((mean - 1.0).abs() < 1e-12, "{mean}");
    assert!((0..k * k).all(|i| (0..k * k).all(|j| (system.column(i)[j] - system.column(j)[i]).abs() < 1e-12)));
}

/// Rotations that agree, but for one that is another rotation.
#[test]
fn one_map_that_disagrees_is_told_and_overruled() {
    let (n, k) = (5, 6);
    let rotation = |seed: usize| {
        let mut matrix = DenseMatrix::zeros(k, k);
        (0..k).for_each(|i| matrix.column_mut(i)[i] = 1.0);
        for step in 0..k - 1 {
            let angle = (seed * 17 + step * 5) as f64;
            let (cos, sin) = (angle.cos(), angle.sin());
            for column in 0..k {
                let values = matrix.column_mut(column);
                (values[step], values[step + 1]) =
                    (cos * values[step] - sin * values[step + 1], sin * values[step] + cos * values[step + 1]);
            }
        }
        matrix
    };
    let frames: Vec<DenseMatrix> = (0..n).map(|shape| rotation(shape + 1)).collect();
    let truth =
        |a: usize, b: usize| frames[b].times(&crate::analysis::functional_map::matching::transposed(&frames[a]));
    let mut maps: Maps = Vec::new();
    for a in 0..n {
        for b in (0..n).filter(|&b| b != a) {
            maps.push(((a, b), if (a, b) == (0, 3) { rotation(77) } else { truth(a, b) }));
        }
    }
    let latent = Latent::new(n, k, &maps, None, &Unwatched).unwrap();
    for a in 0..n {
        for b in (0..n).filter(|&b| b != a) {
            let odd = (a, b) == (0, 3);
            assert_eq!(latent.disagreement(a, b) > 0.3, odd, "{a} {b}: {}", latent.disagreement(a, b));
            // In what the latent space holds, five of six dimensions, maps are the true ones.
            let inside = |shape: usize| latent.embedding(shape).unwrap();
            let image = truth(a, b).times(&inside(a));
            let worst = image.values().iter().zip(inside(b).values()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(worst < 0.05, "{a} {b}: {worst}");
        }
    }
}

#[test]
fn what_does_not_fit_is_named() {
    let mesh = grid(10);
    let basis = basis(&mesh, 30);
    let other = chain(90, 30);
    let points = TriangleMesh { positions: mesh.positions.clone(), faces: Vec::new(), ..Default::default() };
    let shape = CollectionShape { basis: &basis, mesh: &mesh };
    let said = |shapes: &[CollectionShape<'_>], request: CollectionRequest| {
        map_collection(shapes, &request, &Unwatched).unwrap_err().to_string()
    };
    let small = CollectionRequest { start: 10, pairs: 20, samples: 100, ..request() };
    assert!(said(&[shape], small.clone()).ends_with("shapes must be between 2 and 32, got 1"));
    assert!(
        said(&[shape; 2], CollectionRequest { pairs: 31, ..small.clone() })
            .ends_with("pairs must be between 5 and 30, got 31")
    );
    assert!(
        said(&[shape; 2], CollectionRequest { start: 21, ..small.clone() })
            .starts_with("start must be between 5 and 20, got 21")
    );
    assert!(
        said(&[shape; 2], CollectionRequest { step: 0, ..small.clone() }).starts_with("step must be between 1 and ")
    );
    assert!(said(&[shape; 2], CollectionRequest { samples: 3, ..small.clone() }).ends_with(", got 3"));
    let wrong = CollectionShape { basis: &other, mesh: &mesh };
    assert_eq!(said(&[shape, wrong], small.clone()), "the basis has 90 vertices and the mesh 100");
    let bare = CollectionShape { basis: &basis, mesh: &points };
    assert!(map_collection(&[shape, bare], &small, &Unwatched).is_err());
    let blind = CollectionRequest { oriented: false, ..small };
    assert!(map_collection(&[shape, bare], &blind, &Unwatched).is_ok());
}

#[test]
fn what_a_collection_costs_is_what_is_counted() {
    let meshes = [figure(), shuffled(&figure(), 3).0, figure()];
    let bases: Vec<Basis> = meshes.iter().map(|mesh| basis(mesh, 40)).collect();
    let shapes: Vec<CollectionShape<'_>> =
        bases.iter().zip(&meshes).map(|(basis, mesh)| CollectionShape { basis, mesh }).collect();
    let size = |shape: &CollectionShape<'_>| ShapeSize {
        vertices: shape.basis.vertices(),
        faces: shape.mesh.faces.len(),
        pairs: shape.basis.count(),
    };
    let sizes: Vec<ShapeSize> = shapes.iter().map(size).collect();
    for (start, pairs, step, samples, polish) in [(8, 40, 7, 100, true), (10, 30, 5, 80, false), (9, 9, 3, 80, true)] {
        let request = CollectionRequest { start, pairs, step, samples, oriented: true, polish };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let compared = pool.install(|| {
            let before = COMPARED.get();
            map_collection(&shapes, &request, &Unwatched).unwrap();
            COMPARED.get() - before
        });
        let cost = CollectionCost::new(&sizes, &request);
        assert_eq!(cost.compared, compared as f64, "{request:?}");
        assert!(cost.multiplied > 0.0 && cost.first > 0.0 && cost.cubes > 0.0, "{cost:?}");
    }
}
