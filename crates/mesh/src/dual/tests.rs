use chladni_base::Unwatched;

use super::*;
use crate::fixtures::{grid, klein_bottle, moebius, projective_plane, sphere, turned_over, union};
use crate::sample::farthest_points;
use crate::shape::{Shape, generate};

#[test]
fn neighbours_know_each_other_and_lengths_agree() {
    for mesh in [sphere(9), grid(7), generate(Shape::Torus, 300).unwrap()] {
        let graph = DualGraph::new(&mesh).unwrap();
        for f in 0..graph.faces() {
            for k in 0..3 {
                let g = graph.neighbours(f)[k];
                if g == NO_FACE {
                    continue;
                }
                let j = graph.slot(g, graph.edges(f)[k]);
                assert_eq!(graph.neighbours(g as usize)[j], f as u32);
                assert_eq!(graph.lengths(f)[k], graph.lengths(g as usize)[j]);
                let shared = [(k + 1) % 3, (k + 2) % 3].map(|c| mesh.faces[f][c]);
                assert!(shared.iter().all(|v| mesh.faces[g as usize].contains(v)));
            }
        }
    }
}

#[test]
fn lengths_in_a_plane_are_those_between_barycentres() {
    let mesh = grid(6);
    let graph = DualGraph::new(&mesh).unwrap();
    let centre =
        |f: usize| [0, 1].map(|i| mesh.faces[f].iter().map(|&v| mesh.positions[v as usize][i] / 3.0).sum::<f64>());
    for f in 0..graph.faces() {
        for k in 0..3 {
            let g = graph.neighbours(f)[k];
            if g != NO_FACE {
                let (a, b) = (centre(f), centre(g as usize));
                let expected = (a[0] - b[0]).hypot(a[1] - b[1]) / 5.0;
                assert!((f64::from(graph.lengths(f)[k]) - expected).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn euler_characteristics_components_and_fans_are_right() {
    let torus = DualGraph::new(&generate(Shape::Torus, 300).unwrap()).unwrap();
    assert!((torus.euler_characteristic(), torus.is_closed()) == (0, true));
    let mesh = union(&[sphere(4), grid(5)]);
    let graph = DualGraph::new(&mesh).unwrap();
    assert_eq!((graph.euler_characteristic(), graph.is_closed(), graph.components().1), (3, false, 2));
    let mut corners = Vec::new();
    let mut total = 0;
    for v in 0..mesh.positions.len() as u32 {
        let closed = graph.fan(&mesh, v, &mut corners);
        total += corners.len();
        assert!(corners.iter().all(|&c| mesh.faces[c as usize / 3][c as usize % 3] == v));
        for (i, &c) in corners.iter().enumerate() {
            let next = graph.neighbours(c as usize / 3)[(c as usize + 1) % 3];
            let follows = corners.get(i + 1).or(closed.then_some(&corners[0]));
            assert_eq!(follows.map_or(NO_FACE, |&c| c / 3), next);
        }
    }
    assert_eq!(total, 3 * mesh.faces.len());
}

#[test]
fn what_is_no_manifold_is_named() {
    let square = |faces: Vec<[u32; 3]>| TriangleMesh {
        positions: (0..7).map(|i| [f64::from(i), f64::from(i * i), f64::from(i % 2)]).collect(),
        faces,
        ..Default::default()
    };
    let fail = |faces| DualGraph::new(&square(faces)).unwrap_err();
    assert_eq!(fail(vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]), DualError::NonManifoldEdge { from: 0, to: 1, faces: 3 });
    let both = DualGraph::new(&square(vec![[0, 1, 2], [0, 1, 3]])).unwrap();
    assert_eq!(both.oriented(), Err(OneSided { from: 0, to: 1, faces: [0, 1] }));
    assert_eq!(fail(vec![[0, 1, 2], [0, 3, 4]]), DualError::NonManifoldVertex { vertex: 0 });
    assert_eq!(fail(vec![[0, 1, 9]]), DualError::Face { face: 0, vertex: 9, vertices: 7 });
    assert_eq!(fail(vec![[0, 1, 1]]), DualError::Face { face: 0, vertex: 1, vertices: 7 });
    assert_eq!(fail(vec![]), DualError::Empty);
}

#[test]
fn faces_that_are_turned_over_have_the_same_neighbours_distances_and_fans() {
    for mesh in [sphere(8), grid(7)] {
        let other = turned_over(&mesh, |face| face % 3 == 1 || face % 7 == 2);
        let (graph, turned) = (DualGraph::new(&mesh).unwrap(), DualGraph::new(&other).unwrap());
        assert!(graph.oriented().is_ok() && turned.oriented().is_err());
        let sorted = |graph: &DualGraph, face: usize| {
            let mut own: Vec<(u32, u32)> =
                graph.neighbours(face).into_iter().zip(graph.lengths(face).map(|l| (l * 1e6).round() as u32)).collect();
            own.sort_unstable();
            own
        };
        assert!((0..graph.faces()).all(|face| sorted(&graph, face) == sorted(&turned, face)));
        let (mut corners, mut others) = (Vec::new(), Vec::new());
        for vertex in 0..mesh.positions.len() as u32 {
            let mut sides = Vec::new();
            let closed = graph.fan(&mesh, vertex, &mut corners);
            assert_eq!(turned.sided_fan(&other, vertex, &mut others, |side| sides.push(side)), closed);
            let around = |corners: &[u32]| corners.iter().map(|c| c / 3).collect::<Vec<_>>();
            let (around, mut there) = (around(&corners), around(&others));
            // Sides are those of the faces that were turned over, or of all others.
            let over = |face: u32| face % 3 == 1 || face % 7 == 2;
            assert!(there.iter().zip(&sides).all(|(&f, &side)| (over(f) == over(there[0])) == (side == sides[0])));
            // The same circle or path, from some place on and one way or the other.
            if over(there[0]) != sides[0] {
                there.reverse();
            }
            let begin = there.iter().position(|&f| f == around[0]).unwrap();
            assert!(closed || begin == 0);
            there.rotate_left(begin);
            assert_eq!(there, around);
        }
    }
    for (mesh, characteristic, closed) in
        [(moebius(20, 4), 0, false), (klein_bottle(24, 12), 0, true), (projective_plane(6), 1, true)]
    {
        let graph = DualGraph::new(&mesh).unwrap();
        assert_eq!((graph.euler_characteristic(), graph.is_closed()), (characteristic, closed));
        assert!(graph.oriented().is_err() && graph.components().1 == 1);
    }
}

#[test]
fn disks_hold_what_is_within_the_radius_nearest_first() {
    let mesh = sphere(12);
    let graph = DualGraph::new(&mesh).unwrap();
    let mut grower = DiskGrower::new(&graph);
    let all = grower.grow(&graph, 17, f32::INFINITY).to_vec();
    assert!(all.len() == graph.faces() && all.is_sorted_by(|a, b| a.1 <= b.1));
    for radius in [0.0, 0.1, 0.2] {
        let disk = grower.grow(&graph, 17, radius).to_vec();
        assert_eq!(disk.len(), all.iter().filter(|f| f.1 <= radius).count());
        assert!(disk.iter().enumerate().all(|(i, f)| grower.index_of(f.0) == Some(i) && f.1 == all[i].1));
        assert!(all[disk.len()..].iter().all(|f| grower.index_of(f.0).is_none()));
    }
    assert!(grower.grow(&graph, 1_000_000, 1.0).is_empty());
    assert_eq!(grower.farthest_distance(&graph, &[17]), all[all.len() - 1].1);
    assert!(grower.farthest_distance(&graph, &[17, all[all.len() - 1].0]) < all[all.len() - 1].1);
    assert_eq!(grower.farthest_distance(&graph, &[]), 0.0);
}

#[test]
fn weights_draw_samples_to_where_they_are_large() {
    let mesh = grid(40);
    let graph = DualGraph::new(&mesh).unwrap();
    let left = |f: u32| mesh.positions[mesh.faces[f as usize][0] as usize][0] < 19.5;
    let weights: Vec<f64> = (0..graph.faces()).map(|f| if left(f as u32) { 3.0 } else { 1.0 }).collect();
    let count = |graph: &DualGraph| {
        let samples = farthest_points(&graph.connectivity(), 100, 1, &Unwatched).unwrap();
        samples.iter().filter(|&&f| left(f)).count()
    };
    assert!((35..65).contains(&count(&graph)));
    assert!(count(&graph.weighted(&weights).unwrap()) > 75);
    assert!(graph.weighted(&weights[1..]).is_none());
}
