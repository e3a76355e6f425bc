//! What was asked and answered, written so that another program can judge it: a line of JSON, then numbers of eight
//! bytes, little-endian.

use std::io::{Result, Write};
use std::path::Path;

use chladni_algebra::{MassMatrix, SparseMatrix};
use chladni_spectral::operator::EigenProblem;
use chladni_spectral::spectrum::hsim::{Eigenpairs, HsimError};
use serde_json::json;

use super::cases::{Question, Request};

/// Writes one solve. The pencil follows as rows, columns and values of all entries of `S`, then of `M`; then values and
/// bounds on unit area, and the columns on the unknowns one after the other.
pub fn write(
    path: &Path,
    (name, question): (&str, &Question),
    problem: &EigenProblem,
    answer: &std::result::Result<Eigenpairs, HsimError>,
    columns: &[Vec<f64>],
) -> Result<()> {
    let diagonal;
    let mass = match &problem.mass {
        MassMatrix::Sparse(mass) | MassMatrix::Weighted(chladni_algebra::WeightedMass { matrix: mass, .. }) => mass,
        MassMatrix::Diagonal(values) => {
            let n = values.len();
            diagonal =
                SparseMatrix::from_sorted_parts(n, n, (0..=n).collect(), (0..n as u32).collect(), values.clone());
            &diagonal
        }
    };
    let (count, below) = match question.wanted {
        Request::Count(count) => (Some(count), None),
        Request::Below(bound) => (None, Some(bound * problem.area)),
    };
    let (outcome, pairs, floor) = match answer {
        Ok(pairs) => ("complete", Some(pairs), None),
        Err(HsimError::Floor { floor, .. }) => ("tolerance-below-rounding", None, Some(*floor)),
        Err(error) => (error.kind(), None, None),
    };
    let on_bounds: Vec<_> = pairs
        .iter()
        .flat_map(|pairs| &pairs.on_bounds)
        .map(|pair| json!([pair.index, pair.value * problem.area, pair.within * problem.area]))
        .collect();
    let header = json!({
        "name": name, "size": problem.size(), "stiffness": problem.stiffness.entries(), "mass": mass.entries(), "count": count, "below": below,
        "tolerance": question.tolerance, "outcome": outcome, "floor": floor, "pairs": columns.len(),
        "defect": pairs.map(|pairs| pairs.orthonormality_defect), "on_bounds": on_bounds,
    });
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    writeln!(file, "{header}")?;
    let mut put = |numbers: &[f64]| numbers.iter().try_for_each(|number| file.write_all(&number.to_le_bytes()));
    for matrix in [&problem.stiffness, mass] {
        let rows: Vec<f64> = (0..matrix.rows()).flat_map(|row| vec![row as f64; matrix.row(row).0.len()]).collect();
        let places: Vec<f64> = matrix.indices().iter().map(|&column| f64::from(column)).collect();
        put(&rows)?;
        put(&places)?;
        put(matrix.values())?;
    }
    if let Some(pairs) = pairs {
        let on_unit_area = |numbers: &[f64]| numbers.iter().map(|x| x * problem.area).collect::<Vec<f64>>();
        put(&on_unit_area(&pairs.values))?;
        put(&on_unit_area(&pairs.bounds))?;
    }
    columns.iter().try_for_each(|column| put(column))
}
