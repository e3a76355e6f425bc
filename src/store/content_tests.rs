//! What the store promises of meshes, bases, fields, and of content and the folder that it lies in.

use super::*;

#[tokio::test]
pub(super) async fn a_mesh_is_stored_once_and_comes_back_whole() {
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
pub(super) async fn fields_are_kept_once_and_go_with_their_mesh_or_their_basis() {
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
    // A basis that is made anew keeps its fields; one that is deleted takes them with it, and leaves content that
    // others have.
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
pub(super) async fn equal_meshes_that_arrive_at_once_are_one() {
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
pub(super) async fn an_upload_is_stored_whoever_deletes_the_same_mesh_meanwhile() {
    let (store, _folder) = store().await;
    let deletes = tokio::spawn({
        let store = store.clone();
        async move {
            loop {
                let listed = store.meshes_named(None, &PageRequest::default()).await.unwrap();
                for record in listed.items {
                    let _ = store.delete_mesh(&record.id, false).await;
                }
            }
        }
    });
    for _ in 0..60 {
        let stored = store.add_mesh(mesh(4, 30)).await.unwrap();
        assert_eq!(stored.record.vertices, 30);
    }
    deletes.abort();
}

#[tokio::test]
pub(super) async fn a_mesh_in_use_is_deleted_only_with_what_uses_it() {
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
pub(super) async fn pages_are_stable_while_rows_arrive() {
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
pub(super) async fn ranges_of_a_blob_are_exact_across_chunks() {
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
pub(super) async fn a_slow_reader_keeps_no_transaction_open() {
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
pub(super) async fn the_cache_loads_each_basis_once_and_keeps_to_its_bytes() {
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
pub(super) async fn damaged_content_is_told_and_not_served() {
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
pub(super) async fn half_written_content_goes_and_leases_of_the_dead_are_reaped_at_the_start() {
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
pub(super) async fn a_folder_serves_one_store_at_a_time() {
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
pub(super) async fn a_full_disk_is_told_and_leaves_nothing_half_visible() {
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
pub(super) async fn a_locked_database_is_busy_and_loses_nothing() {
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

#[test]
pub(super) fn faults_are_read_and_refused() {
    for point in fault::FailPoint::ALL.into_iter().chain(fault::FailPoint::OF_DIVISION) {
        assert!(Faults::parse(&format!("{}:kill", point.name())).is_ok());
    }
    assert!(Faults::parse("mid-run:panic:100").is_ok());
    for bad in ["", "mid-run", "mid-run:", "nowhere:kill", "mid-run:laugh", "mid-run:kill:x", "mid-run:kill:1:2"] {
        assert!(Faults::parse(bad).is_err(), "{bad}");
    }
}
