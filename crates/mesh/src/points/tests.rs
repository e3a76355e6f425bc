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
    let (same, local) = Known::new(marked.clone());
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
