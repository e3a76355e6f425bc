//! Poses of a camel mapped to each other: one mesh in ten poses, so that the true correspondence is known.

use chladni::analysis::functional_map::{MapRequest, functional_map};
use chladni::mesh::TriangleMesh;
use chladni::mesh::connectivity::Connectivity;
use chladni::mesh::distance::{DistanceGeometry, DistanceKind, DistanceWorkspace};
use chladni::mesh::measure::surface_area;

use crate::paint::{Sheet, View, coloured};
use crate::{Failure, scene};

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let pose = |k: usize| scene::load(&folder.join(format!("camel-gallop/camel-gallop-{k:02}.off")));
    let source = pose(1)?;
    let from = scene::eigenbasis(&source, 120)?;
    let landmarks = spread(&source, 6);
    let view = View::from([1.0, 0.2, 0.2], [0.0, 1.0, 0.0]);
    let colours = places(&source);
    let mut sheet = Sheet::new(4, 190, 170);
    sheet.add_marked(&source, &coloured(&colours, 6), &view, "source, and its landmarks", &landmarks);
    for k in [3, 6, 9] {
        let target = pose(k)?;
        if target.positions.len() != source.positions.len() {
            println!("pose {k} has {} vertices, not {}", target.positions.len(), source.positions.len());
            continue;
        }
        let to = scene::eigenbasis(&target, 120)?;
        for (name, pairs, step) in [("first map of 20", 20, 5), ("refined to 100", 100, 5)] {
            let request = MapRequest {
                landmarks: landmarks.iter().map(|&vertex| [vertex, vertex]).collect(),
                descriptors: None,
                signatures: false,
                start: 20,
                pairs,
                step,
                samples: 2000,
                commutativity: 0.1,
                all_points: true,
            };
            let begin = std::time::Instant::now();
            let map = functional_map(&from, &to, &request)?;
            let seconds = begin.elapsed().as_secs_f64();
            let (mean, within) = error(&source, &map.points);
            println!(
                "pose 1 to {k}, {name}: mean geodesic error {mean:.4} of √area, {:.1} % within 0.05; orthogonality {:.3}, commutativity {:.3}, embedding {:.3}, coverage {:.2}; {seconds:.2} s",
                100.0 * within,
                map.orthogonality_defect,
                map.commutativity_defect,
                map.embedding_error,
                map.coverage
            );
            if pairs == 100 {
                let carried: Vec<[f64; 3]> = map.points.iter().map(|&point| colours[point as usize]).collect();
                sheet.add(&target, &coloured(&carried, 6), &view, &format!("carried to pose {k}"));
            }
        }
    }
    scene::save("functional-maps.svg", &sheet.svg())
}

/// Colours by place, so that a point and its image have the same.
fn places(mesh: &TriangleMesh) -> Vec<[f64; 3]> {
    let range = |axis: usize| {
        let values = mesh.positions.iter().map(|p| p[axis]);
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
    };
    let ranges = [range(0), range(1), range(2)];
    let share =
        |p: &[f64; 3]| std::array::from_fn(|axis| (p[axis] - ranges[axis].0) / (ranges[axis].1 - ranges[axis].0));
    mesh.positions.iter().map(share).collect()
}

/// Vertices that lie far from each other.
fn spread(mesh: &TriangleMesh, count: usize) -> Vec<u32> {
    let mut chosen = vec![0usize];
    let mut nearest = vec![f64::INFINITY; mesh.positions.len()];
    while chosen.len() <= count {
        let last = mesh.positions[chosen[chosen.len() - 1]];
        for (least, p) in nearest.iter_mut().zip(&mesh.positions) {
            *least = least.min((0..3).map(|k| (p[k] - last[k]).powi(2)).sum());
        }
        let next = (0..nearest.len()).max_by(|&a, &b| nearest[a].total_cmp(&nearest[b])).unwrap_or(0);
        chosen.push(next);
    }
    // The first was any vertex.
    chosen[1..].iter().map(|&vertex| vertex as u32).collect()
}

/// The mean geodesic distance on the source between where points went and where they belong, relative to the root of the area, and the share of them
/// within a twentieth of it.
fn error(mesh: &TriangleMesh, points: &[u32]) -> (f64, f64) {
    let connectivity = Connectivity::new(mesh);
    let geometry = DistanceGeometry::new(mesh, &connectivity, DistanceKind::FastMarching, 1.0);
    let mut workspace = DistanceWorkspace::new(&geometry);
    let size = surface_area(mesh).sqrt();
    let (mut sum, mut within, mut count) = (0.0, 0, 0);
    for (vertex, &point) in points.iter().enumerate().step_by(7) {
        let found = workspace.local_distances(&geometry, vertex as u32, f32::INFINITY);
        let distance = found.iter().find(|(other, _)| *other == point).map_or(f64::INFINITY, |(_, d)| f64::from(*d));
        let distance = (distance / size).min(2.0);
        sum += distance;
        within += usize::from(distance < 0.05);
        count += 1;
    }
    (sum / count as f64, within as f64 / count as f64)
}
