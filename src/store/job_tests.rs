//! What the store promises of jobs, and of the leases on them.

use super::*;

#[tokio::test]
pub(super) async fn the_bases_of_a_job_stay_until_it_has_ended() {
    let (store, _folder) = store().await;
    let mut shapes = Vec::new();
    for seed in 0..2 {
        let mesh = store.add_mesh(mesh(seed, 30)).await.unwrap().record.id;
        let job = store.enqueue(new_job(&mesh, &format!("own {seed}"))).await.unwrap().record.id;
        let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
        let CompleteAnswer::Stored(basis) = store.complete(claim.token, basis(1.0, 30), Vec::new()).await.unwrap()
        else {
            panic!()
        };
        shapes.push((mesh, basis, job));
    }
    let [first, second] = &shapes[..] else { panic!() };
    let bases = vec![second.1, first.1];
    let collected = |work: &str| NewJob { bases: bases.clone(), ..new_job(&second.0, work) };
    let unknown = NewJob { bases: vec![second.1, Uuid::nil()], ..new_job(&second.0, "none") };
    let refused = store.enqueue(unknown).await.unwrap_err();
    assert!(matches!(&refused, StoreError::NotFound { resource: "basis", .. }), "{refused}");
    let job = store.enqueue(collected("maps")).await.unwrap().record;
    assert_eq!(job.bases, bases);
    assert_eq!(store.enqueue(collected("maps")).await.unwrap().outcome, EnqueueOutcome::SameWork);
    let in_use = |result: Result<(), StoreError>| match result {
        Err(StoreError::BasisInUse { basis, job }) => (basis, job),
        other => panic!("{other:?}"),
    };
    let everything = Retention {
        basis_age: Some(Duration::ZERO),
        bases: Some(0),
        mesh_age: Some(Duration::ZERO),
        meshes: Some(0),
        bytes: Some(0),
        ..Retention::default()
    };
    let mut token = None;
    // Waiting, and running.
    for _ in 0..2 {
        assert_eq!(in_use(store.delete_basis(first.1).await), (first.1, job.id));
        assert_eq!(in_use(store.delete_job(first.2, true).await), (first.1, job.id));
        match store.delete_mesh(&first.0, false).await {
            Err(StoreError::MeshInUse { unfinished_jobs: 1, bases: 1, job: Some(own), .. }) if own == job.id => {}
            other => panic!("{other:?}"),
        }
        assert_eq!(store.retain(&everything).await.unwrap(), Removed::default());
        if let Some(claim) = store.claim("w", &[], LEASE).await.unwrap() {
            assert_eq!(claim.job.bases, bases);
            token = Some(claim.token);
            let Subject::Collection(loaded) = store.load_subject(&claim.job).await.unwrap() else { panic!() };
            let ids: Vec<_> = loaded.iter().map(|shape| (&shape.mesh_id, shape.id)).collect();
            assert_eq!(ids, [(&second.0, second.1), (&first.0, first.1)]);
            // As a process of its own hears of it.
            let mut sent = Vec::new();
            Subject::Collection(loaded.clone()).write(&mut sent).unwrap();
            let Some(Subject::Collection(heard)) = Subject::read(&sent) else { panic!() };
            for (a, b) in loaded.iter().zip(&heard) {
                assert_eq!((&a.mesh_id, a.id, &a.basis, &a.mesh.faces), (&b.mesh_id, b.id, &b.basis, &b.mesh.faces));
            }
            assert!((1..sent.len()).step_by(997).all(|cut| Subject::read(&sent[..cut]).is_none()));
        }
    }
    // With its mesh a basis goes, and the job is asked to stop; once it has ended, its other basis is free.
    store.delete_mesh(&first.0, true).await.unwrap();
    assert!(store.job(job.id).await.unwrap().cancel_requested);
    assert_eq!(in_use(store.delete_basis(second.1).await), (second.1, job.id));
    assert!(store.finish_canceled(token.unwrap()).await.unwrap());
    let refused = store.retry_job(job.id).await.unwrap_err();
    assert!(matches!(&refused, StoreError::NotFound { resource: "basis", .. }), "{refused}");
    store.delete_basis(second.1).await.unwrap();
    assert_eq!(store.job(job.id).await.unwrap().bases, bases);
    store.delete_job(job.id, false).await.unwrap();
    let left: i64 =
        sql::query_scalar("SELECT COUNT(*) FROM job_bases").fetch_one(store.inner.catalog.reader()).await.unwrap();
    assert_eq!(left, 0);
}

#[tokio::test]
pub(super) async fn a_job_goes_from_enqueued_to_its_basis() {
    let (store, _folder) = store().await;
    let mut events = store.watch_jobs();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&id, "w")).await.unwrap();
    assert_eq!((job.outcome, job.record.status, job.record.attempt), (EnqueueOutcome::Created, JobStatus::Enqueued, 0));
    let claim = store.claim("me", &[], LEASE).await.unwrap().unwrap();
    assert_eq!((claim.job.id, claim.job.attempt, claim.job.status), (job.record.id, 1, JobStatus::Processing));
    assert!(store.claim("me", &[], LEASE).await.unwrap().is_none());
    let progress = Progress {
        stage: Some("eigen".to_owned()),
        fraction: Some(0.5),
        detail: Some("level 1 of 2".to_owned()),
        stage_seconds: vec![("basis".to_owned(), 1.5)],
    };
    let answer = store.heartbeat(claim.token, Some(&progress), LEASE).await.unwrap();
    assert_eq!(answer, HeartbeatAnswer::Held { cancel_requested: false });
    let running = store.job(job.record.id).await.unwrap();
    assert_eq!((running.stage.as_deref(), running.progress), (Some("eigen"), Some(0.5)));
    assert_eq!(running.stage_seconds, progress.stage_seconds);
    let seconds = vec![("eigen".to_owned(), 0.25)];
    let CompleteAnswer::Stored(made) = store.complete(claim.token, basis(2.5, 40), seconds.clone()).await.unwrap()
    else {
        panic!("not stored")
    };
    let finished = store.job(job.record.id).await.unwrap();
    assert_eq!(
        (finished.status, finished.basis, &finished.stage_seconds),
        (JobStatus::Succeeded, Some(made), &seconds)
    );
    let record = store.basis(made).await.unwrap();
    assert_eq!((record.vertices, record.rows, record.dimension, record.count, record.nonzeros), (9, 40, 2, 2, 40));
    assert_eq!((record.eigenvalues.as_slice(), &record.mesh, record.job), ([0.0, 2.5].as_slice(), &id, job.record.id));
    assert_eq!(*store.load_basis(made).await.unwrap(), basis(2.5, 40));
    let mut revisions = Vec::new();
    while let Ok(event) = events.try_recv() {
        revisions.push(event.revision);
    }
    assert_eq!(revisions, [1, 2, 3, 4]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
pub(super) async fn four_workers_claim_each_job_exactly_once() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for job in 0..200 {
        store.enqueue(new_job(&id, &format!("w{job}"))).await.unwrap();
    }
    let begun = std::time::Instant::now();
    let workers = (0..4).map(|worker| {
        let store = store.clone();
        tokio::spawn(async move {
            let mut mine = Vec::new();
            while let Some(claim) = store.claim(&format!("{worker}"), &[], LEASE).await.unwrap() {
                assert_eq!(claim.job.attempt, 1);
                mine.push(claim.job.id);
                assert_eq!(
                    store.fail(claim.token, &problem(), false).await.unwrap(),
                    FailAnswer::Finished(JobStatus::Failed)
                );
            }
            mine
        })
    });
    let mut claimed = Vec::new();
    for worker in workers.collect::<Vec<_>>() {
        claimed.extend(worker.await.unwrap());
    }
    println!("{:.3} ms per claim and end", begun.elapsed().as_secs_f64() * 1e3 / 200.0);
    assert_eq!(claimed.len(), 200);
    assert_eq!(claimed.into_iter().collect::<HashSet<_>>().len(), 200);
    assert_eq!(store.job_counts().await.unwrap(), [("eigenbasis".to_owned(), JobStatus::Failed, 200)]);
}

#[tokio::test]
pub(super) async fn urgent_jobs_come_first_and_equals_in_order() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for (work, priority) in [("a", 0), ("b", 5), ("c", 0), ("d", 5), ("e", -1)] {
        store.enqueue(NewJob { priority, ..new_job(&id, work) }).await.unwrap();
    }
    // Someone else wants the last one, and now.
    let raised = store.enqueue(NewJob { priority: 9, ..new_job(&id, "e") }).await.unwrap();
    assert_eq!((raised.outcome, raised.record.priority), (EnqueueOutcome::SameWork, 9));
    let other = store.enqueue(NewJob { kind: "field_basis".to_owned(), ..new_job(&id, "f") }).await.unwrap().record.id;
    let mut order = Vec::new();
    while let Some(claim) = store.claim("w", &["eigenbasis".to_owned()], LEASE).await.unwrap() {
        order.push(claim.job.work_key);
    }
    assert_eq!(order, ["e", "b", "d", "a", "c"]);
    let kinds = ["vibration_basis".to_owned(), "field_basis".to_owned()];
    assert_eq!(store.claim("w", &kinds, LEASE).await.unwrap().unwrap().job.id, other);
}

#[tokio::test]
pub(super) async fn equal_work_is_done_once() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let first = store.enqueue(new_job(&id, "same")).await.unwrap().record.id;
    let again = store.enqueue(new_job(&id, "same")).await.unwrap();
    assert_eq!((again.outcome, again.record.id), (EnqueueOutcome::SameWork, first));
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!(store.enqueue(new_job(&id, "same")).await.unwrap().record.id, first);
    let CompleteAnswer::Stored(made) = store.complete(claim.token, basis(1.0, 4), vec![]).await.unwrap() else {
        panic!()
    };
    let done = store.enqueue(new_job(&id, "same")).await.unwrap();
    assert_eq!((done.outcome, done.record.basis), (EnqueueOutcome::SameWork, Some(made)));
    // Without its result it has to be done again.
    store.delete_basis(made).await.unwrap();
    let anew = store.enqueue(new_job(&id, "same")).await.unwrap();
    assert_eq!(anew.outcome, EnqueueOutcome::Created);
    // A job that is asked to stop does not count either, and cannot be retried beside the new one.
    store.claim("w", &[], LEASE).await.unwrap().unwrap();
    store.cancel_job(anew.record.id).await.unwrap();
    let third = store.enqueue(new_job(&id, "same")).await.unwrap();
    assert_eq!(third.outcome, EnqueueOutcome::Created);
    assert!(matches!(store.retry_job(first).await, Err(StoreError::JobState { .. })));
    assert!(matches!(store.enqueue(new_job("nowhere", "x")).await, Err(StoreError::NotFound { resource: "mesh", .. })));
    let on_problem = NewJob { kind: "pencil_basis".to_owned(), ..new_job("nowhere", "x") };
    assert!(matches!(store.enqueue(on_problem).await, Err(StoreError::NotFound { resource: "problem", .. })));
}

#[tokio::test]
pub(super) async fn an_idempotency_key_stands_for_one_request() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let keyed = |request: &str, work: &str| NewJob {
        idempotency: Some(IdempotencyKey { key: "k".to_owned(), request_hash: request.to_owned() }),
        ..new_job(&id, work)
    };
    let first = store.enqueue(keyed("r1", "a")).await.unwrap();
    let again = store.enqueue(keyed("r1", "a")).await.unwrap();
    assert_eq!((again.outcome, again.record.id), (EnqueueOutcome::Replayed, first.record.id));
    match store.enqueue(keyed("r2", "b")).await {
        Err(StoreError::IdempotencyConflict { job, .. }) => assert_eq!(job, first.record.id),
        other => panic!("{other:?}"),
    }
    // The key still stands when the job is over.
    store.cancel_job(first.record.id).await.unwrap();
    assert_eq!(store.enqueue(keyed("r1", "a")).await.unwrap().outcome, EnqueueOutcome::Replayed);
    assert_eq!(store.jobs(&JobFilter::default(), &PageRequest::default()).await.unwrap().items.len(), 1);
}

#[tokio::test]
pub(super) async fn the_writes_of_a_lost_lease_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000));
    let store =
        Store::open(StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) }).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&id, "w")).await.unwrap().record.id;
    let stale = store.claim("one", &[], LEASE).await.unwrap().unwrap();
    hands.fetch_add(29_000, Ordering::Relaxed);
    assert!(store.reap().await.unwrap().is_empty(), "the lease holds for 30 s");
    hands.fetch_add(2_000, Ordering::Relaxed);
    assert_eq!(store.reap().await.unwrap().len(), 1);
    assert!(store.claim("two", &[], LEASE).await.unwrap().is_none(), "there is a pause first");
    hands.fetch_add(1_000, Ordering::Relaxed);
    let fresh = store.claim("two", &[], LEASE).await.unwrap().unwrap();
    assert_eq!((fresh.job.id, fresh.job.attempt), (job, 2));
    let before = store.job(job).await.unwrap();
    assert_eq!(store.heartbeat(stale.token, Some(&Progress::default()), LEASE).await.unwrap(), HeartbeatAnswer::Lost);
    assert_eq!(store.complete(stale.token, basis(1.0, 4), vec![]).await.unwrap(), CompleteAnswer::Lost);
    assert_eq!(store.fail(stale.token, &problem(), false).await.unwrap(), FailAnswer::Lost);
    assert!(!store.finish_canceled(stale.token).await.unwrap());
    assert!(!store.release(stale.token).await.unwrap());
    assert_eq!(store.job(job).await.unwrap(), before);
    let blobs = store.pieces_of_content().await;
    assert_eq!(blobs, 1, "only the mesh: what the stale worker wrote is gone");
    assert!(matches!(store.complete(fresh.token, basis(1.0, 4), vec![]).await.unwrap(), CompleteAnswer::Stored(_)));
}

#[tokio::test]
pub(super) async fn attempts_are_bounded_and_pauses_grow() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000));
    let store =
        Store::open(StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) }).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&id, "w")).await.unwrap().record.id;
    for (attempt, pause_ms) in [(1, 1000), (2, 2000)] {
        let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
        assert_eq!(claim.job.attempt, attempt);
        assert_eq!(store.fail(claim.token, &problem(), true).await.unwrap(), FailAnswer::Retried);
        let waiting = store.job(job).await.unwrap();
        assert_eq!(waiting.not_before_ms - waiting.enqueued_ms, pause_ms);
        assert_eq!(waiting.problem, Some(problem()));
        hands.fetch_add(pause_ms, Ordering::Relaxed);
    }
    store.claim("w", &[], LEASE).await.unwrap().unwrap();
    hands.fetch_add(31_000, Ordering::Relaxed);
    assert_eq!(store.reap().await.unwrap()[0].job.status, JobStatus::Failed);
    let failed = store.job(job).await.unwrap();
    assert_eq!(failed.problem.unwrap().kind, "worker-lost");
    assert!(store.claim("w", &[], LEASE).await.unwrap().is_none());
    let again = store.retry_job(job).await.unwrap();
    assert_eq!((again.status, again.attempt, &again.problem), (JobStatus::Enqueued, 0, &None));
    assert_eq!(store.retry_job(job).await.unwrap(), again, "asking twice changes nothing");
    // A released attempt does not count.
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert!(store.release(claim.token).await.unwrap());
    assert_eq!(store.job(job).await.unwrap().attempt, 0);
}

#[tokio::test]
pub(super) async fn a_worker_that_is_lost_makes_no_longer_pause_the_more_often_that_happens() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000));
    let store =
        Store::open(StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) }).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(NewJob { max_attempts: 30, ..new_job(&id, "w") }).await.unwrap().record.id;
    for attempt in 1..12 {
        let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
        assert_eq!(claim.job.attempt, attempt);
        hands.fetch_add(31_000, Ordering::Relaxed);
        assert_eq!(store.reap().await.unwrap().len(), 1);
        let waiting = store.job(job).await.unwrap();
        assert_eq!(waiting.not_before_ms - waiting.enqueued_ms, 1000, "attempt {attempt}");
        hands.fetch_add(1000, Ordering::Relaxed);
    }
}

#[tokio::test]
pub(super) async fn a_clock_that_goes_back_holds_no_job() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000_000));
    let store =
        Store::open(StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) }).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    store.fail(claim.token, &problem(), true).await.unwrap();
    assert!(store.claim("w", &[], LEASE).await.unwrap().is_none(), "there is a pause");
    hands.fetch_sub(5 * 3600 * 1000, Ordering::Relaxed);
    assert!(store.claim("w", &[], LEASE).await.unwrap().is_some());
}

#[tokio::test]
pub(super) async fn a_job_that_may_have_crashed_a_server_runs_alone() {
    let (first, folder) = store().await;
    let id = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for work in ["a", "b", "c"] {
        first.enqueue(new_job(&id, work)).await.unwrap();
    }
    let suspects =
        [first.claim("w", &[], LEASE).await.unwrap().unwrap(), first.claim("w", &[], LEASE).await.unwrap().unwrap()];
    std::fs::write(first.crash_mark(), "11\n").unwrap();
    first.close().await;
    drop(first);
    let later = Clock::manual(Arc::new(AtomicI64::new(Clock::system().now_ms() + 60_000)));
    Store::open(options(&folder)).await.unwrap().close().await;
    let store = Store::open(StoreOptions { clock: later, ..options(&folder) }).await.unwrap();
    for suspect in &suspects {
        let job = store.job(suspect.job.id).await.unwrap();
        assert_eq!((job.status, job.attempt), (JobStatus::Enqueued, 0));
        assert!(job.problem.unwrap().detail.contains("signal 11"));
    }
    // The first in the queue is a suspect: nobody takes it, or another in its stead, while something runs.
    assert!(
        store
            .claim_within("w", &[], LEASE, u64::MAX, Company { others: true, ..Company::default() })
            .await
            .unwrap()
            .is_none()
    );
    let claim = store.claim_within("w", &[], LEASE, u64::MAX, Company::default()).await.unwrap().unwrap();
    assert_eq!((claim.job.id, claim.alone), (suspects[0].job.id, true));
    assert_eq!(std::fs::read_to_string(store.crash_mark()).unwrap(), "", "counted once");
}

#[tokio::test]
pub(super) async fn a_job_is_cancelled_at_once_or_at_its_end() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let waiting = store.enqueue(new_job(&id, "a")).await.unwrap().record.id;
    let canceled = store.cancel_job(waiting).await.unwrap();
    assert_eq!(canceled.status, JobStatus::Canceled);
    assert_eq!(store.cancel_job(waiting).await.unwrap(), canceled);
    let running = store.enqueue(new_job(&id, "b")).await.unwrap().record.id;
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    let asked = store.cancel_job(running).await.unwrap();
    assert_eq!((asked.status, asked.cancel_requested), (JobStatus::Processing, true));
    let answer = store.heartbeat(claim.token, None, LEASE).await.unwrap();
    assert_eq!(answer, HeartbeatAnswer::Held { cancel_requested: true });
    // It came to a result all the same: the client's word counts.
    assert_eq!(store.complete(claim.token, basis(1.0, 4), vec![]).await.unwrap(), CompleteAnswer::Canceled);
    assert_eq!(store.job(running).await.unwrap().status, JobStatus::Canceled);
    assert!(store.bases(&BasisFilter::default(), &PageRequest::default()).await.unwrap().items.is_empty());
    let done = done(&store, &id, 3.0).await;
    let job = store.basis(done).await.unwrap().job;
    assert!(matches!(store.cancel_job(job).await, Err(StoreError::JobState { status: JobStatus::Succeeded, .. })));
    assert!(matches!(store.cancel_job(Uuid::now_v7()).await, Err(StoreError::NotFound { resource: "job", .. })));
}

#[tokio::test]
pub(super) async fn a_large_job_is_waited_for_and_not_overtaken() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for (work, memory_bytes) in [("large", 1000), ("small", 10)] {
        store.enqueue(NewJob { memory_bytes, ..new_job(&mesh, work) }).await.unwrap();
    }
    assert!(store.claim_within("w", &[], LEASE, 999, Company::default()).await.unwrap().is_none());
    let large = store.claim_within("w", &[], LEASE, 1000, Company::default()).await.unwrap().unwrap();
    assert_eq!((large.job.work_key.as_str(), large.job.memory_bytes), ("large", 1000));
    assert_eq!(
        store.claim_within("w", &[], LEASE, 10, Company::default()).await.unwrap().unwrap().job.work_key,
        "small"
    );
}

#[tokio::test]
pub(super) async fn the_queue_has_an_end() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(StoreOptions { queued_jobs_limit: Some(2), ..options(&folder) }).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let first = store.enqueue(new_job(&id, "a")).await.unwrap().record.id;
    store.enqueue(new_job(&id, "b")).await.unwrap();
    assert!(matches!(store.enqueue(new_job(&id, "c")).await, Err(StoreError::QueueFull { waiting: 2, limit: 2 })));
    assert_eq!(store.enqueue(new_job(&id, "b")).await.unwrap().outcome, EnqueueOutcome::SameWork);
    store.cancel_job(first).await.unwrap();
    store.enqueue(new_job(&id, "c")).await.unwrap();
    assert!(matches!(store.retry_job(first).await, Err(StoreError::QueueFull { .. })));
}

#[tokio::test]
pub(super) async fn a_caller_that_goes_away_breaks_nothing() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for round in 0..30u64 {
        let wait = Duration::from_micros(round * 40);
        let _ = tokio::time::timeout(wait, store.enqueue(new_job(&id, &format!("{round}")))).await;
        let _ = tokio::time::timeout(wait, store.claim("w", &[], LEASE)).await;
        let _ = tokio::time::timeout(wait, store.health()).await;
    }
    assert!(store.health().await.writable);
    store.enqueue(new_job(&id, "last")).await.unwrap();
}

/// A small generator of numbers (Knuth's MMIX constants): the same walk in every run.
struct Walk(u64);

impl Walk {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % bound
    }
}

#[tokio::test]
pub(super) async fn any_walk_through_the_calls_keeps_the_invariants() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000));
    let store =
        Store::open(StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) }).await.unwrap();
    let mut walk = Walk(7);
    let mut tokens: Vec<Uuid> = Vec::new();
    let page = PageRequest { limit: PageRequest::MOST, from: None };
    for step in 0..1500 {
        let id = store.add_mesh(mesh(walk.below(3), 9)).await.unwrap().record.id;
        let jobs = store.jobs(&JobFilter::default(), &page).await.unwrap().items;
        let any_job = if jobs.is_empty() { Uuid::nil() } else { jobs[walk.below(jobs.len())].id };
        // Of old tokens too: most of them are void.
        let token = if tokens.is_empty() { Uuid::nil() } else { tokens[walk.below(tokens.len())] };
        let bases = store.bases(&BasisFilter::default(), &page).await.unwrap().items;
        hands.fetch_add(walk.below(2000) as i64, Ordering::Relaxed);
        // Refusals are answers too; only what is told to be broken is.
        let told = match walk.below(14) {
            0..=2 => store.enqueue(new_job(&id, &format!("{id} {}", walk.below(4)))).await.map(|_| ()),
            3..=5 => store.claim("w", &[], LEASE).await.map(|claim| tokens.extend(claim.map(|claim| claim.token))),
            6..=7 => store.complete(token, basis(walk.below(3) as f64, 8), vec![]).await.map(|_| ()),
            8 => store.fail(token, &problem(), walk.below(2) == 0).await.map(|_| ()),
            9 => store.release(token).await.map(|_| ()),
            10 => store.cancel_job(any_job).await.map(|_| ()),
            11 => store.retry_job(any_job).await.map(|_| ()),
            12 if walk.below(6) == 0 => store.delete_mesh(&id, walk.below(2) == 0).await,
            12 => match bases.first() {
                Some(basis) => store.delete_basis(basis.id).await,
                None => store.finish_canceled(token).await.map(|_| ()),
            },
            _ => {
                hands.fetch_add(40_000, Ordering::Relaxed);
                store.reap().await.map(|_| ())
            }
        };
        match told {
            Ok(()) => {}
            Err(StoreError::NotFound { .. } | StoreError::JobState { .. } | StoreError::MeshInUse { .. }) => {}
            Err(error) => panic!("step {step}: {error}"),
        }
        if step % 10 == 0 {
            keeps_invariants(&store).await;
        }
    }
    let counts = store.job_counts().await.unwrap();
    assert!(counts.len() >= 3, "the walk came to several kinds of end: {counts:?}");
}

async fn keeps_invariants(store: &Store) {
    let mut page = PageRequest { limit: PageRequest::MOST, from: None };
    let mut jobs = Vec::new();
    loop {
        let got = store.jobs(&JobFilter::default(), &page).await.unwrap();
        jobs.extend(got.items);
        page.from = got.next;
        if page.from.is_none() {
            break;
        }
    }
    let bases = store.bases(&BasisFilter::default(), &page).await.unwrap().items;
    let mut under_way = HashSet::new();
    for job in &jobs {
        assert!(job.attempt <= job.max_attempts);
        assert_eq!(job.finished_ms.is_some(), job.status.is_finished(), "{job:?}");
        assert!(job.basis.is_none() || job.status == JobStatus::Succeeded, "{job:?}");
        assert!(!job.cancel_requested || job.status == JobStatus::Processing, "{job:?}");
        if !job.status.is_finished() && !job.cancel_requested {
            assert!(under_way.insert(&job.work_key), "equal work twice: {job:?}");
        }
    }
    let mut hashes = HashSet::new();
    let mut bytes = 0;
    for basis in &bases {
        let job = jobs.iter().find(|job| job.id == basis.job).unwrap();
        assert_eq!((job.status, job.basis), (JobStatus::Succeeded, Some(basis.id)));
        store.load_basis(basis.id).await.unwrap();
        bytes += if hashes.insert(&basis.content_hash) { basis.bytes } else { 0 };
    }
    assert_eq!(bases.len(), jobs.iter().filter(|job| job.basis.is_some()).count());
    for mesh in store.meshes(&page).await.unwrap().items {
        store.load_mesh(&mesh.id).await.unwrap();
        bytes += mesh.bytes;
    }
    assert_eq!(store.health().await.blob_bytes, bytes, "every blob is referred to");
}
