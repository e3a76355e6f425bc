use std::f64::consts::{PI, TAU};

use chladni_base::{SplitMix64, Unwatched};

use super::*;
use crate::fixtures::{grid, sphere, union};

fn distances(mesh: &TriangleMesh, source: u32) -> Vec<f64> {
    ExactGeodesics::new(mesh).from_nearest(&[source], &Unwatched).unwrap()
}

fn straight(mesh: &TriangleMesh, a: usize, b: usize) -> f64 {
    (mesh.points()[a] - mesh.points()[b]).norm()
}

fn at(mesh: &TriangleMesh, place: [f64; 3]) -> u32 {
    let found = mesh.positions.iter().position(|p| (0..3).all(|k| (p[k] - place[k]).abs() < 1e-9));
    found.unwrap_or_else(|| panic!("no vertex at {place:?}")) as u32
}

#[test]
fn on_a_convex_plate_paths_are_straight_however_it_is_cut() {
    let mut random = SplitMix64::new(3);
    for trial in 0..6 {
        let mut mesh = grid(12);
        for p in mesh.positions.iter_mut().filter(|p| p[..2].iter().all(|&x| x > 0.0 && x < 11.0)) {
            (0..2).for_each(|k| p[k] += 0.09 * f64::from(trial) * (random.unit() - 0.5));
        }
        for source in [0, 17, 66, 143] {
            let found = distances(&mesh, source);
            for (v, d) in found.iter().enumerate() {
                let expected = straight(&mesh, source as usize, v);
                assert!((d - expected).abs() < 1e-9, "trial {trial}, {source} to {v}: {d} {expected}");
            }
        }
    }
}

/// A rectangle of `[across, up]` vertices and these sides, turned in space and moved away from the origin.
fn rectangle([across, up]: [usize; 2], sides: [f64; 2], angle: f64, away: [f64; 3]) -> TriangleMesh {
    let (sine, cosine) = angle.sin_cos();
    let mut mesh = TriangleMesh::default();
    for (i, j) in (0..up).flat_map(|j| (0..across).map(move |i| (i, j))) {
        let (x, y) = (sides[0] * i as f64 / (across - 1) as f64, sides[1] * j as f64 / (up - 1) as f64);
        let (u, v) = (cosine * x - sine * y, sine * x + cosine * y);
        mesh.positions.push([u + away[0], 0.8 * v + away[1], 0.6 * v + away[2]]);
    }
    for (i, j) in (0..up - 1).flat_map(|j| (0..across - 1).map(move |i| (i, j))) {
        let a = (j * across + i) as u32;
        let [b, c, d] = [a + 1, a + across as u32 + 1, a + across as u32];
        mesh.faces.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// Rays run through rows of vertices there, and leave the rims of windows to rounding.
#[test]
fn on_a_rectangle_paths_are_straight_to_rounding_however_it_is_stretched_turned_and_moved() {
    for (counts, sides) in
        [([40, 40], [1.0, 0.02]), ([60, 60], [1.0, 0.001]), ([20, 100], [1.0, 0.02]), ([30, 30], [1.0, 1e-5])]
    {
        for (angle, away) in [(0.0, [0.0; 3]), (0.3, [3.0, 4.0, 5.0]), (1.1, [-10.0, 0.1, 2.0])] {
            let mesh = rectangle(counts, sides, angle, away);
            let n = mesh.positions.len();
            for source in [0, 3, n / 2, n / 3] {
                let found = distances(&mesh, source as u32);
                let off = |v: usize| (found[v] - straight(&mesh, source, v)).abs();
                let worst = (0..n).map(off).fold(0.0, f64::max);
                assert!(worst < 1e-12, "{counts:?} {sides:?}, by {angle}, from {source}: {worst:e}");
            }
        }
    }
}

#[test]
fn around_the_inner_corner_of_a_plate_paths_turn() {
    let mut mesh = grid(11);
    mesh.faces
        .retain(|f| !f.iter().all(|&v| mesh.positions[v as usize][0] >= 5.0 && mesh.positions[v as usize][1] >= 5.0));
    let corner = at(&mesh, [5.0, 5.0, 0.0]) as usize;
    for source in [at(&mesh, [9.0, 1.0, 0.0]), at(&mesh, [10.0, 5.0, 0.0]), at(&mesh, [6.0, 4.0, 0.0])] {
        let found = distances(&mesh, source);
        let [sx, sy, _] = mesh.positions[source as usize];
        for v in 0..mesh.positions.len() {
            let [x, y, _] = mesh.positions[v];
            if x > 5.0 && y > 5.0 {
                assert_eq!(found[v], f64::INFINITY, "no face is left there");
                continue;
            }
            // Which side of the corner the straight line passes.
            let hidden = y > 5.0 && sx + (x - sx) * (5.0 - sy) / (y - sy) > 5.0;
            let (source, direct) = (source as usize, straight(&mesh, source as usize, v));
            let turned = straight(&mesh, source, corner) + straight(&mesh, corner, v);
            let expected = if hidden { turned } else { direct };
            assert!((found[v] - expected).abs() < 1e-9, "{source} to {x} {y}: {} {expected}", found[v]);
        }
    }
}

/// The surface of a box, cut into unit squares.
fn room(size: [usize; 3]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut index = std::collections::HashMap::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for level in [0, size[axis]] {
            for (i, j) in (0..size[u]).flat_map(|i| (0..size[v]).map(move |j| (i, j))) {
                let mut corner = |i: usize, j: usize| {
                    let mut p = [0; 3];
                    (p[axis], p[u], p[v]) = (level, i, j);
                    *index.entry(p).or_insert_with(|| {
                        mesh.positions.push(p.map(|x| x as f64));
                        mesh.positions.len() as u32 - 1
                    })
                };
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                mesh.faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh
}

/// Dudeney's spider and fly (1903): 40 feet, over five of the six walls, in a room of 30 × 12 × 12. And the cube.
#[test]
fn over_boxes_paths_are_those_that_are_known() {
    let mesh = room([30, 12, 12]);
    let found = distances(&mesh, at(&mesh, [0.0, 6.0, 11.0]));
    assert!((found[at(&mesh, [30.0, 6.0, 1.0]) as usize] - 40.0).abs() < 1e-9);
    let cube = room([4, 4, 4]);
    let found = distances(&cube, at(&cube, [0.0; 3]));
    assert!((found[at(&cube, [4.0; 3]) as usize] - 4.0 * 5f64.sqrt()).abs() < 1e-9);
    let found = distances(&cube, at(&cube, [2.0, 2.0, 0.0]));
    assert!((found[at(&cube, [2.0, 2.0, 4.0]) as usize] - 8.0).abs() < 1e-9);
    // In the middle of a side wall from the middle of the floor: straight over one edge.
    assert!((found[at(&cube, [0.0, 2.0, 2.0]) as usize] - 4.0).abs() < 1e-9);
}

/// A cone of flat sectors whose angles at the apex sum to `total`, with the polar coordinates of its vertices.
fn cone(sectors: usize, total: f64, rings: usize) -> (TriangleMesh, Vec<[f64; 2]>) {
    let (each, turn) = (total / sectors as f64, TAU / sectors as f64);
    // Generators at equal angles from each other: on a round cone, or up and down by turns where the angles sum to more
    // than 2π.
    let up = if total < TAU { 1.0 } else { -1.0 };
    let square = (up - each.cos()) / (up - turn.cos());
    let (out, height) = (square.sqrt(), (1.0 - square).sqrt());
    let generator = |k: usize| {
        let (sine, cosine) = (turn * k as f64).sin_cos();
        let sign = if total >= TAU && k % 2 == 1 { -1.0 } else { 1.0 };
        [out * cosine, out * sine, sign * height]
    };
    let (mut mesh, mut polar) = (TriangleMesh::default(), vec![[0.0, 0.0]]);
    mesh.positions.push([0.0; 3]);
    let number = |ring: usize, sector: usize, step: usize| match ring {
        0 => 0,
        _ => (1 + sectors * ring * (ring - 1) / 2 + (sector * ring + step) % (sectors * ring)) as u32,
    };
    for ring in 1..=rings {
        for (sector, step) in (0..sectors).flat_map(|sector| (0..ring).map(move |step| (sector, step))) {
            let (a, b) = (generator(sector), generator((sector + 1) % sectors));
            let (s, t) = ((ring - step) as f64, step as f64);
            mesh.positions.push([0, 1, 2].map(|k| s * a[k] + t * b[k]));
            let place = [s + t * each.cos(), t * each.sin()];
            polar.push([place[0].hypot(place[1]), sector as f64 * each + place[1].atan2(place[0])]);
        }
        for (sector, step) in (0..sectors).flat_map(|sector| (0..ring).map(move |step| (sector, step))) {
            let inner = number(ring - 1, sector, step);
            mesh.faces.push([inner, number(ring, sector, step), number(ring, sector, step + 1)]);
            if step + 1 < ring {
                mesh.faces.push([inner, number(ring, sector, step + 1), number(ring - 1, sector, step + 1)]);
            }
        }
    }
    (mesh, polar)
}

#[test]
fn around_the_apex_of_a_cone_paths_are_those_of_the_unrolled_cone() {
    for (sectors, total) in [(5, 2.0), (6, 4.5), (7, 6.0), (8, 7.0), (12, 11.0)] {
        let (mesh, polar) = cone(sectors, total, 6);
        for source in [1, sectors + 2, 4 * sectors + 3] {
            let found = distances(&mesh, source as u32);
            for (v, d) in found.iter().enumerate() {
                let ([r, a], [s, b]) = (polar[source], polar[v]);
                let apart = (a - b).abs();
                let apart = apart.min(total - apart);
                let expected =
                    if apart >= PI { r + s } else { (r * r + s * s - 2.0 * r * s * apart.cos()).max(0.0).sqrt() };
                assert!((d - expected).abs() < 1e-7, "{sectors} {total}: {source} to {v}: {d} {expected}");
            }
        }
    }
}

/// All distances of a small mesh, by unfolding every sequence of faces that some straight path from a vertex crosses,
/// and then by paths over vertices.
fn by_brute_force(mesh: &TriangleMesh) -> Vec<Vec<f64>> {
    let n = mesh.positions.len();
    let mut direct = vec![vec![f64::INFINITY; n]; n];
    for u in 0..n {
        direct[u][u] = 0.0;
        for (f, face) in mesh.faces.iter().enumerate() {
            let Some(i) = face.iter().position(|&v| v as usize == u) else { continue };
            let [l, r] = [face[(i + 2) % 3], face[(i + 1) % 3]].map(|v| v as usize);
            let [a, b, c] = [straight(mesh, u, l), straight(mesh, u, r), straight(mesh, l, r)];
            direct[u][l] = direct[u][l].min(a);
            direct[u][r] = direct[u][r].min(b);
            let x = (a * a + b * b - c * c) / (2.0 * b);
            let (left, right) = ([x, (a * a - x * x).max(0.0).sqrt()], [b, 0.0]);
            unfold(mesh, &mut direct[u], &mut vec![f], [(l, left), (r, right)], [left, right]);
        }
    }
    for k in 0..n {
        for i in 0..n {
            for j in 0..n {
                direct[i][j] = direct[i][j].min(direct[i][k] + direct[k][j]);
            }
        }
    }
    direct
}

/// Goes over an edge, whose ends are unfolded into the plane with the source in its origin, into every face that was
/// not crossed, between two rays.
fn unfold(
    mesh: &TriangleMesh,
    found: &mut [f64],
    crossed: &mut Vec<usize>,
    [(l, left), (r, right)]: [(usize, [f64; 2]); 2],
    rays: [[f64; 2]; 2],
) {
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    for (f, face) in mesh.faces.iter().enumerate() {
        let third = face.iter().map(|&v| v as usize).find(|&v| v != l && v != r);
        let both = face.contains(&(l as u32)) && face.contains(&(r as u32));
        let (true, false, Some(w)) = (both, crossed.contains(&f), third) else { continue };
        let (a, b, c) = (straight(mesh, r, w), straight(mesh, l, w), straight(mesh, l, r));
        let t = (a * a + c * c - b * b) / (2.0 * c);
        let height = (a * a - t * t).max(0.0).sqrt();
        let along = [(left[0] - right[0]) / c, (left[1] - right[1]) / c];
        // To the right of the way from the right end to the left one lies what is beyond the edge.
        let apex = [right[0] + t * along[0] + height * along[1], right[1] + t * along[1] - height * along[0]];
        if cross(apex, rays[0]) >= 0.0 && cross(rays[1], apex) >= 0.0 {
            found[w] = found[w].min(apex[0].hypot(apex[1]));
        }
        crossed.push(f);
        let right_ray = if cross(rays[1], apex) > 0.0 { apex } else { rays[1] };
        if cross(right_ray, rays[0]) > 0.0 {
            unfold(mesh, found, crossed, [(l, left), (w, apex)], [rays[0], right_ray]);
        }
        let left_ray = if cross(apex, rays[0]) > 0.0 { apex } else { rays[0] };
        if cross(rays[1], left_ray) > 0.0 {
            unfold(mesh, found, crossed, [(w, apex), (r, right)], [left_ray, rays[1]]);
        }
        crossed.pop();
    }
}

#[test]
fn on_small_meshes_of_any_shape_all_sequences_of_faces_give_nothing_shorter() {
    for seed in 0..40 {
        let mut random = SplitMix64::new(seed);
        let mut mesh = if seed % 2 == 0 { sphere(2) } else { grid(4) };
        // From fair to wild: spikes, folds, needles; the plates have a boundary.
        let wild = 0.1 + 0.05 * seed as f64;
        for p in &mut mesh.positions {
            *p = std::array::from_fn(|k| p[k] + wild * (random.unit() - 0.5));
        }
        let expected = by_brute_force(&mesh);
        for source in 0..mesh.positions.len() {
            for (v, d) in distances(&mesh, source as u32).iter().enumerate() {
                let expected = expected[source][v];
                assert!((d - expected).abs() < 1e-8 * (1.0 + expected), "seed {seed}, {source} to {v}: {d} {expected}");
            }
        }
    }
}

#[test]
fn on_larger_rough_meshes_distances_are_symmetric_and_between_the_straight_line_and_the_way_along_edges() {
    let mut random = SplitMix64::new(9);
    let mut mesh = sphere(12);
    mesh.positions.iter_mut().for_each(|p| {
        let radius = 1.0 + 0.3 * random.unit();
        *p = p.map(|x| x * radius);
    });
    let all: Vec<Vec<f64>> = (0..40).map(|k| distances(&mesh, 14 * k)).collect();
    for (k, from) in all.iter().enumerate() {
        for (j, other) in all.iter().enumerate() {
            assert!((from[14 * j] - other[14 * k]).abs() < 1e-9, "{k} {j}");
            assert!(from[14 * j] >= straight(&mesh, 14 * k, 14 * j) - 1e-12);
        }
        for face in &mesh.faces {
            for i in 0..3 {
                let [a, b] = [face[i] as usize, face[(i + 1) % 3] as usize];
                assert!((from[a] - from[b]).abs() <= straight(&mesh, a, b) + 1e-12);
            }
        }
    }
}

#[test]
fn on_a_sphere_distances_converge_to_great_circles() {
    let error = |k: usize| {
        let mesh = sphere(k);
        let found = distances(&mesh, 7);
        let expected = |v: usize| 2.0 * (0.5 * straight(&mesh, 7, v)).min(1.0).asin();
        (0..found.len()).map(|v| (found[v] - expected(v)).abs()).fold(0.0, f64::max)
    };
    let [coarse, fine] = [8, 16].map(error);
    assert!(fine < 0.3 * coarse && fine < 0.01, "{coarse} {fine}");
}

#[test]
fn pages_of_a_book_faces_of_mixed_orientation_and_other_components() {
    // Three half planes that meet in the line x = 0, the second turned over; then a plate of its own, and a vertex
    // without faces.
    let page = |angle: f64| {
        let mut page = grid(6);
        page.positions.iter_mut().for_each(|p| *p = [p[0] * angle.cos(), p[1], p[0] * angle.sin()]);
        page
    };
    let mut book = page(0.3);
    for angle in [1.5, 4.0] {
        let other = page(angle);
        let mut numbers = Vec::new();
        for p in &other.positions {
            let spine = book.positions.iter().position(|q| p[0].hypot(p[2]) < 1e-9 && q == p);
            numbers.push(spine.unwrap_or(book.positions.len()) as u32);
            if spine.is_none() {
                book.positions.push(*p);
            }
        }
        let turned = |f: &[u32; 3]| if angle < 2.0 { [f[0], f[2], f[1]] } else { *f };
        book.faces.extend(other.faces.iter().map(|f| turned(f).map(|v| numbers[v as usize])));
    }
    let pages = book.positions.len();
    let mut mesh = union(&[book, grid(3)]);
    mesh.positions.push([1.0; 3]);
    let source = 3;
    let found = distances(&mesh, source);
    let [x, y, z] = mesh.positions[source as usize];
    for v in 0..pages {
        let [p, q, r] = mesh.positions[v];
        let own = v < 36;
        let gap = if own { x.hypot(z) - p.hypot(r) } else { x.hypot(z) + p.hypot(r) };
        assert!((found[v] - gap.hypot(y - q)).abs() < 1e-9, "{v}");
    }
    assert!(found[pages..].iter().all(|d| *d == f64::INFINITY));
    let both = ExactGeodesics::new(&mesh).from_nearest(&[3, pages as u32, 9999], &Unwatched).unwrap();
    assert!(both[..pages] == found[..pages] && (both[pages + 8] - 8f64.sqrt()).abs() < 1e-12);
    assert_eq!(both[pages + 9], f64::INFINITY);
}

#[test]
fn faces_without_area_equal_positions_and_units_do_no_harm() {
    let mut mesh = grid(9);
    mesh.positions[40] = mesh.positions[41];
    mesh.positions[20] = [2.0, 2.0 + 1e-13, 0.0];
    mesh.positions[60] = [6.5, 6.5, 0.0];
    for source in [0, 20, 40, 60] {
        for (v, d) in distances(&mesh, source).iter().enumerate() {
            let least = straight(&mesh, source as usize, v);
            assert!(*d >= least - 1e-9 && *d < 1.5 * least + 1e-9, "{source} {v}: {d} {least}");
        }
    }
    let rough = cone(8, 7.0, 4).0;
    let expected = distances(&rough, 9);
    for scale in [1e-30, 1e-6, 1e12, 1e60] {
        let positions = rough.positions.iter().map(|p| p.map(|x| x * scale)).collect();
        let found = distances(&TriangleMesh { positions, faces: rough.faces.clone(), ..Default::default() }, 9);
        assert!(found.iter().zip(&expected).all(|(a, b)| (a / scale - b).abs() < 1e-9), "{scale}");
    }
}

/// `CHLADNI_CASE` names a mesh, bunny.obj where it is not set.
#[test]
#[ignore = "measures; run it alone: cargo test --release -p chladni-mesh --lib -- --ignored --nocapture seconds_of_exact"]
fn seconds_of_exact_distances() {
    use crate::read::{MeshFormat, ReadLimits, read};
    let Some(folder) = std::env::var_os("CHLADNI_MESHES").map(std::path::PathBuf::from) else { return };
    let name = std::env::var("CHLADNI_CASE").unwrap_or_else(|_| "bunny.obj".to_owned());
    let path = folder.join(&name);
    let format = MeshFormat::from_extension(path.extension().unwrap().to_str().unwrap()).unwrap();
    let raw = read(&std::fs::read(path).unwrap(), format, &ReadLimits::default()).unwrap();
    let mesh = crate::check::check(raw, &Default::default()).unwrap().mesh;
    let begin = std::time::Instant::now();
    let prepared = ExactGeodesics::new(&mesh);
    let ready = begin.elapsed().as_secs_f64();
    for source in [0, mesh.positions.len() as u32 / 2] {
        let begin = std::time::Instant::now();
        let found = prepared.from_nearest(&[source], &Unwatched).unwrap();
        let (sum, most) = (found.iter().sum::<f64>(), found.iter().fold(0.0, |most: f64, x| most.max(*x)));
        println!(
            "{name} from {source}: prepared in {ready:.3} s, {:.3} s, sum {sum:.15e}, most {most:.15e}",
            begin.elapsed().as_secs_f64()
        );
    }
}
