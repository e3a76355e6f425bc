//! What a worker does about a job that asks to be divided: it makes the plan, or joins the parts, as the records call
//! for.

use chladni_spectral::basis::{EIGENBASIS_PART, ProductKind};
use chladni_work::packed::Packed;
use chladni_work::{Division, JobParameters, MeshSize, abbreviated};

use super::shared::{Ending, Shared};
use super::{MEMORY_EXCEEDED, WorkerOptions};
use crate::store::{JobProblem, JobRecord, NewPart, Store, StoreError, Subject};

/// What is next for a job.
pub(super) enum Next {
    /// To run it, on this.
    Run(Subject),
    /// To end it, for a part that was given up.
    Fail(JobProblem),
    /// To give it back, since one of its parts waits or runs.
    Wait,
}

/// What is next for a job that was claimed, on a mesh or something else.
pub(super) async fn next(shared: &Shared, job: &JobRecord, subject: Subject) -> Result<Next, StoreError> {
    let Subject::Mesh(mesh, solid) = subject else { return Ok(Next::Run(subject)) };
    if !asks(job) {
        return Ok(Next::Run(Subject::Mesh(mesh, solid)));
    }
    let parts = shared.store.parts_of(job.id).await?;
    if let Some(problem) = parts.iter().find_map(|part| part.broken(job.parts as usize)) {
        return Ok(Next::Fail(problem));
    }
    if parts.iter().any(|part| !part.status.is_finished()) {
        return Ok(Next::Wait);
    }
    let made: Vec<_> = parts.iter().filter_map(|part| part.made.clone()).collect();
    if job.parts == 0 || made.len() != job.parts as usize {
        let workers = workers(&shared.store, &shared.options).await? as usize;
        return Ok(Next::Run(Subject::ToDivide { mesh, solid, workers, before: job.parts as usize }));
    }
    // An attempt that failed may have met damage.
    if job.attempt > 1 {
        let mut redone = false;
        for (part, made) in parts.iter().zip(&made) {
            if !shared.store.part_is_whole(made).await? {
                shared.store.redo_part(part.job).await?;
                redone = true;
            }
        }
        if redone {
            return Ok(Next::Wait);
        }
    }
    let parts = shared.store.part_source(made);
    Ok(Next::Run(Subject::Parts { mesh, solid, parts }))
}

/// The size of the mesh that a job is on; of nothing, where it is on something else.
pub(super) fn mesh_size(subject: &Subject) -> MeshSize {
    match subject {
        Subject::Mesh(mesh, solid) | Subject::ToDivide { mesh, solid, .. } | Subject::Parts { mesh, solid, .. } => {
            MeshSize::of_body(mesh, solid.as_deref())
        }
        Subject::Problem(_) | Subject::Collection(_) => MeshSize::default(),
    }
}

/// Whether a job asks to be divided.
fn asks(job: &JobRecord) -> bool {
    job.kind == ProductKind::Eigenbasis.name() && !job.parameters["parts"].is_null()
}

/// How many parts may be solved at once: seats of this process and of the others that are known.
async fn workers(store: &Store, options: &WorkerOptions) -> Result<u64, StoreError> {
    let takes = |kinds: &[String]| {
        let of_parts = |kind: &String| kind == ProductKind::Eigenbasis.name() || kind == EIGENBASIS_PART;
        kinds.is_empty() || kinds.iter().any(of_parts)
    };
    let known = store.workers().await?;
    let seats: u64 = known.iter().filter(|worker| takes(&worker.kinds)).map(|worker| worker.seats).sum();
    // One that is alone, or has begun just now, is not among those that are known.
    Ok(seats.max(if takes(&options.kinds) { options.workers as u64 } else { 0 }))
}

/// What becomes of a job that turned out to need more memory than it was promised. One that was to be divided was
/// promised what it takes to plan and join, and goes to whoever has room for one piece; another gets no more than it
/// asked for.
pub(super) async fn enlarged(shared: &Shared, job: &JobRecord, bytes: u64, detail: String) -> Ending {
    if !asks(job) || bytes <= job.memory_bytes {
        return Ending::Failed(JobProblem { kind: MEMORY_EXCEEDED.to_owned(), detail }, false);
    }
    match refused_everywhere(shared, bytes, "the job has to be done in one piece, which").await {
        Some(problem) => Ending::Failed(problem, false),
        None => Ending::Enlarged(bytes),
    }
}

/// Why nobody who is known takes a job that needs so much.
async fn refused_everywhere(shared: &Shared, bytes: u64, what: &str) -> Option<JobProblem> {
    let mut most = shared.budget.total();
    for kind in [ProductKind::Eigenbasis.name(), EIGENBASIS_PART] {
        if most >= bytes {
            return None;
        }
        match shared.store.most_memory_for(kind, bytes).await {
            Ok(known) => most = most.max(known.unwrap_or(0)),
            // Who there is is not known now; whoever comes will see.
            Err(_) => return None,
        }
    }
    let detail = format!("{what} needs about {bytes} bytes of memory; jobs may use {most}");
    (most < bytes).then(|| JobProblem { kind: "job-too-large".to_owned(), detail })
}

/// The jobs that solve the parts of one.
pub(super) async fn part_jobs(
    shared: &Shared,
    job: &JobRecord,
    size: MeshSize,
    division: Division,
) -> Result<Vec<NewPart>, JobProblem> {
    let Division { parts, memory_bytes } = division;
    let unread = |error: chladni_work::ParameterError| JobProblem {
        kind: "invalid-parameters".to_owned(),
        detail: error.to_string(),
    };
    let parameters = JobParameters::read(&job.kind, &Packed::from(&job.parameters)).map_err(unread)?;
    // Whoever made the plan has seen the mesh; what it says is not trusted beyond what any mesh takes.
    let memory_bytes = memory_bytes.min(parameters.part_memory_bytes(size, parts));
    // They would wait for ever.
    if let Some(problem) = refused_everywhere(shared, memory_bytes, &format!("each of {parts} parts")).await {
        return Err(problem);
    }
    let new = |part: chladni_work::PartJob| {
        let canonical = part.canonical();
        let brief = abbreviated(&canonical);
        NewPart {
            brief: (brief != canonical).then_some(brief),
            work_key: part.work_key(&job.mesh, &job.solver_version),
            parameters: canonical,
            memory_bytes,
        }
    };
    Ok(parameters.part_jobs(parts).map(new).collect())
}
