//! Cross fields along creases, cut and combed, and seamless parametrisations along them.

use chladni_algebra::{DenseMatrix, solve_definite};
use chladni_base::{SplitMix64, Unwatched, Vector3};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::NO_FACE;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate, noisy};

use chladni_spectral::field::FieldSurface;
use chladni_spectral::field::quad::{
    Combed, CrossField, CrossParameters, Parametrisation, ParametrisationParameters, QuadError, VertexOrder, comb,
    parametrise, write_matching, write_obj, write_raw_field, write_singularities, write_vtk,
};
use chladni_spectral::operator::frames::{Complex64, complex, inner, outer, parts, power};

/// How far both numbers of each are from whole ones, at most.
fn off_whole(numbers: &[Complex64]) -> f64 {
    numbers.iter().flat_map(|&z| parts(z)).map(|x| (x - x.round()).abs()).fold(0.0, f64::max)
}

/// A unit cube, each side of `n × n` squares.
fn cube(n: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh { positions: Vec::new(), faces: Vec::new(), ..Default::default() };
    let mut index = std::collections::HashMap::new();
    for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
        let mut at = |i: usize, j: usize| {
            let mut p = [0usize; 3];
            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side * n, i, j);
            *index.entry(p).or_insert_with(|| {
                mesh.positions.push(p.map(|x| x as f64 / n as f64));
                mesh.positions.len() as u32 - 1
            })
        };
        let mut faces = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let halves = if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
                faces.extend(halves.map(|[a, b, c]| if side == 1 { [a, b, c] } else { [a, c, b] }));
            }
        }
        mesh.faces.extend(faces);
    }
    mesh
}

fn random_crosses(surface: &FieldSurface, seed: u64) -> Vec<f32> {
    let mut random = SplitMix64::new(seed);
    (0..2 * surface.faces()).map(|_| random.signed_unit() as f32).collect()
}

fn parameters(surface: &FieldSurface, integers: bool) -> ParametrisationParameters {
    let spacing = 0.1 * surface.frames().area().sqrt();
    ParametrisationParameters { spacing, integers, creases: Vec::new(), stiffening: 0 }
}

fn coordinates(surface: &FieldSurface, combed: &Combed, parameters: &ParametrisationParameters) -> Parametrisation {
    let order = VertexOrder::new(surface).unwrap();
    parametrise(surface, combed, &order, parameters, &Unwatched).unwrap()
}

/// For each inner edge the corners of its two ends in the lower face and in the upper one.
fn corners(surface: &FieldSurface) -> Vec<(usize, [[usize; 2]; 2])> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let inner = dual.edge_faces().iter().enumerate().filter(|(_, faces)| faces[1] != NO_FACE);
    let both = inner.map(|(edge, &[low, high])| {
        let k = dual.slot(low, edge as u32);
        let ends = [1, 2].map(|i| (k + i) % 3);
        let there = ends.map(|k| {
            let v = mesh.faces[low as usize][k];
            let j = mesh.faces[high as usize].iter().position(|&w| w == v).unwrap();
            3 * high as usize + j
        });
        (edge, [ends.map(|k| 3 * low as usize + k), there])
    });
    both.collect()
}

/// The greatest jump of coordinates across an edge that is not cut, and of their differences along one that is, after
/// its quarter turns; and all translations.
fn seams(surface: &FieldSurface, combed: &Combed, found: &Parametrisation) -> (f64, Vec<Complex64>) {
    let at = |corner: usize| found.coordinates[corner / 3][corner % 3];
    let (mut worst, mut translations) = (0.0f64, Vec::new());
    for (edge, [low, high]) in corners(surface) {
        // z_upper = i^(−jump) z_lower + t
        let turn = power(-Complex64::I, u32::from(combed.jumps[edge]));
        let t = [0, 1].map(|i| at(high[i]) - turn * at(low[i]));
        worst = worst.max((t[0] - t[1]).norm());
        if combed.cut[edge] {
            translations.push(t[0]);
        } else {
            assert_eq!(combed.jumps[edge], 0, "only the cut turns");
            worst = worst.max(t[0].norm());
        }
    }
    (worst, translations)
}

#[test]
fn coordinates_are_seamless_whatever_the_field_and_the_surface() {
    let two = union(&[generate(Shape::Sphere, 100).unwrap(), generate(Shape::Torus, 150).unwrap()]);
    let meshes = [
        noisy(&generate(Shape::Sphere, 162).unwrap(), 0.2, 1).unwrap(),
        noisy(&generate(Shape::Torus, 200).unwrap(), 0.2, 2).unwrap(),
        generate(Shape::Genus(2), 800).unwrap(),
        generate(Shape::Violin, 300).unwrap(),
        generate(Shape::Disk, 200).unwrap(),
        two,
    ];
    for (at, mesh) in meshes.into_iter().enumerate() {
        let surface = FieldSurface::new(mesh).unwrap();
        let smooth = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap().field;
        for (field, random) in [(smooth, false), (random_crosses(&surface, at as u64), true)] {
            let combed = comb(&surface, &field, &[]).unwrap();
            let closed = surface.dual().is_closed();
            let sum: i64 = combed.singularities.iter().map(|s| i64::from(s.numerator)).sum();
            assert!(!closed || sum == 4 * surface.dual().euler_characteristic(), "{at}: {sum}");
            let found = coordinates(&surface, &combed, &parameters(&surface, false));
            let (worst, _) = seams(&surface, &combed, &found);
            assert!(worst < 1e-7, "{at} random {random}: {worst:e}");
            let sorted = combed.singularities.windows(2).all(|s| s[0].vertex < s[1].vertex);
            assert!(sorted && (random || combed.singularities.len() < 40), "{at}: {}", combed.singularities.len());
        }
    }
}

/// The least energy of coordinates of corners that are tied together only by what has to hold across each edge: no
/// seams, no nodes, all corners free.
fn least(surface: &FieldSurface, combed: &Combed, spacing: f64) -> Vec<[Complex64; 3]> {
    let n = 6 * surface.faces();
    let mut matrix = DenseMatrix::zeros(n, n);
    let mut right = DenseMatrix::zeros(n, 1);
    let mut row = |terms: &[(usize, f64)], value: f64, weight: f64| {
        for &(i, x) in terms {
            right.column_mut(0)[i] += weight * x * value;
            terms.iter().for_each(|&(j, y)| matrix.column_mut(j)[i] += weight * x * y);
        }
    };
    let frames = surface.frames();
    for face in 0..surface.faces() {
        let e = frames.edges(face);
        for k in 0..3 {
            let (a, b) = (e[(k + 1) % 3], e[(k + 2) % 3]);
            let weight = -inner(a, b) / (2.0 * frames.areas()[face]);
            let wanted = parts(e[k] * combed.directions[face].conj() / spacing);
            let [p, q] = [1, 2].map(|i| 2 * (3 * face + (k + i) % 3));
            (0..2).for_each(|i| row(&[(q + i, 1.0), (p + i, -1.0)], wanted[i], weight));
        }
    }
    let firm = 1e7;
    for (edge, [low, high]) in corners(surface) {
        let [c, s] = parts(power(-Complex64::I, u32::from(combed.jumps[edge])));
        // Of a complex number turned by (c, s): the real and the imaginary part.
        let both = |corner: usize, sign: f64| {
            let z = 2 * corner;
            [vec![(z, sign * c), (z + 1, -sign * s)], vec![(z, sign * s), (z + 1, sign * c)]]
        };
        for i in 0..2 {
            let plain = |corner: usize, sign: f64| (2 * corner + i, sign);
            if combed.cut[edge] {
                let mut terms = vec![plain(high[0], 1.0), plain(high[1], -1.0)];
                terms.extend(both(low[0], -1.0)[i].iter().chain(&both(low[1], 1.0)[i]));
                row(&terms, 0.0, firm);
            } else {
                (0..2).for_each(|end| row(&[plain(high[end], 1.0), plain(low[end], -1.0)], 0.0, firm));
            }
        }
    }
    (0..n).for_each(|i| matrix.column_mut(i)[i] += 1e-6);
    solve_definite(matrix, &mut right).unwrap();
    let z = |corner: usize| complex([0, 1].map(|i| right.column(0)[2 * corner + i]));
    (0..surface.faces()).map(|face| [0, 1, 2].map(|k| z(3 * face + k))).collect()
}

#[test]
fn coordinates_have_the_least_energy_of_all_that_are_seamless() {
    for (shape, vertices) in [(Shape::Sphere, 42), (Shape::Torus, 60), (Shape::Disk, 50)] {
        let surface = FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.2, 4).unwrap()).unwrap();
        let field = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap().field;
        let combed = comb(&surface, &field, &[]).unwrap();
        let parameters = parameters(&surface, false);
        let found = coordinates(&surface, &combed, &parameters);
        let oracle = least(&surface, &combed, 0.1);
        let mut worst = 0.0f64;
        for (own, other) in found.coordinates.iter().zip(&oracle) {
            // Up to one translation of each component, which differences do not have.
            (1..3).for_each(|k| worst = worst.max(((own[k] - own[0]) - (other[k] - other[0])).norm()));
        }
        assert!(worst < 1e-3, "{shape}: {worst:e}");
    }
}

#[test]
fn a_plate_gets_a_square_grid_along_its_sides() {
    let mesh = noisy(&generate(Shape::Rectangle, 400).unwrap(), 0.0, 1).unwrap();
    let surface = FieldSurface::new(mesh).unwrap();
    let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
    assert!(cross.crease_error[1] < 1e-3 && !cross.creases.is_empty());
    let combed = comb(&surface, &cross.field, &[]).unwrap();
    assert!(combed.singularities.is_empty() && !combed.cut.contains(&true));
    let found = coordinates(&surface, &combed, &parameters(&surface, false));
    assert!(found.inverted.is_empty() && found.deviation < 1e-5, "{}", found.deviation);
}

#[test]
fn grid_lines_of_a_cube_run_along_its_edges_and_meet_across_the_cut() {
    let surface = FieldSurface::new(cube(6)).unwrap();
    let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
    assert_eq!(cross.creases.len(), 12 * 6);
    assert!(cross.crease_error[1] < 1e-3, "{:?}", cross.crease_error);
    let combed = comb(&surface, &cross.field, &[]).unwrap();
    let indices: Vec<i32> = combed.singularities.iter().map(|s| s.numerator).collect();
    assert_eq!(indices, [1; 8], "its corners");
    // Three and a third squares along an edge become three or four.
    let wanted =
        ParametrisationParameters { spacing: 0.3, integers: true, creases: cross.creases.clone(), stiffening: 0 };
    let found = coordinates(&surface, &combed, &wanted);
    let (worst, translations) = seams(&surface, &combed, &found);
    assert!(worst < 1e-6 && found.inverted.is_empty() && found.misfit.unwrap() < 1e-6, "{worst:e} {:?}", found.misfit);
    assert!(off_whole(&translations) < 1e-6);
    for (corners, z) in surface.mesh().faces.iter().zip(&found.coordinates) {
        for (&v, z) in corners.iter().zip(z) {
            let p = surface.mesh().positions[v as usize];
            let sharp = p.iter().filter(|x| **x == 0.0 || **x == 1.0).count();
            let whole = parts(*z).into_iter().filter(|x| (x - x.round()).abs() < 1e-6).count();
            assert!(whole + 1 >= sharp, "{p:?} {z:?}");
        }
    }
    let squares: f64 = found.coordinates.iter().map(|[a, b, c]| 0.5 * outer(b - a, c - a)).sum();
    // Of three and four squares along the axes.
    let boxes = [6 * 9, 2 * (9 + 12 + 12), 2 * (16 + 12 + 12), 6 * 16];
    assert!(boxes.iter().any(|&whole| (squares - f64::from(whole)).abs() < 1e-3), "{squares} squares");
    assert_eq!(found.spacing, 0.3);
}

/// A mesh with each face cut into four at the middles of its sides.
fn halved(mesh: &TriangleMesh) -> TriangleMesh {
    let mut fine = TriangleMesh { positions: mesh.positions.clone(), faces: Vec::new(), ..Default::default() };
    let mut middles = std::collections::HashMap::new();
    for &[a, b, c] in &mesh.faces {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                let (p, q) = (mesh.positions[p as usize], mesh.positions[q as usize]);
                fine.positions.push([0, 1, 2].map(|i| (p[i] + q[i]) / 2.0));
                fine.positions.len() as u32 - 1
            })
        });
        fine.faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine
}

/// Four edges of a cube may be whole together where one is not: then no whole number of squares fits an edge.
#[test]
fn whole_numbers_on_cubes_agree_whatever_the_spacing() {
    let mut box_of_twelve = cube(1);
    for times in 1..=4 {
        box_of_twelve = halved(&box_of_twelve);
        for mesh in [box_of_twelve.clone(), cube(1 << times)].into_iter().filter(|_| times > 1) {
            let surface = FieldSurface::new(mesh).unwrap();
            let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
            let combed = comb(&surface, &cross.field, &[]).unwrap();
            assert_eq!(combed.singularities.len(), 8);
            for spacing in [150f64.sqrt().recip(), 0.08, 0.1, 0.125, 0.13, 0.19, 0.3] {
                let creases = cross.creases.clone();
                let wanted = ParametrisationParameters { spacing, integers: true, creases, stiffening: 0 };
                let found = coordinates(&surface, &combed, &wanted);
                let (worst, translations) = seams(&surface, &combed, &found);
                let context = format!("cut {times} times, {spacing}: {:?} {worst:e}", found.misfit);
                assert!(found.misfit.unwrap() < 1e-8 && worst < 1e-6 && found.inverted.is_empty(), "{context}");
                assert!(off_whole(&translations) < 1e-6, "{context}");
                for (corners, z) in surface.mesh().faces.iter().zip(&found.coordinates) {
                    let singular = |v: u32| combed.singularities.iter().any(|s| s.vertex == v);
                    for z in corners.iter().zip(z).filter(|(v, _)| singular(**v)).map(|(_, z)| z) {
                        assert!(off_whole(&[*z]) < 1e-6, "{context}: {z:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn whole_translations_are_whole_on_surfaces_with_handles() {
    for (shape, vertices) in [(Shape::Torus, 600), (Shape::Genus(2), 1500), (Shape::Sphere, 642)] {
        let surface = FieldSurface::new(generate(shape, vertices).unwrap()).unwrap();
        let field = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap().field;
        let combed = comb(&surface, &field, &[]).unwrap();
        let found = coordinates(&surface, &combed, &parameters(&surface, true));
        let (worst, translations) = seams(&surface, &combed, &found);
        assert!(worst < 1e-6 && found.misfit.unwrap() < 1e-5, "{shape}: {worst:e} {:?}", found.misfit);
        assert!(off_whole(&translations) < 1e-5, "{shape}");
        for s in &combed.singularities {
            let at = surface.mesh().faces.iter().position(|f| f.contains(&s.vertex)).unwrap();
            let k = surface.mesh().faces[at].iter().position(|&v| v == s.vertex).unwrap();
            assert!(off_whole(&[found.coordinates[at][k]]) < 1e-5, "{shape}: {s:?}");
        }
    }
}

#[test]
fn faces_are_turned_back_and_seams_stay_as_they_are() {
    let (mut before, mut after) = (0, 0);
    for (shape, vertices, integers) in [
        (Shape::Torus, 600, false),
        (Shape::Genus(2), 1500, false),
        (Shape::Violin, 500, false),
        (Shape::Genus(2), 1500, true),
    ] {
        let surface = FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.3, 7).unwrap()).unwrap();
        let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
        let combed = comb(&surface, &cross.field, &[]).unwrap();
        let spacing = 0.05 * surface.frames().area().sqrt();
        let wanted = |stiffening| ParametrisationParameters { spacing, integers, creases: Vec::new(), stiffening };
        let (plain, turned) = (coordinates(&surface, &combed, &wanted(0)), coordinates(&surface, &combed, &wanted(4)));
        assert!(turned.inverted.len() <= plain.inverted.len(), "{shape}");
        if !integers {
            // Whole numbers may leave some faces no room.
            (before, after) = (before + plain.inverted.len(), after + turned.inverted.len());
        }
        let (worst, translations) = seams(&surface, &combed, &turned);
        assert!(worst < 1e-6, "{shape}: {worst:e}");
        assert!(!integers || off_whole(&translations) < 1e-5, "{shape}");
    }
    assert!(2 * after <= before && before > 0, "{after} of {before}");
}

/// What [`write_obj`] and Directional's files say, read again by hand.
#[test]
fn files_have_the_corners_the_directions_and_how_they_go_on() {
    let surface = FieldSurface::new(cube(3)).unwrap();
    let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
    let combed = comb(&surface, &cross.field, &[]).unwrap();
    let found = coordinates(&surface, &combed, &parameters(&surface, false));
    let text = |write: &dyn Fn(&mut Vec<u8>) -> std::io::Result<()>| {
        let mut out = Vec::new();
        write(&mut out).unwrap();
        String::from_utf8(out).unwrap()
    };
    let numbers = |line: &str| -> Vec<f64> { line.split_whitespace().filter_map(|x| x.parse().ok()).collect() };
    let obj = text(&|out| write_obj(&surface, &combed, &found, out));
    let rows = |start: &str| obj.lines().filter(|l| l.starts_with(start)).map(numbers).collect::<Vec<_>>();
    let (points, textures) = (rows("v "), rows("vt "));
    assert_eq!(points.len(), surface.mesh().positions.len());
    // A tree that reaches the eight corners: each of its vertices once for each of its edges there, all others once.
    let cut = combed.cut.iter().filter(|cut| **cut).count();
    assert_eq!(textures.len(), points.len() + 2 * cut - (cut + 1));
    for (face, line) in obj.lines().filter(|l| l.starts_with("f ")).enumerate() {
        for (k, corner) in line[2..].split(' ').enumerate() {
            let (v, vt) = corner.split_once('/').unwrap();
            let [v, vt]: [usize; 2] = [v, vt].map(|x| x.parse().unwrap());
            assert_eq!(points[v - 1], surface.mesh().positions[surface.mesh().faces[face][k] as usize]);
            let own = complex([textures[vt - 1][0], textures[vt - 1][1]]) - found.coordinates[face][k];
            assert!(own.norm() < 1e-9);
        }
    }
    let field: Vec<Vec<f64>> = text(&|out| write_raw_field(&surface, &combed, out)).lines().map(numbers).collect();
    assert_eq!((field[0].as_slice(), field.len()), ([4.0, surface.faces() as f64].as_slice(), surface.faces() + 1));
    let (dual, frames) = (surface.dual(), surface.frames());
    let matching = text(&|out| write_matching(&surface, &combed, out));
    assert_eq!(matching.lines().count(), dual.edge_count() + 1);
    for line in matching.lines().skip(1).map(numbers) {
        let [low, high, from, to, turn] = [0, 1, 2, 3, 4].map(|i| line[i] as usize);
        let edge = (0..3).find(|&k| dual.neighbours(low)[k] as usize == high).unwrap();
        let corners = surface.mesh().faces[low];
        assert_eq!([from as u32, to as u32], [corners[(edge + 1) % 3], corners[(edge + 2) % 3]]);
        let carried = frames.carry(dual, low, edge).unwrap();
        for k in 0..4 {
            let of = |face: usize, k: usize| {
                frames.from_world(face, Vector3(std::array::from_fn(|i| field[face + 1][3 * k + i])))
            };
            let there = carried.of(of(high, (k + turn) % 4));
            assert!((there - of(low, k)).norm() < 0.8, "the nearest of four");
        }
    }
    let singular = text(&|out| write_singularities(&combed, out));
    assert!(singular.starts_with("4 8\n") && singular.lines().skip(1).all(|line| line.ends_with(" 1")));
    let vtk = text(&|out| write_vtk(&surface, &combed, &found, out));
    assert!(vtk.contains(&format!("POINTS {} double", textures.len())) && vtk.contains("SCALARS inverted"));
}

#[test]
fn what_does_not_fit_is_named() {
    let surface = FieldSurface::new(cube(2)).unwrap();
    let aligned = |change: &dyn Fn(&mut CrossParameters)| {
        let mut parameters = CrossParameters::default();
        change(&mut parameters);
        CrossField::aligned(&surface, &parameters, &Unwatched).map(|cross| cross.field)
    };
    let named = |error: QuadError| error.to_string();
    assert!(named(aligned(&|p| p.creases = Some(f64::NAN)).unwrap_err()).contains("creases is NaN"));
    assert!(named(aligned(&|p| p.curvature = -1.0).unwrap_err()).contains("curvature is -1"));
    assert_eq!(
        aligned(&|p| p.directions = vec![(48, [1.0, 0.0])]),
        Err(QuadError::Face { at: 0, face: 48, faces: 48 })
    );
    assert_eq!(aligned(&|p| p.directions = vec![(7, [0.0; 2])]), Err(QuadError::NoDirection { face: 7 }));
    let mut field = aligned(&|_| {}).unwrap();
    assert_eq!(comb(&surface, &field[1..], &[]), Err(QuadError::Field { found: 95, wanted: 96 }));
    let combed = comb(&surface, &field, &[]).unwrap();
    field[10..12].fill(0.0);
    assert_eq!(comb(&surface, &field, &[]), Err(QuadError::NoDirection { face: 5 }));
    field[10] = f32::NAN;
    assert_eq!(comb(&surface, &field, &[]), Err(QuadError::NoDirection { face: 5 }));
    let order = VertexOrder::new(&surface).unwrap();
    for (spacing, stiffening, creases, name) in [
        (0.0, 0, vec![], "spacing"),
        (f64::NAN, 0, vec![], "spacing"),
        (0.1, 51, vec![], "stiffening"),
        (0.1, 0, vec![72], "crease"),
    ] {
        let wanted = ParametrisationParameters { spacing, integers: false, creases, stiffening };
        let error = parametrise(&surface, &combed, &order, &wanted, &Unwatched).unwrap_err();
        assert!(matches!(error, QuadError::Parameter { name: found, .. } if found == name), "{error}");
    }
}

/// Rings of `sides` vertices each, at radius and height, between two middles or from a middle to an open rim.
fn turned(sides: usize, rings: &[[f64; 2]], closed: bool) -> TriangleMesh {
    let (first, last) = (rings[0], rings[rings.len() - 1]);
    let mut mesh = TriangleMesh { positions: vec![[0.0, 0.0, first[1]]], faces: Vec::new(), ..Default::default() };
    for [radius, height] in rings {
        mesh.positions.extend((0..sides).map(|i| {
            let (s, c) = (std::f64::consts::TAU * i as f64 / sides as f64).sin_cos();
            [radius * c, radius * s, *height]
        }));
    }
    let at = |ring: usize, i: usize| (1 + ring * sides + i % sides) as u32;
    mesh.faces.extend((0..sides).map(|i| [0, at(0, i + 1), at(0, i)]));
    for ring in 1..rings.len() {
        for i in 0..sides {
            let [a, b, c, d] = [at(ring - 1, i), at(ring - 1, i + 1), at(ring, i + 1), at(ring, i)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    if closed {
        mesh.positions.push([0.0, 0.0, last[1]]);
        let top = mesh.positions.len() as u32 - 1;
        mesh.faces.extend((0..sides).map(|i| [top, at(rings.len() - 1, i), at(rings.len() - 1, i + 1)]));
    }
    mesh
}

/// As programs for construction cut them: fans of triangles around the middles, each halved twice.
fn cylinder(sides: usize) -> TriangleMesh {
    halved(&halved(&turned(sides, &[[0.5, 0.0], [0.5, 1.0]], true)))
}

fn along(count: usize, at: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
    (1..=count).map(|i| at(i as f64 / count as f64)).collect()
}

/// Faces whose corners go the other way round in the plane: counted anew.
fn turned_over(found: &Parametrisation) -> usize {
    found.coordinates.iter().filter(|[a, b, c]| outer(b - a, c - a) <= 0.0).count()
}

#[test]
fn zeros_of_order_four_in_regular_caps_are_split() {
    let disk = turned(32, &along(10, |t| [t, 0.0]), false);
    let polygon = turned(12, &along(8, |t| [t, 0.0]), false);
    let mut cone = turned(32, &[[0.5, 0.0]], true);
    cone.positions[33][2] = 1.0;
    let cone = halved(&halved(&cone));
    let capsule = turned(
        32,
        &along(31, |t| {
            let (s, c) = (std::f64::consts::PI * t * 31.0 / 32.0).sin_cos();
            [0.5 * s, if c > 0.0 { -0.5 * c } else { 1.0 - 0.5 * c }]
        }),
        true,
    );
    let cases = [
        ("cylinder of 16", cylinder(16)),
        ("cylinder of 24", cylinder(24)),
        ("cylinder of 32", cylinder(32)),
        ("cylinder of 64", cylinder(64)),
        ("cone", cone),
        ("capsule", capsule),
        ("disk", disk),
        ("12-gon", polygon),
    ];
    let mut failed = Vec::new();
    for (name, mesh) in cases {
        let surface = FieldSurface::new(mesh).unwrap();
        let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
        let combed = comb(&surface, &cross.field, &[]).unwrap();
        for integers in [false, true] {
            for spacing in [1.0 / 30.0, 0.1] {
                let spacing = spacing * surface.frames().area().sqrt();
                let creases = cross.creases.clone();
                let wanted = ParametrisationParameters { spacing, integers, creases, stiffening: 0 };
                let found = coordinates(&surface, &combed, &wanted);
                let (worst, _) = seams(&surface, &combed, &found);
                let turned = turned_over(&found);
                if integers {
                    let at = |corner: usize| found.coordinates[corner / 3][corner % 3];
                    for (_, [low, _]) in corners(&surface).iter().filter(|(e, _)| cross.creases.contains(&(*e as u32)))
                    {
                        let [p, q] = [0, 1].map(|end| parts(at(low[end])));
                        let on = |i: usize| (p[i] - q[i]).abs() < 1e-5 && (p[i] - p[i].round()).abs() < 1e-5;
                        assert!(on(0) || on(1), "{name}: a crease lies on no line, {p:?} to {q:?}");
                    }
                }
                if 100 * turned >= surface.faces() || worst > 1e-6 {
                    failed.push(format!("{name} {integers} {spacing}: {turned} of {} {worst:e}", surface.faces()));
                }
            }
        }
        assert!(cross.crease_error[1] < 1e-3, "{name}: {:?}", cross.crease_error);
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn where_no_quads_can_meet_the_vertex_is_named_with_what_helps() {
    // A fan whose faces all lie at the rim: nothing is free around its middle.
    let fans = turned(40, &along(10, |t| [1.0, 4.0 * t]), true);
    let surface = FieldSurface::new(fans).unwrap();
    let refused = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap_err();
    assert!(matches!(refused, QuadError::Zero { held: true, .. }), "{refused}");
    let told = refused.to_string();
    assert!(told.contains("a ring of vertices between") && told.contains("creases of a larger angle"), "{told}");
    // Both ways that are named lead on.
    let ring = [[0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [0.5, 2.0]];
    let surface = FieldSurface::new(turned(40, &ring, true)).unwrap();
    assert!(CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).is_ok());
    let surface = FieldSurface::new(turned(40, &along(10, |t| [1.0, 4.0 * t]), true)).unwrap();
    let none = CrossParameters { creases: None, ..CrossParameters::default() };
    assert!(CrossField::aligned(&surface, &none, &Unwatched).is_ok());
}

#[test]
fn no_field_has_a_tip_around_which_no_quads_can_meet() {
    let sphere = generate(Shape::Sphere, 642).unwrap();
    for stretch in [1.0, 10.0, 30.0, 100.0, 300.0, 1000.0] {
        let positions = sphere.positions.iter().map(|p| [p[0], p[1], stretch * p[2]]).collect();
        let mesh = TriangleMesh { positions, faces: sphere.faces.clone(), ..Default::default() };
        let surface = FieldSurface::new(mesh).unwrap();
        match CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched) {
            Ok(cross) => {
                let combed = comb(&surface, &cross.field, &[]).unwrap();
                assert!(combed.singularities.iter().all(|s| s.numerator < 4), "{stretch}: {:?}", combed.singularities);
            }
            Err(QuadError::Zero { index, .. }) => assert!(index >= 1.0 && stretch > 10.0, "{stretch}"),
            Err(other) => panic!("{stretch}: {other}"),
        }
    }
}
