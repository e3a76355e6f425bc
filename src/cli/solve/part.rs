//! `solve --part`: one part of a problem, for `join` to put together with the others.

use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use chladni_spectral::basis::Part;
use chladni_spectral::formats::npz;
use chladni_work::{MadePart, SOLVER_VERSION};
use serde_json::{Map, json};

use crate::cli::asked::Asked;
use crate::cli::work::{OutputFile, Prepared, WorkArguments, peak_rss_bytes};
use crate::cli::{CliError, StageBars, grouped};

/// Which part of how many, counted from 1 as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WhichPart {
    number: usize,
    parts: NonZeroUsize,
}

/// Reads `K/N`.
pub fn parse_part(text: &str) -> Result<WhichPart, String> {
    let words = "expected K/N, part K of N, such as 2/4";
    let (number, parts) = text.split_once('/').ok_or(words)?;
    let number: usize = number.trim().parse().map_err(|_| words)?;
    let parts: NonZeroUsize = parts.trim().parse().map_err(|_| words)?;
    if !(1..=parts.get()).contains(&number) {
        return Err(format!("there is no part {number} of {parts}; parts are counted from 1"));
    }
    Ok(WhichPart { number, parts })
}

/// Solves a part and writes it.
pub fn solve(job: &Asked, which: WhichPart, work: &WorkArguments) -> Result<ExitCode, CliError> {
    let WhichPart { number, parts } = which;
    let path = work.output.as_deref().filter(|path| path.extension().is_some_and(|ending| ending == "npz"));
    let path =
        path.ok_or_else(|| CliError::Usage("--part needs --output FILE.npz, which the command join reads".to_owned()))?;
    let pool = work.pool()?;
    let file = OutputFile::probe(path)?;
    let bars = StageBars::new(work.json || work.quiet);
    let began = Instant::now();
    bars.begin("read");
    let Prepared { mesh, solid, job: kept, size, .. } = work.prepare(job, &pool)?;
    let read = ("read", began.elapsed().as_secs_f64());
    let exact = || Ok(pool.install(|| kept.part_memory_bytes_on(&mesh, solid.as_ref(), parts, &bars))?);
    let memory_estimate = work.refuse_memory_by(kept.part_memory_bytes(size, parts), exact)?;
    let made = pool.install(|| kept.solve_part(&mesh, solid.as_ref(), (number - 1, parts), &bars))?;
    let total = began.elapsed().as_secs_f64();
    bars.finish();
    let MadePart { part, seconds } = made;
    // As it was given: whoever joins the parts reads the mesh anew.
    let about =
        json!({"kind": job.kind(), "parameters": job.canonical(), "vertices": size.vertices, "faces": size.faces});
    let began = Instant::now();
    file.write(|out| npz::write_part(&part, &about, out))?;
    let write = began.elapsed().as_secs_f64();
    let text = if work.json {
        let stages = std::iter::once(read).chain(seconds).map(|(stage, seconds)| (stage.to_owned(), json!(seconds)));
        let line = json!({
            "part": number,
            "parts": parts,
            "pairs": pairs(&part),
            "given_up": part.slices.as_ref().err(),
            "slices": part.slices.as_ref().map_or(0, Vec::len),
            "unknowns": part.share.as_ref().map(|share| share.rows.len()),
            "seconds": {"total": total, "stages": stages.collect::<Map<_, _>>(), "write": write},
            "threads": pool.current_num_threads(),
            "solver_version": SOLVER_VERSION,
            "peak_rss_bytes": peak_rss_bytes(),
            "memory_estimate_bytes": memory_estimate,
        });
        format!("{line}\n")
    } else {
        table(&part, (number, parts), path, total)
    };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

/// The pairs of a part, those that it shares with its neighbours included, or those beyond the wanted ones.
fn pairs(part: &Part) -> usize {
    if let Some(share) = &part.share {
        return share.values.len();
    }
    part.slices.iter().flatten().map(|slice| slice.values.len()).sum()
}

fn table(part: &Part, (number, parts): (usize, NonZeroUsize), path: &Path, total: f64) -> String {
    let of = format!("part {number} of {parts}");
    let what = match (&part.share, &part.slices) {
        (Some(share), _) => {
            let (rows, pairs) = (grouped(share.rows.len()), grouped(share.values.len()));
            format!("{of}: {rows} of {} unknowns, {pairs} pairs", grouped(part.plan.problem.unknowns))
        }
        (None, Ok(slices)) => {
            let from = slices.first().map_or(0, |slice| slice.from);
            format!("{of}: {} pairs above the kernel, from number {} on", grouped(pairs(part)), grouped(from + 1))
        }
        (None, Err(reason)) => format!("{of} was given up, and join will solve the whole: {reason}"),
    };
    format!(
        "{what}, {total:.3} s\nwritten to {}; when all parts are there: chladni join MESH PART.npz …\n",
        path.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_one_of_so_many() {
        let four = NonZeroUsize::new(4).unwrap();
        assert_eq!(parse_part("2/4"), Ok(WhichPart { number: 2, parts: four }));
        for text in ["", "2", "2/", "/4", "0/4", "5/4", "1/0", "-1/4", "1.5/4", "1/4/2"] {
            assert!(parse_part(text).is_err(), "{text}");
        }
    }
}
