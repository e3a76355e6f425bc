//! What the store promises of dense bases.

use chladni_algebra::DenseMatrix;
use chladni_spectral::basis::{Basis, BasisError, Certificate, DenseFunctions, Functions, Precision};
use chladni_spectral::formats::npz;

use super::super::{
    fault::{FailPoint, FaultAction, Faults},
    tests::{LEASE, an_hour_later, basis, mesh, new_job, options, store},
    *,
};

/// A dense basis of so many columns.
fn dense(seed: f64, vertices: usize, columns: usize, precision: Precision) -> Basis {
    let values = (0..vertices * columns).map(|i| (i as f64 + seed).sin()).collect();
    let matrix = DenseMatrix::from_columns(vertices, columns, values);
    let basis = basis(seed, vertices);
    Basis {
        functions: Functions::Dense(DenseFunctions::from_columns(&matrix, precision)),
        eigenvalues: (0..columns).map(|k| k as f64).collect(),
        certificate: Certificate {
            residuals: vec![0.0; columns],
            bounds: vec![0.0; columns],
            complete: Some(true),
            ..basis.certificate
        },
        ..basis
    }
}

/// Enqueues, claims and completes a job with a given basis.
async fn stored(store: &Store, mesh: &str, work: &str, basis: Basis) -> Uuid {
    store.enqueue(new_job(mesh, work)).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    match store.complete(claim.token, basis, vec![]).await.unwrap() {
        CompleteAnswer::Stored(id) => id,
        other => panic!("{other:?}"),
    }
}

/// Some modes of a stored basis, read where it may block.
async fn modes(store: &Store, id: Uuid, range: std::ops::Range<usize>) -> Result<Vec<f64>, BasisError> {
    let basis = store.load_basis(id).await.unwrap();
    tokio::task::spawn_blocking(move || basis.lift(range)).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dense_basis_comes_back_by_its_columns() {
    for precision in [Precision::F32, Precision::F64] {
        let (first, folder) = store().await;
        let mesh = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
        let original = dense(2.0, 3000, 100, precision);
        let id = stored(&first, &mesh, "w", original.clone()).await;
        let record = first.basis(id).await.unwrap();
        let BasisStorage::Dense(layout) = &record.storage else { panic!("{record:?}") };
        assert_eq!((layout.precision, layout.chunks.len(), record.dimension, record.nonzeros), (precision, 4, 0, 0));
        assert_eq!((record.count, record.rows, record.bytes), (100, 3000, layout.total));
        // What is stored is a file that others open.
        let content = first.blob_bytes(&record.content_hash, 0..record.bytes).await.unwrap();
        assert_eq!(npz::read(&content).unwrap(), original);
        assert_eq!(content, npz::to_bytes(&original).unwrap());
        first.close().await;
        drop(first);
        let second = Store::open(options(&folder)).await.unwrap();
        let loaded = second.load_basis(id).await.unwrap();
        assert_eq!(second.cache_statistics().misses, 1, "no columns are read yet");
        assert_eq!((&loaded.eigenvalues, &loaded.certificate), (&original.eigenvalues, &original.certificate));
        let found = modes(&second, id, 30..70).await.unwrap();
        assert_eq!(found, original.lift::<f64>(30..70).unwrap());
        assert_eq!(second.cache_statistics().misses, 4, "three chunks of four");
        let whole = tokio::task::spawn_blocking(move || *loaded == original).await.unwrap();
        assert!(whole);
        assert_eq!(second.cache_statistics().misses, 5);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_chunk_harms_its_own_columns_alone() {
    let (first, folder) = store().await;
    let mesh = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let original = dense(2.0, 5000, 100, Precision::F64);
    let id = stored(&first, &mesh, "w", original.clone()).await;
    let record = first.basis(id).await.unwrap();
    let BasisStorage::Dense(layout) = &record.storage else { panic!() };
    let place = layout.chunk_bytes(5000, 1);
    let middle = (place.start + place.end) / 2 / (256 << 10);
    let mut transaction = first.chunks().write().await.unwrap();
    sqlx::query("UPDATE chunks SET data = zeroblob(length(data)) WHERE position = ? AND blob = (SELECT id FROM blobs WHERE hash = ?)")
        .bind(middle as i64)
        .bind(&record.content_hash)
        .execute(transaction.on())
        .await
        .unwrap();
    transaction.commit().await.unwrap();
    first.close().await;
    drop(first);
    let store = Store::open(options(&folder)).await.unwrap();
    for range in [0..32, 64..100] {
        assert_eq!(modes(&store, id, range.clone()).await.unwrap(), original.lift::<f64>(range).unwrap());
    }
    let told = modes(&store, id, 40..41).await.unwrap_err().to_string();
    assert!(told.contains("chunk 1") && told.contains("hash"), "{told}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_deleted_dense_basis_is_gone_for_who_still_holds_it() {
    let (store, _folder) = store().await;
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let id = stored(&store, &mesh, "w", dense(2.0, 3000, 100, Precision::F32)).await;
    let held = store.load_basis(id).await.unwrap();
    assert!(modes(&store, id, 0..1).await.is_ok());
    store.delete_basis(id).await.unwrap();
    assert_eq!(store.cache_statistics().bytes, 0);
    let told = tokio::task::spawn_blocking(move || held.lift::<f32>(0..1)).await.unwrap().unwrap_err();
    assert_eq!(told.to_string(), "chunk 0 of the eigenfunctions cannot be read: they were deleted");
    let chunks: i64 =
        sqlx::query_scalar("SELECT COUNT(*) FROM chunks").fetch_one(store.chunks().reader()).await.unwrap();
    assert_eq!(chunks, 1, "the mesh alone");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dense_basis_that_does_not_fit_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let limited = StoreOptions { blob_bytes_limit: Some(2 << 20), ..options(&folder) };
    let store = Store::open(limited).await.unwrap();
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    store.enqueue(new_job(&mesh, "big")).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    let refused = store.complete(claim.token, dense(1.0, 10_000, 200, Precision::F64), vec![]).await;
    assert!(matches!(refused, Err(StoreError::StorageFull { .. })), "{refused:?}");
    let blobs: (i64, i64) = sqlx::query_as("SELECT (SELECT COUNT(*) FROM blobs), (SELECT COUNT(*) FROM chunks)")
        .fetch_one(store.chunks().reader())
        .await
        .unwrap();
    assert_eq!(blobs, (1, 1), "the mesh alone");
    let fits = store.complete(claim.token, dense(1.0, 1000, 40, Precision::F64), vec![]).await;
    assert!(matches!(fits, Ok(CompleteAnswer::Stored(_))));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dense_basis_that_nobody_wants_any_more_is_not_written_out() {
    let folder = tempfile::tempdir().unwrap();
    // There is no room for all of it: whoever writes on regardless fails.
    let limited = StoreOptions { blob_bytes_limit: Some(2 << 20), ..options(&folder) };
    let store = Store::open(limited).await.unwrap();
    let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let job = store.enqueue(new_job(&mesh, "w")).await.unwrap().record.id;
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    store.cancel_job(job).await.unwrap();
    let large = || dense(1.0, 10_000, 200, Precision::F64);
    assert_eq!(store.complete(claim.token, large(), vec![]).await.unwrap(), CompleteAnswer::Canceled);
    assert_eq!(store.job(job).await.unwrap().status, JobStatus::Canceled);
    assert_eq!(store.complete(claim.token, large(), vec![]).await.unwrap(), CompleteAnswer::Lost);
    let blobs: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM blobs").fetch_one(store.chunks().reader()).await.unwrap();
    assert_eq!(blobs, 1, "the mesh alone");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_death_between_chunks_of_a_dense_basis_leaves_nothing_to_see() {
    let folder = tempfile::tempdir().unwrap();
    for point in [FailPoint::MidChunks, FailPoint::BeforeBlobReady, FailPoint::AfterBlobReady] {
        let quiet = Store::open(options(&folder)).await.unwrap();
        let mesh = quiet.add_mesh(mesh(1, 9)).await.unwrap().record.id;
        let before = quiet.health().await.blob_bytes;
        quiet.close().await;
        drop(quiet);
        let faults = Faults::armed(point, FaultAction::Panic, 0);
        let store = Store::open(StoreOptions { faults, ..options(&folder) }).await.unwrap();
        store.enqueue(new_job(&mesh, point.name())).await.unwrap();
        let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
        // 16 MB: two transactions of chunks.
        let died = store.complete(claim.token, dense(1.0, 20_000, 100, Precision::F64), vec![]).await;
        assert!(matches!(died, Err(StoreError::Unavailable { .. })), "{died:?}");
        assert!(store.bases(&BasisFilter::default(), &PageRequest::default()).await.unwrap().items.is_empty());
        store.close().await;
        drop(store);
        let again = an_hour_later(&folder).await;
        assert_eq!(again.health().await.blob_bytes, before, "{}", point.name());
        let chunks: i64 =
            sqlx::query_scalar("SELECT COUNT(*) FROM chunks").fetch_one(again.chunks().reader()).await.unwrap();
        assert_eq!(chunks, 1, "{}: the mesh alone", point.name());
        let job = again.jobs(&JobFilter::default(), &PageRequest::default()).await.unwrap().items.remove(0);
        assert_eq!(job.status, JobStatus::Enqueued, "{}", point.name());
        again.cancel_job(job.id).await.unwrap();
        again.close().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_basis_without_a_pair_is_stored_like_any_other() {
    let (first, folder) = store().await;
    let mesh = first.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let original = dense(1.0, 50, 0, Precision::F32);
    let id = stored(&first, &mesh, "w", original.clone()).await;
    first.close().await;
    drop(first);
    let again = Store::open(options(&folder)).await.unwrap();
    let loaded = again.load_basis(id).await.unwrap();
    assert_eq!((loaded.count(), loaded.vertices()), (0, 50));
    assert_eq!(*loaded, original);
}
