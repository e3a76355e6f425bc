//! The same promises where the records are in a PostgreSQL and the content in an object store, and what is promised
//! there alone.
#![cfg(feature = "cluster")]

use std::cell::Cell;

use chladni_s3_server as s3_server;

use super::*;

#[path = "../../tests/common/postgres.rs"]
mod server;

#[cfg(test)]
#[path = "shared_object_tests.rs"]
mod objects_elsewhere;

#[cfg(test)]
#[path = "shared_trouble_tests.rs"]
mod trouble;

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
        a_mesh_is_stored_once_and_comes_back_whole: tests::content::a_mesh_is_stored_once_and_comes_back_whole,
        a_job_goes_from_enqueued_to_its_basis: tests::jobs_and_leases::a_job_goes_from_enqueued_to_its_basis,
        ranges_of_a_blob_are_exact_across_chunks: tests::content::ranges_of_a_blob_are_exact_across_chunks,
        opening_takes_nothing_from_others: opening,
        damaged_objects_are_told_and_written_anew: objects_elsewhere::damaged_objects,
        content_that_nothing_refers_to_has_an_hour: objects_elsewhere::an_hour,
        large_content_goes_in_parts_and_comes_in_ranges: objects_elsewhere::large_content,
        a_store_that_refuses_and_cuts_is_asked_again: objects_elsewhere::refusals_and_cuts,
        a_store_that_is_away_is_told_and_a_result_waits_for_it: objects_elsewhere::away,
        who_is_refused_is_told_at_once: objects_elsewhere::refused,
        a_result_survives_a_database_that_goes_away_before_it_is_seen: objects_elsewhere::database_away,
        a_store_of_another_database_is_refused: trouble::strangers,
        completing_twice_is_completing_once: objects_elsewhere::completing_twice,
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
    ($($file:ident: $($name:ident),*;)*) => {
        const OF_BOTH: &[&str] = &[$($(stringify!($name)),*),*];
        $($(
            #[test]
            fn $name() {
                sharing(super::$file::$name);
            }
        )*)*
    };
}

both!(
    content: a_mesh_is_stored_once_and_comes_back_whole,
        fields_are_kept_once_and_go_with_their_mesh_or_their_basis,
        equal_meshes_that_arrive_at_once_are_one,
        an_upload_is_stored_whoever_deletes_the_same_mesh_meanwhile,
        a_mesh_in_use_is_deleted_only_with_what_uses_it,
        pages_are_stable_while_rows_arrive,
        ranges_of_a_blob_are_exact_across_chunks,
        the_cache_loads_each_basis_once_and_keeps_to_its_bytes;
    jobs_and_leases: the_bases_of_a_job_stay_until_it_has_ended,
        a_job_goes_from_enqueued_to_its_basis,
        four_workers_claim_each_job_exactly_once,
        urgent_jobs_come_first_and_equals_in_order,
        equal_work_is_done_once,
        an_idempotency_key_stands_for_one_request,
        the_writes_of_a_lost_lease_change_nothing,
        attempts_are_bounded_and_pauses_grow,
        a_worker_that_is_lost_makes_no_longer_pause_the_more_often_that_happens,
        a_clock_that_goes_back_holds_no_job,
        a_job_is_cancelled_at_once_or_at_its_end,
        a_large_job_is_waited_for_and_not_overtaken,
        the_queue_has_an_end,
        a_caller_that_goes_away_breaks_nothing,
        any_walk_through_the_calls_keeps_the_invariants;
    jobs_in_parts: a_job_waits_for_its_parts_without_a_worker,
        equal_parts_are_solved_once_and_stay_while_a_job_needs_them,
        a_part_that_is_given_up_ends_its_job_and_a_retry_finds_the_others,
        parts_go_with_their_job_and_what_they_made_with_them,
        parts_are_shown_where_they_are_asked_for_and_go_with_their_job_alone,
        who_has_lost_a_job_does_not_divide_it,
        any_walk_with_parts_ends_and_leaves_nothing_behind;
);

#[test]
fn every_test_of_the_store_is_one_of_both_or_of_a_folder() {
    let mut names: Vec<&str> = Vec::new();
    let files = [include_str!("content_tests.rs"), include_str!("job_tests.rs"), include_str!("parts_tests.rs")];
    let mut lines = files.into_iter().flat_map(str::lines);
    while let Some(line) = lines.next() {
        if line.starts_with("#[tokio::test") || line == "#[test]" {
            let line = lines.next().unwrap();
            names.push(
                line.trim_start_matches("pub(super) ")
                    .trim_start_matches("async ")
                    .trim_start_matches("fn ")
                    .trim_end_matches("() {"),
            );
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
    for table in
        ["meshes", "jobs", "job_parameters", "job_bases", "job_parts", "idempotency_keys", "bases", "fields", "health"]
    {
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
