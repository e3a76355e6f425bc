//! What the store promises of jobs in parts.

use chladni_algebra::PanelMatrix;
use chladni_base::SplitMix64;
use chladni_spectral::basis::{EIGENBASIS_PART, Fingerprint, Part, PartCount, PartPlan, PartSlice, StoredPart};

use super::*;

/// What a part of so many makes.
fn made(number: usize, parts: usize) -> StoredPart {
    let slice = PartSlice {
        from: number,
        values: vec![1.0],
        vectors: PanelMatrix::zeros(3, 1),
        count: PartCount { shift: 1.5, below: number + 1, radius: 0.0 },
    };
    let problem = Fingerprint { unknowns: 3, entries: 7, products: [1.0; 6] };
    let version = "1".to_owned();
    let plan =
        PartPlan { version, problem, parts, slices: 1, pairs: 8, kernel: 1, tolerance: 1e-6, seed: 0, columns: None };
    StoredPart::new(&Part { plan, number, slices: Ok(vec![slice]), share: None }, json!({"part": number + 1})).unwrap()
}

fn new_parts(work: &str, count: usize) -> Vec<NewPart> {
    let new = |number: usize| NewPart {
        parameters: json!({"part": number + 1, "of": count, "parameters": {"count": 4}}),
        brief: None,
        work_key: format!("{work}: part {number} of {count}"),
        memory_bytes: 10 + number as u64,
    };
    (0..count).map(new).collect()
}

/// Claims the next job, which is this one, and divides it.
async fn divided(store: &Store, job: Uuid, work: &str, count: usize) -> JobRecord {
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!(claim.job.id, job);
    match store.divide(claim.token, new_parts(work, count)).await.unwrap() {
        DivideAnswer::Divided(job) => *job,
        other => panic!("{other:?}"),
    }
}

/// Claims the next job, which is a part, and completes it.
async fn solve_one(store: &Store) -> Uuid {
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert!(claim.job.is_part());
    let number = claim.job.parameters["part"].as_u64().unwrap() as usize - 1;
    let answer = store.complete(claim.token, made(number, 4), vec![]).await.unwrap();
    assert!(matches!(answer, CompleteAnswer::Stored(_)));
    claim.job.id
}

/// Jobs that are parts, and rows that say of which.
async fn parts_left(store: &Store) -> (i64, i64) {
    let jobs = sql::query_scalar("SELECT COUNT(*) FROM jobs WHERE kind = ?").bind(EIGENBASIS_PART);
    let rows = sql::query_scalar("SELECT COUNT(*) FROM job_parts");
    let reader = || store.inner.catalog.reader();
    (jobs.fetch_one(reader()).await.unwrap(), rows.fetch_one(reader()).await.unwrap())
}

async fn progress(store: &Store, id: Uuid) -> (JobStatus, Option<f64>, Option<String>, u32) {
    let job = store.job(id).await.unwrap();
    (job.status, job.progress, job.detail, job.parts_done)
}

#[tokio::test]
pub(super) async fn a_job_waits_for_its_parts_without_a_worker() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let content = store.pieces_of_content().await;
    let job = store.enqueue(NewJob { priority: 3, ..new_job(&mesh, "a") }).await.unwrap().record.id;
    let waits = divided(&store, job, "a", 3).await;
    assert_eq!((waits.status, waits.attempt, waits.parts, waits.parts_done), (JobStatus::Enqueued, 0, 3, 0));
    assert_eq!((waits.stage.as_deref(), waits.detail.as_deref()), (Some("parts"), Some("0 of 3 parts done")));
    let parts = store.parts_of(job).await.unwrap();
    assert_eq!(parts.iter().map(|part| part.place).collect::<Vec<_>>(), [1, 2, 3]);
    let second = store.job(parts[1].job).await.unwrap();
    assert_eq!((second.kind.as_str(), second.parent, &second.mesh), (EIGENBASIS_PART, Some(job), &mesh));
    assert_eq!((second.priority, second.max_attempts, second.memory_bytes), (3, 3, 11));
    // One worker does everything: the job is passed over as long as a part waits or runs.
    let mut events = store.watch_jobs();
    for done in 1..=3 {
        assert_eq!(solve_one(&store).await, parts[done - 1].job);
        store.maintain_parts().await.unwrap();
        let words = format!("{done} of 3 parts done");
        let expected = (JobStatus::Enqueued, Some(done as f64 / 3.0), Some(words), done as u32);
        assert_eq!(progress(&store, job).await, expected);
        // Nothing more to tell.
        let revision = store.job(job).await.unwrap().revision;
        store.maintain_parts().await.unwrap();
        assert_eq!(store.job(job).await.unwrap().revision, revision);
    }
    let mut heard = 0;
    while let Ok(event) = events.try_recv() {
        heard += usize::from(event.job == job);
    }
    assert_eq!(heard, 3);
    let claim = store.claim("w", &["eigenbasis".to_owned()], LEASE).await.unwrap().unwrap();
    assert_eq!((claim.job.id, claim.job.attempt, claim.job.parts_done), (job, 1, 3));
    let parts: Vec<MadePart> = store.parts_of(job).await.unwrap().into_iter().filter_map(|part| part.made).collect();
    let source = store.part_source(parts);
    let read = tokio::task::spawn_blocking(move || {
        let mut bytes = Vec::new();
        source.copy(2, &mut bytes).unwrap();
        assert!(source.copy(3, &mut Vec::new()).is_err());
        (source.count(), bytes)
    });
    assert_eq!(read.await.unwrap(), (3, made(2, 4).content().to_vec()));
    assert!(matches!(store.complete(claim.token, basis(1.0, 40), vec![]).await.unwrap(), CompleteAnswer::Stored(_)));
    store.maintain_parts().await.unwrap();
    assert_eq!(parts_left(&store).await, (0, 0));
    assert_eq!(store.pieces_of_content().await, content + 1);
    let ended = store.job(job).await.unwrap();
    assert_eq!((ended.status, ended.parts, ended.parts_done), (JobStatus::Succeeded, 3, 3));
}

#[tokio::test]
pub(super) async fn equal_parts_are_solved_once_and_stay_while_a_job_needs_them() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let one = store.enqueue(new_job(&mesh, "one")).await.unwrap().record.id;
    divided(&store, one, "same", 2).await;
    solve_one(&store).await;
    let two = store.enqueue(NewJob { priority: 5, ..new_job(&mesh, "two") }).await.unwrap().record.id;
    divided(&store, two, "same", 2).await;
    assert_eq!(parts_left(&store).await, (2, 4));
    let (of_one, of_two) = (store.parts_of(one).await.unwrap(), store.parts_of(two).await.unwrap());
    assert_eq!(of_one, of_two);
    // Whoever is in more of a hurry moves the part that both wait for.
    assert_eq!(store.job(of_one[1].job).await.unwrap().priority, 5);
    store.maintain_parts().await.unwrap();
    assert_eq!(progress(&store, two).await.3, 1);
    store.cancel_job(two).await.unwrap();
    store.maintain_parts().await.unwrap();
    assert_eq!(parts_left(&store).await, (2, 2));
    let running = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!(running.job.id, of_one[1].job);
    store.cancel_job(one).await.unwrap();
    store.maintain_parts().await.unwrap();
    // The one that is done is gone, the other is asked to stop.
    assert_eq!(parts_left(&store).await, (1, 0));
    let answer = store.heartbeat(running.token, None, LEASE).await.unwrap();
    assert_eq!(answer, HeartbeatAnswer::Held { cancel_requested: true });
    assert_eq!(store.complete(running.token, made(1, 2), vec![]).await.unwrap(), CompleteAnswer::Canceled);
    store.maintain_parts().await.unwrap();
    assert_eq!(parts_left(&store).await, (0, 0));
}

#[tokio::test]
pub(super) async fn a_part_that_is_given_up_ends_its_job_and_a_retry_finds_the_others() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&mesh, "a")).await.unwrap().record.id;
    divided(&store, job, "a", 4).await;
    let first = solve_one(&store).await;
    let second = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    let third = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!(store.fail(second.token, &problem(), false).await.unwrap(), FailAnswer::Finished(JobStatus::Failed));
    let ended = store.maintain_parts().await.unwrap();
    assert_eq!(ended.iter().map(|ended| ended.id).collect::<Vec<_>>(), [job]);
    let failed = store.job(job).await.unwrap();
    let reason = JobProblem { kind: "trouble".to_owned(), detail: "part 2 of 4: something broke".to_owned() };
    assert_eq!((failed.status, failed.problem), (JobStatus::Failed, Some(reason)));
    // The others are of no use as long as nobody asks again; what is done is kept.
    assert_eq!(store.claim("w", &[], LEASE).await.unwrap(), None);
    assert!(store.job(third.job.id).await.unwrap().cancel_requested);
    assert!(store.finish_canceled(third.token).await.unwrap());
    store.maintain_parts().await.unwrap();
    let again = store.retry_job(job).await.unwrap();
    assert_eq!((again.status, again.parts), (JobStatus::Enqueued, 4));
    store.maintain_parts().await.unwrap();
    divided(&store, job, "a", 4).await;
    let parts = store.parts_of(job).await.unwrap();
    assert_eq!(parts[0].job, first);
    assert!(parts[0].made.is_some() && parts[1].job != second.job.id);
    for _ in 0..3 {
        solve_one(&store).await;
    }
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!((claim.job.id, claim.job.parts_done), (job, 4));
    // An attempt at the join that fails leaves the parts to the next.
    store.fail(claim.token, &problem(), false).await.unwrap();
    store.maintain_parts().await.unwrap();
    store.retry_job(job).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!((claim.job.id, claim.job.parts_done), (job, 4));
}

#[tokio::test]
pub(super) async fn parts_go_with_their_job_and_what_they_made_with_them() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000_000));
    let timed = StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) };
    let store = Store::open(timed).await.unwrap();
    let mesh_id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let content = store.pieces_of_content().await;
    // Failed, and not retried within an hour; cancelled; deleted.
    let mut jobs = Vec::new();
    for work in ["failed", "canceled", "deleted"] {
        let job = store.enqueue(new_job(&mesh_id, work)).await.unwrap().record.id;
        divided(&store, job, work, 2).await;
        solve_one(&store).await;
        if work == "failed" {
            let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
            store.fail(claim.token, &problem(), false).await.unwrap();
            store.maintain_parts().await.unwrap();
        } else {
            solve_one(&store).await;
            store.cancel_job(job).await.unwrap();
        }
        jobs.push(job);
    }
    store.delete_job(jobs[2], false).await.unwrap();
    // Equal content is kept once.
    assert_eq!(store.pieces_of_content().await, content + 2);
    store.maintain_parts().await.unwrap();
    assert_eq!(parts_left(&store).await, (2, 2));
    assert_eq!(store.pieces_of_content().await, content + 1);
    // A mesh goes without being asked to take them along.
    assert!(matches!(store.retain(&Retention { bases: Some(0), ..Retention::default() }).await.unwrap().bases, 0));
    hands.fetch_add(3601 * 1000, Ordering::Relaxed);
    store.maintain_parts().await.unwrap();
    assert_eq!(parts_left(&store).await, (0, 0));
    assert_eq!(store.pieces_of_content().await, content);
    // With their mesh.
    let job = store.enqueue(new_job(&mesh_id, "mesh")).await.unwrap().record.id;
    divided(&store, job, "mesh", 2).await;
    solve_one(&store).await;
    store.delete_mesh(&mesh_id, true).await.unwrap();
    store.maintain_parts().await.unwrap();
    assert_eq!((parts_left(&store).await, store.job(job).await.unwrap().status), ((0, 0), JobStatus::Canceled));
    assert_eq!(store.pieces_of_content().await, 0);
}

#[tokio::test]
pub(super) async fn parts_are_shown_where_they_are_asked_for_and_go_with_their_job_alone() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&mesh, "a")).await.unwrap().record.id;
    divided(&store, job, "a", 3).await;
    let part = solve_one(&store).await;
    let page = PageRequest::default();
    let shown = async |filter: JobFilter| -> Vec<Uuid> {
        store.jobs(&filter, &page).await.unwrap().items.iter().map(|job| job.id).collect()
    };
    assert_eq!(shown(JobFilter::default()).await, [job]);
    assert_eq!(shown(JobFilter { mesh: Some(mesh.clone()), ..JobFilter::default() }).await, [job]);
    let of_job = JobFilter { parent: Some(job), ..JobFilter::default() };
    assert_eq!(shown(of_job.clone()).await.len(), 3);
    assert_eq!(shown(JobFilter { status: Some(JobStatus::Succeeded), ..of_job }).await, [part]);
    let by_kind = JobFilter { kind: Some(EIGENBASIS_PART.to_owned()), ..JobFilter::default() };
    assert_eq!(shown(by_kind).await.len(), 3);
    assert_eq!(store.bases(&BasisFilter::default(), &page).await.unwrap().items, []);
    let basis = store.job(part).await.unwrap().basis.unwrap();
    assert!(matches!(store.basis(basis).await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.load_product(basis).await, Err(StoreError::NotFound { .. })));
    let words = format!("it is a part of job {job}, and goes with it");
    let waiting = store.parts_of(job).await.unwrap()[2].job;
    for refused in [
        store.cancel_job(part).await.map(drop),
        store.cancel_job(waiting).await.map(drop),
        store.retry_job(part).await.map(drop),
        store.delete_job(part, true).await,
    ] {
        assert!(matches!(&refused, Err(StoreError::JobState { reason, .. }) if *reason == words), "{refused:?}");
    }
    let counts = store.job_counts().await.unwrap();
    assert!(counts.contains(&(EIGENBASIS_PART.to_owned(), JobStatus::Enqueued, 2)), "{counts:?}");
    // A worker of eigenbases takes their parts, another does not; and who waits for parts waits for no worker.
    assert_eq!(store.claim("w", &["field_basis".to_owned()], LEASE).await.unwrap(), None);
    for _ in 0..2 {
        let claim = store.claim("w", &["eigenbasis".to_owned()], LEASE).await.unwrap().unwrap();
        assert!(claim.job.is_part());
    }
    assert_eq!(store.oldest_waiting_ms().await.unwrap(), None);
}

#[tokio::test]
pub(super) async fn who_has_lost_a_job_does_not_divide_it() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&mesh, "a")).await.unwrap().record.id;
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert!(store.release(claim.token).await.unwrap());
    assert_eq!(store.divide(claim.token, new_parts("a", 2)).await.unwrap(), DivideAnswer::Lost);
    assert_eq!(parts_left(&store).await, (0, 0));
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    store.cancel_job(job).await.unwrap();
    assert_eq!(store.divide(claim.token, new_parts("a", 2)).await.unwrap(), DivideAnswer::Canceled);
    assert_eq!((parts_left(&store).await, store.job(job).await.unwrap().status), ((0, 0), JobStatus::Canceled));
    store.retry_job(job).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert!(matches!(store.divide(claim.token, new_parts("a", 2)).await.unwrap(), DivideAnswer::Divided(_)));
    assert_eq!(store.divide(claim.token, new_parts("a", 2)).await.unwrap(), DivideAnswer::Lost);
    assert_eq!(parts_left(&store).await, (2, 2));
}

/// Everything that clients and workers may do, in any order, with jobs of which two have the same parts. However it
/// goes, jobs end once workers do their work, and nothing of their parts is left.
#[tokio::test]
pub(super) async fn any_walk_with_parts_ends_and_leaves_nothing_behind() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let content = store.pieces_of_content().await;
    let mut random = SplitMix64::new(7);
    let mut below = |bound: u64| random.next_u64() % bound;
    let works = ["a", "b", "b'"];
    for _ in 0..6 {
        let (mut jobs, mut leases) = (Vec::new(), Vec::new());
        for _ in 0..40 {
            match below(9) {
                0 => {
                    let work = works[below(3) as usize];
                    let job = store.enqueue(new_job(&mesh, work)).await.unwrap().record.id;
                    jobs.push(job);
                }
                1..4 => leases.extend(store.claim("w", &[], LEASE).await.unwrap()),
                4 => store.maintain_parts().await.map(drop).unwrap(),
                5 if !jobs.is_empty() => {
                    let job = jobs[below(jobs.len() as u64) as usize];
                    let _may_be_refused = match below(3) {
                        0 => store.cancel_job(job).await.map(drop),
                        1 => store.retry_job(job).await.map(drop),
                        _ => store.delete_job(job, true).await,
                    };
                }
                6 if !leases.is_empty() => {
                    let claim: Claim = leases.swap_remove(below(leases.len() as u64) as usize);
                    let _may_be_lost = store.fail(claim.token, &problem(), below(4) > 0).await.unwrap();
                }
                _ if !leases.is_empty() => work_on(&store, leases.swap_remove(0)).await,
                _ => {}
            }
        }
        // Whoever still holds a lease gives it back; then one worker does all that there is to do.
        for claim in leases {
            store.release(claim.token).await.unwrap();
        }
        for turn in 0.. {
            store.maintain_parts().await.unwrap();
            let Some(claim) = claim_whenever(&store).await else { break };
            work_on(&store, claim).await;
            assert!(turn < 100);
        }
        for job in jobs {
            let Ok(record) = store.job(job).await else { continue };
            assert!(record.status.is_finished(), "{record:?}");
            let _deleted_before = store.delete_job(job, true).await;
        }
        store.maintain_parts().await.unwrap();
        assert_eq!(parts_left(&store).await, (0, 0));
        assert_eq!(store.pieces_of_content().await, content);
    }
}

/// Claims the next job, however long it would pause after a failed attempt.
async fn claim_whenever(store: &Store) -> Option<Claim> {
    let text = "UPDATE jobs SET not_before_ms = 0 WHERE status = 'enqueued'";
    let mut transaction = store.inner.catalog.write().await.unwrap();
    sql::query(text).execute(transaction.on()).await.unwrap();
    transaction.commit().await.unwrap();
    store.claim("w", &[], LEASE).await.unwrap()
}

/// Does what a worker would.
async fn work_on(store: &Store, claim: Claim) {
    let Claim { job, token, .. } = claim;
    let (seconds, answer) = (Vec::new(), "the lease may be lost, and the job cancelled");
    if job.is_part() {
        let number = job.parameters["part"].as_u64().unwrap() as usize;
        store.complete(token, made(number, 9), seconds).await.expect(answer);
        return;
    }
    let parts = store.parts_of(job.id).await.unwrap();
    if let Some(problem) = parts.iter().find_map(|part| part.broken(parts.len())) {
        store.fail(token, &problem, false).await.unwrap();
    } else if job.parts > 0 && parts.iter().filter(|part| part.made.is_some()).count() == job.parts as usize {
        store.complete(token, basis(job.parts as f64, 40), seconds).await.expect(answer);
    } else {
        let work = job.work_key.trim_end_matches('\'');
        let count = if work == "a" { 2 } else { 3 };
        store.divide(token, new_parts(work, count)).await.unwrap();
    }
}
