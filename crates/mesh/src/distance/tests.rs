use super::*;
use crate::fixtures::{grid, sphere};

const KINDS: [DistanceKind; 5] = [
    DistanceKind::Dijkstra,
    DistanceKind::Euclidean,
    DistanceKind::Stvd { window: 3 },
    DistanceKind::Stvd { window: 6 },
    DistanceKind::FastMarching,
];

/// `(vertex, distance)` pairs from one source, in the units of the mesh.
fn distances(mesh: &TriangleMesh, kind: DistanceKind, source: u32, radius: f64) -> Vec<(u32, f64)> {
    let connectivity = Connectivity::new(mesh);
    let geometry = DistanceGeometry::new(mesh, &connectivity, kind, radius);
    let mut workspace = DistanceWorkspace::new(&geometry);
    let found = workspace.local_distances(&geometry, source, 1.0);
    found.iter().map(|&(v, d)| (v, f64::from(d) * radius)).collect()
}

fn straight(mesh: &TriangleMesh, a: u32, b: u32) -> f64 {
    (mesh.point(a) - mesh.point(b)).norm()
}

/// The mean and largest relative error over vertices at least `least` away.
fn errors(mesh: &TriangleMesh, kind: DistanceKind, radius: f64, least: f64, exact: impl Fn(u32) -> f64) -> (f64, f64) {
    let source = (mesh.positions.len() / 2) as u32;
    let found = distances(mesh, kind, source, radius);
    let errors: Vec<f64> = found.iter().filter(|(_, d)| *d > least).map(|&(v, d)| (d / exact(v) - 1.0).abs()).collect();
    assert!(errors.len() > 100, "{kind:?} reached {}", errors.len());
    (errors.iter().sum::<f64>() / errors.len() as f64, errors.iter().fold(0.0, |a, &b| a.max(b)))
}

#[test]
fn in_the_plane_each_kind_is_as_exact_as_it_claims() {
    let mesh = grid(61);
    let source = (mesh.positions.len() / 2) as u32;
    let bounds = [(0.07, 0.09), (1e-6, 1e-6), (0.03, 0.09), (0.02, 0.06), (0.012, 0.04)];
    let mut means = Vec::new();
    for (kind, (mean_bound, max_bound)) in KINDS.into_iter().zip(bounds) {
        let (mean, max) = errors(&mesh, kind, 25.0, 2.0, |v| straight(&mesh, source, v));
        assert!(mean < mean_bound && max < max_bound, "{kind:?}: mean {mean}, max {max}");
        means.push(mean);
    }
    assert!(means[0] > means[2] && means[2] > means[3], "a wider window is more exact: {means:?}");
}

#[test]
fn on_a_sphere_distances_follow_great_circles() {
    let mesh = sphere(32);
    let source = (mesh.positions.len() / 2) as u32;
    let exact = |v: u32| 2.0 * (0.5 * straight(&mesh, source, v)).asin();
    for (kind, bound) in [
        (DistanceKind::FastMarching, 0.012),
        (DistanceKind::Stvd { window: 6 }, 0.03),
        (DistanceKind::Stvd { window: 3 }, 0.06),
        (DistanceKind::Dijkstra, 0.11),
    ] {
        let (mean, _) = errors(&mesh, kind, 1.0, 0.1, exact);
        assert!(mean < bound, "{kind:?}: mean {mean}");
    }
}

#[test]
fn a_window_of_one_is_dijkstra() {
    let mesh = sphere(12);
    let dijkstra = distances(&mesh, DistanceKind::Dijkstra, 7, 0.8);
    assert_eq!(distances(&mesh, DistanceKind::Stvd { window: 1 }, 7, 0.8), dijkstra);
}

#[test]
fn no_kind_exceeds_the_path_along_edges() {
    let mesh = sphere(16);
    let mut along_edges = vec![f64::INFINITY; mesh.positions.len()];
    for (v, d) in distances(&mesh, DistanceKind::Dijkstra, 3, 3.0) {
        along_edges[v as usize] = d;
    }
    for kind in KINDS {
        for (v, d) in distances(&mesh, kind, 3, 1.0) {
            assert!(d <= along_edges[v as usize] * (1.0 + 1e-5), "{kind:?} at {v}");
        }
    }
}

#[test]
fn vertices_come_once_within_the_radius_and_the_source_first() {
    let mesh = sphere(16);
    for kind in KINDS {
        let found = distances(&mesh, kind, 11, 0.7);
        assert_eq!(found[0], (11, 0.0));
        assert!(found.iter().all(|&(_, d)| (0.0..=0.7 * (1.0 + 1e-6)).contains(&d)));
        let mut vertices: Vec<u32> = found.iter().map(|&(v, _)| v).collect();
        vertices.sort_unstable();
        let count = vertices.len();
        vertices.dedup();
        assert_eq!(vertices.len(), count, "{kind:?}");
    }
}

#[test]
fn a_workspace_used_again_gives_what_a_fresh_one_gives() {
    let mesh = sphere(10);
    let connectivity = Connectivity::new(&mesh);
    for kind in KINDS {
        let geometry = DistanceGeometry::new(&mesh, &connectivity, kind, 0.6);
        let mut used = DistanceWorkspace::new(&geometry);
        for source in 0..connectivity.vertices() as u32 {
            let mut fresh = DistanceWorkspace::new(&geometry);
            let expected = fresh.local_distances(&geometry, source, 1.0).to_vec();
            assert_eq!(used.local_distances(&geometry, source, 1.0), expected, "{kind:?} from {source}");
        }
    }
}

#[test]
fn stamps_that_run_out_begin_again() {
    let mesh = sphere(4);
    let connectivity = Connectivity::new(&mesh);
    let geometry = DistanceGeometry::new(&mesh, &connectivity, DistanceKind::FastMarching, 1.0);
    let mut workspace = DistanceWorkspace::new(&geometry);
    let expected = workspace.local_distances(&geometry, 5, 0.9).to_vec();
    workspace.stamp = 7;
    for _ in 0..8 {
        assert_eq!(workspace.local_distances(&geometry, 5, 0.9), expected);
    }
}

#[test]
fn other_components_and_lone_vertices_are_out_of_reach() {
    let mut mesh = grid(5);
    let other: Vec<[f64; 3]> = mesh.positions.iter().map(|p| [p[0], p[1], 0.1]).collect();
    let faces: Vec<[u32; 3]> = mesh.faces.iter().map(|f| f.map(|v| v + 25)).collect();
    mesh.positions.extend(other);
    mesh.faces.extend(faces);
    mesh.positions.push([2.0, 2.0, 0.05]);
    for kind in KINDS {
        let found = distances(&mesh, kind, 12, 100.0);
        assert_eq!(found.len(), 25, "{kind:?}");
        assert!(found.iter().all(|&(v, _)| v < 25));
        assert_eq!(distances(&mesh, kind, 50, 1.0), [(50, 0.0)], "{kind:?}");
        assert_eq!(distances(&mesh, kind, 51, 1.0), [], "{kind:?}: not a vertex");
    }
}

#[test]
fn faces_without_area_and_equal_positions_do_no_harm() {
    let mut mesh = grid(9);
    // A vertex on top of another, a needle, and a vertex on an edge.
    mesh.positions[40] = mesh.positions[41];
    mesh.positions[20] = [2.0, 2.0 + 1e-13, 0.0];
    mesh.positions[60] = [6.5, 6.5, 0.0];
    for kind in KINDS {
        let found = distances(&mesh, kind, 0, 20.0);
        assert_eq!(found.len(), 81, "{kind:?}");
        for (v, d) in found {
            assert!(d.is_finite() && d <= straight(&mesh, 0, v) * 1.5 + 1e-9, "{kind:?} at {v}: {d}");
        }
    }
}

#[test]
fn scale_and_place_do_not_matter() {
    let mesh = sphere(12);
    for scale in [1e-30, 1e-6, 1e12, 1e60] {
        let scaled =
            TriangleMesh { positions: mesh.positions.iter().map(|p| p.map(|x| x * scale)).collect(), ..mesh.clone() };
        for kind in KINDS {
            let (a, b) = (distances(&mesh, kind, 9, 0.5), distances(&scaled, kind, 9, 0.5 * scale));
            assert_eq!(a.len(), b.len(), "{kind:?} at {scale}");
            let worst = a.iter().zip(&b).map(|(a, b)| (a.1 - b.1 / scale).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-5, "{kind:?} at {scale}: {worst}");
        }
    }
}
