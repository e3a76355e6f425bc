//! A server process of its own, for tests of what happens when it ends.
#![allow(dead_code)]

use std::{
    fmt::Write as _,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, ExitStatus, Output, Stdio},
    time::{Duration, Instant},
};

use serde_json::{Value, json};

#[path = "../common/cryptography.rs"]
pub mod cryptography;

pub const PATIENCE: Duration = Duration::from_secs(120);

/// A server process of its own.
pub struct Server {
    pub process: Child,
    pub url: String,
    pub client: reqwest::Client,
}

impl Server {
    pub fn start(folder: &Path, settings: &[&str]) -> Self {
        Self::start_in(folder, settings, &[])
    }

    /// Starts one with variables in its environment.
    pub fn start_in(folder: &Path, settings: &[&str], environment: &[(&str, &str)]) -> Self {
        Self::begin(folder, settings, environment).unwrap_or_else(|line| panic!("{line:?}"))
    }

    /// The same of one that may be dead before it is heard of: what it said instead of where it listens.
    pub fn begin(folder: &Path, settings: &[&str], environment: &[(&str, &str)]) -> Result<Self, String> {
        let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
            .args([
                "serve",
                "--listen",
                "127.0.0.1:0",
                "--threads",
                "1",
                "--least-free-bytes",
                "0",
                "--log-level",
                "error",
            ])
            .arg("--data")
            .arg(folder)
            .args(settings)
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let Some(url) = line.trim().strip_prefix("listening on ").map(str::to_owned) else {
            let _ = process.kill();
            let _ = process.wait();
            return Err(line);
        };
        Ok(Self { process, url, client: cryptography::client() })
    }

    pub async fn upload(&self) -> String {
        self.upload_off(torus()).await
    }

    pub async fn upload_off(&self, text: String) -> String {
        let answer = self.client.post(format!("{}/v1/meshes?format=off", self.url)).body(text).send().await.unwrap();
        assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
        answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned()
    }

    /// Asks for a basis of so many functions; the job's identifier if the server lived to acknowledge it.
    pub async fn submit(&self, mesh: &str, count: usize) -> Option<String> {
        self.submit_with(mesh, json!({"count": count})).await
    }

    pub async fn submit_with(&self, mesh: &str, parameters: Value) -> Option<String> {
        let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
        let answer = self.client.post(format!("{}/v1/jobs", self.url)).json(&request).send().await.ok()?;
        let status = answer.status();
        let job = answer.json::<Value>().await.ok()?;
        assert!(status.is_success(), "{status}: {job}");
        Some(job["id"].as_str().unwrap().to_owned())
    }

    pub async fn job(&self, id: &str) -> Value {
        let answer = self.client.get(format!("{}/v1/jobs/{id}?wait=5s", self.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "job {id} was acknowledged and is lost");
        answer.json().await.unwrap()
    }

    /// A job as it stands.
    pub async fn job_now(&self, id: &str) -> Value {
        self.client.get(format!("{}/v1/jobs/{id}", self.url)).send().await.unwrap().json().await.unwrap()
    }

    /// Waits until a job is finished.
    pub async fn finished(&self, id: &str) -> Value {
        let begun = Instant::now();
        loop {
            let job = self.job(id).await;
            if ["succeeded", "failed", "canceled"].contains(&job["status"].as_str().unwrap()) {
                return job;
            }
            assert!(begun.elapsed() < PATIENCE, "{job}");
        }
    }

    /// Waits until the process has ended by itself.
    pub fn ended(mut self) -> ExitStatus {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().unwrap() {
                return status;
            }
            assert!(begun.elapsed() < PATIENCE, "the server is still alive");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Asks the process to stop and waits until it has.
    pub fn stop(self) {
        let process = rustix::process::Pid::from_child(&self.process);
        rustix::process::kill_process(process, rustix::process::Signal::TERM).unwrap();
        let status = self.ended();
        assert!(status.success(), "{status}");
    }

    pub fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // A test that failed leaves no server behind; one that has ended already is no trouble.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A torus of 24 × 12 vertices as OFF.
pub fn torus() -> String {
    torus_of(24, 12)
}

/// A torus of so many vertices around and across, as OFF.
pub fn torus_of(around: usize, across: usize) -> String {
    let mut text = format!("OFF\n{} {} 0\n", around * across, 2 * around * across);
    for i in 0..around {
        for j in 0..across {
            let (u, v) =
                (std::f64::consts::TAU * i as f64 / around as f64, std::f64::consts::TAU * j as f64 / across as f64);
            let radius = 2.0 + 0.7 * v.cos();
            writeln!(text, "{} {} {}", radius * u.cos(), radius * u.sin(), 0.7 * v.sin()).unwrap();
        }
    }
    let vertex = |i: usize, j: usize| (i % around) * across + j % across;
    for i in 0..around {
        for j in 0..across {
            let (a, b, c, d) = (vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
            writeln!(text, "3 {a} {b} {c}\n3 {a} {c} {d}").unwrap();
        }
    }
    text
}

/// A vertex with so many triangles around it, closed to a cone, as OFF.
pub fn fan(valence: usize) -> String {
    let mut text = format!("OFF\n{} {valence} 0\n0 0 0.1\n", valence + 1);
    for k in 0..valence {
        let angle = std::f64::consts::TAU * k as f64 / valence as f64;
        writeln!(text, "{} {} 0", angle.cos(), angle.sin()).unwrap();
    }
    for k in 0..valence {
        writeln!(text, "3 0 {} {}", 1 + k, 1 + (k + 1) % valence).unwrap();
    }
    text
}

/// Runs a command of the program to its end.
pub fn chladni(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_chladni")).args(arguments).output().unwrap()
}
