//! Databases that do not belong together are refused, and nothing is deleted for it.

use std::sync::{Arc, atomic::AtomicI64};

use super::super::{
    Clock, PageRequest, Store, StoreError, StoreOptions,
    orphans::REPRIEVE_MS,
    tests::{mesh, options},
};
use tempfile::TempDir;

async fn refused(folder: &TempDir, what: &str) {
    match Store::open(options(folder)).await {
        Err(StoreError::Mismatch { meta, blobs, detail }) => {
            assert!(detail.contains(what), "{detail}");
            assert!(meta.ends_with("meta.db") && blobs.ends_with("blobs.db"));
        }
        other => panic!("{what}: {other:?}"),
    }
}

/// A closed store has no other files.
fn copy(folder: &TempDir, from: &str, to: &str) {
    std::fs::copy(folder.path().join(from), folder.path().join(to)).unwrap();
}

#[tokio::test]
async fn a_lost_or_older_database_is_refused_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let store = Store::open(options(&folder)).await.unwrap();
    let first = store.add_mesh(mesh(1, 50)).await.unwrap().record.id;
    store.close().await;
    drop(store);
    copy(&folder, "meta.db", "meta.old");
    copy(&folder, "blobs.db", "blobs.old");
    let store = Store::open(options(&folder)).await.unwrap();
    let second = store.add_mesh(mesh(2, 50)).await.unwrap().record.id;
    store.close().await;
    drop(store);
    copy(&folder, "meta.db", "meta.new");
    copy(&folder, "blobs.db", "blobs.new");

    for (lost, what) in [("meta.db", "meta.db is missing or empty"), ("blobs.db", "blobs.db is missing or empty")] {
        std::fs::rename(file(lost), file("away")).unwrap();
        refused(&folder, what).await;
        std::fs::write(file(lost), "").unwrap();
        refused(&folder, what).await;
        std::fs::rename(file("away"), file(lost)).unwrap();
    }
    copy(&folder, "meta.old", "meta.db");
    refused(&folder, "meta.db is older").await;
    copy(&folder, "meta.new", "meta.db");
    copy(&folder, "blobs.old", "blobs.db");
    refused(&folder, "blobs.db is older").await;
    copy(&folder, "blobs.new", "blobs.db");
    // Another folder's database fits neither.
    let other = tempfile::tempdir().unwrap();
    let store = Store::open(options(&other)).await.unwrap();
    store.add_mesh(mesh(3, 50)).await.unwrap();
    store.close().await;
    drop(store);
    std::fs::copy(other.path().join("meta.db"), file("meta.db")).unwrap();
    refused(&folder, "each was paired with another").await;
    copy(&folder, "meta.new", "meta.db");

    let store = Store::open(options(&folder)).await.unwrap();
    for id in [&first, &second] {
        store.load_mesh(id).await.unwrap();
    }
    assert_eq!(store.meshes(&PageRequest::default()).await.unwrap().items.len(), 2);
}

#[tokio::test]
async fn an_older_copy_of_the_same_run_is_refused_too() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    store.add_mesh(mesh(1, 50)).await.unwrap();
    // A copy while the store is open, with its log.
    for name in ["meta.db", "meta.db-wal"] {
        copy(&folder, name, &format!("{name}.old"));
    }
    store.add_mesh(mesh(2, 50)).await.unwrap();
    store.close().await;
    drop(store);
    copy(&folder, "meta.db.old", "meta.db");
    copy(&folder, "meta.db-wal.old", "meta.db-wal");
    refused(&folder, "meta.db is older").await;
}

#[tokio::test]
async fn orphans_go_an_hour_after_they_were_first_seen() {
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000_000));
    let at = |ms: i64| StoreOptions {
        clock: Clock::manual(Arc::new(AtomicI64::new(1_000_000_000 + ms))),
        ..options(&folder)
    };
    let store =
        Store::open(StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) }).await.unwrap();
    let record = store.add_mesh(mesh(1, 50)).await.unwrap().record;
    let other = store.add_mesh(mesh(2, 50)).await.unwrap().record;
    // What a crash between content and record leaves, or a record that was lost.
    let mut transaction = store.records().write().await.unwrap();
    sqlx::query("DELETE FROM meshes WHERE id = ?").bind(&record.id).execute(transaction.on()).await.unwrap();
    transaction.commit().await.unwrap();
    store.close().await;
    drop(store);
    for (ms, kept) in [(0, true), (REPRIEVE_MS - 1, true), (REPRIEVE_MS, false)] {
        let store = Store::open(at(ms)).await.unwrap();
        assert_eq!(store.blob_length(&record.content_hash).await.is_ok(), kept, "after {ms} ms");
        store.load_mesh(&other.id).await.unwrap();
        store.close().await;
    }
}

#[tokio::test]
async fn an_orphan_that_is_wanted_again_stays() {
    let folder = tempfile::tempdir().unwrap();
    let at = |ms: i64| StoreOptions {
        clock: Clock::manual(Arc::new(AtomicI64::new(1_000_000_000 + ms))),
        ..options(&folder)
    };
    let store = Store::open(at(0)).await.unwrap();
    let record = store.add_mesh(mesh(1, 50)).await.unwrap().record;
    let mut transaction = store.records().write().await.unwrap();
    sqlx::query("DELETE FROM meshes").execute(transaction.on()).await.unwrap();
    transaction.commit().await.unwrap();
    store.close().await;
    drop(store);
    let store = Store::open(at(1)).await.unwrap();
    assert!(store.add_mesh(mesh(1, 50)).await.unwrap().created);
    store.close().await;
    drop(store);
    let store = Store::open(at(2 * REPRIEVE_MS)).await.unwrap();
    store.load_mesh(&record.id).await.unwrap();
    let marks: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM blobs WHERE condemned_ms IS NOT NULL")
        .fetch_one(store.chunks().reader())
        .await
        .unwrap();
    assert_eq!(marks, 0);
}

/// A folder as the version before wrote it is paired as it is.
#[tokio::test]
async fn databases_from_before_are_paired_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    let id = store.add_mesh(mesh(1, 50)).await.unwrap().record.id;
    for database in [store.records(), store.chunks()] {
        let mut transaction = database.write().await.unwrap();
        sqlx::query("DELETE FROM identity").execute(transaction.on()).await.unwrap();
        transaction.commit().await.unwrap();
    }
    store.records().close().await;
    store.chunks().close().await;
    drop(store);
    let store = Store::open(options(&folder)).await.unwrap();
    store.load_mesh(&id).await.unwrap();
    store.close().await;
}
