//! One job in parts, on one machine and on several: its pairs are those of a whole one, and deaths, cancellation and
//! failures leave nothing half done.
#![cfg(unix)]

#[cfg(feature = "cluster")]
#[path = "common/places.rs"]
mod places;
#[cfg(feature = "cluster")]
#[path = "common/postgres.rs"]
mod postgres;
mod process;
#[cfg(feature = "cluster")]
use std::{os::unix::process::ExitStatusExt, time::Instant};

use process::{PATIENCE, Server};
use serde_json::{Value, json};

const SIGKILL: i32 = 9;

/// Enough unknowns for Krylov spaces, and no more.
fn surface() -> String {
    process::torus_of(56, 28)
}

/// So many pairs in so many parts. What is asked for with another seed is other work.
fn wanted(seed: u64, parts: Value) -> Value {
    json!({"method": "hsim", "count": 200, "tolerance": 1e-6, "seed": seed, "parts": parts})
}

impl Server {
    async fn get(&self, path: &str) -> Value {
        let answer = self.client.get(format!("{}{path}", self.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "{path}: {}", answer.text().await.unwrap());
        answer.json().await.unwrap()
    }

    async fn ask(&self, path: &str) -> Value {
        let answer = self.client.post(format!("{}{path}", self.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "{path}: {}", answer.text().await.unwrap());
        answer.json().await.unwrap()
    }

    async fn basis_of(&self, job: &Value) -> Value {
        let basis = job["basis"].as_str().unwrap_or_else(|| panic!("{job}"));
        self.get(&format!("/v1/bases/{basis}")).await
    }

    /// Jobs that solve parts, as lists show them.
    async fn parts_listed(&self) -> Vec<Value> {
        self.get("/v1/jobs?kind=eigenbasis_part&limit=200").await["items"].as_array().unwrap().clone()
    }

    /// Waits until a job is as described.
    async fn until(&self, job: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let record = self.job_now(job).await;
            if holds(&record) {
                return record;
            }
            assert!(begun.elapsed() < PATIENCE, "{record}");
            tokio::time::sleep(std::time::Duration::from_millis(5)).await;
        }
    }

    /// Waits until no job has parts any more.
    async fn until_no_parts(&self) {
        self.until_no_parts_but(0).await;
    }

    /// The same but for so many, of a job that failed.
    async fn until_no_parts_but(&self, kept: usize) {
        let begun = Instant::now();
        while self.parts_listed().await.len() > kept {
            assert!(begun.elapsed() < PATIENCE, "{:?}", self.parts_listed().await);
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    }
}

fn values(basis: &Value) -> Vec<f64> {
    basis["eigenvalues"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

/// That a job was solved in so many parts, to the pairs that are known.
fn check(job: &Value, basis: &Value, parts: usize, known: &[f64]) {
    assert_eq!((&job["status"], &job["attempt"]), (&"succeeded".into(), &1.into()), "{job}");
    assert_eq!(job["parts"], json!({"done": parts, "of": parts}));
    let told = basis["details"]["parts"].as_array().unwrap_or_else(|| panic!("{}", basis["details"]));
    assert_eq!(told.len(), parts);
    assert!(told.iter().zip(1..).all(|(part, number)| part["part"] == number && part["pairs"].as_u64() > Some(64)));
    assert!(basis["details"]["fallbacks"].is_null(), "{}", basis["details"]);
    assert_eq!(basis["certificate"]["complete"], true);
    let found = values(basis);
    assert_eq!(found.len(), known.len());
    for (k, (a, b)) in found.iter().zip(known).enumerate() {
        assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "pair {k} is {a}, not {b}");
    }
}

/// Parts of the surface: all make the pairs, and each measures them on its own vertices.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_approximation_in_parts_has_the_values_of_a_whole_one_and_bounds_beside_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &["--workers", "2"]);
    let mesh = server.upload_off(process::torus_of(160, 80)).await;
    let mut bases = Vec::new();
    for (seed, parts) in [(0, Value::Null), (1, json!(3))] {
        let wanted = json!({
            "method": "approximate", "count": 20, "dimension": 60, "accuracy": {"goal": 0.02}, "seed": seed, "parts": parts,
        });
        let done = server.submit_with(&mesh, wanted).await.unwrap();
        let done = server.finished(&done).await;
        assert_eq!(done["status"], "succeeded", "{done}");
        assert_eq!(done["parts"].is_null(), parts.is_null(), "{done}");
        bases.push(server.basis_of(&done).await);
    }
    let [whole, parts] = &bases[..] else { panic!("two bases") };
    let told = parts["details"]["parts"].as_array().unwrap_or_else(|| panic!("{}", parts["details"]));
    assert_eq!(told.len(), 3);
    assert_eq!(told.iter().map(|part| part["unknowns"].as_u64().unwrap()).sum::<u64>(), 160 * 80, "{told:?}");
    assert!(parts["details"]["fallbacks"].is_null(), "{}", parts["details"]);
    let numbers = |basis: &Value, name: &str| -> Vec<f64> {
        let list = if name == "eigenvalues" { &basis[name] } else { &basis["certificate"][name] };
        list.as_array().unwrap_or_else(|| panic!("{name}: {basis}")).iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (values, bounds) = (numbers(whole, "eigenvalues"), numbers(whole, "bounds"));
    // Another seed is other work, and its samples are others: values agree as far as they are exact, and each bound
    // reaches to the other value.
    for (k, (found, bound)) in numbers(parts, "eigenvalues").iter().zip(numbers(parts, "bounds")).enumerate() {
        let apart = (found - values[k]).abs();
        assert!(
            apart <= 0.02 * values[k].max(1.0) && apart <= bound + bounds[k] + 1e-9,
            "pair {k}: {found} {} {bound}",
            values[k]
        );
    }
    server.until_no_parts().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_in_parts_has_the_pairs_of_a_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &["--workers", "2"]);
    let mesh = server.upload_off(surface()).await;
    let whole = server.submit_with(&mesh, wanted(0, Value::Null)).await.unwrap();
    let whole = server.finished(&whole).await;
    assert!(whole["parts"].is_null() && whole["links"]["parts"].is_null());
    let whole = server.basis_of(&whole).await;
    let known = values(&whole);
    // What is done in one piece is not done again in parts.
    let again = server.submit_with(&mesh, wanted(0, json!(3))).await.unwrap();
    assert_eq!(server.job_now(&again).await["basis"], whole["id"]);
    let job = server.submit_with(&mesh, wanted(1, json!(3))).await.unwrap();
    let events = server.client.get(format!("{}/v1/jobs/{job}/events", server.url)).send().await.unwrap();
    let events = tokio::time::timeout(PATIENCE, events.text()).await.unwrap().unwrap();
    assert!(events.contains(r#""stage":"parts""#) && events.contains(r#""of":3}"#), "{events}");
    let done = server.finished(&job).await;
    let basis = server.basis_of(&done).await;
    check(&done, &basis, 3, &known);
    assert_eq!(basis["certificate"]["tolerance"], whole["certificate"]["tolerance"]);
    // As many as there are workers.
    let auto = server.submit_with(&mesh, wanted(2, json!("auto"))).await.unwrap();
    let done = server.finished(&auto).await;
    assert_eq!(done["parts"], Value::Null, "so few pairs are not divided: {done}");
    server.until_no_parts().await;
    let listed = server.get("/v1/jobs").await;
    assert_eq!(listed["items"].as_array().unwrap().len(), 3);
    assert_eq!(server.get(&format!("/v1/jobs?parent={job}")).await["items"], json!([]));
    let refused = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": wanted(3, json!(4))});
    let answer = server.client.post(format!("{}/v1/jobs", server.url)).json(&refused).send().await.unwrap();
    assert_eq!(answer.status(), 422);
    let refused: Value = answer.json().await.unwrap();
    assert!(refused["detail"].as_str().unwrap().contains("200 pairs make at most 3 parts"), "{refused}");
    server.stop();
}

/// Before and after the job is divided, before and after a part is claimed and done, and the same of the join.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_is_killed_at_any_point_loses_no_part() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    let mesh = server.upload_off(surface()).await;
    let whole = server.submit_with(&mesh, wanted(0, Value::Null)).await.unwrap();
    let known = values(&server.basis_of(&server.finished(&whole).await).await);
    server.stop();
    let faults = [
        "before-divide:kill",
        "after-divide:kill",
        "after-claim:kill:1",
        "before-complete:kill:1",
        "after-complete:kill:1",
        "after-claim:kill:4",
        "before-complete:kill:3",
    ];
    for (seed, fault) in (1..).zip(faults) {
        let doomed = Server::start(folder.path(), &["--fault", fault]);
        let job = doomed.submit_with(&mesh, wanted(seed, json!(3))).await.unwrap();
        assert_eq!(doomed.ended().signal(), Some(SIGKILL), "{fault}");
        let server = Server::start(folder.path(), &[]);
        let before = server.job_now(&job).await["parts"]["done"].as_u64();
        let expected = match fault {
            "before-divide:kill" => None,
            "after-divide:kill" | "after-claim:kill:1" => Some(0),
            "before-complete:kill:1" => Some(1),
            "after-complete:kill:1" => Some(2),
            _ => Some(3),
        };
        assert!(before >= expected, "{fault}: {before:?} parts done");
        let done = server.finished(&job).await;
        check(&done, &server.basis_of(&done).await, 3, &known);
        server.until_no_parts().await;
        server.stop();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn parts_end_with_a_job_that_is_cancelled_and_are_found_by_one_that_is_retried() {
    let folder = tempfile::tempdir().unwrap();
    // The first part is not stored, and there is one attempt.
    let server = Server::start(folder.path(), &["--fault", "before-chunks:panic:1", "--max-attempts", "1"]);
    let mesh = server.upload_off(surface()).await;
    let job = server.submit_with(&mesh, wanted(1, json!(3))).await.unwrap();
    let failed = server.finished(&job).await;
    let detail = failed["problem"]["detail"].as_str().unwrap_or_else(|| panic!("{failed}"));
    assert!(failed["status"] == "failed" && detail.starts_with("part 2 of 3: "), "{failed}");
    assert_eq!(failed["problem"]["type"], "/problems/job/storage-unavailable", "{failed}");
    server.stop();
    // What was done is found.
    let server = Server::start(folder.path(), &[]);
    let listed = server.get(&format!("/v1/jobs?parent={job}&status=succeeded")).await["items"].clone();
    assert_eq!(listed.as_array().unwrap().len(), 1, "{listed}");
    let part = &listed[0];
    assert_eq!(
        (&part["kind"], &part["parent"], &part["basis"]),
        (&"eigenbasis_part".into(), &job.as_str().into(), &Value::Null)
    );
    let refused = server.client.post(format!("{}/v1/jobs/{}/cancel", server.url, part["id"].as_str().unwrap()));
    assert_eq!(refused.send().await.unwrap().status(), 409);
    server.ask(&format!("/v1/jobs/{job}/retry")).await;
    server.until(&job, |job| job["parts"]["done"].as_u64() >= Some(1)).await;
    let done = server.finished(&job).await;
    assert_eq!((&done["status"], &done["parts"]), (&"succeeded".into(), &json!({"done": 3, "of": 3})), "{done}");
    // Another is cancelled in the middle of its parts.
    let job = server.submit_with(&mesh, wanted(2, json!(3))).await.unwrap();
    let waiting = server.until(&job, |job| job["parts"]["done"].as_u64() >= Some(1)).await;
    assert_eq!((&waiting["status"], &waiting["stage"]), (&"enqueued".into(), &"parts".into()), "{waiting}");
    let canceled = server.ask(&format!("/v1/jobs/{job}/cancel")).await;
    assert_eq!(canceled["status"], "canceled");
    server.until_no_parts().await;
    server.ask(&format!("/v1/jobs/{job}/retry")).await;
    assert_eq!(server.finished(&job).await["status"], "succeeded");
    let gone = server.client.delete(format!("{}/v1/jobs/{job}?cascade=true", server.url)).send().await.unwrap();
    assert_eq!(gone.status(), 204);
    server.until_no_parts().await;
    server.stop();
    let examined = process::chladni(&["doctor", "--data", folder.path().to_str().unwrap()]);
    assert!(examined.status.success(), "{examined:?}");
}

#[cfg(feature = "cluster")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_share_the_parts_of_a_job_and_one_that_is_killed_loses_its_own_alone() {
    let Some(places) = places::Places::over_s3() else { return };
    let server = places.server();
    let mesh = server.upload_off(surface()).await;
    let first = places.worker(&[]);
    let whole = server.submit_with(&mesh, wanted(0, Value::Null)).await.unwrap();
    let known = values(&server.basis_of(&server.finished(&whole).await).await);
    drop(first);
    // Who divides the job dies, and who solves its first part in the middle of it.
    let job = server.submit_with(&mesh, wanted(1, json!(3))).await.unwrap();
    let planner = places.worker(&["--fault", "after-divide:kill:0"]);
    assert_eq!(planner.ended(), Some(SIGKILL));
    let waiting = server.job_now(&job).await;
    assert_eq!(
        (&waiting["status"], &waiting["parts"]),
        (&"enqueued".into(), &json!({"done": 0, "of": 3})),
        "{waiting}"
    );
    let doomed = places.worker(&["--kinds", "eigenbasis_part", "--fault", "mid-run:kill:3"]);
    assert_eq!(doomed.ended(), Some(SIGKILL));
    let _workers = [places.worker(&[]), places.worker(&["--jobs-in", "threads"])];
    let parts = server.get(&format!("/v1/jobs?parent={job}")).await["items"].as_array().unwrap().clone();
    assert_eq!(parts.len(), 3);
    let done = server.finished(&job).await;
    check(&done, &server.basis_of(&done).await, 3, &known);
    server.until_no_parts().await;
    assert_eq!(places.check().await, 2);
    server.stop();
}

/// An approximation of a surface of 80,000 vertices, in parts or whole.
fn approximated(seed: u64, parts: Value, goal: f64) -> Value {
    json!({"method": "approximate", "count": 30, "dimension": 90, "accuracy": {"goal": goal}, "seed": seed, "parts": parts})
}

impl Server {
    /// What a job needs, as the server estimates it.
    async fn estimate(&self, mesh: &str, parameters: Value) -> u64 {
        let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
        let answer = self.client.post(format!("{}/v1/job-estimates", self.url)).json(&request).send().await.unwrap();
        assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
        answer.json::<Value>().await.unwrap()["memory_bytes"].as_u64().unwrap()
    }

    /// Why a job is refused.
    async fn refused(&self, mesh: &str, parameters: Value) -> Value {
        let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
        let answer = self.client.post(format!("{}/v1/jobs", self.url)).json(&request).send().await.unwrap();
        assert!(answer.status().is_client_error(), "{}", answer.status());
        answer.json().await.unwrap()
    }
}

/// Memory between what a whole approximation needs and what one in parts does; and what the whole does.
async fn between(server: &Server, mesh: &str) -> (u64, u64) {
    let whole = server.estimate(mesh, approximated(0, Value::Null, 0.1)).await;
    let parts = server.estimate(mesh, approximated(0, json!(3), 0.1)).await;
    assert!(parts + (32 << 20) < whole, "{parts} of {whole}");
    // Whether it is divided is not known yet.
    assert!(server.estimate(mesh, approximated(0, json!("auto"), 0.1)).await >= whole);
    (parts.midpoint(whole), whole)
}

/// Its plan, its parts and its join are all that anybody needs room for.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_in_parts_is_done_where_there_is_no_room_for_it_in_one_piece() {
    let folder = tempfile::tempdir().unwrap();
    let large = Server::start(folder.path(), &["--workers", "1"]);
    let mesh = large.upload_off(process::torus_of(400, 200)).await;
    let (memory, whole) = between(&large, &mesh).await;
    large.stop();
    let bytes = memory.to_string();
    let server = Server::start(folder.path(), &["--workers", "1", "--memory-bytes", &bytes]);
    let refused = server.refused(&mesh, approximated(1, Value::Null, 0.1)).await;
    assert!(refused["detail"].as_str().unwrap().contains(&bytes), "{refused}");
    // Who leaves it to the server is divided too, though there is a single worker.
    for (seed, parts) in [(1, json!(3)), (2, json!("auto"))] {
        let job = server.submit_with(&mesh, approximated(seed, parts, 0.1)).await.unwrap();
        let done = server.finished(&job).await;
        assert_eq!((&done["status"], &done["attempt"]), (&"succeeded".into(), &1.into()), "{done}");
        assert!(done["parts"]["of"].as_u64() > Some(1) && done["memory_bytes"].as_u64() <= Some(memory), "{done}");
        let basis = server.basis_of(&done).await;
        assert!(basis["details"]["fallbacks"].is_null(), "{}", basis["details"]);
    }
    // What its parts miss is not made in one piece here, and somewhere else it is.
    let missed = server.submit_with(&mesh, approximated(3, json!(3), 5e-4)).await.unwrap();
    let failed = server.finished(&missed).await;
    assert_eq!(failed["status"], "failed", "{failed}");
    assert_eq!(failed["problem"]["type"], "/problems/job/job-too-large", "{failed}");
    assert!(failed["problem"]["detail"].as_str().unwrap().contains(&bytes), "{failed}");
    server.until_no_parts_but(3).await;
    server.stop();
    let large = Server::start(folder.path(), &["--workers", "1"]);
    large.ask(&format!("/v1/jobs/{missed}/retry")).await;
    let done = large.finished(&missed).await;
    assert_eq!(done["status"], "succeeded", "{done}");
    assert!(done["memory_bytes"].as_u64() >= Some(whole), "{done}");
    let basis = large.basis_of(&done).await;
    assert!(basis["details"]["fallbacks"].to_string().contains("parts"), "{}", basis["details"]);
    large.stop();
}

/// Four workers, none of which has room for the whole.
#[cfg(feature = "cluster")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn small_workers_do_together_what_none_has_room_for() {
    let Some(places) = places::Places::over_s3() else { return };
    let server = places.server();
    let mesh = server.upload_off(process::torus_of(400, 200)).await;
    let (memory, whole) = between(&server, &mesh).await;
    let bytes = memory.to_string();
    let workers: Vec<places::Worker> = (0..4).map(|_| places.worker(&["--memory-bytes", &bytes])).collect();
    let begun = Instant::now();
    while server.get("/readyz").await["workers"][0]["processes"] != 4 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    let refused = server.refused(&mesh, approximated(1, Value::Null, 0.1)).await;
    assert!(refused["detail"].as_str().unwrap().contains(&bytes), "{refused}");
    for (seed, parts) in [(1, json!(4)), (2, json!("auto"))] {
        let job = server.submit_with(&mesh, approximated(seed, parts, 0.1)).await.unwrap();
        let done = server.finished(&job).await;
        assert_eq!(done["status"], "succeeded", "{done}");
        assert!(done["parts"]["of"].as_u64() > Some(1), "{done}");
        assert!(done["memory_bytes"].as_u64() <= Some(memory), "{done}");
    }
    // One whose parts miss the goal waits for nobody while there is nobody, and goes to whoever has room for one piece
    // when there is.
    let missed = server.submit_with(&mesh, approximated(3, json!(4), 5e-4)).await.unwrap();
    assert_eq!(server.finished(&missed).await["problem"]["type"], "/problems/job/job-too-large");
    let large = places.worker(&[]);
    while server.get("/readyz").await["workers"].as_array().unwrap().len() < 2 {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    server.ask(&format!("/v1/jobs/{missed}/retry")).await;
    let done = server.finished(&missed).await;
    assert_eq!(done["status"], "succeeded", "{done}");
    assert!(done["memory_bytes"].as_u64() >= Some(whole), "{done}");
    drop((workers, large));
    server.stop();
}
