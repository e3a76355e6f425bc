//! Shape-DNA and distances on real surfaces: poses, remeshings, approximate and exact pairs.

use std::path::PathBuf;

use serde_json::json;

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::{DistanceGeometry, DistanceKind, DistanceWorkspace};
use chladni_mesh::measure::surface_area;
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_spectral::analysis::distance::SpectralDistance;
use chladni_spectral::analysis::functional_map::{MapRequest, functional_map};
use chladni_spectral::analysis::shape_dna::{Compared, Comparison, Scale, Spectrum, Weighting, compare};
use chladni_spectral::basis::Basis;
use chladni_work::EigenbasisParameters;

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("CHLADNI_MESHES").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: CHLADNI_MESHES is not set");
    }
    folder
}

fn load(path: PathBuf) -> TriangleMesh {
    load_with(path, &CheckOptions::default())
}

fn load_with(path: PathBuf, options: &CheckOptions) -> TriangleMesh {
    let format = MeshFormat::from_extension(path.extension().unwrap().to_str().unwrap()).unwrap();
    let raw = read(&std::fs::read(&path).unwrap(), format, &ReadLimits::default()).unwrap();
    check(raw, options).unwrap().mesh
}

fn basis(mesh: &TriangleMesh, parameters: serde_json::Value) -> Basis {
    EigenbasisParameters::parse(&parameters).unwrap().run(mesh, &Unwatched).unwrap()
}

fn nearest(found: &Compared, shape: usize) -> usize {
    let distances = found.distances.column(shape);
    let others = (0..distances.len()).filter(|&other| other != shape);
    others.min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap()
}

#[test]
fn poses_cluster_remeshings_agree_and_approximate_spectra_do_as_exact_ones() {
    let Some(folder) = folder() else { return };
    const COUNT: usize = 50;
    let mut files: Vec<String> =
        [1, 4, 7, 10].iter().map(|k| format!("camel-gallop/camel-gallop-{k:02}.off")).collect();
    let others = ["homer.obj", "homer-remeshed-4531.off", "homer-remeshed-7178.off", "rocker-arm.off", "elephant.obj"];
    files.extend(others.map(String::from));
    let (mut approximate, mut exact) = (Vec::new(), Vec::new());
    for file in &files {
        let mesh = load(folder.join(file));
        let area = surface_area(&mesh);
        let fast = basis(&mesh, json!({"count": COUNT + 1}));
        approximate.push(Spectrum { eigenvalues: fast.eigenvalues, kernel: 1, area });
        let slow = basis(&mesh, json!({"count": COUNT + 1, "method": "hsim", "tolerance": 1e-3, "storage": "compact"}));
        exact.push(Spectrum { eigenvalues: slow.eigenvalues, kernel: 1, area });
    }
    let how = Comparison { count: COUNT, scale: Scale::Area, weighting: Weighting::Index, dimensions: 2 };
    let (fast, slow) = (compare(&approximate, &how).unwrap(), compare(&exact, &how).unwrap());
    for found in [&fast, &slow] {
        let distance = |a: usize, b: usize| found.distances.column(a)[b];
        for camel in 0..4 {
            assert!(nearest(found, camel) < 4, "{}", files[camel]);
            let to_camels = (0..4).map(|b| distance(camel, b)).fold(0.0, f64::max);
            let to_others = (4..files.len()).map(|b| distance(camel, b)).fold(f64::INFINITY, f64::min);
            assert!(to_camels < to_others, "{}: {to_camels} {to_others}", files[camel]);
        }
        // Higher eigenvalues see the triangles, until these are divided.
        for (a, b) in [(4, 5), (4, 6), (5, 6)] {
            let [x, y] = [a, b].map(|shape| &found.descriptors.column(shape)[..10]);
            let gap = x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt();
            let size = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!(gap < 0.01 * size, "{} {}: {}", files[a], files[b], gap / size);
        }
    }
    for shape in 0..files.len() {
        assert_eq!(nearest(&fast, shape), nearest(&slow, shape), "{}", files[shape]);
    }
}

/// Three meshes of one figure have one spectrum once their faces are small enough for it: as they are, they differ by 2
/// %.
#[test]
fn the_first_hundred_eigenvalues_of_remeshings_agree_within_one_percent_after_faces_are_divided() {
    let Some(folder) = folder() else { return };
    let files = ["homer.obj", "homer-remeshed-4531.off", "homer-remeshed-7178.off"];
    let spectra: Vec<Spectrum> = files
        .iter()
        .map(|file| {
            let options = CheckOptions { subdivisions: 2, ..CheckOptions::default() };
            let mesh = load_with(folder.join(file), &options);
            let exact = basis(&mesh, json!({"count": 101, "method": "hsim", "tolerance": 1e-3, "storage": "compact"}));
            Spectrum { eigenvalues: exact.eigenvalues, kernel: 1, area: surface_area(&mesh) }
        })
        .collect();
    let how = Comparison { count: 100, scale: Scale::Area, weighting: Weighting::Index, dimensions: 2 };
    let found = compare(&spectra, &how).unwrap();
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let [x, y] = [a, b].map(|shape| found.descriptors.column(shape));
        let gaps: Vec<f64> = x.iter().zip(y).map(|(x, y)| (x / y - 1.0).abs()).collect();
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        let most = gaps.iter().copied().fold(0.0, f64::max);
        let whole = found.distances.column(a)[b] / x.iter().map(|x| x * x).sum::<f64>().sqrt();
        println!("{} {}: mean {mean:.4}, largest {most:.4}, distance {whole:.4}", files[a], files[b]);
        assert!(mean < 0.005 && whole < 0.005 && most < 0.01, "{} {}: {mean} {most} {whole}", files[a], files[b]);
    }
}

#[test]
fn distances_by_approximate_pairs_are_near_those_by_exact_ones() {
    let Some(folder) = folder() else { return };
    let mesh = load(folder.join("rocker-arm.off"));
    let fast = basis(&mesh, json!({"count": 100}));
    let exact = basis(&mesh, json!({"count": 100, "method": "hsim", "tolerance": 1e-5, "precision": "f64"}));
    let unit = 1.0 / exact.eigenvalues[1];
    let diffusion = SpectralDistance::Diffusion { times: vec![0.05 * unit, unit] };
    for distance in [diffusion, SpectralDistance::Biharmonic] {
        let [found, expected] = [&fast, &exact].map(|basis| distance.from_sources(basis, &[100]).unwrap());
        for column in 0..found.columns() {
            let (a, b) = (found.column(column), expected.column(column));
            let lost: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            let whole: f64 = b.iter().map(|b| b * b).sum();
            assert!((lost / whole).sqrt() < 0.01, "{distance:?}: {}", (lost / whole).sqrt());
        }
    }
}

/// Vertices of two meshes of one figure, brought into one box, correspond where they are nearest to each other.
#[test]
fn maps_between_meshes_of_one_figure_lead_near_to_where_points_belong_and_zoom_out_brings_them_nearer() {
    let Some(folder) = folder() else { return };
    let [source, target] = ["homer.obj", "homer-remeshed-4531.off"].map(|file| load(folder.join(file)));
    let (a, b) = (boxed(&source), boxed(&target));
    let square = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
    let nearest = |q: &[f64; 3]| (0..a.len()).min_by(|&i, &j| square(&a[i], q).total_cmp(&square(&a[j], q))).unwrap();
    let furthest = |direction: [f64; 3]| {
        let along = |p: &[f64; 3]| (0..3).map(|k| p[k] * direction[k]).sum::<f64>();
        (0..b.len()).max_by(|&i, &j| along(&b[i]).total_cmp(&along(&b[j]))).unwrap()
    };
    // Head, hands, feet, front and back.
    let ends = [
        [0.0, 1.0, 0.0],
        [1.0, 0.2, 0.0],
        [-1.0, 0.2, 0.0],
        [0.4, -1.0, 0.0],
        [-0.4, -1.0, 0.0],
        [0.0, -0.2, 1.0],
        [0.0, -0.2, -1.0],
    ];
    let landmarks = ends.map(furthest).map(|vertex| [nearest(&b[vertex]) as u32, vertex as u32]).to_vec();
    let [from, to] = [&source, &target].map(|mesh| basis(mesh, json!({"count": 100})));
    let connectivity = Connectivity::new(&source);
    let geometry = DistanceGeometry::new(&source, &connectivity, DistanceKind::Dijkstra, 1.0);
    let mut workspace = DistanceWorkspace::new(&geometry);
    let unit = surface_area(&source).sqrt();
    let means = [20, 100].map(|pairs| {
        let request = MapRequest {
            landmarks: landmarks.clone(),
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
        let map = functional_map(&from, &to, &request).unwrap();
        let errors = (0..b.len()).step_by(20).map(|vertex| {
            let reached = workspace.local_distances(&geometry, nearest(&b[vertex]) as u32, f32::INFINITY);
            let there = reached.iter().find(|(at, _)| *at == map.to_source.points[vertex]);
            there.map_or(f64::INFINITY, |(_, distance)| f64::from(*distance) / unit)
        });
        let errors: Vec<f64> = errors.collect();
        let near = errors.iter().filter(|&&error| error < 0.02).count() as f64 / errors.len() as f64;
        println!(
            "{pairs} pairs: mean error {:.4} of the root of the area, {near:.3} within 2 %",
            errors.iter().sum::<f64>() / errors.len() as f64
        );
        (errors.iter().sum::<f64>() / errors.len() as f64, near)
    });
    assert!(means[1].0 < 0.01 && means[1].1 > 0.9, "{means:?}");
    assert!(means[1].0 < 0.7 * means[0].0 && means[1].1 > means[0].1, "{means:?}");
}

/// Vertices about the middle of their box, whose longest side is 1.
fn boxed(mesh: &TriangleMesh) -> Vec<[f64; 3]> {
    let sides = [0, 1, 2].map(|k| {
        let along = mesh.positions.iter().map(|p| p[k]);
        [along.clone().fold(f64::MAX, f64::min), along.fold(f64::MIN, f64::max)]
    });
    let size = sides.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let place = |p: &[f64; 3]| std::array::from_fn(|k| (p[k] - 0.5 * (sides[k][0] + sides[k][1])) / size);
    mesh.positions.iter().map(place).collect()
}
