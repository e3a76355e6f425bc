//! The radial construction over every surface of the folder that `CHLADNI_MESHES` names.

use std::io::Read;

use chladni_base::Unwatched;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};

use super::*;

/// Every usable surface of the folder, with its name and the number of its components.
fn surfaces() -> Vec<(String, TriangleMesh, usize)> {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        eprintln!("skipped: CHLADNI_MESHES is not set");
        return Vec::new();
    };
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let load = |path: &std::path::PathBuf| {
        let name = path.file_name()?.to_str()?.to_owned();
        let format = MeshFormat::from_extension(name.trim_end_matches(".gz").rsplit('.').next()?)?;
        let mut bytes = std::fs::read(path).ok()?;
        if name.ends_with(".gz") {
            let mut unpacked = Vec::new();
            flate2::read::GzDecoder::new(bytes.as_slice()).read_to_end(&mut unpacked).ok()?;
            bytes = unpacked;
        }
        let checked = check(read(&bytes, format, &ReadLimits::default()).ok()?, &CheckOptions::default()).ok()?;
        Some((name, checked.mesh, checked.report.components))
    };
    paths.iter().filter_map(load).collect()
}

#[test]
fn every_vertex_is_covered_on_every_surface() {
    for (name, mesh, components) in surfaces() {
        let n = mesh.positions.len();
        let connectivity = Connectivity::new(&mesh);
        for (sampling, distance) in [
            (Sampling::PoissonDisk, DistanceKind::Euclidean),
            (Sampling::FarthestPoints, DistanceKind::Stvd { window: 3 }),
            (Sampling::WellSpread, DistanceKind::FastMarching),
        ] {
            let dimension = 300.min(n.div_ceil(4));
            let parameters = RadialParameters { sampling, distance, ..Default::default() };
            let u = space(&mesh, &connectivity, dimension, 0, &parameters, &Unwatched).unwrap();
            // A component that no sample fell on gets one of its own.
            let most = dimension + components + 40;
            assert!(u.columns() >= dimension && u.columns() < most, "{name}: {} columns", u.columns());
            for row in 0..n {
                let sum: f64 = u.row(row).1.iter().map(|&x| f64::from(x)).sum();
                assert!((sum - 1.0).abs() < 1e-5, "{name}, {sampling:?}, row {row} sums to {sum}");
            }
        }
    }
}
