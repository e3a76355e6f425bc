//! What the store promises.

use std::{
    collections::HashSet,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};

use bytes::Bytes;
use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Basis, Certificate, Compact, Functions};
use futures_util::StreamExt;
use serde_json::json;
use tempfile::TempDir;

use super::{fault::Faults, *};

#[cfg(test)]
#[path = "lease_model_tests.rs"]
mod lease_model;
#[cfg(test)]
#[path = "shared_tests.rs"]
mod shared;

pub(super) const LEASE: Duration = Duration::from_secs(30);

pub(crate) fn options(folder: &TempDir) -> StoreOptions {
    #[cfg(feature = "cluster")]
    let shared = shared::places(folder);
    #[cfg(not(feature = "cluster"))]
    let shared = None;
    StoreOptions { least_free_bytes: 0, shared, ..StoreOptions::new(folder.path()) }
}

impl Store {
    /// The records in the data folder.
    pub(super) fn records(&self) -> &Database {
        self.inner.catalog.sqlite().expect("nothing is shared")
    }

    /// The content in the data folder.
    pub(super) fn chunks(&self) -> &Database {
        self.inner.blobs.sqlite().expect("nothing is shared")
    }

    /// Pieces of content that are kept, finished or not.
    async fn pieces_of_content(&self) -> i64 {
        match self.inner.blobs.sqlite() {
            Some(chunks) => sqlx::query_scalar("SELECT COUNT(*) FROM blobs").fetch_one(chunks.reader()).await.unwrap(),
            // What nothing refers to is condemned, what was given up has gone.
            None => sql::query_scalar("SELECT COUNT(*) FROM blobs WHERE state <> 'gone' AND condemned_ms IS NULL")
                .fetch_one(self.inner.catalog.reader())
                .await
                .unwrap(),
        }
    }
}

pub(super) async fn store() -> (Store, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    (Store::open(options(&folder)).await.unwrap(), folder)
}

/// Opens a store twice, an hour apart: what nothing refers to is gone.
pub(super) async fn an_hour_later(folder: &TempDir) -> Store {
    let first = Store::open(options(folder)).await.unwrap();
    let later = Clock::manual(Arc::new(AtomicI64::new(first.now_ms() + orphans::REPRIEVE_MS + 1000)));
    first.close().await;
    drop(first);
    Store::open(StoreOptions { clock: later, ..options(folder) }).await.unwrap()
}

pub(crate) fn mesh(seed: usize, vertices: usize) -> NewMesh {
    let positions: Vec<_> = (0..vertices).map(|i| [i as f64, (i * i + seed) as f64, 0.5]).collect();
    let faces: Vec<_> = (2..vertices as u32).map(|i| [0, i - 1, i]).collect();
    let numbering = Arc::new(chladni_mesh::numbering::Numbering::identity(positions.len(), faces.len()));
    NewMesh {
        solid: None,
        numbering,
        attributes: None,
        mesh: Arc::new(TriangleMesh { positions, faces, ..Default::default() }),
        report: json!({"genus": 0}),
        name: Some(format!("mesh {seed}")),
        format: "ply".to_owned(),
        source_bytes: 7,
    }
}

pub(crate) fn new_job(mesh: &str, work: &str) -> NewJob {
    NewJob {
        brief: None,
        kind: "eigenbasis".to_owned(),
        mesh: mesh.to_owned(),
        bases: Vec::new(),
        parameters: json!({"count": 4}),
        priority: 0,
        idempotency: None,
        max_attempts: 3,
        work_key: work.to_owned(),
        solver_version: "1".to_owned(),
        memory_bytes: 0,
        most_bytes: u64::MAX,
    }
}

/// A basis of four vertices and two functions that differs by its seed.
pub(crate) fn basis(seed: f64, vertices: usize) -> Basis {
    let space = SparseMatrix::from_sorted_parts(
        vertices,
        2,
        (0..=vertices).collect(),
        (0..vertices as u32).map(|i| i % 2).collect(),
        vec![1.0; vertices],
    );
    Basis {
        functions: Functions::Compact(Compact::new(space, DenseMatrix::from_columns(2, 2, vec![1.0, seed, 0.0, 1.0]))),
        eigenvalues: vec![0.0, seed],
        mass: MassMatrix::Diagonal(vec![0.25; vertices]),
        certificate: Certificate {
            residuals: vec![0.0, 1e-9],
            bounds: vec![0.0, 1e-9],
            orthonormality_defect: 1e-15,
            ..Certificate::default()
        },
        metadata: json!({"seed": seed}),
    }
}

fn problem() -> JobProblem {
    JobProblem { kind: "trouble".to_owned(), detail: "something broke".to_owned() }
}

/// Enqueues, claims and completes a job.
pub(super) async fn done(store: &Store, mesh: &str, seed: f64) -> Uuid {
    store.enqueue(new_job(mesh, &format!("work {seed}"))).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    match store.complete(claim.token, basis(seed, 40), vec![("eigen".to_owned(), 0.5)]).await.unwrap() {
        CompleteAnswer::Stored(id) => id,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_mesh_is_stored_once_and_comes_back_whole() {
    let (store, _folder) = store().await;
    let new = mesh(1, 50);
    let first = store.add_mesh(new.clone()).await.unwrap();
    assert!(first.created);
    assert_eq!(first.record.id.len(), 32);
    assert_eq!((first.record.vertices, first.record.faces), (50, 48));
    let second = store.add_mesh(NewMesh { name: None, ..new.clone() }).await.unwrap();
    assert!(!second.created);
    assert_eq!(second.record, first.record);
    assert_eq!(store.load_mesh(&first.record.id).await.unwrap(), new.mesh);
    assert_eq!(store.blob_length(&first.record.content_hash).await.unwrap(), first.record.bytes);
    let empty = NewMesh { mesh: Arc::default(), ..new };
    let empty = store.add_mesh(empty).await.unwrap().record;
    assert_eq!(*store.load_mesh(&empty.id).await.unwrap(), TriangleMesh::default());
}

#[tokio::test]
async fn fields_are_kept_once_and_go_with_their_mesh_or_their_basis() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 40)).await.unwrap().record.id;
    let basis = done(&store, &mesh, 1.0).await;
    let field = |basis: Option<Uuid>, seed: f32| NewField {
        mesh: mesh.clone(),
        basis,
        name: Some(format!("Field {seed}")),
        width: 2,
        values: (0..76).map(|i| seed * i as f32).collect(),
        design: json!({"seed": seed}),
    };
    let first = store.add_field(field(None, 0.5)).await.unwrap();
    let again = store.add_field(NewField { name: None, ..field(None, 0.5) }).await.unwrap();
    assert_eq!((first.created, again.created, &again.record), (true, false, &first.record));
    assert_eq!((first.record.width, first.record.faces, &first.record.design), (2, 38, &json!({"seed": 0.5})));
    assert_eq!(*store.load_field(&first.record).await.unwrap(), field(None, 0.5).values);
    // The same numbers in a basis are another field with the same content.
    let designed = store.add_field(field(Some(basis), 0.5)).await.unwrap().record;
    assert!(designed.id != first.record.id && designed.content_hash == first.record.content_hash);
    let other = store.add_field(field(Some(basis), 2.0)).await.unwrap().record;
    let list = async |filter: FieldFilter| -> Vec<String> {
        let page = store.fields(&filter, &PageRequest::default()).await.unwrap();
        page.items.into_iter().map(|record| record.id).collect()
    };
    let all = FieldFilter::default();
    assert_eq!(list(all.clone()).await, [other.id.clone(), designed.id.clone(), first.record.id.clone()]);
    assert_eq!(
        list(FieldFilter { name: Some("field 2".to_owned()), ..all.clone() }).await,
        std::slice::from_ref(&other.id)
    );
    assert_eq!(list(FieldFilter { basis: Some(Uuid::nil().to_string()), ..all.clone() }).await, Vec::<String>::new());
    assert_eq!(store.rename_field(&other.id, Some("x")).await.unwrap().name.as_deref(), Some("x"));
    for (wrong, resource) in
        [(NewField { mesh: "0".repeat(32), ..field(None, 1.0) }, "mesh"), (field(Some(Uuid::nil()), 1.0), "basis")]
    {
        let refused = store.add_field(wrong).await.unwrap_err();
        assert!(matches!(&refused, StoreError::NotFound { resource: own, .. } if *own == resource), "{refused}");
    }
    // A basis that is made anew keeps its fields; one that is deleted takes them with it, and leaves content that others have.
    match store.delete_mesh(&mesh, false).await {
        Err(StoreError::MeshInUse { unfinished_jobs: 0, bases: 1, fields: 3, .. }) => {}
        other => panic!("{other:?}"),
    }
    let job = store.basis(basis).await.unwrap().job;
    store.redo_job(job).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    let anew = super::tests::basis(1.0, 40);
    assert_eq!(store.complete(claim.token, anew, Vec::new()).await.unwrap(), CompleteAnswer::Stored(basis));
    assert_eq!(list(all.clone()).await.len(), 3);
    store.delete_basis(basis).await.unwrap();
    assert_eq!(list(all.clone()).await, std::slice::from_ref(&first.record.id));
    assert_eq!(store.load_field(&first.record).await.unwrap().len(), 76);
    assert!(matches!(store.field(&other.id).await, Err(StoreError::NotFound { resource: "field", .. })));
    store.delete_mesh(&mesh, true).await.unwrap();
    assert!(matches!(store.load_field(&first.record).await, Err(StoreError::NotFound { .. })));
    assert!(list(all).await.is_empty());
}

#[tokio::test]
async fn the_bases_of_a_job_stay_until_it_has_ended() {
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn equal_meshes_that_arrive_at_once_are_one() {
    let (store, _folder) = store().await;
    let adds = (0..8).map(|_| {
        tokio::spawn({
            let store = store.clone();
            async move { store.add_mesh(mesh(3, 2000)).await.unwrap() }
        })
    });
    let mut created = 0;
    for add in adds.collect::<Vec<_>>() {
        created += usize::from(add.await.unwrap().created);
    }
    assert_eq!(created, 1);
    assert_eq!(store.meshes(&PageRequest::default()).await.unwrap().items.len(), 1);
    let blobs = store.pieces_of_content().await;
    assert_eq!(blobs, 1);
}

#[tokio::test]
async fn a_mesh_in_use_is_deleted_only_with_what_uses_it() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let basis = done(&store, &id, 2.0).await;
    let waiting = store.enqueue(new_job(&id, "other")).await.unwrap().record.id;
    match store.delete_mesh(&id, false).await {
        Err(StoreError::MeshInUse { unfinished_jobs: 1, bases: 1, .. }) => {}
        other => panic!("{other:?}"),
    }
    store.delete_mesh(&id, true).await.unwrap();
    assert_eq!(store.job(waiting).await.unwrap().status, JobStatus::Canceled);
    assert!(matches!(store.basis(basis).await, Err(StoreError::NotFound { resource: "basis", .. })));
    assert!(matches!(store.load_basis(basis).await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.load_mesh(&id).await, Err(StoreError::NotFound { resource: "mesh", .. })));
    assert_eq!(store.health().await.blob_bytes, 0);
    assert!(matches!(store.delete_mesh(&id, true).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn a_job_goes_from_enqueued_to_its_basis() {
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
async fn four_workers_claim_each_job_exactly_once() {
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
async fn urgent_jobs_come_first_and_equals_in_order() {
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
async fn equal_work_is_done_once() {
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
async fn an_idempotency_key_stands_for_one_request() {
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
async fn the_writes_of_a_lost_lease_change_nothing() {
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
async fn attempts_are_bounded_and_pauses_grow() {
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
async fn a_clock_that_goes_back_holds_no_job() {
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
async fn a_job_that_may_have_crashed_a_server_runs_alone() {
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
async fn a_job_is_cancelled_at_once_or_at_its_end() {
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
async fn pages_are_stable_while_rows_arrive() {
    let (store, _folder) = store().await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let mut expected = Vec::new();
    for job in 0..7 {
        expected.push(store.enqueue(new_job(&id, &format!("{job}"))).await.unwrap().record.id);
    }
    expected.reverse();
    let mut seen = Vec::new();
    let mut page = PageRequest { limit: 3, from: None };
    loop {
        let got = store.jobs(&JobFilter { mesh: Some(id.clone()), ..JobFilter::default() }, &page).await.unwrap();
        seen.extend(got.items.iter().map(|job| job.id));
        store.enqueue(new_job(&id, &format!("later {}", seen.len()))).await.unwrap();
        match got.next {
            Some(next) => page.from = Some(next),
            None => break,
        }
    }
    assert_eq!(seen, expected);
    for cursor in ["", "-1", "x", "99999999999999999999", "1;DROP TABLE jobs"] {
        let bad = PageRequest { limit: 3, from: Some(cursor.to_owned()) };
        assert!(matches!(store.meshes(&bad).await, Err(StoreError::InvalidCursor { .. })), "{cursor}");
    }
    let failed = JobFilter { status: Some(JobStatus::Failed), ..JobFilter::default() };
    assert!(store.jobs(&failed, &PageRequest::default()).await.unwrap().items.is_empty());
    let odd = JobFilter { kind: Some("' OR 1=1 --".to_owned()), ..JobFilter::default() };
    assert!(store.jobs(&odd, &PageRequest { limit: 0, from: None }).await.unwrap().items.is_empty());
}

#[tokio::test]
async fn ranges_of_a_blob_are_exact_across_chunks() {
    let (store, _folder) = store().await;
    let content = Bytes::from((0..700_001u32).map(|i| (i * 2_654_435_761) as u8).collect::<Vec<_>>());
    let hash = blobs::hash_of(&content).await.unwrap();
    store.put_blob(&hash, &content).await.unwrap();
    let n = content.len() as u64;
    for range in [0..n, 0..1, n - 1..n, 5..5, 262_143..262_145, 262_144..524_288, 100..600_000, 0..0, n..n] {
        let expected = content.slice(range.start as usize..range.end as usize);
        assert_eq!(store.blob_bytes(&hash, range.clone()).await.unwrap(), expected, "{range:?}");
        let streamed: Vec<Bytes> = store.blob_stream(&hash, range.clone()).map(Result::unwrap).collect().await;
        let most = if store.is_shared() { 8 << 20 } else { 256 << 10 };
        assert!(streamed.iter().all(|piece| piece.len() <= most));
        assert_eq!(streamed.concat(), expected, "{range:?}");
    }
    #[allow(clippy::reversed_empty_ranges)]
    for range in [0..n + 1, 5..4, n + 1..n + 1, u64::MAX - 1..u64::MAX] {
        assert!(matches!(store.blob_bytes(&hash, range.clone()).await, Err(StoreError::InvalidRange { .. })));
        let mut stream = Box::pin(store.blob_stream(&hash, range));
        assert!(matches!(stream.next().await, Some(Err(StoreError::InvalidRange { .. }))));
    }
    assert!(matches!(store.blob_length("00").await, Err(StoreError::NotFound { resource: "blob", .. })));
}

#[tokio::test]
async fn a_slow_reader_keeps_no_transaction_open() {
    let (store, _folder) = store().await;
    let content = Bytes::from(vec![7u8; 1 << 20]);
    let hash = blobs::hash_of(&content).await.unwrap();
    store.put_blob(&hash, &content).await.unwrap();
    let mut streams: Vec<_> = (0..40).map(|_| Box::pin(store.blob_stream(&hash, 0..1 << 20))).collect();
    for stream in &mut streams {
        stream.next().await.unwrap().unwrap();
    }
    // More streams than connections stand still, and a checkpoint can still empty the whole log.
    let row = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(store.chunks().reader()).await;
    drop(row);
    let mut transaction = store.chunks().write().await.unwrap();
    transaction.rollback().await.unwrap();
    transaction = store.chunks().write().await.unwrap();
    transaction.commit().await.unwrap();
    for stream in &mut streams {
        assert_eq!(stream.next().await.unwrap().unwrap().len(), 256 << 10);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn the_cache_loads_each_basis_once_and_keeps_to_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let cache_bytes = 40 << 10;
    let first = Store::open(StoreOptions { cache_bytes, ..options(&folder) }).await.unwrap();
    let id = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let mut bases = Vec::new();
    for seed in 0..20 {
        bases.push(done(&first, &id, f64::from(seed)).await);
        assert!(first.cache_statistics().bytes <= cache_bytes);
    }
    first.close().await;
    drop(first);
    let store = Store::open(StoreOptions { cache_bytes, ..options(&folder) }).await.unwrap();
    let loads: Vec<_> = (0..16)
        .map(|_| {
            let (store, id) = (store.clone(), bases[3]);
            tokio::spawn(async move { store.load_basis(id).await.unwrap() })
        })
        .collect();
    for load in loads {
        assert_eq!(*load.await.unwrap(), basis(3.0, 40));
    }
    assert_eq!(store.cache_statistics().misses, 1);
    for (seed, id) in bases.iter().enumerate() {
        assert_eq!(*store.load_basis(*id).await.unwrap(), basis(seed as f64, 40));
        let statistics = store.cache_statistics();
        assert!(statistics.bytes <= cache_bytes && statistics.bytes > 0, "{statistics:?}");
    }
}

#[tokio::test]
async fn damaged_content_is_told_and_not_served() {
    let (store, _folder) = store().await;
    let record = store.add_mesh(mesh(1, 900)).await.unwrap().record;
    let mut transaction = store.chunks().write().await.unwrap();
    sqlx::query("UPDATE chunks SET data = zeroblob(length(data))").execute(transaction.on()).await.unwrap();
    transaction.commit().await.unwrap();
    assert!(matches!(store.load_mesh(&record.id).await, Err(StoreError::Damaged { .. })));
    let mut transaction = store.chunks().write().await.unwrap();
    sqlx::query("DELETE FROM chunks").execute(transaction.on()).await.unwrap();
    transaction.commit().await.unwrap();
    assert!(matches!(store.blob_bytes(&record.content_hash, 0..10).await, Err(StoreError::Damaged { .. })));
}

#[tokio::test]
async fn a_large_job_is_waited_for_and_not_overtaken() {
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
async fn half_written_content_goes_and_leases_of_the_dead_are_reaped_at_the_start() {
    let (first, folder) = store().await;
    let id = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let kept = done(&first, &id, 1.0).await;
    let orphan = Bytes::from_static(b"nothing refers to this");
    let hash = blobs::hash_of(&orphan).await.unwrap();
    first.put_blob(&hash, &orphan).await.unwrap();
    let mut transaction = first.chunks().write().await.unwrap();
    for sql in [
        "INSERT INTO blobs (hash, bytes, chunk_bytes, state, created_ms) VALUES ('ab', 9, 262144, 'pending', 0)",
        "INSERT INTO chunks (blob, position, data) SELECT id, 0, 'half' FROM blobs WHERE hash = 'ab'",
    ] {
        sqlx::query(sql).execute(transaction.on()).await.unwrap();
    }
    transaction.commit().await.unwrap();
    let running = first.enqueue(new_job(&id, "w")).await.unwrap().record.id;
    first.claim("dead", &[], LEASE).await.unwrap().unwrap();
    first.close().await;
    drop(first);
    let second = Store::open(options(&folder)).await.unwrap();
    assert_eq!(second.blob_length(&hash).await.unwrap(), orphan.len() as u64, "an orphan has an hour");
    let counts: (i64, i64) = sqlx::query_as("SELECT (SELECT COUNT(*) FROM blobs), (SELECT COUNT(*) FROM chunks)")
        .fetch_one(second.chunks().reader())
        .await
        .unwrap();
    assert_eq!(counts, (3, 3), "the mesh, the basis and the orphan, a chunk each");
    assert_eq!(*second.load_basis(kept).await.unwrap(), basis(1.0, 40));
    assert_eq!(second.job(running).await.unwrap().status, JobStatus::Enqueued);
}

#[tokio::test]
async fn a_folder_serves_one_store_at_a_time() {
    let (first, folder) = store().await;
    assert!(matches!(Store::open(options(&folder)).await, Err(StoreError::FolderInUse { .. })));
    first.close().await;
    drop(first);
    Store::open(options(&folder)).await.unwrap();
    let file = folder.path().join("lock");
    let inside = StoreOptions { least_free_bytes: 0, ..StoreOptions::new(file.join("below a file")) };
    assert!(matches!(Store::open(inside).await, Err(StoreError::Folder { .. })));
}

#[tokio::test]
async fn a_full_disk_is_told_and_leaves_nothing_half_visible() {
    let folder = tempfile::tempdir().unwrap();
    let limited = StoreOptions { blob_bytes_limit: Some(2 << 20), ..options(&folder) };
    let store = Store::open(limited).await.unwrap();
    let small = store.add_mesh(mesh(1, 9)).await.unwrap().record;
    // 36 bytes a vertex: 3.6 MB.
    for _ in 0..3 {
        assert!(matches!(store.add_mesh(mesh(2, 100_000)).await, Err(StoreError::StorageFull { .. })));
    }
    assert_eq!(store.meshes(&PageRequest::default()).await.unwrap().items.len(), 1);
    let chunks: i64 =
        sqlx::query_scalar("SELECT COUNT(*) FROM chunks").fetch_one(store.chunks().reader()).await.unwrap();
    assert_eq!(chunks, 1, "the chunks of what did not fit are gone");
    // A result that does not fit leaves its job as it was.
    let job = store.enqueue(new_job(&small.id, "big")).await.unwrap().record.id;
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    let refused = store.complete(claim.token, basis(1.0, 200_000), vec![]).await;
    assert!(matches!(refused, Err(StoreError::StorageFull { .. })));
    assert_eq!(store.job(job).await.unwrap().status, JobStatus::Processing);
    assert!(store.bases(&BasisFilter::default(), &PageRequest::default()).await.unwrap().items.is_empty());
    // What fits is still taken: the refusals broke no connection.
    assert!(matches!(store.complete(claim.token, basis(1.0, 40), vec![]).await, Ok(CompleteAnswer::Stored(_))));
    assert!(store.add_mesh(mesh(3, 1000)).await.unwrap().created);
    assert!(store.health().await.writable);
    store.close().await;
    drop(store);
    let frugal = StoreOptions { least_free_bytes: u64::MAX / 2, ..options(&folder) };
    let store = Store::open(frugal).await.unwrap();
    assert!(matches!(store.add_mesh(mesh(4, 9)).await, Err(StoreError::StorageFull { .. })));
    let health = store.health().await;
    assert!(health.full && health.reason.is_some());
}

#[tokio::test]
async fn a_locked_database_is_busy_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let store =
        Store::open(StoreOptions { busy_timeout: Duration::from_millis(50), ..options(&folder) }).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let other = sqlx::SqlitePool::connect_with(
        sqlx::sqlite::SqliteConnectOptions::new().filename(folder.path().join("meta.db")),
    )
    .await
    .unwrap();
    let mut held = other.acquire().await.unwrap();
    sqlx::query("BEGIN IMMEDIATE").execute(&mut *held).await.unwrap();
    let refused = store.enqueue(new_job(&id, "w")).await.unwrap_err();
    assert!(matches!(refused, StoreError::Busy { .. }) && refused.is_retryable());
    assert!(matches!(store.claim("w", &[], LEASE).await, Err(StoreError::Busy { .. })));
    assert!(matches!(store.add_mesh(mesh(2, 9)).await, Err(StoreError::Busy { .. })));
    assert!(!store.health().await.writable);
    assert_eq!(store.mesh(&id).await.unwrap().id, id, "reading goes on");
    sqlx::query("ROLLBACK").execute(&mut *held).await.unwrap();
    assert_eq!(store.enqueue(new_job(&id, "w")).await.unwrap().outcome, EnqueueOutcome::Created);
    assert!(store.add_mesh(mesh(2, 9)).await.unwrap().created);
    assert!(store.health().await.writable);
}

#[tokio::test]
async fn the_queue_has_an_end() {
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
async fn a_caller_that_goes_away_breaks_nothing() {
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
async fn any_walk_through_the_calls_keeps_the_invariants() {
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

#[test]
fn faults_are_read_and_refused() {
    for point in fault::FailPoint::ALL {
        assert!(Faults::parse(&format!("{}:kill", point.name())).is_ok());
    }
    assert!(Faults::parse("mid-run:panic:100").is_ok());
    for bad in ["", "mid-run", "mid-run:", "nowhere:kill", "mid-run:laugh", "mid-run:kill:x", "mid-run:kill:1:2"] {
        assert!(Faults::parse(bad).is_err(), "{bad}");
    }
}
