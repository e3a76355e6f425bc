//! Requests at random: whatever comes, the answer is a success or a problem of the client's making, never a fault.

use serde_json::json;

use crate::common::{OCTAHEDRON, TestApp};

/// Bytes that mean something to one parser or another.
const ODD: &[u8] = b"0-9.eE{}[],\"\0\xff";

/// A small generator, so that a failure can be repeated from its seed.
struct Dice(u64);

impl Dice {
    fn below(&mut self, sides: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % sides
    }

    fn pick<'a, T: ?Sized>(&mut self, items: &[&'a T]) -> &'a T {
        items[self.below(items.len())]
    }

    /// Takes a text and damages it: cuts, repeats or changes some of it.
    fn damage(&mut self, text: &str) -> Vec<u8> {
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..self.below(4) {
            let at = self.below(bytes.len() + 1);
            match self.below(4) {
                0 => bytes.truncate(at),
                1 => bytes.insert(at, self.below(256) as u8),
                2 if at < bytes.len() => bytes[at] = ODD[self.below(ODD.len())],
                _ => bytes.extend_from_within(at..),
            }
        }
        bytes
    }
}

#[tokio::test]
async fn no_request_is_a_fault_of_the_server() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let mesh = app.octahedron().await;
    let job = app.submit(&mesh, json!({"count": 3})).await["id"].as_str().unwrap().to_owned();
    let paths = [
        "/v1/meshes".to_owned(),
        format!("/v1/meshes/{mesh}"),
        format!("/v1/meshes/{mesh}/content"),
        "/v1/jobs".to_owned(),
        format!("/v1/jobs/{job}"),
        format!("/v1/jobs/{job}/events"),
        format!("/v1/jobs/{job}/cancel"),
        format!("/v1/jobs/{job}/retry"),
        "/v1/bases".to_owned(),
        format!("/v1/bases/{basis}"),
        format!("/v1/bases/{basis}/content"),
        format!("/v1/bases/{basis}/modes"),
        format!("/v1/bases/{basis}/filter"),
        format!("/v1/bases/{basis}/project"),
        format!("/v1/bases/{basis}/reconstruct"),
        format!("/v1/bases/{basis}/distances"),
        format!("/v1/bases/{basis}/signatures"),
        format!("/v1/bases/{basis}/similar-points"),
        format!("/v1/bases/{basis}/compress"),
        format!("/v1/bases/{basis}/decompress"),
        "/v1/shape-comparisons".to_owned(),
        "/v1/functional-maps".to_owned(),
        "/v1/map-collections".to_owned(),
        "/v1/bases/%00%ff".to_owned(),
        "/v1/jobs/..%2f..%2fetc".to_owned(),
    ];
    let queries = [
        "",
        "limit=5",
        "limit=-1",
        "limit=99999999999999999999",
        "from=%ff",
        "from=1",
        "wait=1ms",
        "wait=1e400s",
        "format=ply",
        "format=f32",
        "format=obj",
        "from=1&to=2",
        "from=18446744073709551615",
        "from=2&to=18446744073709551615",
        "dtype=f64",
        "transfer=%7B%22kind%22%3A%22heat%22%2C%22time%22%3A1e999%7D",
        "transfer=%7B%22kind%22%3A%22heat%22%2C%22time%22%3A1%7D",
        "function=coordinates",
        "reconstruct=true",
        "merge=always",
        "name=%00",
        "&&=&",
        "%",
        "status=enqueued",
    ];
    let bodies = [
        "",
        OCTAHEDRON,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "ply\nformat ascii 1.0\nelement vertex 3\nend_header\n",
        r#"{"kind": "eigenbasis", "mesh": "x", "parameters": {"count": 3}}"#,
        r#"{"functions": "coordinates", "transfer": {"kind": "band_pass", "low": 0, "high": 1e308}}"#,
        r#"{"functions": {"columns": 1, "values": [1, 2, 3, 4, 5, 6]}, "reconstruct": true}"#,
        r#"{"columns": 2, "values": [1e308, 1e308, 1e308, 1e308, 1e308, 1e308]}"#,
    ];
    let media_types = [
        "application/json",
        "application/octet-stream",
        "model/obj",
        "text/plain",
        "multipart/form-data; boundary=x",
        "x",
        ";",
    ];
    let headers = [
        ("range", "bytes=0-"),
        ("range", "bytes=-0"),
        ("range", "bytes=18446744073709551615-"),
        ("if-none-match", "*"),
        ("if-none-match", "W/\""),
        ("accept", "*/*;q=nan"),
        ("accept", "image/png"),
        ("accept", ",,;q="),
        ("content-encoding", "gzip"),
        ("content-encoding", "zstd"),
        ("idempotency-key", "k"),
        ("last-event-id", "-9"),
        ("last-event-id", "999999"),
        ("x-request-id", "?"),
        ("origin", "null"),
        ("authorization", "Bearer"),
        ("accept-encoding", "gzip, zstd"),
        ("expect", "100-continue"),
    ];
    let mut dice = Dice(20261121);
    for round in 0..1500 {
        let path = dice.pick(&paths.iter().map(String::as_str).collect::<Vec<_>>()).to_owned();
        let method = dice.pick(&["GET", "GET", "POST", "POST", "HEAD", "PUT", "OPTIONS"]);
        let query = dice.pick(&queries);
        let mut request = app.client.request(method.parse().unwrap(), app.url(&format!("{path}?{query}")));
        if method == "POST" || method == "PUT" {
            let body = dice.pick(&bodies);
            request = request.header("content-type", dice.pick(&media_types)).body(dice.damage(body));
        }
        for _ in 0..dice.below(3) {
            let (name, value) = headers[dice.below(headers.len())];
            request = request.header(name, value);
        }
        let what = format!("round {round}: {method} {path}?{query}");
        let response =
            request.timeout(std::time::Duration::from_secs(30)).send().await.unwrap_or_else(|e| panic!("{what}: {e}"));
        let status = response.status();
        let media_type = response.headers().get("content-type").map(|v| v.to_str().unwrap().to_owned());
        assert!(!status.is_server_error(), "{what}: {status} {}", response.text().await.unwrap());
        if status.is_client_error() && method != "HEAD" {
            assert_eq!(media_type.as_deref(), Some("application/problem+json"), "{what}: {status}");
        }
    }
    assert_eq!(app.get("/readyz").send().await.unwrap().status(), 200);
    // What the dice submitted is over soon: the scripted runner answers at once.
    let waiting = ["enqueued", "processing"];
    for status in waiting {
        loop {
            let page: serde_json::Value =
                app.get(&format!("/v1/jobs?status={status}")).send().await.unwrap().json().await.unwrap();
            if page["items"].as_array().unwrap().is_empty() {
                break;
            }
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    }
}
