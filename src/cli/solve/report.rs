//! What a solve tells: one object, or a few lines to read.

use std::ops::Range;
use std::sync::Arc;

use chladni_spectral::basis::{Basis, Certificate, CutCluster, Interval, Product};
use chladni_work::{JobParameters, SOLVER_VERSION, abbreviate};
use serde_json::{Value, json};

use crate::cli::work::{Finished, WorkArguments};
use crate::cli::{Table, bytes, grouped, number};

/// Rows of the printed table of eigenvalues.
const LISTED_PAIRS: usize = 12;

/// An eigenbasis with what its run measured.
pub struct Run {
    /// That of `finished`: a copy of the basis of a large mesh would take as much memory as all the work.
    basis: Arc<Basis>,
    finished: Finished,
}

impl Run {
    /// What a run made; `None` where that is no eigenbasis.
    pub fn of(finished: Finished) -> Option<Self> {
        let Product::Eigenbasis(basis) = &finished.product else { return None };
        let basis = Arc::clone(basis);
        Some(Self { basis, finished })
    }

    /// One object with what was computed and what it cost.
    pub fn json(&self, job: &JobParameters) -> Value {
        let Finished { mesh, total, write, threads, peak_rss, .. } = &self.finished;
        let mut line = json!({
            "vertices": mesh.positions.len(),
            "faces": mesh.faces.len(),
            "subspace": self.basis.certificate.accuracy.map(|accuracy| accuracy.dimension).or(self.basis.dimension()),
            "seconds": {"total": total, "stages": self.finished.stage_seconds(), "write": write},
            "threads": threads,
            "solver_version": SOLVER_VERSION,
            "peak_rss_bytes": peak_rss,
            "eigenvalues": self.basis.eigenvalues,
            "residuals": self.basis.certificate.residuals,
            "bounds": self.basis.certificate.bounds,
            "estimates": self.basis.certificate.estimates,
            "orthonormality_defect": self.basis.certificate.orthonormality_defect,
            "iterations": self.basis.certificate.levels.iter().map(|level| level.iterations).collect::<Vec<_>>(),
            "certificate": self.certificate(),
            "operator_report": self.basis.metadata.json()["operator"],
            "method_used": self.basis.metadata.method(),
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
            members.remove("estimates");
        }
        certificate
    }

    /// A few lines to read.
    pub fn table(&self, job: &JobParameters, arguments: &WorkArguments) -> String {
        let parameters = job.canonical();
        let mut text = format!(
            "{}: {} vertices, {} faces\n",
            arguments.input.mesh.display(),
            grouped(self.finished.mesh.positions.len()),
            grouped(self.finished.mesh.faces.len()),
        );
        let certificate = &self.basis.certificate;
        let pairs = grouped(self.basis.eigenvalues.len());
        // Eigenfields have no name of a method of their own.
        let method = self.basis.metadata.method();
        // Each method has some of these parameters.
        let words = ["construction", "variant", "start"].into_iter().map(|name| parameters[name].as_str());
        let details: Vec<&str> = [method].into_iter().chain(words).flatten().collect();
        let details = details.join(", ");
        text += &match (certificate.tolerance, certificate.accuracy) {
            (Some(tolerance), _) => format!("{pairs} eigenpairs to a tolerance of {tolerance:e} ({details})\n\n"),
            (None, Some(accuracy)) => format!(
                "{pairs} eigenpairs from a subspace of dimension {} ({details})\n\n",
                grouped(accuracy.dimension)
            ),
            (None, None) => format!("{pairs} eigenpairs ({details})\n\n"),
        };
        let mut stages = Table::new(&["stage", "seconds"]);
        for (name, seconds) in &self.finished.stages {
            stages.row([(*name).to_owned(), format!("{seconds:.3}")]);
        }
        stages.row(["total".into(), format!("{:.3}", self.finished.total)]);
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
        let Certificate { residuals, estimates, bounds, .. } = certificate;
        text += &eigenvalue_table(&self.basis.eigenvalues, residuals, estimates, bounds);
        if let Ok(flat @ 1..) = self.basis.metadata.flat_tetrahedra() {
            text += &format!(
                "\ntetrahedra that are flat but for rounding, and left out: {flat}; all values are those of the others\n"
            );
        }
        if let Some(accuracy) = certificate.accuracy {
            text += &format!(
                "\nestimated error: {:.2} % at most; the goal is {} %{}\n",
                100.0 * accuracy.largest_estimate,
                (1e6 * accuracy.goal).round() / 1e4,
                match (accuracy.reached, accuracy.rounds) {
                    (true, 0) => String::new(),
                    (true, 1) => ", reached after the space was made finer once".to_owned(),
                    (true, rounds) => format!(", reached after the space was made finer {rounds} times"),
                    (false, _) => ". NOT REACHED: take --method hsim, or a larger --dimension".to_owned(),
                }
            );
        }
        if let Some(interval) = &certificate.interval {
            text += &interval_of(certificate.first, interval);
        }
        if let Some(cut) = certificate.cut {
            text += &cut_of(cut, certificate.first..certificate.first + self.basis.eigenvalues.len());
        }
        text += match certificate.complete {
            Some(true) if certificate.accuracy.is_some() => {
                "\ncertified: an inertia count and the bounds enclose the eigenvalue of each index\n"
            }
            Some(true) => "\ncomplete: inertia counts prove that no eigenvalue was skipped\n",
            Some(false) => "\nNOT complete: inertia counts contradict the pairs, or do not reach the last\n",
            None => "",
        };
        if let Some(largest) = certificate.largest_projection_error {
            text += &format!("compact storage: eigenfunctions are off by {largest:.2e} of their norm at most\n");
        }
        let (stored, dense) = (self.basis.stored_bytes(), self.basis.dense_bytes());
        text += &format!("\n{}\n", storage(stored, dense));
        if let (Some(path), Some(seconds)) = (&arguments.output, self.finished.write) {
            text += &format!("written to {} in {seconds:.3} s\n", path.display());
        }
        text
    }
}

/// What a basis takes, and how that compares to all its numbers in double precision where it is less.
pub fn storage(stored: u64, dense: u64) -> String {
    if stored >= dense {
        return format!("{} stored", bytes(stored));
    }
    let share = 100.0 * stored as f64 / dense as f64;
    format!("{} stored, {share:.0} % of the {} of a dense basis in double precision", bytes(stored), bytes(dense))
}

/// Which eigenvalues an interval holds, and which lie on a bound of it.
pub fn interval_of(first: usize, interval: &Interval) -> String {
    let Interval { from, to, on_bounds } = interval;
    let mut text = match from {
        Some(from) => format!("\nrequested: from {from}, below {to}\n"),
        None => format!("\nrequested: below {to}\n"),
    };
    if first > 0 {
        text += &format!("the first of these has the index {first} among all, from 0\n");
    }
    for pair in on_bounds {
        let side = if pair.below { "below" } else { "not below" };
        let (index, value, within, bound) = (pair.index, pair.value, number(pair.within), pair.bound);
        text += &format!(
            "eigenvalue {index} is {value}, within {within} of which the bound {bound} lies: it counts as {side} it\n"
        );
    }
    text
}

/// That the last pairs are some of a cluster, in words; pairs of these indices are delivered.
pub fn cut_of(cut: CutCluster, delivered: Range<usize>) -> String {
    let first = cut.first.max(delivered.start);
    let (of, from) = (grouped(cut.end - cut.first), grouped(first + 1));
    let here = grouped(delivered.end.saturating_sub(first));
    format!(
        "\nthe count cuts a cluster of up to {of} eigenvalues: {here} of them are delivered, from pair {from} on, and their eigenfunctions are one choice among many\n"
    )
}

/// The first eigenvalues and the last, with what is known of their errors in percent: estimates and bounds where there
/// are estimates, residuals and bounds elsewhere.
pub fn eigenvalue_table(eigenvalues: &[f64], residuals: &[f64], estimates: &[f64], bounds: &[f64]) -> String {
    let estimated = !estimates.is_empty();
    let mut table = Table::new(&["pair", "eigenvalue", if estimated { "error, est." } else { "residual" }, "bound"]);
    let mut listed: Vec<usize> = (0..eigenvalues.len().min(LISTED_PAIRS)).collect();
    if eigenvalues.len() > LISTED_PAIRS {
        listed.push(eigenvalues.len() - 1);
    }
    // What counts as zero has no relative error. Deep wells of a potential say nothing of what is zero above them.
    let largest = eigenvalues.iter().fold(0.0, |most: f64, &value| most.max(value));
    let kernel = 1e-6 * if largest > 0.0 { largest } else { eigenvalues.first().map_or(0.0, |value| value.abs()) };
    let percent = |values: &[f64], index: usize| match values.get(index) {
        None => "–".to_owned(),
        Some(_) if eigenvalues[index].abs() <= kernel => "kernel".to_owned(),
        Some(value) => {
            let share = 100.0 * value / eigenvalues[index].abs();
            if share >= 0.01 { format!("{share:.2} %") } else { format!("{share:.0e} %") }
        }
    };
    for index in listed {
        let second = if estimated {
            percent(estimates, index)
        } else {
            residuals.get(index).map_or_else(|| "–".into(), |&value| number(value))
        };
        table.row([(index + 1).to_string(), number(eigenvalues[index]), second, percent(bounds, index)]);
    }
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_spectral::basis::OnBound;

    #[test]
    fn errors_are_told_in_percent_and_nothing_larger_than_dense_is_praised() {
        let table = eigenvalue_table(&[1e-14, 2.0], &[0.0, 0.5], &[0.0, 0.01], &[0.0, 0.1]);
        assert!(table.contains("0.50 %") && table.contains("5.00 %") && table.contains("kernel"), "{table}");
        let table = eigenvalue_table(&[1e-14, 2.0], &[0.0, 0.5], &[], &[0.0, 0.1]);
        assert!(table.contains("residual") && table.contains("5.00 %"), "{table}");
        let on = OnBound { index: 4, value: 2.5, within: 1e-12, bound: 2.5, below: false };
        let interval = Interval { from: Some(1.0), to: 2.5, on_bounds: vec![on] };
        let text = interval_of(3, &interval);
        assert!(text.contains("from 1, below 2.5") && text.contains("index 3 among all"), "{text}");
        assert!(text.contains("eigenvalue 4 is 2.5") && text.contains("not below"), "{text}");
        let text = cut_of(CutCluster { first: 8, end: 32 }, 0..14);
        assert!(text.contains("up to 24 eigenvalues: 6 of them are delivered, from pair 9 on"), "{text}");
        let text = cut_of(CutCluster { first: 8, end: 32 }, 10..17);
        assert!(text.contains("up to 24 eigenvalues: 7 of them are delivered, from pair 11 on"), "{text}");
        assert_eq!(storage(2000, 1000), "2.0 kB stored");
        assert!(storage(500, 1000).contains("50 % of the 1.0 kB"));
    }
}
