//! Real meshes, and what is known of them.

use std::path::PathBuf;

use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};

/// The folder of real meshes; says so where there is none.
pub fn meshes() -> Option<PathBuf> {
    let folder = std::env::var_os("CHLADNI_MESHES").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: CHLADNI_MESHES is not set");
    }
    folder
}

/// A mesh, packed or not, read and checked as the service does it.
pub fn load(path: &std::path::Path) -> TriangleMesh {
    let mut bytes = std::fs::read(path).unwrap();
    let mut name = path.to_path_buf();
    if path.extension().is_some_and(|ending| ending == "gz") {
        let mut unpacked = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::MultiGzDecoder::new(bytes.as_slice()), &mut unpacked).unwrap();
        bytes = unpacked;
        name = path.with_extension("");
    }
    let format = MeshFormat::from_extension(name.extension().unwrap().to_str().unwrap()).unwrap();
    check(read(&bytes, format, &ReadLimits::default()).unwrap(), &CheckOptions::default()).unwrap().mesh
}

/// Where they lie, for this crate and for those beside it that include this module.
const REFERENCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../spectral/tests/data/reference");

/// Eigenvalues that another solver found.
pub fn reference(name: &str) -> Vec<f64> {
    let path = PathBuf::from(REFERENCES).join(format!("{name}.txt"));
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().filter(|line| !line.starts_with('#')).map(|line| line.parse().unwrap()).collect()
}
