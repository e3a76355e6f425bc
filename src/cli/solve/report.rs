//! What a solve tells: one object, or a few lines to read.

use serde_json::{Map, Value, json};

use super::SolveArguments;
use crate::basis::Basis;
use crate::cli::{Table, bytes, grouped, memory, number};
use crate::job::{JobParameters, SOLVER_VERSION, abbreviate};

/// Rows of the printed table of eigenvalues.
const LISTED_PAIRS: usize = 12;

/// What one run measured.
pub(super) struct Run {
    pub vertices: usize,
    pub faces: usize,
    pub basis: Basis,
    pub stages: Vec<(&'static str, f64)>,
    pub total: f64,
    pub write: Option<f64>,
}

impl Run {
    /// One object with what was computed and what it cost.
    pub fn json(&self, job: &JobParameters, threads: usize) -> Value {
        let stages: Map<String, Value> =
            self.stages.iter().map(|&(name, seconds)| (name.to_owned(), json!(seconds))).collect();
        let mut line = json!({
            "vertices": self.vertices,
            "faces": self.faces,
            "subspace": self.basis.dimension(),
            "seconds": {"total": self.total, "stages": stages, "write": self.write},
            "threads": threads,
            "solver_version": SOLVER_VERSION,
            "peak_rss_bytes": peak_rss_bytes(),
            "eigenvalues": self.basis.eigenvalues,
            "residuals": self.basis.certificate.residuals,
            "bounds": self.basis.certificate.bounds,
            "orthonormality_defect": self.basis.certificate.orthonormality_defect,
            "iterations": self.basis.certificate.levels.iter().map(|level| level.iterations).collect::<Vec<_>>(),
            "certificate": self.certificate(),
            "operator_report": self.basis.metadata["operator"],
            "basis_bytes": self.basis.stored_bytes(),
            "dense_bytes": self.basis.dense_bytes(),
        });
        let mut canonical = job.canonical();
        abbreviate(&mut canonical);
        if let (Value::Object(line), Value::Object(parameters)) = (&mut line, canonical) {
            for (name, value) in parameters {
                line.entry(name).or_insert(value);
            }
            // What the basis really holds: a mesh of few vertices may have fewer pairs than were asked for.
            line.insert("count".into(), json!(self.basis.eigenvalues.len()));
        }
        line
    }

    /// What is proven about the whole; what is proven about each pair stands beside the eigenvalues.
    fn certificate(&self) -> Value {
        let mut certificate = serde_json::to_value(&self.basis.certificate).unwrap_or_default();
        if let Value::Object(members) = &mut certificate {
            members.remove("residuals");
            members.remove("bounds");
        }
        certificate
    }

    /// A few lines to read.
    pub fn table(&self, job: &JobParameters, arguments: &SolveArguments) -> String {
        let parameters = job.canonical();
        let word = |name: &str| parameters[name].as_str().unwrap_or_default().to_owned();
        let mut text = format!(
            "{}: {} vertices, {} faces\n",
            arguments.input.mesh.display(),
            grouped(self.vertices),
            grouped(self.faces),
        );
        let certificate = &self.basis.certificate;
        let pairs = grouped(self.basis.eigenvalues.len());
        text += &match (self.basis.dimension(), certificate.tolerance) {
            (Some(dimension), None) => format!(
                "{pairs} eigenpairs from a subspace of dimension {} ({}, {}, {})\n\n",
                grouped(dimension),
                word("method"),
                word("construction"),
                word("accuracy"),
            ),
            (_, tolerance) => format!(
                "{pairs} eigenpairs to a tolerance of {:e} ({}, {}{})\n\n",
                tolerance.unwrap_or_default(),
                word("method"),
                word("variant"),
                word("start"),
            ),
        };
        let mut stages = Table::new(&["stage", "seconds"]);
        for (name, seconds) in &self.stages {
            stages.row([(*name).to_owned(), format!("{seconds:.3}")]);
        }
        stages.row(["total".into(), format!("{:.3}", self.total)]);
        text += &format!("{stages}\n");
        if !certificate.levels.is_empty() {
            let mut levels = Table::new(&["level", "dimension", "iterations", "shifts"]);
            for (level, report) in certificate.levels.iter().enumerate() {
                let numbers = [report.dimension, report.iterations, report.shifts].map(grouped);
                let [dimension, iterations, shifts] = numbers;
                levels.row([(level + 1).to_string(), dimension, iterations, shifts]);
            }
            text += &format!("{levels}\n");
        }
        text += &eigenvalue_table(&self.basis.eigenvalues, &certificate.residuals, &certificate.bounds);
        text += match certificate.complete {
            Some(true) => "\ncomplete: inertia counts prove that no eigenvalue was skipped\n",
            Some(false) => "\nNOT complete: inertia counts contradict the pairs, or do not reach the last\n",
            None => "",
        };
        if let Some(largest) = certificate.largest_projection_error {
            text += &format!("compact storage: eigenfunctions are off by {largest:.2e} of their norm at most\n");
        }
        let (stored, dense) = (self.basis.stored_bytes(), self.basis.dense_bytes());
        text += &format!(
            "\n{}, {:.0} % of the {} of a dense basis in double precision\n",
            bytes(stored),
            100.0 * stored as f64 / dense.max(1) as f64,
            bytes(dense)
        );
        if let (Some(path), Some(seconds)) = (&arguments.output, self.write) {
            text += &format!("written to {} in {seconds:.3} s\n", path.display());
        }
        text
    }
}

/// The first eigenvalues with residuals and bounds, and the last one.
pub fn eigenvalue_table(eigenvalues: &[f64], residuals: &[f64], bounds: &[f64]) -> String {
    let mut table = Table::new(&["pair", "eigenvalue", "residual", "bound ±"]);
    let mut listed: Vec<usize> = (0..eigenvalues.len().min(LISTED_PAIRS)).collect();
    if eigenvalues.len() > LISTED_PAIRS {
        listed.push(eigenvalues.len() - 1);
    }
    let cell = |values: &[f64], index: usize| values.get(index).map_or_else(|| "–".into(), |&value| number(value));
    for index in listed {
        table.row([(index + 1).to_string(), cell(eigenvalues, index), cell(residuals, index), cell(bounds, index)]);
    }
    table.to_string()
}

/// The largest resident memory of this process so far, in bytes; absent where the system does not tell.
pub(in crate::cli) fn peak_rss_bytes() -> Option<u64> {
    memory::field(&std::fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_memory_is_told_on_linux() {
        assert!(!cfg!(target_os = "linux") || peak_rss_bytes().is_some_and(|bytes| bytes > 1 << 20));
    }
}
