//! Functional maps between surfaces that correspond: how far matched points are from where they belong, before and
//! after ZoomOut, and a function that is carried over.

use std::path::Path;

use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::{DistanceGeometry, DistanceKind, DistanceWorkspace};
use chladni_mesh::measure::surface_area;
use chladni_spectral::analysis::functional_map::{MapRequest, functional_map};
use chladni_spectral::basis::Basis;

use crate::paint::{Sheet, View, isolines};
use crate::{Failure, scene};

/// Directions of which the furthest vertices are landmarks: top, hands and feet, belly, back.
const ENDS: [[f64; 3]; 7] = [
    [0.0, 1.0, 0.0],
    [1.0, 0.2, 0.0],
    [-1.0, 0.2, 0.0],
    [0.4, -1.0, 0.0],
    [-0.4, -1.0, 0.0],
    [0.0, -0.2, 1.0],
    [0.0, -0.2, -1.0],
];

/// How many vertices of the target are looked at.
const LOOKED_AT: usize = 1000;

struct Surface {
    mesh: TriangleMesh,
    basis: Basis,
}

impl Surface {
    fn load(path: &Path) -> Result<Self, Failure> {
        let mesh = scene::load(path)?;
        let basis = scene::eigenbasis(&mesh, 100)?;
        Ok(Self { mesh, basis })
    }

    fn distances(&self, from: u32) -> Vec<f64> {
        let connectivity = Connectivity::new(&self.mesh);
        let geometry = DistanceGeometry::new(&self.mesh, &connectivity, DistanceKind::FastMarching, 1.0);
        let mut all = vec![0.0; self.mesh.positions.len()];
        let mut workspace = DistanceWorkspace::new(&geometry);
        let found = workspace.local_distances(&geometry, from, f32::INFINITY);
        found.iter().for_each(|&(vertex, distance)| all[vertex as usize] = f64::from(distance));
        all
    }

    fn map_to(&self, target: &Self, landmarks: &[[u32; 2]], pairs: usize) -> Result<Vec<u32>, Failure> {
        let request = MapRequest {
            landmarks: landmarks.to_vec(),
            descriptors: None,
            signatures: false,
            start: 20,
            pairs,
            step: 5,
            samples: 2000,
            commutativity: 0.1,
            all_points: true,
            both_ways: false,
        };
        Ok(functional_map(&self.basis, &target.basis, &request)?.to_source.points)
    }
}

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mut sheet = Sheet::new(3, 200, 220);
    for (a, b) in [
        ("homer.obj", "homer-remeshed-4531.off"),
        ("homer.obj", "homer-remeshed-7178.off"),
        ("fertility-14k.obj", "fertility.off"),
    ] {
        let (source, target) = (Surface::load(&folder.join(a))?, Surface::load(&folder.join(b))?);
        let truth = corresponding(&source.mesh, &target.mesh);
        let landmarks = ENDS.map(|direction| {
            let vertex = scene::furthest(&target.mesh, direction);
            [truth[vertex as usize], vertex]
        });
        let [before, after] = [source.map_to(&target, &landmarks, 20)?, source.map_to(&target, &landmarks, 100)?];
        report(&format!("{b} to {a}, 20 pairs"), &source, &before, &truth);
        report(&format!("{b} to {a}, 100 pairs by ZoomOut"), &source, &after, &truth);
        if b == "homer-remeshed-4531.off" {
            let view = View::from([0.2, 0.1, 1.0], [0.0, 1.0, 0.0]);
            three(&mut sheet, &source, &target, landmarks[1][0], [&before, &after], &view);
        }
    }
    scene::save("functional-maps.svg", &sheet.svg())
}

/// The distance from a point of the source, and what two maps make of it on the target.
fn three(sheet: &mut Sheet, source: &Surface, target: &Surface, from: u32, maps: [&[u32]; 2], view: &View) {
    let values = source.distances(from);
    sheet.add(&source.mesh, &isolines(&values), view, "source");
    for (map, caption) in maps.into_iter().zip(["20 pairs", "100 pairs, by ZoomOut"]) {
        let carried: Vec<f64> = map.iter().map(|&vertex| values[vertex as usize]).collect();
        sheet.add(&target.mesh, &isolines(&carried), view, caption);
    }
}

/// For each vertex of the target the nearest of the source, both surfaces being of one shape and brought into one box.
fn corresponding(source: &TriangleMesh, target: &TriangleMesh) -> Vec<u32> {
    let (a, b) = (boxed(source), boxed(target));
    let square = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
    let nearest = |q: &[f64; 3]| (0..a.len()).min_by(|&i, &j| square(&a[i], q).total_cmp(&square(&a[j], q)));
    b.iter().map(|q| nearest(q).unwrap_or(0) as u32).collect()
}

fn boxed(mesh: &TriangleMesh) -> Vec<[f64; 3]> {
    let side = |k: usize| {
        let along = mesh.positions.iter().map(|p| p[k]);
        (along.clone().fold(f64::MAX, f64::min), along.fold(f64::MIN, f64::max))
    };
    let sides = [0, 1, 2].map(side);
    let size = sides.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
    mesh.positions.iter().map(|p| std::array::from_fn(|k| (p[k] - 0.5 * (sides[k].0 + sides[k].1)) / size)).collect()
}

/// Prints how far points are from where they belong: geodesic distances on the source over the root of its area.
fn report(name: &str, source: &Surface, found: &[u32], truth: &[u32]) {
    let connectivity = Connectivity::new(&source.mesh);
    let geometry = DistanceGeometry::new(&source.mesh, &connectivity, DistanceKind::FastMarching, 1.0);
    let mut workspace = DistanceWorkspace::new(&geometry);
    let unit = surface_area(&source.mesh).sqrt();
    let mut errors: Vec<f64> = (0..found.len())
        .step_by(found.len().div_ceil(LOOKED_AT))
        .map(|vertex| {
            let reached = workspace.local_distances(&geometry, truth[vertex], f32::INFINITY);
            let there = reached.iter().find(|(at, _)| *at == found[vertex]);
            there.map_or(f64::INFINITY, |(_, distance)| f64::from(*distance) / unit)
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let share =
        |limit: f64| 100.0 * errors.iter().filter(|&&error| error <= limit).count() as f64 / errors.len() as f64;
    println!(
        "{name}: mean error {:.2} %, median {:.2} %, largest {:.1} % of the root of the area; exact {:.0} %, within 2 % {:.0} %",
        100.0 * errors.iter().sum::<f64>() / errors.len() as f64,
        100.0 * errors[errors.len() / 2],
        100.0 * errors[errors.len() - 1],
        share(0.0),
        share(0.02)
    );
}
