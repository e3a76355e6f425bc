use chladni_base::Unwatched;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use std::sync::Arc;

use crate::field::quad::{comb, crosses_of};
use crate::field::{
    Constraint, DesignModel, EnergyWeights, FieldParameters, Hold, field_basis, matched_singularities,
    matching_of_power,
};

fn surface(shape: Shape, vertices: usize) -> FieldSurface {
    FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.1, 3).unwrap()).unwrap()
}

/// What a field of single numbers is singular at, as it was prescribed.
fn found(surface: &FieldSurface, field: &PrescribedField) -> Vec<Prescribed> {
    let single: Vec<f32> = field.target(Complex64::new(0.6, 0.8)).iter().map(|&x| x as f32).collect();
    let matching = field.matching(surface, &single);
    let found = matched_singularities(surface, field.kind(), &single, &matching).unwrap();
    found.iter().map(|s| Prescribed { vertex: s.vertex, numerator: s.numerator }).collect()
}

fn check(surface: &FieldSurface, kind: FieldKind, mut prescribed: Vec<Prescribed>) {
    let field = PrescribedField::new(surface, kind, &prescribed, &Unwatched).unwrap();
    prescribed.sort_by_key(|p| p.vertex);
    assert_eq!(found(surface, &field), prescribed, "{kind:?}");
}

fn at(vertex: u32, numerator: i32) -> Prescribed {
    Prescribed { vertex, numerator }
}

#[test]
fn a_field_is_singular_where_it_was_prescribed_and_nowhere_else() {
    let sphere = surface(Shape::Sphere, 642);
    check(&sphere, FieldKind::Vector {}, vec![at(3, 1), at(500, 1)]);
    check(&sphere, FieldKind::Vector {}, vec![at(3, 1), at(500, 1), at(77, 1), at(200, -1)]);
    check(&sphere, FieldKind::NVector { n: 4 }, (0..8).map(|i| at(80 * i, 1)).collect());
    check(&sphere, FieldKind::NVector { n: 2 }, vec![at(100, 2), at(400, 1), at(401, 1)]);
    check(&sphere, FieldKind::Tensor {}, (0..4).map(|i| at(150 * i, 1)).collect());
    let torus = surface(Shape::Torus, 600);
    check(&torus, FieldKind::NVector { n: 4 }, vec![at(10, 1), at(300, -1)]);
    check(&torus, FieldKind::Vector {}, vec![]);
    let double = surface(Shape::Genus(2), 1200);
    check(&double, FieldKind::Vector {}, vec![at(10, -1), at(700, -1)]);
    check(&double, FieldKind::NVector { n: 6 }, (0..12).map(|i| at(90 * i + 5, -1)).collect());
}

#[test]
fn boundaries_take_what_is_missing_and_components_are_counted_one_by_one() {
    let disk = surface(Shape::Disk, 400);
    let inside = (0..).find(|&v| disk.dual().fan(disk.mesh(), v, &mut Vec::new())).unwrap();
    check(&disk, FieldKind::Vector {}, vec![at(inside, -1)]);
    check(&disk, FieldKind::Vector {}, vec![]);
    let mut annulus = generate(Shape::Torus, 600).unwrap();
    let positions = annulus.positions.clone();
    annulus.faces.retain(|f| !f.iter().all(|&v| positions[v as usize][0] > 1.0));
    let annulus = FieldSurface::new(annulus).unwrap();
    let inside = (0..).filter(|&v| annulus.dual().fan(annulus.mesh(), v, &mut Vec::new())).nth(40).unwrap();
    check(&annulus, FieldKind::NVector { n: 2 }, vec![at(inside, 1)]);
    let both = union(&[generate(Shape::Sphere, 162).unwrap(), generate(Shape::Torus, 200).unwrap()]);
    let both = FieldSurface::new(both).unwrap();
    check(&both, FieldKind::Vector {}, vec![at(2, 1), at(100, 1), at(170, 1), at(250, -1)]);
    let error = PrescribedField::new(&both, FieldKind::Vector {}, &[at(2, 1), at(170, 1)], &Unwatched).unwrap_err();
    assert_eq!(error, PrescribedError::Sum { face: 0, sum: 1, order: 1, characteristic: 2 });
}

#[test]
fn what_cannot_be_is_named() {
    let sphere = surface(Shape::Sphere, 162);
    let refuse = |n, prescribed: &[Prescribed]| {
        PrescribedField::new(&sphere, FieldKind::NVector { n }, prescribed, &Unwatched).unwrap_err()
    };
    let error = refuse(4, &[at(1, 4), at(7, 3)]);
    assert_eq!(error, PrescribedError::Sum { face: 0, sum: 7, order: 4, characteristic: 2 });
    assert!(error.to_string().contains("add up to 7/4, but its Euler characteristic is 2"), "{error}");
    assert_eq!(refuse(1, &[at(1, 1), at(162, 1)]), PrescribedError::Vertex { at: 1, vertex: 162, vertices: 162 });
    assert_eq!(refuse(1, &[at(1, 1), at(1, 1)]), PrescribedError::Twice { vertex: 1 });
    assert_eq!(refuse(1, &[at(1, 2), at(2, 0)]), PrescribedError::Zero { at: 1, vertex: 2 });
    let disk = surface(Shape::Disk, 100);
    let rim = (0..).find(|&v| !disk.dual().fan(disk.mesh(), v, &mut Vec::new())).unwrap();
    let error = PrescribedField::new(&disk, FieldKind::Vector {}, &[at(rim, 1)], &Unwatched).unwrap_err();
    assert_eq!(error, PrescribedError::Boundary { at: 0, vertex: rim });
}

/// The index of a vertex from what a field does when it is carried around it, by a way of its own: the turn of each
/// step, with its full turns, and the angles of the corners of the mesh in space.
fn index_around(
    surface: &FieldSurface,
    kind: FieldKind,
    field: &[f32],
    matching: &[Matching],
    vertex: u32,
) -> Option<f64> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    let mut corners = Vec::new();
    if !dual.fan(mesh, vertex, &mut corners) {
        return None;
    }
    let angle = |face: usize| match kind {
        FieldKind::Tensor {} => {
            let [a, b, c] = [0, 1, 2].map(|i| f64::from(field[3 * face + i]));
            (2f64.sqrt() * c).atan2(a - b)
        }
        _ => f64::from(field[2 * face + 1]).atan2(f64::from(field[2 * face])),
    };
    let mut turned = 0.0;
    let mut defect = TAU;
    for (at, &corner) in corners.iter().enumerate() {
        let (face, k) = (corner as usize / 3, corner as usize % 3);
        let next = corners[(at + 1) % corners.len()] as usize / 3;
        let [p, q, r] = std::array::from_fn(|i| mesh.point(mesh.faces[face][(k + i) % 3]));
        let (a, b) = (q - p, r - p);
        defect -= (a.dot(b) / (a.norm_squared() * b.norm_squared()).sqrt()).clamp(-1.0, 1.0).acos();
        let slot = (0..3).find(|&s| dual.neighbours(face)[s] as usize == next && s == (k + 1) % 3)?;
        let carried = turn(kind, dual, frames, face, slot)?;
        let step = angle(next) + carried.by.arg() - angle(face);
        let step = step - TAU * (step / TAU).round();
        let edge = dual.edges(face)[slot];
        let sign = if dual.edge_faces()[edge as usize][0] as usize == face { 1.0 } else { -1.0 };
        let more: i32 = matching.iter().filter(|m| m.edge == edge).map(|m| m.turns).sum();
        turned += step + sign * TAU * f64::from(more);
    }
    Some((turned / f64::from(kind.order()) + defect) / TAU)
}

#[test]
fn exact_fields_have_the_prescribed_singularities_and_no_others_on_any_mesh() {
    // Coarse and noisy meshes, on which the turns of some edges are beyond 180°.
    let double = |genus, vertices, seed| {
        FieldSurface::new(noisy(&generate(genus, vertices).unwrap(), 0.3, seed).unwrap()).unwrap()
    };
    let shapes = [
        double(Shape::Sphere, 162, 1),
        double(Shape::Torus, 300, 2),
        double(Shape::Genus(2), 900, 3),
        double(Shape::Genus(4), 1700, 4),
    ];
    let mut beyond = 0;
    for (which, surface) in shapes.iter().enumerate() {
        let characteristic = surface.dual().euler_characteristic() as i32;
        for n in [1, 2, 4, 6] {
            let kind = FieldKind::NVector { n };
            let vertices = surface.mesh().positions.len() as u32;
            let count = (n as i32 * characteristic).unsigned_abs();
            let mut prescribed: Vec<Prescribed> = (0..count)
                .map(|i| at((i * vertices / count.max(1) + 3 * n) % vertices, characteristic.signum()))
                .collect();
            // And one pair that is sharp: as many turns as the order.
            prescribed.extend([at(vertices / 3 + 1, n as i32), at(vertices / 2 + 2, -(n as i32))]);
            prescribed.sort_by_key(|p| p.vertex);
            prescribed.dedup_by_key(|p| p.vertex);
            let missing = n as i32 * characteristic - prescribed.iter().map(|p| p.numerator).sum::<i32>();
            if missing != 0 {
                let free = (0..vertices).find(|v| prescribed.iter().all(|p| p.vertex != *v)).unwrap();
                prescribed.push(at(free, missing));
                prescribed.sort_by_key(|p| p.vertex);
            }
            check(surface, kind, prescribed.clone());
            let field = PrescribedField::new(surface, kind, &prescribed, &Unwatched).unwrap();
            let single: Vec<f32> = field.target(Complex64::new(0.6, -0.8)).iter().map(|&x| x as f32).collect();
            let matching = field.matching(surface, &single);
            beyond += matching.len();
            for vertex in 0..vertices {
                let wanted = prescribed.iter().find(|p| p.vertex == vertex).map_or(0, |p| p.numerator);
                let index = index_around(surface, kind, &single, &matching, vertex).unwrap();
                assert!((index - f64::from(wanted) / f64::from(n)).abs() < 1e-4, "{which}, n = {n}, {vertex}: {index}");
            }
        }
    }
    assert!(beyond > 0, "no shape needed a matching");
}

#[test]
fn each_component_is_turned_to_fit_its_own_strokes() {
    let both = union(&[generate(Shape::Torus, 300).unwrap(), generate(Shape::Torus, 200).unwrap()]);
    let surface = FieldSurface::new(both).unwrap();
    let kind = FieldKind::NVector { n: 4 };
    let basis = field_basis(&surface, &FieldParameters::new(kind, 80), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let field = PrescribedField::new(&surface, kind, &[], &Unwatched).unwrap();
    let prescription = model.prescription(&basis, &surface, field).unwrap();
    let last = surface.faces() as u32 - 5;
    let one = |face, angle: f64| Constraint { face, value: [angle.cos(), angle.sin(), 0.0], hold: Hold::Strength(1.0) };
    let (field, matching) = prescription.exact(&surface, &[one(4, 0.3), one(last, -2.0)], &[]);
    assert!(matching.is_empty());
    for (face, angle) in [(4, 0.3f32), (last as usize, -2.0)] {
        assert!((field[2 * face] - angle.cos()).abs() < 1e-5 && (field[2 * face + 1] - angle.sin()).abs() < 1e-5);
    }
}

/// Circles of edges that generate the first homology of a closed surface, each as how often it runs along an edge in
/// the direction of its lower face: what is left over by a tree of faces and one of vertices, in trees of its own.
fn circles(surface: &FieldSurface) -> Vec<Vec<f64>> {
    let (dual, edges) = (surface.dual(), surface.dual().edge_count());
    let mut reached = vec![false; surface.faces()];
    let mut crossed = vec![false; edges];
    let mut stack = vec![0usize];
    reached[0] = true;
    while let Some(face) = stack.pop() {
        for (k, other) in dual.neighbours(face).into_iter().enumerate() {
            if !reached[other as usize] {
                reached[other as usize] = true;
                crossed[dual.edges(face)[k] as usize] = true;
                stack.push(other as usize);
            }
        }
    }
    // The way from each vertex to the first, in edges with their signs.
    let vertices = surface.mesh().positions.len();
    let mut ways: Vec<Option<Vec<(usize, f64)>>> = vec![None; vertices];
    ways[surface.mesh().faces[0][0] as usize] = Some(Vec::new());
    let mut used = vec![false; edges];
    loop {
        let mut grown = false;
        for edge in (0..edges).filter(|&e| !crossed[e]) {
            let [a, b] = ends(surface, edge).map(|v| v as usize);
            let (from, to, sign) = match (&ways[a], &ways[b]) {
                (Some(_), None) => (a, b, -1.0),
                (None, Some(_)) => (b, a, 1.0),
                _ => continue,
            };
            let mut way = ways[from].clone().unwrap();
            way.push((edge, sign));
            ways[to] = Some(way);
            (used[edge], grown) = (true, true);
        }
        if !grown {
            break;
        }
    }
    let left = (0..edges).filter(|&e| !crossed[e] && !used[e]);
    let circle = |edge: usize| {
        let [a, b] = ends(surface, edge).map(|v| v as usize);
        let mut circle = vec![0.0; edges];
        circle[edge] += 1.0;
        ways[b].iter().flatten().for_each(|&(e, sign)| circle[e] += sign);
        ways[a].iter().flatten().for_each(|&(e, sign)| circle[e] -= sign);
        circle
    };
    left.map(circle).collect()
}

/// The least energy of turns that differ from given ones by whole turns along loops, up to `reach` around each circle:
/// by a dense system on the faces, and by trial of all whole numbers.
fn least_energy(surface: &FieldSurface, kind: FieldKind, turns: &[f64], reach: i32) -> (f64, f64) {
    let dual = surface.dual();
    let weights: Vec<f64> = Connection::new(surface, kind).conductance.iter().map(|c| 1.0 / c).collect();
    let faces = surface.faces();
    let mut laplacian = DenseMatrix::zeros(faces, faces);
    laplacian.column_mut(0)[0] = 1.0;
    for (&[a, b], w) in dual.edge_faces().iter().zip(&weights) {
        for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            laplacian.column_mut(column as usize)[row as usize] += sign * w;
        }
    }
    let circles = circles(surface);
    let mut parts: Vec<Vec<f64>> = circles.into_iter().map(|c| c.iter().map(|x| TAU * x).collect()).collect();
    parts.push(turns.to_vec());
    let mut potentials = DenseMatrix::zeros(faces, parts.len());
    for (k, part) in parts.iter().enumerate() {
        for ((&[a, b], w), x) in dual.edge_faces().iter().zip(&weights).zip(part) {
            potentials.column_mut(k)[b as usize] += w * x;
            potentials.column_mut(k)[a as usize] -= w * x;
        }
    }
    solve_definite(laplacian, &mut potentials).unwrap();
    for (k, part) in parts.iter_mut().enumerate() {
        let p = potentials.column(k);
        part.iter_mut().zip(dual.edge_faces()).for_each(|(x, &[a, b])| *x -= p[b as usize] - p[a as usize]);
    }
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).zip(&weights).map(|((a, b), w)| w * a * b).sum::<f64>();
    let gram: Vec<Vec<f64>> = parts.iter().map(|a| parts.iter().map(|b| product(a, b)).collect()).collect();
    let loops = parts.len() - 1;
    let width = (2 * reach + 1) as usize;
    let least = (0..width.pow(loops as u32))
        .map(|code| {
            let number = |k: usize| match k == loops {
                true => 1.0,
                false => f64::from((code / width.pow(k as u32) % width) as i32 - reach),
            };
            let sum = |a: usize| (0..=loops).map(|b| gram[a][b] * number(b)).sum::<f64>();
            (0..=loops).map(|a| number(a) * sum(a)).sum::<f64>()
        })
        .fold(f64::INFINITY, f64::min);
    (product(turns, turns), least)
}

#[test]
fn no_other_turns_around_handles_have_less_energy() {
    let torus = surface(Shape::Torus, 300);
    let double = surface(Shape::Genus(2), 800);
    let far = |surface: &FieldSurface, share: f64| (share * surface.mesh().positions.len() as f64) as u32;
    for n in [1, 2, 4] {
        let kind = FieldKind::NVector { n };
        for share in [0.2, 0.35, 0.5, 0.65, 0.8] {
            let pair = [at(0, n as i32), at(far(&torus, share), -(n as i32))];
            let field = PrescribedField::new(&torus, kind, &pair, &Unwatched).unwrap();
            let (own, least) = least_energy(&torus, kind, &field.turns, 4);
            assert!(own <= least * (1.0 + 1e-9), "torus, n = {n}, {share}: {own}, {least}");
            let pair = [at(0, -(n as i32)), at(far(&double, share), -(n as i32))];
            let field = PrescribedField::new(&double, kind, &pair, &Unwatched).unwrap();
            let (own, least) = least_energy(&double, kind, &field.turns, 3);
            assert!(own <= least * (1.0 + 1e-9), "genus 2, n = {n}, {share}: {own}, {least}");
        }
    }
}

#[test]
fn each_component_is_turned_to_what_it_is_aligned_to_where_no_stroke_says_otherwise() {
    let both = union(&[generate(Shape::Torus, 300).unwrap(), generate(Shape::Torus, 200).unwrap()]);
    let surface = FieldSurface::new(both).unwrap();
    let (components, _) = surface.dual().components();
    let areas = surface.frames().areas();
    for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
        let b = kind.block();
        let basis = field_basis(&surface, &FieldParameters::new(kind, 80), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        let order = kind.order() as i32;
        let prescribed = [at(10, order), at(60, -order)];
        let field = PrescribedField::new(&surface, kind, &prescribed, &Unwatched).unwrap();
        // The field itself, each component turned by an angle of its own, three times as long, and noise that turns
        // nothing on the whole.
        let angle = |component: u32| if component == 0 { 0.7f64 } else { -2.1 };
        let target: Vec<f64> = (0..surface.faces())
            .flat_map(|face| {
                let turn = angle(components[face]) + if face % 2 == 0 { 0.3 } else { -0.3 };
                field
                    .value(face, Complex64::from_polar(1.0, turn))
                    .into_iter()
                    .take(b)
                    .map(|x| 3.0 * x)
                    .collect::<Vec<_>>()
            })
            .collect();
        let alignment = Arc::new(model.alignment(&basis, areas, &target, None).unwrap());
        let prescription = model.prescription(&basis, &surface, field.clone()).unwrap();
        let (found, matching) = prescription.exact(&surface, &[], &[(alignment.clone(), 2.0)]);
        let own = matched_singularities(&surface, kind, &found, &matching).unwrap();
        assert_eq!(own.iter().map(|s| at(s.vertex, s.numerator)).collect::<Vec<_>>(), prescribed, "{kind:?}");
        // What is left of the noise is what the two halves of the faces differ by in area.
        let close = |face: usize, turn: f64| {
            let wanted = field.value(face, Complex64::from_polar(1.0, turn));
            (0..b).all(|i| (f64::from(found[b * face + i]) - wanted[i]).abs() < 0.05)
        };
        assert!((0..surface.faces()).all(|face| close(face, angle(components[face]))), "{kind:?}");
        // Softly both are terms of the energy, and the whole is turned to fit.
        let prescription = Arc::new(prescription);
        let weights = EnergyWeights::default();
        let all: Vec<(Arc<_>, f64)> = vec![(alignment.clone(), 5.0)];
        let soft = model.weighted_with(weights, all, Some((prescription.clone(), 500.0))).unwrap();
        let design = soft.solve(&basis, &[]).unwrap();
        let [mut along, mut across] = [0.0; 2];
        for (face, area) in areas.iter().enumerate() {
            let [u, v] = [ONE, Complex64::I].map(|turn| field.value(face, turn));
            (0..b).for_each(|i| along += area * u[i] * target[b * face + i]);
            (0..b).for_each(|i| across += area * v[i] * target[b * face + i]);
        }
        let turn = design.turn.unwrap();
        assert!((turn.arg() - across.atan2(along)).abs() < 1e-6, "{kind:?} {turn:?}");
    }
}

#[test]
fn crosses_of_exact_fields_are_singular_where_these_are() {
    let coarse = |shape, vertices, seed| {
        FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.3, seed).unwrap()).unwrap()
    };
    let mut lost = 0;
    for (surface, seed) in [(coarse(Shape::Genus(2), 900, 3), 1u32), (coarse(Shape::Genus(4), 1700, 4), 2)] {
        let characteristic = surface.dual().euler_characteristic() as i32;
        let vertices = surface.mesh().positions.len() as u32;
        for n in [1, 2, 4] {
            let kind = FieldKind::NVector { n };
            let count = (n as i32 * characteristic).unsigned_abs();
            let mut prescribed: Vec<Prescribed> =
                (0..count).map(|i| at((i * vertices / count + 5 * seed + n) % vertices, -1)).collect();
            prescribed.sort_by_key(|p| p.vertex);
            let field = PrescribedField::new(&surface, kind, &prescribed, &Unwatched).unwrap();
            let single: Vec<f32> = field.target(Complex64::new(0.6, -0.8)).iter().map(|&x| x as f32).collect();
            let matching = field.matching(&surface, &single);
            let crosses = crosses_of(kind, &single).unwrap();
            let four = FieldKind::NVector { n: 4 };
            let matched = matching_of_power(&surface, (kind, &single, &matching), (four, &crosses)).unwrap();
            if n == 4 {
                assert_eq!(matched, matching);
            }
            let wanted: Vec<(u32, i32)> = prescribed.iter().map(|p| (p.vertex, p.numerator * 4 / n as i32)).collect();
            let found = comb(&surface, &crosses, &matched).unwrap().singularities;
            assert_eq!(found.iter().map(|s| (s.vertex, s.numerator)).collect::<Vec<_>>(), wanted, "n = {n}");
            let without = comb(&surface, &crosses, &[]).unwrap().singularities;
            lost += usize::from(without.iter().map(|s| (s.vertex, s.numerator)).collect::<Vec<_>>() != wanted);
        }
    }
    assert!(lost > 0, "no field needed its matching");
}
