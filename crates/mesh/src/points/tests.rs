use chladni_base::Unwatched;

use super::*;
use crate::fixtures::{grid, sphere};
use crate::measure::surface_area;

#[test]
fn points_of_a_mesh_of_acute_triangles_give_back_its_triangles() {
    // An icosahedral sphere would do; of the octahedral one, triangles beside the axes are cut in other ways.
    let mesh = crate::shape::generate(crate::shape::Shape::Sphere, 642).unwrap();
    let local = with_local_triangles(&mesh.positions, &Unwatched).unwrap();
    let found = once_each(&local);
    let mut wanted: Vec<[u32; 3]> = mesh.faces.clone();
    wanted.iter_mut().for_each(|face| face.sort_unstable());
    wanted.sort_unstable();
    assert_eq!(local.faces.len(), 3 * mesh.faces.len());
    assert_eq!(found.faces, wanted);
}

#[test]
fn triangles_cover_a_surface_three_times_and_begin_at_their_point() {
    let mesh = sphere(20);
    let local = with_local_triangles(&mesh.positions, &Unwatched).unwrap();
    assert!(local.faces.is_sorted_by_key(|face| face[0]));
    let ratio = surface_area(&local) / surface_area(&mesh);
    assert!((ratio / COVERS - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn the_rim_of_an_open_surface_is_kept() {
    // Shaken, so that no four points lie on a circle.
    let mut mesh = grid(20);
    let mut random = chladni_base::SplitMix64::new(3);
    mesh.positions.iter_mut().for_each(|p| (0..2).for_each(|i| p[i] += 0.2 * (random.unit() - 0.5)));
    let local = with_local_triangles(&mesh.positions, &Unwatched).unwrap();
    // The hull of the points, which the rim of the grid is next to.
    let area = surface_area(&local) / COVERS;
    assert!((area / (19.0 * 19.0) - 1.0).abs() < 0.02, "{area}");
    assert!(
        are_points(&TriangleMesh { positions: mesh.positions.clone(), faces: vec![], ..Default::default() })
            && !are_points(&mesh)
    );
}

#[test]
fn triangles_that_are_known_are_those_of_the_positions_and_of_no_others() {
    let positions = sphere(12).positions;
    let fresh = with_local_triangles(&positions, &Unwatched).unwrap();
    // Others in their place tell whether they are taken or made.
    let marked = TriangleMesh { faces: fresh.faces[..9].to_vec(), ..fresh.clone() };
    let (same, local) = KnownTriangles::new(marked.clone());
    assert_eq!(same, positions);
    let mut points = TriangleMesh { positions, local, ..Default::default() };
    assert_eq!(triangulated(&points, &Unwatched).unwrap().faces, marked.faces);
    assert_eq!(points, TriangleMesh { positions: same, ..Default::default() });
    points.positions[3][0] += 1e-3;
    let moved = with_local_triangles(&points.positions, &Unwatched).unwrap();
    assert_eq!(triangulated(&points, &Unwatched).unwrap(), moved);
    points.positions.truncate(100);
    assert!(points.local.of(&points.positions).is_none());
}

/// Points of a surface by rows, each turned by a share of a cell against the one before; rows may close.
fn rows(across: usize, along: usize, shift: f64, at: impl Fn(f64, f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    let cell = |j: usize, i: usize| at((i as f64 + shift * j as f64) / across as f64, j as f64 / along as f64);
    (0..along).flat_map(|j| (0..across).map(move |i| (j, i))).map(|(j, i)| cell(j, i)).collect()
}

fn torus(u: f64, v: f64) -> [f64; 3] {
    let (u, v) = (u * std::f64::consts::TAU, v * std::f64::consts::TAU);
    let r = 1.0 + 0.3 * v.cos();
    [r * u.cos(), r * u.sin(), 0.3 * v.sin()]
}

#[test]
fn four_points_of_a_cell_agree_on_its_diagonal_in_whatever_planes_they_see_it() {
    for (across, along) in [(60, 20), (90, 40), (200, 60)] {
        let local = with_local_triangles(&rows(across, along, 0.0, torus), &Unwatched).unwrap();
        assert_eq!(local.faces.len(), 6 * across * along, "{across} x {along}");
        assert_eq!(disputed(&local), (vec![], 0.0), "{across} x {along}");
        assert_eq!(once_each(&local).faces.len(), 2 * across * along);
    }
}

#[test]
fn a_grid_is_covered_three_times_and_not_four() {
    for turn in [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.36, 0.48, 0.8]] {
        let [a, b, c] = turn;
        // Two unit vectors at right angles to each other.
        let side = if c == 0.0 { [0.0, 0.0, 1.0] } else { [-0.8, 0.6, 0.0] };
        let positions = rows(60, 60, 0.0, |u, v| std::array::from_fn(|i| u * [a, b, c][i] + v * side[i]));
        let local = with_local_triangles(&positions, &Unwatched).unwrap();
        let area = surface_area(&local) / COVERS * (60.0f64 / 59.0).powi(2);
        assert!((area - 1.0).abs() < 5e-4, "{area}");
        assert!(disputed(&local).1 < 5e-3);
    }
}

#[test]
fn a_rim_that_the_surface_bends_along_is_not_filled_in() {
    // An open cylinder: in the planes of points at its ends the others of the rim lie farther out than they do.
    for shift in [0.0, 0.25, 0.5] {
        let cylinder = |u: f64, v: f64| {
            let angle = u * std::f64::consts::TAU;
            [angle.cos(), angle.sin(), 3.0 * v * 60.0 / 59.0]
        };
        let local = with_local_triangles(&rows(80, 60, shift, cylinder), &Unwatched).unwrap();
        let area = surface_area(&local) / COVERS / (6.0 * std::f64::consts::PI);
        // Chords of 80 to the circle are shorter by 2.6e-4.
        assert!((area - 1.0).abs() < 5e-4, "{shift}: {area}");
        assert_eq!(disputed(&local).0, Vec::<u32>::new());
    }
}

#[test]
fn disputed_are_the_triangles_that_a_corner_of_theirs_lacks() {
    let positions = vec![[0.0; 3]; 4];
    // All three of the first have it; of the second, point 3 does not.
    let faces = vec![[0, 1, 2], [0, 2, 3], [1, 2, 0], [2, 1, 0], [2, 0, 3]];
    let local = TriangleMesh { positions, faces, ..Default::default() };
    assert_eq!(disputed(&local), (vec![0, 2], 0.4));
}
