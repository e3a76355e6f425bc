//! A server with a graphics card: the software one, on which the kernels are tested too. It is a process of its own,
//! since a card belongs to its process.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use serde_json::{Value, json};

use crate::common::text;

struct Server {
    process: Child,
    url: String,
    client: reqwest::Client,
    _folder: tempfile::TempDir,
}

impl Server {
    /// With the adapter that `CHLADNI_TEST_GPU` names; `None` where there is none and none is required.
    async fn start(settings: &[&str]) -> Option<Self> {
        let wanted = std::env::var("CHLADNI_TEST_GPU").unwrap_or_default();
        let card = if ["", "required"].contains(&wanted.as_str()) { "llvmpipe" } else { &wanted };
        let folder = tempfile::tempdir().unwrap();
        let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
            .args(["serve", "--listen", "127.0.0.1:0", "--least-free-bytes", "0", "--log-level", "error"])
            .args(["--gpu", card])
            .args(settings)
            .arg("--data")
            .arg(folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line:?}")).to_owned();
        let server = Self { process, url, client: crate::common::cryptography::client(), _folder: folder };
        let available = server.metric("chladni_gpu_available").await;
        assert!(available == 1 || wanted.is_empty(), "no card {card:?}");
        (available == 1).then_some(server)
    }

    async fn get(&self, path: &str) -> String {
        let answer = self.client.get(format!("{}{path}", self.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "{path}: {}", answer.status());
        answer.text().await.unwrap()
    }

    async fn metric(&self, name: &str) -> u64 {
        let metrics = self.get("/metrics").await;
        let value = metrics.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_else(|| panic!("{metrics}"));
        value.trim().parse().unwrap()
    }

    async fn posted(&self, path: &str, body: reqwest::Body) -> Value {
        let request = self.client.post(format!("{}{path}", self.url)).header("content-type", "application/json");
        let answer = request.body(body).send().await.unwrap();
        let status = answer.status();
        let value: Value = answer.json().await.unwrap();
        assert!(status.is_success(), "{status}: {value}");
        value
    }

    /// A basis of so many functions, as the service shows it, and their values.
    async fn solve(&self, mesh: &str, count: usize) -> (Value, Vec<f64>) {
        let parameters = json!({"count": count, "dimension": 96});
        let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters}).to_string();
        let mut job = self.posted("/v1/jobs", body.into()).await;
        let begun = Instant::now();
        while job["status"] != "succeeded" {
            assert!(job["status"] != "failed" && begun.elapsed() < Duration::from_secs(60), "{job}");
            let path = format!("/v1/jobs/{}?wait=5s", text(&job["id"]));
            job = serde_json::from_str(&self.get(&path).await).unwrap();
        }
        let basis = text(&job["basis"]);
        let about: Value = serde_json::from_str(&self.get(&format!("/v1/bases/{basis}")).await).unwrap();
        let values = about["eigenvalues"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        (about, values)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // One that has ended already is no trouble.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[tokio::test]
async fn a_result_tells_of_the_card_and_of_its_failure_which_is_counted() {
    let Some(server) = Server::start(&["--fault", "gpu-lost"]).await else {
        println!("skipped: no software card");
        return;
    };
    let mut bytes = Vec::new();
    write_ply(&generate(Shape::Sphere, 300).unwrap(), None, &mut bytes).unwrap();
    let mesh = text(&server.posted("/v1/meshes?format=ply", bytes.into()).await["id"]);

    let (about, on_cpu) = server.solve(&mesh, 30).await;
    let told = about["details"]["dense_solver"][0].as_str().unwrap_or_else(|| panic!("{about}"));
    assert!(told.starts_with("the CPU instead of ") && told.contains("lost"), "{told}");
    assert_eq!(server.metric("chladni_gpu_fallbacks_total").await, 1);

    // The device is opened again.
    let (about, on_card) = server.solve(&mesh, 31).await;
    let told = about["details"]["dense_solver"][0].as_str().unwrap_or_else(|| panic!("{about}"));
    assert!(!told.contains("CPU instead"), "{told}");
    assert_eq!(server.metric("chladni_gpu_fallbacks_total").await, 1);
    assert_eq!(server.metric("chladni_gpu_available").await, 1);
    let scale = on_card[30];
    assert!(on_cpu.iter().zip(&on_card).all(|(x, y)| (x - y).abs() < 1e-10 * scale), "{on_cpu:?} {on_card:?}");
}
