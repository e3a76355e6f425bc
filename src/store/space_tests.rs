//! Room that was taken comes back.

use std::{
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};

use super::super::{
    Clock, PageRequest, Retention, Store, StoreError, StoreOptions,
    tests::{done, mesh, new_job, options},
};
use super::{Pages, has_room};

#[test]
fn reusable_pages_are_room_and_the_log_has_its_own() {
    let least = 800;
    assert!(has_room(100, 900, 0, least) && !has_room(101, 900, 0, least));
    assert!(has_room(100, 400, 500, least), "half of it is free within the database");
    assert!(!has_room(101, 400, 500, least));
    assert!(!has_room(0, 99, 10_000, least), "the log could not be written");
    assert!(has_room(0, 100, 10_000, least));
    assert!(has_room(5, 0, 5, 0) && has_room(u64::MAX, u64::MAX, 0, 0));
}

#[tokio::test]
async fn what_is_deleted_comes_back_to_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(StoreOptions { blob_bytes_limit: Some(24 << 20), ..options(&folder) }).await.unwrap();
    let file = folder.path().join("blobs.db");
    let empty = std::fs::metadata(&file).unwrap().len();
    for round in 0..3 {
        // 3.6 MB each, until it is full.
        let mut stored = Vec::new();
        loop {
            match store.add_mesh(mesh(round * 100 + stored.len(), 100_000)).await {
                Ok(new) => stored.push(new.record.id),
                Err(StoreError::StorageFull { .. }) => break,
                Err(error) => panic!("{error}"),
            }
        }
        assert!(stored.len() >= 5, "round {round}: {}", stored.len());
        assert!(Pages::of(store.chunks()).await.unwrap().incremental);
        store.chunks().truncate_log().await.unwrap();
        let full = std::fs::metadata(&file).unwrap().len();
        for id in stored {
            store.delete_mesh(&id, false).await.unwrap();
        }
        store.reap().await.unwrap();
        let left = std::fs::metadata(&file).unwrap().len();
        let returned = (full - left) as f64 / (full - empty) as f64;
        assert!(returned >= 0.9, "round {round}: {full} bytes, {left} are left, {returned:.3} came back");
    }
    assert!(store.compact().await.unwrap().after <= 2 * empty + (1 << 20));
}

#[tokio::test]
async fn a_database_from_before_is_written_anew_by_compact() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("meta.db");
    let before = sqlx::sqlite::SqliteConnectOptions::new().filename(&path).create_if_missing(true);
    let pool = sqlx::SqlitePool::connect_with(before).await.unwrap();
    sqlx::query("CREATE TABLE old (x)").execute(&pool).await.unwrap();
    pool.close().await;
    let store = Store::open(options(&folder)).await.unwrap();
    let id = store.add_mesh(mesh(1, 100)).await.unwrap().record.id;
    assert!(!Pages::of(store.records()).await.unwrap().incremental);
    store.compact().await.unwrap();
    assert!(Pages::of(store.records()).await.unwrap().incremental);
    store.load_mesh(&id).await.unwrap();
    store.close().await;
    drop(store);
    Store::open(options(&folder)).await.unwrap().load_mesh(&id).await.unwrap();
}

#[tokio::test]
async fn the_least_recently_used_goes_first_and_never_what_the_queue_needs() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000_000));
    let clock = Clock::manual(Arc::clone(&hands));
    let store = Store::open(StoreOptions { clock, ..options(&folder) }).await.unwrap();
    let pass = |seconds: i64| hands.fetch_add(seconds * 1000, Ordering::Relaxed);
    let mut meshes = Vec::new();
    for seed in 0..4 {
        meshes.push(store.add_mesh(mesh(seed, 100)).await.unwrap().record.id);
        pass(10);
    }
    let waiting = store.enqueue(new_job(&meshes[0], "waits")).await.unwrap().record.id;
    store.cancel_job(waiting).await.unwrap();
    let old = done(&store, &meshes[1], 1.0).await;
    pass(10);
    let new = done(&store, &meshes[1], 2.0).await;
    pass(10);
    store.load_basis(old).await.unwrap();
    let needed = store.enqueue(new_job(&meshes[2], "needed")).await.unwrap().record.id;
    pass(3600);

    // By count: the basis that was used last stays, though it is the older one.
    let removed = store.retain(&Retention { bases: Some(1), ..Retention::default() }).await.unwrap();
    assert_eq!((removed.bases, removed.meshes, removed.jobs), (1, 0, 0));
    assert!(store.basis(old).await.is_ok() && store.basis(new).await.is_err());
    // By age: one has a basis, one a job that waits; the others go.
    let minute = Duration::from_secs(60);
    let removed = store.retain(&Retention { mesh_age: Some(minute), ..Retention::default() }).await.unwrap();
    assert_eq!((removed.bases, removed.meshes, removed.jobs), (0, 2, 0));
    let left: Vec<_> = store.meshes(&PageRequest::default()).await.unwrap().items.into_iter().map(|m| m.id).collect();
    assert_eq!(left, [meshes[2].clone(), meshes[1].clone()]);
    // Jobs: the one whose basis is stored stays, and the one that waits.
    let removed = store.retain(&Retention { job_age: Some(minute), ..Retention::default() }).await.unwrap();
    assert_eq!((removed.bases, removed.meshes, removed.jobs), (0, 0, 2));
    assert!(store.job(needed).await.is_ok());
    // By bytes: all that may go.
    let removed = store.retain(&Retention { bytes: Some(0), ..Retention::default() }).await.unwrap();
    assert_eq!((removed.bases, removed.meshes), (1, 0), "the mesh has its turn once its basis is gone");
    let removed = store.retain(&Retention { bytes: Some(0), jobs: Some(0), ..Retention::default() }).await.unwrap();
    assert_eq!((removed.bases, removed.meshes, removed.jobs), (0, 1, 1));
    assert!(store.load_mesh(&meshes[2]).await.is_ok(), "a job in the queue needs it");
}

#[tokio::test]
async fn what_is_beyond_a_bound_goes_in_one_turn_however_many_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let retention = Retention { meshes: Some(5), ..Retention::default() };
    let store = Store::open(StoreOptions { retention, ..options(&folder) }).await.unwrap();
    for seed in 0..260 {
        store.add_mesh(mesh(seed, 10)).await.unwrap();
    }
    store.inner.retained_ms.store(0, Ordering::Relaxed);
    store.retain_in_turn().await.unwrap();
    let page = PageRequest { limit: PageRequest::MOST, ..PageRequest::default() };
    assert_eq!(store.meshes(&page).await.unwrap().items.len(), 5);
}
