//! A PostgreSQL of its own for the tests of one process: made in a temporary folder, reached by a socket in it, and
//! gone with the process.

#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A server that is running.
pub struct Server {
    folder: PathBuf,
    binaries: PathBuf,
    /// Ends when its standard input does.
    _keeper: Child,
}

/// The server of this process; `None` where PostgreSQL is not installed, which is said.
pub fn server() -> Option<&'static Server> {
    static SERVER: OnceLock<Option<Server>> = OnceLock::new();
    SERVER.get_or_init(Server::start).as_ref()
}

/// The folder of the newest version that is installed.
fn binaries() -> Option<PathBuf> {
    let mut versions: Vec<(u32, PathBuf)> = std::fs::read_dir("/usr/lib/postgresql")
        .ok()?
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            Some((path.file_name()?.to_str()?.parse().ok()?, path.join("bin")))
        })
        .filter(|(_, path): &(u32, PathBuf)| path.join("initdb").exists())
        .collect();
    versions.sort();
    versions.pop().map(|(_, path)| path)
}

impl Server {
    fn start() -> Option<Self> {
        let Some(binaries) = binaries() else {
            assert!(
                std::env::var("CHLADNI_TEST_POSTGRES").as_deref() != Ok("required"),
                "PostgreSQL is not installed, and CHLADNI_TEST_POSTGRES is required"
            );
            eprintln!("skipped: PostgreSQL is not installed");
            return None;
        };
        static COUNT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let number = COUNT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("chladni-pg-{}-{number}", std::process::id()));
        let script = r#"
            set -e
            folder=$1; binaries=$2; shift 2
            rm -rf "$folder"; mkdir -m 700 "$folder"; cd "$folder"
            "$binaries/initdb" -D data -U postgres -A trust -E UTF8 --locale=C.UTF-8 --no-sync >initdb.log 2>&1
            "$binaries/postgres" -D data -k "$folder" -c listen_addresses= -c fsync=off -c max_connections=400 >server.log 2>&1 &
            server=$!
            chmod 755 "$folder"
            cat >/dev/null
            # It may have been started anew since.
            kill -INT "$(head -n 1 data/postmaster.pid)" 2>/dev/null || true
            wait "$server" || true
            while [ -e data/postmaster.pid ] && kill -0 "$(head -n 1 data/postmaster.pid)" 2>/dev/null; do sleep 0.1; done
            cd /; rm -rf "$folder"
        "#;
        let keeper = as_postgres(Path::new("sh"))
            .args(["-c", script, "sh"])
            .args([&folder, &binaries])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("a shell starts");
        let server = Self { folder, binaries, _keeper: keeper };
        let begun = Instant::now();
        while !server.psql("postgres", "SELECT 1") {
            assert!(begun.elapsed() < Duration::from_secs(120), "PostgreSQL does not start: see {:?}", server.folder);
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(server)
    }

    /// Runs a statement; false where that does not work.
    pub fn psql(&self, database: &str, statement: &str) -> bool {
        Command::new(self.binaries.join("psql"))
            .args(["-X", "-q", "-v", "ON_ERROR_STOP=1", "-U", "postgres", "-d", database, "-c", statement, "-h"])
            .arg(&self.folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    }

    /// The process that all others of the server are children of.
    pub fn process(&self) -> Option<u32> {
        std::fs::read_to_string(self.folder.join("data/postmaster.pid")).ok()?.lines().next()?.parse().ok()
    }

    /// Kills the server at once, with all that serve connections, as a machine that loses power would, but for what the
    /// system has still to write.
    pub fn crash(&self) {
        let Some(pid) = self.process().map(|pid| pid.to_string()) else { return };
        let _ = Command::new("kill").args(["-KILL", &pid]).status();
        // Those that serve connections see it and end.
        let ended = || Command::new("pgrep").args(["-P", &pid]).stdout(Stdio::null()).status();
        let begun = Instant::now();
        while ended().is_ok_and(|status| status.success()) && begun.elapsed() < Duration::from_secs(10) {
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Starts the server anew after a [`crash`](Self::crash), and waits until it answers.
    pub fn start_anew(&self) {
        let options = format!("-k {} -c listen_addresses= -c fsync=off -c max_connections=400", self.folder.display());
        let begun = Instant::now();
        loop {
            let mut command = as_postgres(&self.binaries.join("pg_ctl"));
            command.args(["start", "-W", "-D"]).arg(self.folder.join("data"));
            command.arg("-l").arg(self.folder.join("server.log")).args(["-o", &options]);
            let _ = command.current_dir(&self.folder).stdout(Stdio::null()).stderr(Stdio::null()).status();
            let asked = Instant::now();
            while asked.elapsed() < Duration::from_secs(10) {
                if self.psql("postgres", "SELECT 1") {
                    return;
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            assert!(begun.elapsed() < Duration::from_secs(120), "PostgreSQL does not start: see {:?}", self.folder);
        }
    }

    /// The address of a database, which is made where it is missing. Every folder has one.
    pub fn database_of(&self, folder: &Path) -> String {
        let name: String = folder
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default()
            .bytes()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        let name = format!("of_{name}");
        self.psql("postgres", &format!("CREATE DATABASE {name}"));
        format!("postgres://postgres@localhost/{name}?host={}", self.folder.display())
    }
}

/// A command as a user that the server runs as, which refuses to run as root.
fn as_postgres(program: &Path) -> Command {
    if !is_root() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    command.args(["--reuid=postgres", "--regid=postgres", "--clear-groups"]).arg(program);
    command
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|answer| answer.stdout == b"0\n")
}
