//! Meshes, bases and files: what pages have in common.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

use chladni::basis::Basis;
use chladni::job::EigenbasisParameters;
use chladni::mesh::TriangleMesh;
use chladni::mesh::check::{CheckOptions, check};
use chladni::mesh::read::{MeshFormat, ReadLimits, read};
use chladni::monitor::Unwatched;
use serde_json::{Value, json};

use crate::Failure;

/// The folder of the real meshes; `None`, and a line that says so, where the environment does not name it.
pub fn meshes() -> Option<PathBuf> {
    let folder = std::env::var_os("CHLADNI_MESHES").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: CHLADNI_MESHES is not set");
    }
    folder
}

/// Reads, checks and repairs a mesh.
pub fn load(path: &Path) -> Result<TriangleMesh, Failure> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let format = MeshFormat::from_extension(ending).ok_or_else(|| format!("{}: unknown format", path.display()))?;
    Ok(check(read(&bytes, format, &ReadLimits::default())?, &CheckOptions::default())?.mesh)
}

/// The default basis of so many pairs.
pub fn eigenbasis(mesh: &TriangleMesh, count: usize) -> Result<Basis, Failure> {
    eigenbasis_with(mesh, json!({"count": count}))
}

/// A basis as a job of kind `eigenbasis` with these parameters computes it.
pub fn eigenbasis_with(mesh: &TriangleMesh, parameters: Value) -> Result<Basis, Failure> {
    Ok(EigenbasisParameters::parse(&parameters)?.run(mesh, &Unwatched)?)
}

/// Writes a picture to `docs/pictures`.
pub fn save(name: &str, content: &str) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pictures").join(name);
    std::fs::write(&path, content)?;
    println!("docs/pictures/{name}: {} kB", content.len() / 1000);
    Ok(())
}
