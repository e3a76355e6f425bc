//! The operators of a mesh as a file of DiffusionNet's cache: what `chladni.operators(…).save_cache(…)` of the Python
//! package writes for the same positions.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use chladni_algebra::SparseMatrix;
use chladni_base::Unwatched;
use chladni_mesh::check::points::has_points_alone;
use chladni_mesh::read::RawMesh;
use chladni_mesh::solid::check_body;
use chladni_spectral::basis::Product;
use chladni_spectral::formats::npz::{SurfaceOperators, operators_within, write_operators};
use chladni_spectral::operator::vertex_gradients::VertexGradients;
use chladni_spectral::operator::{OperatorParameters, assemble};
use chladni_work::JobParameters;
use serde_json::json;
use sha1::{Digest, Sha1};

use super::progress::Outcome;
use super::{BatchArguments, Shared, prepared};
use crate::cli::work::OutputFile;
use crate::cli::{CliError, NumberingArguments};

/// Eigenpairs where nothing else is said, as DiffusionNet has it.
pub const PAIRS: usize = 128;

/// Residuals of eigenpairs, which single precision does not tell from smaller ones.
const TOLERANCE: f64 = 1e-6;

/// What is added to the normal equations of gradients.
const REGULARISATION: f64 = 1e-5;

/// What is added to the mass of each vertex, as a share of the mean mass: vertices that no face uses have some.
const LEAST_MASS: f64 = 1e-8;

/// Makes the file of a mesh, unless it is there with as many eigenpairs.
pub fn run_on_mesh(
    arguments: &BatchArguments,
    mesh: &Path,
    pairs: usize,
    shared: &Shared,
) -> Result<Outcome, CliError> {
    let input = arguments.input(mesh);
    let options = input.options();
    let refused = |error: &dyn std::fmt::Display| CliError::mesh(mesh, error);
    let mut raw = input.read()?;
    if has_points_alone(&raw) {
        return Err(refused(&"operators need a surface with faces, and the file has only points"));
    }
    // A solid is meant by its surface; a mesh whose format splits vertices, as the one of merged ones.
    if !raw.tetrahedra.is_empty() || raw.splits_vertices || options.merge == chladni_mesh::check::Merge::Always {
        let kept = check_body(raw, &options).map_err(|error| refused(&error))?.surface.mesh;
        raw = RawMesh { positions: kept.positions, faces: kept.faces, ..RawMesh::default() };
    }
    let positions: Vec<[f32; 3]> = raw.positions.iter().map(|p| p.map(|x| x as f32)).collect();
    let faces = raw.faces.clone();
    let path = arguments.output.join(format!("{}_0.npz", digest(&positions, &faces)));
    // Equal meshes have one result: the second of them finds what the first has made.
    let claim = shared.claims.take(&path);
    let due = pairs.min(used_vertices(&faces, positions.len()));
    let may_stay = claim.was_made() || (!arguments.anew && arguments.is_current(&path));
    if may_stay && File::open(&path).is_ok_and(|file| enough(file, due)) {
        return Ok(Outcome::There(path));
    }
    let file = OutputFile::probe(&path)?;
    // As a network is given them: in single precision.
    raw.positions = positions.iter().map(|p| p.map(f64::from)).collect();
    let given = raw.positions.clone();
    let gradients = VertexGradients::new(&given, &faces, REGULARISATION).map_err(|error| refused(&error))?;
    let body =
        check_body(raw, &chladni_mesh::check::CheckOptions { merge: chladni_mesh::check::Merge::Never, ..options });
    let body = body.map_err(|error| refused(&error))?;
    let surface = &body.surface.mesh;
    let count = pairs.min(surface.positions.len());
    let job = json!({"method": "hsim", "count": count, "tolerance": TOLERANCE, "precision": "f64"});
    let job = JobParameters::parse("eigenbasis", &job)?;
    let (job, size, numbering) = prepared(&body, &job.into(), &NumberingArguments::default())?;
    let _promise = shared.promises.take(job.memory_bytes(size))?;
    let problem =
        assemble(surface, &OperatorParameters::default(), &Unwatched).map_err(|error| refused(&error))?.problem;
    let outcome = job.run_body(surface, None, &Unwatched)?;
    let Product::Eigenbasis(basis) = outcome.product else {
        return Err(CliError::Service("the job did not make an eigenbasis".to_owned()));
    };
    let lifted: Vec<f64> = basis.lift(0..count).map_err(|error| refused(&error))?;
    let (n, kept) = (given.len(), surface.positions.len());
    let rows: Vec<Option<u32>> = numbering.vertex_map().collect();
    let spread =
        |values: &[f64]| rows.iter().map(|row| row.map_or(0.0, |row| values[row as usize])).collect::<Vec<f64>>();
    let mass = spread(&problem.mass.scaled(problem.area).lumped());
    let least = LEAST_MASS * mass.iter().sum::<f64>() / n.max(1) as f64;
    let stiffness = spread_matrix(&problem.stiffness, &rows)?;
    let operators = SurfaceOperators {
        positions: &positions,
        faces: &faces,
        frames: &gradients.frames,
        pattern: (&gradients.offsets, &gradients.indices),
        gradients: &gradients.values,
        mass: &mass.iter().map(|own| own + least).collect::<Vec<_>>(),
        stiffness: &stiffness,
        eigenvalues: &basis.eigenvalues.iter().map(|value| value.max(0.0)).collect::<Vec<_>>(),
        functions: &lifted.chunks(kept.max(1)).flat_map(spread).collect::<Vec<_>>(),
    };
    file.write(|out| write_operators(&operators, out))?;
    claim.made();
    Ok(Outcome::Made(path))
}

/// The name that DiffusionNet looks for: of positions in single precision and faces in 64 bits.
fn digest(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> String {
    let mut hash = Sha1::new();
    hash.update(bytemuck::cast_slice::<_, u8>(positions));
    let corners: Vec<i64> = faces.as_flattened().iter().map(|&vertex| i64::from(vertex)).collect();
    hash.update(bytemuck::cast_slice::<_, u8>(&corners));
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// How many vertices are kept: those of faces with three different corners.
fn used_vertices(faces: &[[u32; 3]], vertices: usize) -> usize {
    let mut used = vec![false; vertices];
    for &[a, b, c] in faces.iter().filter(|[a, b, c]| a != b && b != c && c != a) {
        for vertex in [a, b, c] {
            // What refers to no vertex is refused with the mesh.
            if let Some(used) = used.get_mut(vertex as usize) {
                *used = true;
            }
        }
    }
    used.into_iter().filter(|&used| used).count()
}

fn enough(file: File, pairs: usize) -> bool {
    operators_within(BufReader::new(file)).is_some_and(|there| there >= pairs)
}

/// A matrix on kept vertices in the numbering of the file; rows of dropped vertices are empty.
fn spread_matrix(matrix: &SparseMatrix, rows: &[Option<u32>]) -> Result<SparseMatrix, CliError> {
    let mut of = vec![0; matrix.rows()];
    rows.iter().enumerate().for_each(|(file, kept)| {
        if let Some(kept) = kept {
            of[*kept as usize] = file as u32;
        }
    });
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for kept in rows {
        if let Some(kept) = kept {
            let (columns, entries) = matrix.row(*kept as usize);
            let mut row: Vec<(u32, f64)> =
                columns.iter().map(|&c| of[c as usize]).zip(entries.iter().copied()).collect();
            row.sort_unstable_by_key(|&(column, _)| column);
            indices.extend(row.iter().map(|&(column, _)| column));
            values.extend(row.iter().map(|&(_, value)| value));
        }
        offsets.push(indices.len());
    }
    SparseMatrix::new(rows.len(), rows.len(), offsets, indices, values)
        .map_err(|error| CliError::Service(format!("a matrix cannot be renumbered: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_cache() {
        // hashlib.sha1(array.tobytes()) of both arrays, by Python.
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(digest(&positions, &[[0, 1, 2]]), "726e89b380175f97678bdbabf819f2ed896bc216");
    }
}
