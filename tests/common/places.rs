//! Servers and workers as processes of their own that share a PostgreSQL and a store of objects.
#![allow(dead_code)]

use std::{
    collections::HashMap,
    io::{BufRead, BufReader},
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use chladni::store::{BasisFilter, JobFilter, JobRecord, JobStatus, PageRequest, SharedPlaces, Store, StoreOptions};
use chladni_s3_server as s3;
use tempfile::TempDir;

use crate::postgres;
use crate::process::{PATIENCE, Server};

pub const LEASE: Duration = Duration::from_secs(3);

/// Where processes share what they have.
pub struct Places {
    pub database: String,
    /// Where a pooler stands before the database: the way around it, and the process.
    pub pooler: Option<(String, Pooler)>,
    pub objects: String,
    /// Where the objects are in a store that speaks S3: what the processes are told of it, and where the tests find it.
    pub s3: Option<(Vec<(&'static str, String)>, String)>,
    pub folder: TempDir,
    /// Seconds of a lease.
    pub lease: &'static str,
}

/// A PgBouncer that gives connections out by transaction.
pub struct Pooler(Child);

impl Pooler {
    /// One before a database of the tests, and its address; `None` where it is not installed, which is said.
    pub fn before(database: &str, folder: &Path) -> Option<(Self, String)> {
        let binary = Path::new("/usr/sbin/pgbouncer");
        if !binary.exists() {
            eprintln!("skipped: PgBouncer is not installed");
            return None;
        }
        let (rest, sockets) = database.split_once("?host=").unwrap();
        let name = rest.rsplit_once('/').unwrap().1;
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let settings = format!(
            "[databases]\n{name} = host={sockets} user=postgres\n[pgbouncer]\nlisten_addr = 127.0.0.1\nlisten_port = {port}\nunix_socket_dir =\n\
             auth_type = any\npool_mode = transaction\ndefault_pool_size = 4\nmax_client_conn = 200\nserver_login_retry = 1\n"
        );
        let file = folder.join("pgbouncer.ini");
        std::fs::write(&file, settings).unwrap();
        // It refuses to run as root.
        let mut command = if rustix::process::getuid().is_root() {
            use std::os::unix::fs::PermissionsExt;
            std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755)).unwrap();
            let mut command = Command::new("setpriv");
            command.args(["--reuid=postgres", "--regid=postgres", "--clear-groups"]).arg(binary);
            command
        } else {
            Command::new(binary)
        };
        let process = command.arg("-q").arg(&file).stderr(Stdio::null()).spawn().unwrap();
        let begun = Instant::now();
        while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(begun.elapsed() < PATIENCE, "PgBouncer does not start");
            std::thread::sleep(Duration::from_millis(20));
        }
        Some((Self(process), format!("postgres://postgres@127.0.0.1:{port}/{name}?sslmode=disable")))
    }
}

impl Drop for Pooler {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Places {
    /// Fresh ones; `None` where PostgreSQL is not installed, which is said.
    pub fn new() -> Option<Self> {
        let server = postgres::server()?;
        let folder = tempfile::tempdir().unwrap();
        let objects = format!("file://{}", folder.path().join("objects").display());
        Some(Self { database: server.database_of(folder.path()), pooler: None, objects, s3: None, folder, lease: "3" })
    }

    /// The same with objects in a store that speaks S3, whose requests are signed.
    pub fn over_s3() -> Option<Self> {
        let mut places = Self::new()?;
        let [signed, open] = [true, false].map(|signed| s3::of_folder(places.folder.path(), signed));
        let keys = s3::KEYS.map(|(name, value)| (name, value.to_owned()));
        places.objects = signed.objects;
        places.s3 = Some((keys.into_iter().chain([("AWS_ENDPOINT", signed.endpoint)]).collect(), open.objects));
        Some(places)
    }

    pub fn settings(&self) -> Vec<&str> {
        let mut settings =
            vec!["--database", &self.database, "--objects", &self.objects, "--lease-seconds", self.lease];
        if let Some((direct, _)) = &self.pooler {
            settings.extend(["--database-direct", direct]);
        }
        settings
    }

    pub fn environment(&self) -> Vec<(&str, &str)> {
        let told = self.s3.iter().flat_map(|(told, _)| told);
        told.map(|(name, value)| (*name, value.as_str())).collect()
    }

    /// A server that leaves jobs to others. A data folder is none of its business.
    pub fn server(&self) -> Server {
        self.server_with(&["--workers", "0"])
    }

    pub fn server_with(&self, settings: &[&str]) -> Server {
        let nowhere = Path::new("/nonexistent/chladni-data");
        Server::start_in(nowhere, &[&self.settings()[..], settings].concat(), &self.environment())
    }

    pub fn worker(&self, settings: &[&str]) -> Worker {
        Worker::start(&[&self.settings()[..], settings].concat(), &self.environment())
    }

    /// Looks at everything that must hold of what is stored, and gives the number of jobs.
    pub async fn check(&self) -> usize {
        self.check_all(&HashMap::new()).await
    }

    /// The same, where the eigenvalue of the first function of some bases is known.
    pub async fn check_all(&self, known: &HashMap<String, u32>) -> usize {
        let objects = self.s3.as_ref().map_or(&self.objects, |(_, open)| open).clone();
        let direct = self.pooler.as_ref().map(|(direct, _)| direct.clone());
        let shared = SharedPlaces { database: self.database.clone(), direct, objects };
        let options = StoreOptions { shared: Some(shared), ..StoreOptions::new(self.folder.path()) };
        let store = Store::open(options).await.unwrap();
        let mut page = PageRequest { limit: PageRequest::MOST, from: None };
        let mut jobs: HashMap<_, JobRecord> = HashMap::new();
        loop {
            let got = store.jobs(&JobFilter::default(), &page).await.unwrap();
            jobs.extend(got.items.into_iter().map(|job| (job.id, job)));
            page.from = got.next;
            if page.from.is_none() {
                break;
            }
        }
        let mut bases = Vec::new();
        loop {
            let got = store.bases(&BasisFilter::default(), &page).await.unwrap();
            bases.extend(got.items);
            page.from = got.next;
            if page.from.is_none() {
                break;
            }
        }
        for job in jobs.values() {
            assert!(job.attempt <= job.max_attempts);
            assert_eq!(job.status == JobStatus::Succeeded, job.basis.is_some(), "{job:?}");
        }
        for basis in &bases {
            let job = &jobs[&basis.job];
            assert_eq!((job.status, job.basis), (JobStatus::Succeeded, Some(basis.id)));
            // Loading verifies the hash.
            let product = store.load_product(basis.id).await.unwrap();
            assert_eq!(product.summary().unwrap().eigenvalues, basis.eigenvalues);
            if let Some(&number) = known.get(&basis.id.to_string()) {
                assert_eq!(basis.eigenvalues[0], f64::from(number), "the result of another job");
            }
        }
        assert_eq!(bases.len(), jobs.values().filter(|job| job.basis.is_some()).count());
        let examined = store.examine(false).await.unwrap();
        assert!(examined.findings.iter().all(|finding| finding.what.contains("nothing refers to it")), "{examined:?}");
        store.close().await;
        jobs.len()
    }
}

/// A worker process.
pub struct Worker(pub Child);

impl Worker {
    pub fn start(settings: &[&str], environment: &[(&str, &str)]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
            .args(["worker", "--threads", "1", "--gpu", "off", "--log-level", "error", "--heartbeat-seconds", "0.2"])
            .args(settings)
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        // One that is to die may do so before it says so.
        assert!(line == "working\n" || (line.is_empty() && settings.contains(&"--fault")), "{line:?}");
        Self(process)
    }

    /// Waits until the process has ended by itself, and says how.
    pub fn ended(mut self) -> Option<i32> {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                return status.signal();
            }
            assert!(begun.elapsed() < PATIENCE, "the worker is still alive");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    pub fn signal(&self, signal: rustix::process::Signal) {
        rustix::process::kill_process(rustix::process::Pid::from_child(&self.0), signal).unwrap();
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
