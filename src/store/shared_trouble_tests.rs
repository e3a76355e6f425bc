//! What is told where shared places do not belong together, are away or full, and where nobody can do a job.

use std::{
    io,
    net::{Shutdown, TcpListener, TcpStream},
    os::unix::net::UnixStream,
    path::PathBuf,
    sync::Mutex,
};

use object_store::{ObjectStoreExt, path::Path};

use super::*;

fn objects_of(store: &Store) -> &objects::Objects {
    match &store.inner.blobs {
        Blobs::Objects(objects) => objects,
        Blobs::Chunks(_) => panic!("the content is shared"),
    }
}

/// The same places with another prefix, or another database.
fn elsewhere(folder: &TempDir, database: Option<&str>, prefix: &str) -> StoreOptions {
    let mut options = options(folder);
    let shared = options.shared.as_mut().unwrap();
    let (path, settings) = shared.objects.split_once('?').unwrap_or((&shared.objects, ""));
    shared.objects = format!("{path}{prefix}?{settings}").trim_end_matches('?').to_owned();
    if let Some(database) = database {
        shared.database = database.to_owned();
    }
    options
}

async fn refused(options: StoreOptions) -> String {
    match Store::open(options).await {
        Err(StoreError::Refused { detail }) => detail,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_store_of_another_database_is_refused() {
    sharing(strangers);
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
pub(super) async fn strangers() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    let own: String =
        sql::query_scalar("SELECT identity FROM identity").fetch_one(store.inner.catalog.reader()).await.unwrap();
    let objects = objects_of(&store);
    let name = Path::from("identity");
    assert_eq!(objects.store.get(&name).await.unwrap().bytes().await.unwrap(), own.as_bytes());
    // Whoever comes later with the same addresses finds both as they are.
    drop(Store::open(options(&folder)).await.unwrap());
    // A wrong prefix, with nothing there.
    let told = refused(elsewhere(&folder, None, "two")).await;
    assert!(told.contains(&own) && told.contains("two") && told.contains("of_"), "{told}");
    // Another database has a prefix of its own, and neither is used with what is the other's.
    let other = tempfile::tempdir().unwrap();
    let database = server::server().unwrap().database_of(other.path());
    let told = refused(elsewhere(&folder, Some(&database), "")).await;
    assert!(told.contains(&own) && told.contains("of its own"), "{told}");
    let second = Store::open(elsewhere(&folder, Some(&database), "three")).await.unwrap();
    let theirs: String =
        sql::query_scalar("SELECT identity FROM identity").fetch_one(second.inner.catalog.reader()).await.unwrap();
    assert_ne!(own, theirs);
    for told in
        [refused(elsewhere(&folder, Some(&database), "")).await, refused(elsewhere(&folder, None, "three")).await]
    {
        assert!(told.contains(&own) && told.contains(&theirs), "{told}");
    }
    // A store that is changed under a process that runs: nothing is written there.
    objects.store.put(&name, theirs.clone().into_bytes().into()).await.unwrap();
    assert!(store.health().await.reason.unwrap().contains(&theirs));
    let told = store.add_mesh(mesh(1, 9)).await.unwrap_err();
    assert!(matches!(told, StoreError::Refused { .. }), "{told:?}");
    objects.store.put(&name, own.clone().into_bytes().into()).await.unwrap();
    let record = store.add_mesh(mesh(1, 9)).await.unwrap().record;
    assert!(store.health().await.content_up);
    // The object of the identity alone is gone, and its content is there.
    objects.store.delete(&name).await.unwrap();
    assert!(store.health().await.content_up);
    assert_eq!(objects.store.get(&name).await.unwrap().bytes().await.unwrap(), own.as_bytes());
    // A database of an earlier version, or a backup of one, has none.
    sql::query("DELETE FROM identity").execute(store.inner.catalog.reader()).await.unwrap();
    let again = Store::open(options(&folder)).await.unwrap();
    assert_eq!(*again.load_mesh(&record.id).await.unwrap(), *mesh(1, 9).mesh);
    // The same of both, with the right store and with a wrong one.
    sql::query("DELETE FROM identity").execute(store.inner.catalog.reader()).await.unwrap();
    let told = refused(elsewhere(&folder, None, "four")).await;
    assert!(told.contains("is not there"), "{told}");
    objects.store.delete(&name).await.unwrap();
    let again = Store::open(options(&folder)).await.unwrap();
    assert_eq!(*again.load_mesh(&record.id).await.unwrap(), *mesh(1, 9).mesh);
    assert!(objects.store.head(&name).await.is_ok());
}

#[test]
fn addresses_that_are_none_are_refused_at_once() {
    sharing(addresses);
}

#[tokio::main(flavor = "current_thread")]
async fn addresses() {
    let folder = tempfile::tempdir().unwrap();
    let begun = std::time::Instant::now();
    let told = Store::open(elsewhere(&folder, Some("mysql://u:secret@h/d"), "")).await.unwrap_err().to_string();
    assert!(told.contains("mysql://") && !told.contains("secret"), "{told}");
    let mut relative = options(&folder);
    relative.shared.as_mut().unwrap().objects = "file://rel".to_owned();
    let told = Store::open(relative).await.unwrap_err().to_string();
    assert!(told.contains("file:///FOLDER") && !std::path::Path::new("rel").exists(), "{told}");
    assert!(begun.elapsed() < Duration::from_secs(10));
}

/// A way to the database that can be shut.
struct Gate {
    port: u16,
    open: Arc<Mutex<Vec<TcpStream>>>,
    shut: Arc<std::sync::atomic::AtomicBool>,
}

impl Gate {
    fn before(socket: PathBuf) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let gate = Self { port, open: Arc::default(), shut: Arc::default() };
        gate.serve(listener, socket);
        gate
    }

    fn serve(&self, listener: TcpListener, socket: PathBuf) {
        let (open, shut) = (Arc::clone(&self.open), Arc::clone(&self.shut));
        std::thread::spawn(move || {
            for client in listener.incoming() {
                if shut.load(Ordering::Relaxed) {
                    return;
                }
                let (client, database) = (client.unwrap(), UnixStream::connect(&socket).unwrap());
                open.lock().unwrap().push(client.try_clone().unwrap());
                let (mut from, mut to) = (client.try_clone().unwrap(), database.try_clone().unwrap());
                std::thread::spawn(move || {
                    let _ = io::copy(&mut from, &mut to);
                    let _ = to.shutdown(Shutdown::Both);
                });
                let (mut from, mut to) = (database, client);
                std::thread::spawn(move || {
                    let _ = io::copy(&mut from, &mut to);
                    let _ = to.shutdown(Shutdown::Both);
                });
            }
        });
    }

    fn shut(&self) {
        self.shut.store(true, Ordering::Relaxed);
        // Whoever listens hears of it.
        let _ = TcpStream::connect(("127.0.0.1", self.port));
        self.open.lock().unwrap().drain(..).for_each(|client| drop(client.shutdown(Shutdown::Both)));
    }

    fn open_again(&self, socket: PathBuf) {
        self.shut.store(false, Ordering::Relaxed);
        self.serve(TcpListener::bind(("127.0.0.1", self.port)).unwrap(), socket);
    }
}

#[test]
fn a_database_that_refuses_connections_is_told_within_seconds() {
    sharing(connections_refused);
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn connections_refused() {
    let folder = tempfile::tempdir().unwrap();
    let address = server::server().unwrap().database_of(folder.path());
    let (database, sockets) = address.split_once("?host=").unwrap();
    let socket = std::path::Path::new(sockets).join(".s.PGSQL.5432");
    let gate = Gate::before(socket.clone());
    let name = database.rsplit_once('/').unwrap().1;
    let through = format!("postgres://postgres@127.0.0.1:{}/{name}?sslmode=disable", gate.port);
    for direct in [None, Some(through.clone())] {
        let mut options = elsewhere(&folder, Some(&through), "");
        options.shared.as_mut().unwrap().direct = direct;
        let store = Store::open(options).await.unwrap();
        let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
        gate.shut();
        // The first one finds out, the next ones know.
        for _ in 0..2 {
            let begun = std::time::Instant::now();
            let told = store.mesh(&id).await.unwrap_err();
            assert!(matches!(told, StoreError::Unavailable { .. }), "{told:?}");
            assert!(begun.elapsed() < Duration::from_secs(4), "{:?}", begun.elapsed());
        }
        assert!(!store.health().await.database_up);
        gate.open_again(socket.clone());
        let begun = std::time::Instant::now();
        while store.mesh(&id).await.is_err() {
            assert!(begun.elapsed() < Duration::from_secs(20));
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        store.close().await;
    }
}

#[test]
fn a_database_without_room_is_told_until_it_has_room() {
    sharing(full);
}

#[tokio::main(flavor = "current_thread")]
async fn full() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    let on = || store.inner.catalog.reader();
    assert!(!store.health().await.full);
    // Whatever makes a table meets a full disk, as what writes much does.
    let full = "CREATE FUNCTION full_disk() RETURNS event_trigger LANGUAGE plpgsql AS
        $$ BEGIN RAISE EXCEPTION 'no space left' USING ERRCODE = 'disk_full'; END $$";
    sql::query(full).execute(on()).await.unwrap();
    sql::query(
        "CREATE EVENT TRIGGER full_disk ON ddl_command_start WHEN TAG IN ('CREATE TABLE') EXECUTE FUNCTION full_disk()",
    )
    .execute(on())
    .await
    .unwrap();
    // A look at the health writes too little to find out.
    assert!(!store.health().await.full);
    let met = sql::query("CREATE TABLE anything (a BIGINT)").execute(on()).await.unwrap_err();
    assert!(matches!(StoreError::from(met), StoreError::StorageFull { .. }));
    let health = store.health().await;
    assert!(health.full && !health.writable && health.database_up, "{health:?}");
    assert!(health.reason.unwrap().contains("no space left"));
    sql::query("DROP EVENT TRIGGER full_disk").execute(on()).await.unwrap();
    let health = store.health().await;
    assert!(!health.full && health.writable, "{health:?}");
    let left: i64 = sql::query_scalar("SELECT COUNT(*) FROM pg_tables WHERE tablename LIKE 'chladni_room%'")
        .fetch_one(on())
        .await
        .unwrap();
    assert_eq!(left, 0);
}

#[test]
fn the_last_places_of_the_queue_are_given_once() {
    sharing(last_places);
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn last_places() {
    let folder = tempfile::tempdir().unwrap();
    let limited = StoreOptions { queued_jobs_limit: Some(10), ..options(&folder) };
    let stores = [Store::open(limited.clone()).await.unwrap(), Store::open(limited).await.unwrap()];
    let id = stores[0].add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let asked = (0..40).map(|k| {
        let (store, job) = (stores[k % 2].clone(), new_job(&id, &format!("w{k}")));
        tokio::spawn(async move { store.enqueue(job).await })
    });
    let answers = futures_util::future::join_all(asked.collect::<Vec<_>>()).await;
    let (made, refused): (Vec<_>, Vec<_>) = answers.into_iter().map(Result::unwrap).partition(Result::is_ok);
    assert_eq!((made.len(), refused.len()), (10, 30));
    assert!(refused.iter().all(|refusal| matches!(refusal, Err(StoreError::QueueFull { limit: 10, .. }))));
}

#[test]
fn what_nobody_can_do_is_told_and_does_not_age_the_queue() {
    sharing(nobody);
}

#[tokio::main(flavor = "current_thread")]
async fn nobody() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(options(&folder)).await.unwrap();
    let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
    let large = NewJob { memory_bytes: 5000, solver_version: "0.1.0+5".to_owned(), ..new_job(&id, "w") };
    let job = store.enqueue(large).await.unwrap().record;
    let why = async || store.why_nobody_takes(std::slice::from_ref(&job)).await.unwrap().remove(0);
    // Without any worker every job waits, and more of them are needed.
    assert!(why().await.unwrap().contains("none has been heard of"));
    assert!(store.oldest_waiting_ms().await.unwrap().is_some());
    let worker = Worker {
        id: "one".to_owned(),
        solver_version: "0.1.0+5".to_owned(),
        seats: 1,
        threads: 1,
        memory_bytes: 5000,
        kinds: Vec::new(),
    };
    let kinds = vec!["map".to_owned()];
    for (own, words) in [
        (Worker { memory_bytes: 4999, ..worker.clone() }, "5000 bytes"),
        (Worker { kinds, ..worker.clone() }, "eigenbasis"),
        (Worker { solver_version: "0.1.0+4".to_owned(), ..worker.clone() }, "0.1.0+5"),
    ] {
        store.announce_worker(&own).await.unwrap();
        store.inner.fleet.forget();
        assert!(why().await.unwrap().contains(words), "{words}");
        assert_eq!(store.oldest_waiting_ms().await.unwrap(), None, "{words}");
        store.dismiss_worker("one").await.unwrap();
    }
    for able in [worker.clone(), Worker { solver_version: "0.2.0".to_owned(), ..worker.clone() }] {
        store.announce_worker(&able).await.unwrap();
        store.inner.fleet.forget();
        assert_eq!(why().await, None);
        assert!(store.oldest_waiting_ms().await.unwrap().is_some());
        store.dismiss_worker("one").await.unwrap();
    }
}
