//! What a clumsy operator and a failing disk do to the data folder of a real server: nothing is lost, nothing wrong is
//! served, and it is said.
#![cfg(unix)]

mod process;

use std::{
    collections::BTreeMap,
    fs,
    io::Write,
    path::Path,
    process::{Command, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use process::{PATIENCE, Server, chladni};
use serde_json::{Value, json};

/// Starts a server that is not meant to start, and gives what it says.
fn refused(folder: &Path) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_chladni"))
        .args(["serve", "--listen", "127.0.0.1:0", "--log-level", "error", "--data"])
        .arg(folder)
        .stdout(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    assert!(output.stdout.is_empty(), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

async fn get(server: &Server, path: &str) -> reqwest::Response {
    server.client.get(format!("{}{path}", server.url)).send().await.unwrap()
}

async fn bytes(server: &Server, path: &str) -> Vec<u8> {
    let answer = get(server, path).await;
    assert!(answer.status().is_success(), "{path}: {}", answer.status());
    answer.bytes().await.unwrap().to_vec()
}

/// Checks that an answer is a problem of a kind that nobody keeps.
async fn is_problem(answer: reqwest::Response, status: u16, kind: &str) -> Value {
    assert_eq!(answer.status().as_u16(), status);
    assert_eq!(answer.headers()["cache-control"], "no-store");
    assert_eq!(answer.headers()["content-type"], "application/problem+json");
    let problem: Value = answer.json().await.unwrap();
    assert_eq!(problem["type"], format!("/problems/{kind}"), "{problem}");
    problem
}

/// A mesh and a basis on it: their ids and that of the job.
async fn stored(server: &Server) -> (String, String, String) {
    let mesh = server.upload().await;
    let job = server.submit(&mesh, 6).await.unwrap();
    let done = server.finished(&job).await;
    assert_eq!(done["status"], "succeeded", "{done}");
    (mesh, job, done["basis"].as_str().unwrap().to_owned())
}

#[tokio::test]
async fn a_server_does_not_start_on_half_of_its_data() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let server = Server::start(folder.path(), &[]);
    let (mesh, ..) = stored(&server).await;
    server.stop();
    fs::copy(file("meta.db"), file("older")).unwrap();
    let server = Server::start(folder.path(), &[]);
    let job = server.submit(&mesh, 9).await.unwrap();
    let basis = server.finished(&job).await["basis"].as_str().unwrap().to_owned();
    let content = bytes(&server, &format!("/v1/bases/{basis}/content")).await;
    server.stop();
    fs::rename(file("meta.db"), file("newer")).unwrap();
    for what in ["missing", "empty", "older"] {
        match what {
            "empty" => fs::write(file("meta.db"), "").unwrap(),
            "older" => drop(fs::copy(file("older"), file("meta.db")).unwrap()),
            _ => {}
        }
        let size = fs::metadata(file("blobs.db")).unwrap().len();
        let said = refused(folder.path());
        assert!(said.contains("meta.db") && said.contains("blobs.db") && said.contains(what), "{said}");
        assert_eq!(fs::metadata(file("blobs.db")).unwrap().len(), size);
    }
    // Whoever knows better can have them as they are: that is asked for by name.
    let copy = tempfile::tempdir().unwrap();
    for name in ["meta.db", "blobs.db"] {
        fs::copy(file(name), copy.path().join(name)).unwrap();
    }
    let paired = chladni(&["doctor", "--pair", "--data", copy.path().to_str().unwrap()]);
    assert!(paired.status.success(), "{paired:?}");
    let server = Server::start(copy.path(), &[]);
    bytes(&server, &format!("/v1/meshes/{mesh}/content")).await;
    assert_eq!(get(&server, &format!("/v1/bases/{basis}")).await.status(), 404);
    server.stop();
    fs::rename(file("newer"), file("meta.db")).unwrap();
    let server = Server::start(folder.path(), &[]);
    assert_eq!(bytes(&server, &format!("/v1/bases/{basis}/content")).await, content);
    bytes(&server, &format!("/v1/meshes/{mesh}/content")).await;
    server.stop();
}

/// Some bytes from the middle of content.
fn middle(content: &[u8]) -> &[u8] {
    &content[content.len() / 2..][..64]
}

/// Flips a bit of content that lies in the database of a stopped server.
fn flip(folder: &Path, content: &[u8]) {
    let path = folder.join("blobs.db");
    let mut file = fs::read(&path).unwrap();
    let place = file.windows(content.len()).position(|window| window == content).expect("it is in the database");
    file[place] ^= 4;
    fs::File::create(&path).unwrap().write_all(&file).unwrap();
}

#[tokio::test]
async fn a_flipped_bit_is_told_and_healed_by_sending_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    let server = Server::start(folder.path(), &[]);
    let (mesh, job, basis) = stored(&server).await;
    let (of_mesh, of_basis) = (format!("/v1/meshes/{mesh}/content"), format!("/v1/bases/{basis}/content"));
    let positions = bytes(&server, &format!("{of_mesh}?format=ply")).await;
    let content = bytes(&server, &of_basis).await;
    server.stop();
    assert!(chladni(&["doctor", "--data", data]).status.success());

    // A vertex of the torus, as the database has it, and some of the basis. One of the last: of what lies on a leaf of
    // the tree there are old copies.
    let text = process::torus();
    let line = text.lines().nth(2 + 280).unwrap();
    let vertex: Vec<u8> = line.split(' ').flat_map(|x| x.parse::<f64>().unwrap().to_le_bytes()).collect();
    flip(folder.path(), &vertex);
    flip(folder.path(), middle(&content));
    let examined = chladni(&["doctor", "--data", data, "--json"]);
    assert_eq!(examined.status.code(), Some(1), "{examined:?}");
    let examined: Value = serde_json::from_slice(&examined.stdout).unwrap();
    assert_eq!(examined["findings"].as_array().unwrap().len(), 2, "{examined}");

    let server = Server::start(folder.path(), &[]);
    is_problem(get(&server, &of_mesh).await, 500, "damaged-content").await;
    is_problem(get(&server, &of_basis).await, 500, "damaged-content").await;
    let range =
        server.client.get(format!("{}{of_basis}", server.url)).header("range", "bytes=0-9").send().await.unwrap();
    is_problem(range, 500, "damaged-content").await;
    is_problem(get(&server, &format!("/v1/bases/{basis}/modes?from=0&to=1")).await, 500, "damaged-content").await;

    assert_eq!(server.upload().await, mesh);
    assert_eq!(bytes(&server, &format!("{of_mesh}?format=ply")).await, positions);
    // The same job, and the same basis.
    assert_eq!(server.submit(&mesh, 6).await.unwrap(), job);
    let done = server.finished(&job).await;
    assert_eq!((done["status"].as_str(), done["basis"].as_str()), (Some("succeeded"), Some(basis.as_str())), "{done}");
    let answer = get(&server, &of_basis).await;
    let tag = answer.headers()["etag"].to_str().unwrap().trim_matches('"').to_owned();
    let healed = answer.bytes().await.unwrap();
    assert_eq!(blake3::hash(&healed).to_hex().to_string(), tag);
    server.stop();
    let examined = chladni(&["doctor", "--data", data]);
    assert!(examined.status.success(), "{examined:?}");
}

#[tokio::test]
async fn the_doctor_enqueues_what_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    let server = Server::start(folder.path(), &[]);
    let (_, job, basis) = stored(&server).await;
    let content = bytes(&server, &format!("/v1/bases/{basis}/content")).await;
    server.stop();
    flip(folder.path(), middle(&content));
    let examined = chladni(&["doctor", "--data", data, "--repair"]);
    assert!(examined.status.success(), "{examined:?}");
    let server = Server::start(folder.path(), &[]);
    assert_eq!(server.finished(&job).await["status"], "succeeded");
    bytes(&server, &format!("/v1/bases/{basis}/content")).await;
    server.stop();
}

#[tokio::test]
async fn a_database_that_goes_away_stops_all_writing() {
    for name in ["meta.db", "blobs.db", "meta.db-wal", "blobs.db-shm"] {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let server = Server::start(folder.path(), &[]);
        let (mesh, ..) = stored(&server).await;
        fs::rename(file(name), file("away")).unwrap();
        let upload =
            |text: String| server.client.post(format!("{}/v1/meshes?format=off", server.url)).body(text).send();
        let other = process::torus().replace("0.7", "0.6").replace("2.", "3.");
        is_problem(upload(other.clone()).await.unwrap(), 503, "storage-replaced").await;
        let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 9}});
        let job = server.client.post(format!("{}/v1/jobs", server.url)).json(&request).send().await.unwrap();
        if name.starts_with("meta") {
            is_problem(job, 503, "storage-replaced").await;
        }
        let readiness = is_problem(get(&server, "/readyz").await, 503, "not-ready").await;
        assert_eq!(readiness["reasons"], json!(["storage-replaced"]), "{name}");
        // Back in its place, it is what it was.
        fs::rename(file("away"), file(name)).unwrap();
        assert!(upload(other).await.unwrap().status().is_success(), "{name}");
        server.kill();
    }
}

#[tokio::test]
async fn a_lock_file_that_is_deleted_lets_nobody_in() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    fs::remove_file(folder.path().join("lock")).unwrap();
    assert!(refused(folder.path()).contains("in use by another process"));
    stored(&server).await;
    server.stop();
}

#[tokio::test]
async fn a_server_that_is_to_keep_nothing_keeps_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    stored(&server).await;
    server.stop();
    let server = Server::start(folder.path(), &["--keep-bases", "0", "--keep-meshes", "0", "--keep-jobs", "0"]);
    let begun = Instant::now();
    for kind in ["bases", "meshes", "jobs"] {
        while get(&server, &format!("/v1/{kind}")).await.json::<Value>().await.unwrap()["items"] != json!([]) {
            assert!(begun.elapsed() < PATIENCE, "{kind}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
    server.stop();
}

#[tokio::test]
async fn a_server_stops_in_order_while_a_matrix_is_ordered() {
    let folder = tempfile::tempdir().unwrap();
    let sphere = folder.path().join("sphere.ply");
    let made = chladni(&["sample", "sphere", "-n", "150000", "-o", sphere.to_str().unwrap()]);
    assert!(made.status.success(), "{made:?}");
    let sphere = fs::read(sphere).unwrap();
    for round in 0..5u64 {
        let folder = tempfile::tempdir().unwrap();
        let server = Server::start(folder.path(), &["--drain-seconds", "0.1", "--memory-bytes", "64GiB"]);
        let answer = server.client.post(format!("{}/v1/meshes?format=ply", server.url)).body(sphere.clone()).send();
        let mesh: Value = answer.await.unwrap().json().await.unwrap();
        let id = mesh["id"].as_str().unwrap();
        let job = server.submit_with(id, json!({"method": "hsim", "count": 300})).await.unwrap();
        let begun = Instant::now();
        // The matrix is ordered for a second or more of this stage.
        while server.job_now(&job).await["stage"] != "hierarchy" {
            assert!(begun.elapsed() < PATIENCE);
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        tokio::time::sleep(Duration::from_millis(200 + 200 * round)).await;
        server.stop();
    }
}

/// Everything that a server lists, by id, with a hash of its content.
async fn everything(server: &Server) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for kind in ["meshes", "bases", "jobs"] {
        let mut path = format!("/v1/{kind}?limit=200");
        loop {
            let page: Value = get(server, &path).await.json().await.unwrap();
            for item in page["items"].as_array().unwrap() {
                let id = item["id"].as_str().unwrap();
                let content = match kind {
                    "jobs" => item["status"].as_str().unwrap().to_owned(),
                    _ => blake3::hash(&bytes(server, &format!("/v1/{kind}/{id}/content")).await).to_hex().to_string(),
                };
                all.insert(format!("{kind} {id}"), content);
            }
            match page["next"].as_str() {
                Some(next) => path = format!("/v1/{kind}?limit=200&from={next}"),
                None => break,
            }
        }
    }
    all
}

/// An octahedron whose first vertex tells it from others.
fn octahedron(seed: u64) -> String {
    format!(
        "OFF\n6 8 0\n{} 0 0\n-1 0 0\n0 1 0\n0 -1 0\n0 0 1\n0 0 -1\n3 0 2 4\n3 2 1 4\n3 1 3 4\n3 3 0 4\n3 2 0 5\n3 1 2 5\n3 3 1 5\n3 0 3 5\n",
        1.0 + seed as f64 / 1e4
    )
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn backups_under_load_hold_all_that_was_acknowledged_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (data, backup) = (path("data"), path("backup"));
    let server = Arc::new(Server::start(Path::new(&data), &[]));
    let stop = Arc::new(AtomicBool::new(false));
    let kept = Arc::new(Mutex::new(Vec::new()));
    // Clients that upload, solve and delete all the time; what the first one stores stays.
    let clients: Vec<_> = (0..3u64)
        .map(|client| {
            let (server, stop, kept) = (Arc::clone(&server), Arc::clone(&stop), Arc::clone(&kept));
            tokio::spawn(async move {
                let mut seed = client << 32;
                while !stop.load(Ordering::Relaxed) {
                    seed += 1;
                    let body = octahedron(seed % 100_000 + client * 100_000);
                    let answer = server.client.post(format!("{}/v1/meshes?format=off", server.url)).body(body).send();
                    let mesh: Value = answer.await.unwrap().json().await.unwrap();
                    let mesh = mesh["id"].as_str().unwrap().to_owned();
                    let job = server.submit_with(&mesh, json!({"count": 3})).await.unwrap();
                    if client == 0 {
                        kept.lock().unwrap().extend([format!("meshes {mesh}"), format!("jobs {job}")]);
                    } else {
                        let url = format!("{}/v1/meshes/{mesh}?cascade=true", server.url);
                        assert!(server.client.delete(url).send().await.unwrap().status().is_success());
                    }
                }
            })
        })
        .collect();
    let storms: usize = std::env::var("CHLADNI_STORMS").ok().and_then(|text| text.parse().ok()).unwrap_or(3);
    let mut backed_up = Vec::new();
    for storm in 0..storms {
        let acknowledged = kept.lock().unwrap().clone();
        let done = tokio::task::spawn_blocking({
            let (data, backup) = (data.clone(), backup.clone());
            move || chladni(&["backup", &backup, "--data", &data, "--json"])
        });
        let done = done.await.unwrap();
        assert!(done.status.success(), "storm {storm}: {done:?}");
        let report: Value = serde_json::from_slice(&done.stdout).unwrap();
        println!("storm {storm}: {} acknowledged before; {report}", acknowledged.len());
        let copy = path(&format!("backup {storm}"));
        fs::create_dir(&copy).unwrap();
        for name in ["meta.db", "blobs.db"] {
            fs::copy(Path::new(&backup).join(name), Path::new(&copy).join(name)).unwrap();
        }
        backed_up.push((copy, acknowledged));
    }
    stop.store(true, Ordering::Relaxed);
    for client in clients {
        client.await.unwrap();
    }
    let done = chladni(&["backup", &backup, "--data", &data]);
    assert!(done.status.success(), "{done:?}");
    backed_up.push((backup, kept.lock().unwrap().clone()));
    let Ok(server) = Arc::try_unwrap(server) else { panic!("no client is left") };
    server.stop();

    let mut last = BTreeMap::new();
    for (storm, (backup, acknowledged)) in backed_up.iter().enumerate() {
        let restored = path(&format!("restored {storm}"));
        let done = chladni(&["restore", backup, "--data", &restored]);
        assert!(done.status.success(), "storm {storm}: {done:?}");
        assert!(!chladni(&["restore", backup, "--data", &restored]).status.success(), "not over what is there");
        // One that ended between its two files goes on.
        let workshop = Path::new(&restored).join("restoring");
        fs::create_dir(&workshop).unwrap();
        fs::rename(Path::new(&restored).join("meta.db"), workshop.join("meta.db")).unwrap();
        assert!(chladni(&["restore", backup, "--data", &restored]).status.success());
        let server = Server::start(Path::new(&restored), &[]);
        // Content is verified as it is read; every basis and mesh that is listed has its own.
        let all = everything(&server).await;
        for what in acknowledged {
            let found = all.get(what).unwrap_or_else(|| panic!("storm {storm}: {what} is lost"));
            // And the same in every backup.
            let content = last.entry(what.clone()).or_insert_with(|| found.clone());
            assert!(what.starts_with("jobs") || found == content, "storm {storm}: {what}");
        }
        server.stop();
    }
}
