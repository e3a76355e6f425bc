//! The same promises where the records are in a PostgreSQL and the content in an object store, and what is promised there alone.
#![cfg(feature = "cluster")]

use std::cell::Cell;

use chladni_spectral::basis::{DenseFunctions, Precision};
use object_store::{ObjectStoreExt, path::Path};

use super::*;

#[path = "../../tests/common/postgres.rs"]
mod server;

#[path = "../../tests/common/s3.rs"]
mod s3_server;

/// Where the stores of a test share what they have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sharing {
    Nothing,
    /// Objects in a folder.
    Files,
    /// Objects in a store that speaks S3.
    S3,
}

thread_local! {
    /// Where stores of the test on this thread share. A test opens its stores on the thread that it began on.
    static SHARING: Cell<Sharing> = const { Cell::new(Sharing::Nothing) };
}

/// Where the stores of a folder share what they have, in a test of sharing.
pub(super) fn places(folder: &TempDir) -> Option<SharedPlaces> {
    let objects = match SHARING.get() {
        Sharing::Nothing => return None,
        Sharing::Files => format!("file://{}", folder.path().join("objects").display()),
        Sharing::S3 => s3_server::of_folder(folder.path(), false).objects,
    };
    Some(SharedPlaces { database: server::server()?.database_of(folder.path()), direct: None, objects })
}

/// Runs a test whose stores share their records, with objects in a folder.
fn sharing(test: fn()) {
    sharing_in(Sharing::Files, test);
}

fn sharing_in(place: Sharing, test: fn()) {
    if server::server().is_none() {
        return;
    }
    SHARING.set(place);
    let ended = std::panic::catch_unwind(test);
    SHARING.set(Sharing::Nothing);
    if let Err(reason) = ended {
        std::panic::resume_unwind(reason);
    }
}

/// The same tests where objects lie in a store that speaks S3.
mod over_s3 {
    use super::*;

    macro_rules! over_s3 {
        ($($name:ident: $test:path),* $(,)?) => {
            $(
                #[test]
                fn $name() {
                    sharing_in(Sharing::S3, $test);
                }
            )*
        };
    }

    over_s3!(
        a_mesh_is_stored_once_and_comes_back_whole: tests::a_mesh_is_stored_once_and_comes_back_whole,
        a_job_goes_from_enqueued_to_its_basis: tests::a_job_goes_from_enqueued_to_its_basis,
        ranges_of_a_blob_are_exact_across_chunks: tests::ranges_of_a_blob_are_exact_across_chunks,
        opening_takes_nothing_from_others: opening,
        damaged_objects_are_told_and_written_anew: damaged_objects,
        content_that_nothing_refers_to_has_an_hour: an_hour,
        large_content_goes_in_parts_and_comes_in_ranges: large_content,
        a_store_that_refuses_and_cuts_is_asked_again: refusals_and_cuts,
        a_store_that_is_away_is_told_and_a_result_waits_for_it: away,
        who_is_refused_is_told_at_once: refused,
        a_result_survives_a_database_that_goes_away_before_it_is_seen: database_away,
        completing_twice_is_completing_once: completing_twice,
    );
}

/// Tests that look at files of a data folder, or at what only one process in it can be promised.
const OF_A_FOLDER: &[&str] = &[
    "a_job_that_may_have_crashed_a_server_runs_alone",
    "a_slow_reader_keeps_no_transaction_open",
    "damaged_content_is_told_and_not_served",
    "half_written_content_goes_and_leases_of_the_dead_are_reaped_at_the_start",
    "a_folder_serves_one_store_at_a_time",
    "a_full_disk_is_told_and_leaves_nothing_half_visible",
    "a_locked_database_is_busy_and_loses_nothing",
    "faults_are_read_and_refused",
];

macro_rules! both {
    ($($name:ident),* $(,)?) => {
        const OF_BOTH: &[&str] = &[$(stringify!($name)),*];
        $(
            #[test]
            fn $name() {
                sharing(super::$name);
            }
        )*
    };
}

both!(
    a_mesh_is_stored_once_and_comes_back_whole,
    fields_are_kept_once_and_go_with_their_mesh_or_their_basis,
    the_bases_of_a_job_stay_until_it_has_ended,
    equal_meshes_that_arrive_at_once_are_one,
    a_mesh_in_use_is_deleted_only_with_what_uses_it,
    a_job_goes_from_enqueued_to_its_basis,
    four_workers_claim_each_job_exactly_once,
    urgent_jobs_come_first_and_equals_in_order,
    equal_work_is_done_once,
    an_idempotency_key_stands_for_one_request,
    the_writes_of_a_lost_lease_change_nothing,
    attempts_are_bounded_and_pauses_grow,
    a_clock_that_goes_back_holds_no_job,
    a_job_is_cancelled_at_once_or_at_its_end,
    pages_are_stable_while_rows_arrive,
    ranges_of_a_blob_are_exact_across_chunks,
    the_cache_loads_each_basis_once_and_keeps_to_its_bytes,
    a_large_job_is_waited_for_and_not_overtaken,
    the_queue_has_an_end,
    a_caller_that_goes_away_breaks_nothing,
    any_walk_through_the_calls_keeps_the_invariants,
);

#[test]
fn every_test_of_the_store_is_one_of_both_or_of_a_folder() {
    let mut names: Vec<&str> = Vec::new();
    let mut lines = include_str!("tests.rs").lines();
    while let Some(line) = lines.next() {
        if line.starts_with("#[tokio::test") || line == "#[test]" {
            let line = lines.next().unwrap();
            names.push(line.trim_start_matches("async ").trim_start_matches("fn ").trim_end_matches("() {"));
        }
    }
    let mut listed: Vec<&str> = OF_BOTH.iter().chain(OF_A_FOLDER).copied().collect();
    names.sort_unstable();
    listed.sort_unstable();
    assert_eq!(names, listed);
}

async fn pair(folder: &TempDir) -> (Store, Store) {
    (Store::open(options(folder)).await.unwrap(), Store::open(options(folder)).await.unwrap())
}

#[test]
fn the_tables_of_both_databases_have_the_same_columns() {
    sharing(columns);
}

#[tokio::main(flavor = "current_thread")]
async fn columns() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    let other = tempfile::tempdir().unwrap();
    let own = Store::open(StoreOptions { shared: None, ..options(&other) }).await.unwrap();
    for table in ["meshes", "jobs", "job_parameters", "job_bases", "idempotency_keys", "bases", "fields", "health"] {
        let theirs = sql::query(
            "SELECT column_name, data_type, CAST(CASE WHEN is_nullable = 'YES' THEN 0 ELSE 1 END AS BIGINT) AS needed
             FROM information_schema.columns WHERE table_name = ? ORDER BY column_name",
        );
        let theirs = theirs.bind(table).fetch_all(store.inner.catalog.reader()).await.unwrap();
        let theirs: Vec<(String, &str, bool)> = theirs
            .iter()
            .map(|row| {
                let kind = match row.try_get::<&str, _>("data_type").unwrap() {
                    "bigint" => "INTEGER",
                    "text" => "TEXT",
                    "double precision" => "REAL",
                    "bytea" => "BLOB",
                    other => panic!("{table}: {other}"),
                };
                (row.try_get("column_name").unwrap(), kind, row.try_get("needed").unwrap())
            })
            .collect();
        // SQLite does not say of primary keys that they are never null.
        let ours =
            sql::query("SELECT name, type, max(\"notnull\", pk > 0) AS needed FROM pragma_table_info(?) ORDER BY name");
        let ours = ours.bind(table).fetch_all(own.inner.catalog.reader()).await.unwrap();
        let ours: Vec<(String, &str, bool)> = ours
            .iter()
            .map(|row| {
                let kind = row.try_get("type").unwrap();
                (row.try_get("name").unwrap(), kind, row.try_get("needed").unwrap())
            })
            .collect();
        assert!(ours.len() > 1 && ours == theirs, "{table}:\n{ours:?}\n{theirs:?}");
    }
}

#[test]
fn parameters_of_jobs_that_exist_move_to_their_table() {
    sharing(parameters_move);
}

#[tokio::main(flavor = "current_thread")]
async fn parameters_move() {
    let folder = tempfile::tempdir().unwrap();
    let address = options(&folder).shared.unwrap().database;
    let pool = sqlx::PgPool::connect(&address).await.unwrap();
    migrations::postgres_at_first().run(&pool).await.unwrap();
    sqlx::query(migrations::tests::OLD_JOBS).execute(&pool).await.unwrap();
    pool.close().await;
    let store = Store::open(options(&folder)).await.unwrap();
    let jobs = store.jobs(&JobFilter::default(), &PageRequest::default()).await.unwrap().items;
    assert_eq!(jobs.iter().map(|job| job.parameters.clone()).collect::<Vec<_>>(), [json!({"b": 1}), json!({"a": "2"})]);
    assert_eq!(store.job_parameters(jobs[1].id).await.unwrap(), json!({"a": [1, 2]}));
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    assert_eq!((claim.job.id, claim.job.parameters), (jobs[1].id, json!({"a": [1, 2]})));
    assert_eq!(store.job(jobs[1].id).await.unwrap().parameters, json!({"a": "2"}));
}

#[test]
fn sixteen_claimers_of_four_processes_never_take_a_job_twice() {
    sharing(sixteen_claimers);
}

#[tokio::main(flavor = "multi_thread", worker_threads = 4)]
async fn sixteen_claimers() {
    const JOBS: usize = 300;
    let folder = tempfile::tempdir().unwrap();
    let mut stores = Vec::new();
    for _ in 0..4 {
        stores.push(Store::open(options(&folder)).await.unwrap());
    }
    let id = stores[0].add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for job in 0..JOBS {
        stores[job % 4].enqueue(new_job(&id, &format!("w{job}"))).await.unwrap();
    }
    let begun = std::time::Instant::now();
    let claimers = (0..16).map(|claimer| {
        let store = stores[claimer % 4].clone();
        tokio::spawn(async move {
            let (mut mine, mut waited) = (Vec::new(), Vec::new());
            loop {
                let asked = std::time::Instant::now();
                let Some(claim) = store.claim(&format!("{claimer}"), &[], LEASE).await.unwrap() else { break };
                waited.push(asked.elapsed());
                assert_eq!(claim.job.attempt, 1);
                mine.push(claim.job.id);
                let ended = store.fail(claim.token, &problem(), false).await.unwrap();
                assert_eq!(ended, FailAnswer::Finished(JobStatus::Failed));
            }
            (mine, waited)
        })
    });
    let (mut claimed, mut waited) = (Vec::new(), Vec::new());
    for claimer in claimers.collect::<Vec<_>>() {
        let (mine, times) = claimer.await.unwrap();
        claimed.extend(mine);
        waited.extend(times);
    }
    waited.sort_unstable();
    println!(
        "{:.0} jobs/s, claims p50 {:?}, p99 {:?}",
        JOBS as f64 / begun.elapsed().as_secs_f64(),
        waited[waited.len() / 2],
        waited[waited.len() * 99 / 100]
    );
    assert_eq!(claimed.len(), JOBS);
    assert_eq!(claimed.into_iter().collect::<HashSet<_>>().len(), JOBS);
}

#[test]
fn equal_work_that_arrives_at_several_servers_at_once_is_one_job() {
    sharing(equal_work_at_once);
}

#[tokio::main(flavor = "multi_thread", worker_threads = 4)]
async fn equal_work_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = pair(&folder).await;
    let id = one.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for round in 0..20 {
        let asks: Vec<_> = (0..12)
            .map(|ask| {
                let store = if ask % 2 == 0 { one.clone() } else { two.clone() };
                let key = IdempotencyKey { key: format!("k{round}"), request_hash: "r".to_owned() };
                // Some with a key, which comes back as well.
                let idempotency = (ask % 3 == 0).then_some(key);
                let new = NewJob { idempotency, ..new_job(&id, &format!("w{round}")) };
                tokio::spawn(async move { store.enqueue(new).await.unwrap() })
            })
            .collect();
        let (mut jobs, mut created) = (HashSet::new(), 0);
        for ask in asks {
            let enqueued = ask.await.unwrap();
            jobs.insert(enqueued.record.id);
            created += usize::from(enqueued.outcome == EnqueueOutcome::Created);
        }
        assert_eq!((jobs.len(), created), (1, 1), "round {round}");
    }
}

#[test]
fn opening_takes_nothing_from_others() {
    sharing(opening);
}

#[tokio::main(flavor = "current_thread")]
async fn opening() {
    let folder = tempfile::tempdir().unwrap();
    let first = Store::open(options(&folder)).await.unwrap();
    let id = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    first.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = first.claim("one", &[], LEASE).await.unwrap().unwrap();
    // An upload that is under way, and content that nothing refers to yet.
    let upload = Bytes::from_static(b"nothing refers to this yet");
    let hash = blobs::hash_of(&upload).await.unwrap();
    first.put_blob(&hash, &upload).await.unwrap();
    let second = Store::open(options(&folder)).await.unwrap();
    assert!(second.reap().await.unwrap().is_empty());
    assert_eq!(second.blob_bytes(&hash, 0..upload.len() as u64).await.unwrap(), upload);
    assert!(second.claim("two", &[], LEASE).await.unwrap().is_none());
    assert!(matches!(first.complete(claim.token, basis(1.0, 40), vec![]).await, Ok(CompleteAnswer::Stored(_))));
}

#[test]
fn what_a_lost_worker_held_is_claimed_by_another_at_once() {
    sharing(lost_worker);
}

#[tokio::main(flavor = "current_thread")]
async fn lost_worker() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000));
    let timed = StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) };
    let (one, two) = (Store::open(timed.clone()).await.unwrap(), Store::open(timed).await.unwrap());
    let id = one.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    one.enqueue(new_job(&id, "w")).await.unwrap();
    let stale = one.claim("one", &[], LEASE).await.unwrap().unwrap();
    assert!(two.claim("two", &[], LEASE).await.unwrap().is_none());
    hands.fetch_add(31_000, Ordering::Relaxed);
    let fresh = two.claim("two", &[], LEASE).await.unwrap().unwrap();
    assert_eq!((fresh.job.id, fresh.job.attempt), (stale.job.id, 2));
    // The first wakes up: whatever it does is void.
    assert_eq!(one.heartbeat(stale.token, None, LEASE).await.unwrap(), HeartbeatAnswer::Lost);
    assert_eq!(one.complete(stale.token, basis(9.0, 40), vec![]).await.unwrap(), CompleteAnswer::Lost);
    assert_eq!(one.fail(stale.token, &problem(), false).await.unwrap(), FailAnswer::Lost);
    assert!(!one.release(stale.token).await.unwrap());
    assert!(matches!(two.complete(fresh.token, basis(1.0, 40), vec![]).await, Ok(CompleteAnswer::Stored(_))));
    assert_eq!(one.job(stale.job.id).await.unwrap().status, JobStatus::Succeeded);
    assert_eq!(one.pieces_of_content().await, 2, "the mesh and the basis");
}

#[test]
fn a_job_is_left_to_a_worker_that_can_do_it() {
    sharing(left_to_the_right_one);
}

#[tokio::main(flavor = "current_thread")]
async fn left_to_the_right_one() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _other) = pair(&folder).await;
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    for (work, memory_bytes, solver_version) in
        [("large", 1000, "0.1.0+5"), ("small", 10, "0.1.0+5"), ("new", 10, "0.1.0+10")]
    {
        let solver_version = solver_version.to_owned();
        store.enqueue(NewJob { memory_bytes, solver_version, ..new_job(&id, work) }).await.unwrap();
    }
    let other = ["field_basis".to_owned()];
    let idle = store.claim("w", &other, LEASE).await.unwrap();
    assert!(idle.is_none(), "a worker of other kinds takes nothing");
    let claim = async |total_bytes, version: &'static str| {
        let company = Company { total_bytes, solver_version: Some(version), ..Company::default() };
        let claim = store.claim_within("w", &[], LEASE, u64::MAX, company).await.unwrap();
        claim.map(|claim| claim.job.work_key)
    };
    // An older worker waits for nothing that is not for it, and a small one is not held by what is too large for it.
    assert_eq!(claim(100, "0.1.0+4").await, None);
    assert_eq!(claim(100, "0.1.0+5").await.as_deref(), Some("small"));
    assert_eq!(claim(100, "0.1.0+9").await, None);
    assert_eq!(claim(2000, "0.1.0+9").await.as_deref(), Some("large"));
    assert_eq!(claim(100, "0.2.0+1").await.as_deref(), Some("new"));
}

#[test]
fn what_one_process_does_is_heard_of_in_another() {
    sharing(heard);
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn heard() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = pair(&folder).await;
    assert!(one.is_shared() && two.is_shared());
    let id = one.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let mut events = two.watch_jobs();
    let next = async |events: &mut broadcast::Receiver<JobEvent>| {
        tokio::time::timeout(Duration::from_secs(30), events.recv()).await.unwrap().unwrap()
    };
    let job = one.enqueue(new_job(&id, "w")).await.unwrap().record;
    let event = next(&mut events).await;
    assert_eq!((event.job, event.revision, event.status), (job.id, job.revision, JobStatus::Enqueued));
    tokio::time::timeout(Duration::from_secs(30), two.work().notified()).await.unwrap();
    // Claims and progress are found by looking.
    let claim = one.claim("w", &[], LEASE).await.unwrap().unwrap();
    let progress = Progress { stage: Some("eigen".to_owned()), ..Progress::default() };
    one.heartbeat(claim.token, Some(&progress), LEASE).await.unwrap();
    let mut event = next(&mut events).await;
    while event.revision < 3 {
        event = next(&mut events).await;
    }
    assert_eq!((event.status, event.revision), (JobStatus::Processing, 3));
    // To be stopped, which the worker hears of at once.
    let mut own = one.watch_jobs();
    two.cancel_job(job.id).await.unwrap();
    assert!(next(&mut own).await.cancel_requested);
    assert!(one.finish_canceled(claim.token).await.unwrap());
    while event.status != JobStatus::Canceled {
        event = next(&mut events).await;
    }
}

/// Damages every object, as a disk would.
async fn damage_all(objects: &objects::Objects, how: impl Fn(Vec<u8>) -> Option<Vec<u8>>) {
    let keys: Vec<String> =
        sql::query_scalar("SELECT object FROM blobs").fetch_all(objects.records.on()).await.unwrap();
    for key in keys.into_iter().map(Path::from) {
        let bytes = objects.store.get(&key).await.unwrap().bytes().await.unwrap();
        match how(bytes.to_vec()) {
            Some(bytes) => drop(objects.store.put(&key, bytes.into()).await.unwrap()),
            None => objects.store.delete(&key).await.unwrap(),
        }
    }
}

#[test]
fn damaged_objects_are_told_and_written_anew() {
    sharing(damaged_objects);
}

#[tokio::main(flavor = "current_thread")]
async fn damaged_objects() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _other) = pair(&folder).await;
    let new = mesh(1, 9000);
    let record = store.add_mesh(new.clone()).await.unwrap().record;
    let objects = match &store.inner.blobs {
        Blobs::Objects(objects) => objects,
        Blobs::Chunks(_) => panic!("the content is shared"),
    };
    damage_all(objects, |mut bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        Some(bytes)
    })
    .await;
    assert!(matches!(store.load_mesh(&record.id).await, Err(StoreError::Damaged { .. })));
    let whole = 0..record.bytes;
    assert!(matches!(store.blob_bytes(&record.content_hash, whole.clone()).await, Err(StoreError::Damaged { .. })));
    assert!(!store.add_mesh(new.clone()).await.unwrap().created);
    assert_eq!(store.load_mesh(&record.id).await.unwrap(), new.mesh);
    damage_all(objects, |_| None).await;
    assert!(matches!(store.blob_bytes(&record.content_hash, whole).await, Err(StoreError::Damaged { .. })));
}

#[test]
fn content_that_nothing_refers_to_has_an_hour() {
    sharing(an_hour);
}

#[tokio::main(flavor = "current_thread")]
async fn an_hour() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000_000));
    let timed = StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) };
    let (one, two) = (Store::open(timed.clone()).await.unwrap(), Store::open(timed).await.unwrap());
    let orphan = Bytes::from_static(b"nothing refers to this");
    let hash = blobs::hash_of(&orphan).await.unwrap();
    one.put_blob(&hash, &orphan).await.unwrap();
    let kept = one.add_mesh(mesh(1, 9)).await.unwrap().record;
    assert_eq!(two.look_for_orphans().await.unwrap().condemned, 1);
    hands.fetch_add(orphans::REPRIEVE_MS - 1000, Ordering::Relaxed);
    assert_eq!(two.look_for_orphans().await.unwrap().deleted, 0);
    // Someone is about to refer to it after all, and has another hour for that.
    one.put_blob(&hash, &orphan).await.unwrap();
    hands.fetch_add(2000, Ordering::Relaxed);
    assert_eq!(two.look_for_orphans().await.unwrap().deleted, 0);
    assert_eq!(one.blob_length(&hash).await.unwrap(), orphan.len() as u64);
    hands.fetch_add(orphans::REPRIEVE_MS + 1000, Ordering::Relaxed);
    assert_eq!(one.look_for_orphans().await.unwrap().deleted, 1);
    assert!(matches!(one.blob_length(&hash).await, Err(StoreError::NotFound { .. })));
    let Blobs::Objects(objects) = &two.inner.blobs else { panic!("the content is shared") };
    assert_eq!(objects.store.list(None).count().await, 1, "the object of the mesh");
    assert_eq!(*two.load_mesh(&kept.id).await.unwrap(), *mesh(1, 9).mesh);
}

#[test]
fn large_content_goes_in_parts_and_comes_in_ranges() {
    sharing(large_content);
}

#[tokio::main(flavor = "current_thread")]
async fn large_content() {
    let folder = tempfile::tempdir().unwrap();
    let (store, other) = pair(&folder).await;
    let content =
        Bytes::from((0..20_000_003u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 7) as u8).collect::<Vec<_>>());
    let hash = blobs::hash_of(&content).await.unwrap();
    store.put_blob(&hash, &content).await.unwrap();
    let n = content.len() as u64;
    for range in [0..n, 8_388_607..8_388_609, 5_000_000..19_000_001, n - 1..n, 7..7] {
        let expected = content.slice(range.start as usize..range.end as usize);
        assert_eq!(other.blob_bytes(&hash, range.clone()).await.unwrap(), expected, "{range:?}");
        let streamed: Vec<Bytes> = other.blob_stream(&hash, range.clone()).map(Result::unwrap).collect().await;
        assert_eq!(streamed.concat(), expected, "{range:?}");
    }
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn refusals_and_cuts() {
    let folder = tempfile::tempdir().unwrap();
    let (store, other) = pair(&folder).await;
    let server = s3_server::of_folder(folder.path(), false);
    let content =
        Bytes::from((0..9_000_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 9) as u8).collect::<Vec<_>>());
    let hash = blobs::hash_of(&content).await.unwrap();
    // Of each request of an upload in parts, the first is refused.
    server.faults.refuse.store(2, Ordering::Relaxed);
    store.put_blob(&hash, &content).await.unwrap();
    assert_eq!(server.faults.refuse.load(Ordering::Relaxed), 0);
    for (refused, cut) in [(2, 0), (0, 1), (1, 2)] {
        server.faults.refuse.store(refused, Ordering::Relaxed);
        server.faults.cut.store(cut, Ordering::Relaxed);
        assert_eq!(other.blob_bytes(&hash, 0..content.len() as u64).await.unwrap(), content);
        assert_eq!(server.faults.cut.load(Ordering::Relaxed), 0);
    }
    // What never works is told, as nobody's damage.
    server.faults.refuse.store(u64::MAX, Ordering::Relaxed);
    let told = other.blob_bytes(&hash, 0..9).await.unwrap_err();
    assert!(matches!(told, StoreError::Unavailable { .. }), "{told:?}");
    server.faults.refuse.store(0, Ordering::Relaxed);
    assert_eq!(other.blob_bytes(&hash, 0..9).await.unwrap(), content.slice(..9));
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn away() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _other) = pair(&folder).await;
    let server = s3_server::of_folder(folder.path(), false);
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = store.claim("one", &[], LEASE).await.unwrap().unwrap();
    server.faults.refuse.store(u64::MAX, Ordering::Relaxed);
    // Who uploads is told.
    let told = store.add_mesh(mesh(2, 12)).await.unwrap_err();
    assert!(matches!(told, StoreError::Unavailable { .. }) && told.is_retryable(), "{told:?}");
    // A result waits.
    let completing = tokio::spawn({
        let store = store.clone();
        async move { store.complete(claim.token, basis(1.0, 40), vec![]).await }
    });
    let before = server.faults.met.load(Ordering::Relaxed);
    while server.faults.met.load(Ordering::Relaxed) < before + 6 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(!completing.is_finished());
    server.faults.refuse.store(0, Ordering::Relaxed);
    assert!(matches!(completing.await.unwrap(), Ok(CompleteAnswer::Stored(_))));
    let job = store.job(claim.job.id).await.unwrap();
    assert_eq!((job.status, job.attempt), (JobStatus::Succeeded, 1));
    // What was begun in vain is not seen.
    assert_eq!(store.pieces_of_content().await, 2);
}

/// A basis in columns, whose content is made while it is written.
fn dense(seed: f64) -> Basis {
    let columns = DenseMatrix::from_columns(40, 2, (0..80).map(|i| f64::from(i).mul_add(seed, 1.0).sin()).collect());
    let columns = DenseFunctions::from_columns(&columns, Precision::F64);
    Basis { functions: Functions::Dense(columns), ..basis(seed, 40) }
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn refused() {
    let folder = tempfile::tempdir().unwrap();
    let places = options(&folder);
    let shared = places.shared.clone().unwrap();
    // There is no such database.
    let database = shared.database.replacen("/of_", "/not_", 1);
    let told = Store::open(StoreOptions { shared: Some(SharedPlaces { database, ..shared }), ..places }).await;
    let told = told.unwrap_err();
    assert!(matches!(told, StoreError::Refused { .. }), "{told:?}");
    // Rights that are taken away while a result is written: it is told with the next answer.
    let store = Store::open(options(&folder)).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = store.claim("one", &[], LEASE).await.unwrap().unwrap();
    let open = s3_server::of_folder(folder.path(), false);
    open.faults.forbid.store(true, Ordering::Relaxed);
    let before = open.faults.requests.load(Ordering::Relaxed);
    let told = store.complete(claim.token, dense(1.0), vec![]).await.unwrap_err();
    assert!(matches!(&told, StoreError::Refused { detail } if detail.contains("AccessDenied")), "{told:?}");
    assert!(open.faults.requests.load(Ordering::Relaxed) < before + 5, "it was asked again and again");
    open.faults.forbid.store(false, Ordering::Relaxed);
    // The lease still holds.
    assert!(matches!(store.complete(claim.token, dense(1.0), vec![]).await, Ok(CompleteAnswer::Stored(_))));
}

/// Sends everybody away from the database of a folder, or lets them in again.
fn close_database(folder: &TempDir, closed: bool) {
    let server = server::server().unwrap();
    let address = server.database_of(folder.path());
    let name = address.split_once("?host=").unwrap().0.rsplit_once('/').unwrap().1;
    assert!(server.psql("postgres", &format!("ALTER DATABASE {name} ALLOW_CONNECTIONS {}", !closed)));
    if closed {
        let end = format!("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{name}'");
        assert!(server.psql("postgres", &end));
    }
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn database_away() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _other) = pair(&folder).await;
    let server = s3_server::of_folder(folder.path(), false);
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = store.claim("one", &[], LEASE).await.unwrap().unwrap();
    server.faults.refuse.store(u64::MAX, Ordering::Relaxed);
    let before = server.faults.met.load(Ordering::Relaxed);
    let completing = tokio::spawn({
        let store = store.clone();
        async move { store.complete(claim.token, dense(1.0), vec![]).await }
    });
    // Its object is on its way; then the database goes.
    while server.faults.met.load(Ordering::Relaxed) < before + 2 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    close_database(&folder, true);
    assert!(store.job(claim.job.id).await.is_err());
    let written = server.faults.requests.load(Ordering::Relaxed);
    server.faults.refuse.store(0, Ordering::Relaxed);
    // The object and a look at it.
    while server.faults.requests.load(Ordering::Relaxed) < written + 2 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert!(!completing.is_finished());
    close_database(&folder, false);
    assert!(matches!(completing.await.unwrap(), Ok(CompleteAnswer::Stored(_))));
    let job = store.job(claim.job.id).await.unwrap();
    assert_eq!((job.status, job.attempt), (JobStatus::Succeeded, 1));
    assert_eq!(store.pieces_of_content().await, 2, "the mesh and the basis, each once");
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn completing_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _other) = pair(&folder).await;
    let Blobs::Objects(objects) = &store.inner.blobs else { panic!("the content is shared") };
    // Content: the answer to the first try is lost.
    let bytes = Bytes::from_static(b"made once");
    let hash = blobs::hash_of(&bytes).await.unwrap();
    for equal_content_came_first in [false, true] {
        let mut upload = objects.begin(&hash, bytes.len() as u64, true, store.now_ms()).await.unwrap();
        objects.write(&mut upload, std::slice::from_ref(&bytes), store.now_ms()).await.unwrap();
        let sealed = objects.seal(&mut upload, bytes.len() as u64).await.unwrap();
        let ready = objects.place(&hash).await.unwrap();
        assert_eq!(ready.is_some(), equal_content_came_first);
        for _ in 0..2 {
            store.make_ready(objects, &sealed, &hash).await.unwrap();
            let now = objects.place(&hash).await.unwrap().unwrap();
            assert_eq!(now, ready.unwrap_or(now));
            assert_eq!(store.blob_bytes(&hash, 0..now.bytes).await.unwrap(), bytes);
        }
    }
    // A job likewise.
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = store.claim("one", &[], LEASE).await.unwrap().unwrap();
    let written = store.put_product(claim.token, dense(1.0).into(), None).await.unwrap();
    let tried = leases::Tried::default();
    let first = store.make_visible(claim.token, written.as_ref(), &[], &tried).await.unwrap();
    assert!(matches!(first, CompleteAnswer::Stored(_)));
    assert_eq!(store.make_visible(claim.token, written.as_ref(), &[], &tried).await.unwrap(), first);
    // Whoever has not tried has lost it.
    let stranger = leases::Tried::default();
    let void = store.make_visible(claim.token, written.as_ref(), &[], &stranger).await.unwrap();
    assert_eq!(void, CompleteAnswer::Lost);
}

#[test]
fn what_is_there_is_found_whoever_can_do_it_anew() {
    sharing(found_anyhow);
}

#[tokio::main(flavor = "current_thread")]
async fn found_anyhow() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let idempotency = Some(IdempotencyKey { key: "k".to_owned(), request_hash: "r".to_owned() });
    let large = NewJob { memory_bytes: 1000, most_bytes: 1000, idempotency, ..new_job(&id, "w") };
    let made = store.enqueue(large.clone()).await.unwrap();
    assert_eq!(made.outcome, EnqueueOutcome::Created);
    // The worker that could do it has gone.
    let replayed = store.enqueue(NewJob { most_bytes: 999, ..large.clone() }).await.unwrap();
    assert_eq!((replayed.outcome, replayed.record.id), (EnqueueOutcome::Replayed, made.record.id));
    let same = NewJob { most_bytes: 999, idempotency: None, ..large.clone() };
    let same = store.enqueue(same).await.unwrap();
    assert_eq!((same.outcome, same.record.id), (EnqueueOutcome::SameWork, made.record.id));
    let new = NewJob { most_bytes: 999, idempotency: None, work_key: "other".to_owned(), ..large };
    let refused = store.enqueue(new).await.unwrap_err();
    assert!(matches!(refused, StoreError::JobTooLarge { needed: 1000, limit: 999 }), "{refused:?}");
}

#[test]
fn every_schedule_of_leases_goes_as_the_model_says_where_records_are_shared() {
    sharing(lease_model::schedules);
}

/// Figures of one large transfer: `CHLADNI_LARGE_OBJECTS` is the address of a store that nobody has to sign for, and `CHLADNI_LARGE_MB` how much.
#[test]
#[ignore = "figures, with an object store of its own"]
fn a_large_object_goes_and_comes_in_little_memory() {
    sharing(large_object);
}

/// Most bytes that were resident since the last call.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap();
    std::fs::write("/proc/self/clear_refs", "5").unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() << 10
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn large_object() {
    let objects = std::env::var("CHLADNI_LARGE_OBJECTS").expect("CHLADNI_LARGE_OBJECTS");
    let megabytes: u64 = std::env::var("CHLADNI_LARGE_MB").map_or(1000, |text| text.parse().unwrap());
    let bytes = megabytes * 1_000_000;
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(&folder);
    options.shared.as_mut().unwrap().objects = objects;
    let store = Store::open(options).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&id, "w")).await.unwrap();
    let claim = store.claim("one", &[], Duration::from_secs(3600)).await.unwrap().unwrap();
    let fill = move |out: &mut dyn std::io::Write| {
        let (mut state, mut piece) = (1u64, vec![0u8; 1 << 16]);
        let mut left = bytes as usize;
        while left > 0 {
            for word in piece.as_chunks_mut::<8>().0 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                *word = state.to_le_bytes();
            }
            let taken = left.min(piece.len());
            out.write_all(&piece[..taken]).unwrap();
            left -= taken;
        }
    };
    // What a copy takes: from a file to a file, to the disk.
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    fill(&mut std::io::BufWriter::new(std::fs::File::create(&one).unwrap()));
    std::fs::File::open(&one).unwrap().sync_all().unwrap();
    let begun = std::time::Instant::now();
    std::fs::copy(&one, &two).unwrap();
    std::fs::File::open(&two).unwrap().sync_all().unwrap();
    let copy = begun.elapsed().as_secs_f64();
    std::fs::remove_file(&one).unwrap();
    std::fs::remove_file(&two).unwrap();
    peak();
    let before = peak();
    let begun = std::time::Instant::now();
    let make = move |out: &mut piece_writer::PieceWriter| {
        fill(out);
        Ok(())
    };
    let (_, hash, written) = store.put_made(bytes, claim.token, make).await.unwrap().unwrap();
    let (up, up_peak) = (begun.elapsed().as_secs_f64(), peak() - before);
    assert_eq!(written, bytes);
    let before = peak();
    let begun = std::time::Instant::now();
    let (mut read, mut stream) = (0, Box::pin(store.blob_stream(&hash, 0..bytes)));
    while let Some(piece) = stream.next().await {
        read += piece.unwrap().len() as u64;
    }
    let (down, down_peak) = (begun.elapsed().as_secs_f64(), peak() - before);
    assert_eq!(read, bytes);
    println!(
        "{megabytes} MB: copy {copy:.2} s; up {up:.2} s, {:.0} MB resident; down {down:.2} s, {:.0} MB resident",
        up_peak as f64 / 1e6,
        down_peak as f64 / 1e6
    );
}
