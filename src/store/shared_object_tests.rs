//! What is promised of objects that many processes share: damage, refusals, outages, and what is collected.

use chladni_spectral::basis::{DenseFunctions, Precision};
use object_store::{ObjectStoreExt, path::Path};

use super::*;

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
pub(super) async fn damaged_objects() {
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
    // No client is sent to where damaged content lies.
    assert!(matches!(store.refuse_damaged(&record.content_hash).await, Err(StoreError::Damaged { .. })));
    assert!(!store.add_mesh(new.clone()).await.unwrap().created);
    store.refuse_damaged(&record.content_hash).await.unwrap();
    assert_eq!(store.load_mesh(&record.id).await.unwrap(), new.mesh);
    damage_all(objects, |_| None).await;
    assert!(matches!(store.blob_bytes(&record.content_hash, whole).await, Err(StoreError::Damaged { .. })));
}

#[test]
fn content_that_nothing_refers_to_has_an_hour() {
    sharing(an_hour);
}

#[tokio::main(flavor = "current_thread")]
pub(super) async fn an_hour() {
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
    let content = objects.store.list(Some(&Path::from("b")));
    assert_eq!(content.count().await, 1, "the object of the mesh");
    assert_eq!(*two.load_mesh(&kept.id).await.unwrap(), *mesh(1, 9).mesh);
}

#[test]
fn large_content_goes_in_parts_and_comes_in_ranges() {
    sharing(large_content);
}

#[tokio::main(flavor = "current_thread")]
pub(super) async fn large_content() {
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
pub(super) async fn refusals_and_cuts() {
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
pub(super) async fn away() {
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
pub(super) async fn refused() {
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
pub(super) async fn database_away() {
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
pub(super) async fn completing_twice() {
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
        let ready = objects.locate(&hash).await.unwrap();
        assert_eq!(ready.is_some(), equal_content_came_first);
        for _ in 0..2 {
            store.make_ready(objects, &sealed, &hash).await.unwrap();
            let now = objects.locate(&hash).await.unwrap().unwrap();
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

/// Figures of one large transfer: `CHLADNI_LARGE_OBJECTS` is the address of a store that nobody has to sign for, and
/// `CHLADNI_LARGE_MB` how much.
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
