//! Maps of a collection on real poses, against the correspondences that come with them.

use std::path::{Path, PathBuf};

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::{DistanceGeometry, DistanceKind, DistanceWorkspace};
use chladni_mesh::measure::surface_area;
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_spectral::analysis::map_collection::{CollectionRequest, CollectionShape, MapCollection, map_collection};
use chladni_spectral::basis::Basis;
use chladni_work::EigenbasisParameters;
use serde_json::json;

struct Pose {
    mesh: TriangleMesh,
    basis: Basis,
    /// Line after line the vertices that correspond.
    truth: Vec<usize>,
}

impl Pose {
    fn load(folder: &Path, name: &str) -> Self {
        let raw = std::fs::read(folder.join(format!("{name}.off"))).unwrap();
        let raw = read(&raw, MeshFormat::Off, &ReadLimits::default()).unwrap();
        let mesh = check(raw, &CheckOptions::default()).unwrap().mesh;
        let parameters = EigenbasisParameters::parse(&json!({"count": 128, "method": "hsim"})).unwrap();
        let basis = parameters.run(&mesh, &Unwatched).unwrap();
        let lines = std::fs::read_to_string(folder.join(format!("{name}.vts"))).unwrap();
        let truth = lines.split_whitespace().map(|line| line.parse::<usize>().unwrap() - 1).collect();
        Self { mesh, basis, truth }
    }
}

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("CHLADNI_MESHES").map(|folder| PathBuf::from(folder).join("poses"));
    if folder.is_none() {
        println!("skipped: CHLADNI_MESHES is not set");
    }
    folder
}

/// Mean errors of all maps, by source and target, in per cent of the root of the area: distances along edges, at every
/// fortieth true pair.
fn errors(poses: &[Pose], found: &MapCollection) -> Vec<f64> {
    let mut sums = vec![(0.0, 0usize); found.maps.len()];
    for (source, pose) in poses.iter().enumerate() {
        let connectivity = Connectivity::new(&pose.mesh);
        let geometry = DistanceGeometry::new(&pose.mesh, &connectivity, DistanceKind::Dijkstra, 1.0);
        let mut workspace = DistanceWorkspace::new(&geometry);
        let unit = surface_area(&pose.mesh).sqrt();
        for line in (0..pose.truth.len()).step_by(40) {
            let reached = workspace.local_distances(&geometry, pose.truth[line] as u32, f32::INFINITY);
            let mut all = vec![f64::INFINITY; pose.mesh.positions.len()];
            reached.iter().for_each(|&(vertex, distance)| all[vertex as usize] = f64::from(distance) / unit);
            for (map, sum) in found.maps.iter().zip(&mut sums).filter(|(map, _)| map.source == source) {
                if let Some(&vertex) = poses[map.target].truth.get(line) {
                    sum.0 += all[map.to_source.points[vertex] as usize];
                    sum.1 += 1;
                }
            }
        }
    }
    sums.into_iter().map(|(sum, count)| 100.0 * sum / count as f64).collect()
}

fn mapped(names: &[String], request: &CollectionRequest) -> Option<(Vec<f64>, MapCollection)> {
    let folder = folder()?;
    let poses: Vec<Pose> = names.iter().map(|name| Pose::load(&folder, name)).collect();
    let shapes: Vec<CollectionShape<'_>> =
        poses.iter().map(|pose| CollectionShape { basis: &pose.basis, mesh: &pose.mesh }).collect();
    let begin = std::time::Instant::now();
    let found = map_collection(&shapes, request, &Unwatched).unwrap();
    let seconds = begin.elapsed().as_secs_f64();
    let errors = errors(&poses, &found);
    for (map, error) in found.maps.iter().zip(&errors) {
        println!("{} to {}: {error:.2} %, disagreement {:.3}", names[map.source], names[map.target], map.disagreement);
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!("mean {mean:.2} %; {:?}; {seconds:.1} s", found.cycles);
    Some((errors, found))
}

#[test]
fn poses_of_a_centaur_are_mapped_to_each_other_without_landmarks() {
    let names: Vec<String> = (0..6).map(|pose| format!("centaur{pose}")).collect();
    let request = CollectionRequest { samples: 1000, ..CollectionRequest::default() };
    let Some((errors, found)) = mapped(&names, &request) else { return };
    assert_eq!(errors.len(), 30);
    assert!(errors.iter().all(|&error| error < 3.0), "{errors:?}");
    assert!(found.cycles.pairs < 0.02 && found.cycles.triples.unwrap() < 0.02, "{:?}", found.cycles);
}

/// The command of a table in `docs/functional-maps.md`.
#[test]
#[ignore = "takes minutes: cargo test --release --workspace --test map_collection -- --ignored --nocapture"]
fn all_cats() {
    let names: Vec<String> = (0..11).map(|pose| format!("cat{pose}")).collect();
    let Some((errors, _)) = mapped(&names, &CollectionRequest::default()) else { return };
    assert!(errors.iter().all(|&error| error < 5.0), "{errors:?}");
}
