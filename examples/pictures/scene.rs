//! Meshes, bases and files: what pages have in common.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

use chladni_algebra::DenseMatrix;
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_spectral::basis::Basis;
use chladni_work::EigenbasisParameters;
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

/// The vertex that lies furthest in a direction.
pub fn furthest(mesh: &TriangleMesh, direction: [f64; 3]) -> u32 {
    let along = |vertex: &usize| (0..3).map(|k| mesh.positions[*vertex][k] * direction[k]).sum::<f64>();
    (0..mesh.positions.len()).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(0) as u32
}

/// The mesh with other coordinates, a column for each axis.
pub fn moved(mesh: &TriangleMesh, coordinates: &DenseMatrix) -> TriangleMesh {
    let position = |row: usize| std::array::from_fn(|axis| coordinates.column(axis)[row]);
    TriangleMesh {
        positions: (0..mesh.positions.len()).map(position).collect(),
        faces: mesh.faces.clone(),
        ..Default::default()
    }
}

/// The coordinates of a mesh, a column for each axis.
pub fn coordinates(mesh: &TriangleMesh) -> DenseMatrix {
    let mut matrix = DenseMatrix::zeros(mesh.positions.len(), 3);
    for axis in 0..3 {
        matrix.column_mut(axis).iter_mut().zip(&mesh.positions).for_each(|(slot, position)| *slot = position[axis]);
    }
    matrix
}

/// The error of a function relative to another, in the norm of the mass.
pub fn relative_error(basis: &Basis, found: &[f64], expected: &[f64]) -> f64 {
    let masses = basis.mass.lumped();
    let lost: f64 = masses.iter().zip(found).zip(expected).map(|((m, a), b)| m * (a - b) * (a - b)).sum();
    let whole: f64 = masses.iter().zip(expected).map(|(m, b)| m * b * b).sum();
    (lost / whole).sqrt()
}

/// Writes a picture to `docs/pictures`.
pub fn save(name: &str, content: &str) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pictures").join(name);
    std::fs::write(&path, content)?;
    println!("docs/pictures/{name}: {} kB", content.len() / 1000);
    Ok(())
}
