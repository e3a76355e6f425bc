//! A small client of our own API, for `demo`.

use super::CliError;
use futures_util::StreamExt;
use reqwest::{RequestBuilder, header};
use serde_json::{Value, json};
use std::time::Duration;

/// How long a look at a job waits when its event stream has ended early.
const WAIT: &str = "10s";

/// A client of one server.
pub struct Client {
    base: String,
    http: reqwest::Client,
}

impl Client {
    /// A client of the server at `base`, such as `http://127.0.0.1:8080`.
    pub fn new(base: String) -> Result<Self, CliError> {
        // The server is this very process: a proxy of the environment must not come between.
        let http = reqwest::Client::builder().no_proxy().connect_timeout(Duration::from_secs(5)).build();
        Ok(Self { base, http: http.map_err(|error| failed("the client", &error))? })
    }

    /// Uploads a mesh file, as it is or compressed by gzip; answers with the stored mesh.
    pub async fn upload(&self, name: &str, format: Option<&str>, content: Vec<u8>) -> Result<Value, CliError> {
        let mut query = vec![("name", name)];
        query.extend(format.map(|format| ("format", format)));
        let mut request = self
            .http
            .post(format!("{}/v1/meshes", self.base))
            .query(&query)
            .header(header::CONTENT_TYPE, "application/octet-stream");
        if content.starts_with(&[0x1f, 0x8b]) {
            request = request.header(header::CONTENT_ENCODING, "gzip");
        }
        answer(request.body(content)).await
    }

    /// Submits a job; answers with the job, which may be done already.
    pub async fn submit(&self, kind: &str, mesh: &str, parameters: &Value) -> Result<Value, CliError> {
        let body = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
        answer(self.http.post(format!("{}/v1/jobs", self.base)).json(&body)).await
    }

    /// What is found at a path, which begins with a slash.
    pub async fn get(&self, path: &str) -> Result<Value, CliError> {
        answer(self.http.get(format!("{}{path}", self.base))).await
    }

    /// Follows a job to its end; tells each change, and answers with the last.
    pub async fn watch(&self, job: &Value, mut changed: impl FnMut(&Value)) -> Result<Value, CliError> {
        let path = text(job, "/links/self")?;
        changed(job);
        if is_finished(job) {
            return Ok(job.clone());
        }
        let request = self.http.get(format!("{}{}", self.base, text(job, "/links/events")?));
        let response = request.send().await.map_err(|error| failed("GET events", &error))?;
        let mut stream = response.bytes_stream();
        let mut events = Events::default();
        while let Some(Ok(piece)) = stream.next().await {
            for state in events.take(&piece) {
                changed(&state);
                if is_finished(&state) {
                    return Ok(state);
                }
            }
        }
        // The stream broke off; the job goes on.
        loop {
            let state = self.get(&format!("{path}?wait={WAIT}")).await?;
            changed(&state);
            if is_finished(&state) {
                return Ok(state);
            }
        }
    }
}

/// The text at a JSON pointer of an answer.
pub fn text<'v>(value: &'v Value, pointer: &str) -> Result<&'v str, CliError> {
    value
        .pointer(pointer)
        .and_then(Value::as_str)
        .ok_or_else(|| CliError::Service(format!("an answer of the server lacks {pointer}")))
}

fn is_finished(job: &Value) -> bool {
    !matches!(job["status"].as_str(), Some("enqueued" | "processing"))
}

async fn answer(request: RequestBuilder) -> Result<Value, CliError> {
    let response = request.send().await.map_err(|error| failed("a request", &error))?;
    let status = response.status();
    let body: Value = response.json().await.map_err(|error| failed("an answer", &error))?;
    if status.is_success() {
        return Ok(body);
    }
    let part = |name: &str| body[name].as_str().map(str::to_owned);
    let reason = part("detail").or_else(|| part("title")).unwrap_or_else(|| status.to_string());
    Err(CliError::Refused(reason))
}

/// A failure of the connection, with its causes.
fn failed(what: &str, error: &reqwest::Error) -> CliError {
    let mut reason = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        reason = format!("{reason}: {inner}");
        cause = inner.source();
    }
    CliError::Service(format!("{what} failed: {reason}"))
}

/// Puts the data of server-sent events together from pieces of a stream.
#[derive(Debug, Default)]
struct Events {
    line: Vec<u8>,
    data: String,
}

impl Events {
    /// The JSON data of every event that ends in this piece.
    fn take(&mut self, piece: &[u8]) -> Vec<Value> {
        let mut whole = Vec::new();
        for &byte in piece {
            if byte != b'\n' {
                self.line.push(byte);
                continue;
            }
            let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).trim_end_matches('\r').to_owned();
            if let Some(data) = line.strip_prefix("data:") {
                self.data += data.trim_start();
            } else if line.is_empty() && !self.data.is_empty() {
                whole.extend(serde_json::from_str(&std::mem::take(&mut self.data)));
            }
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_put_together_from_any_pieces() {
        let stream = b": keep-alive\n\nevent: job\nid: 8\ndata: {\"status\":\"processing\"}\n\nevent: job\r\ndata: {\"status\":\r\ndata: \"succeeded\"}\r\n\r\ndata: cut";
        for size in [1, 3, 1000] {
            let mut events = Events::default();
            let found: Vec<Value> = stream.chunks(size).flat_map(|piece| events.take(piece)).collect();
            assert_eq!(found, [json!({"status": "processing"}), json!({"status": "succeeded"})]);
        }
    }

    #[test]
    fn a_job_is_finished_unless_it_waits_or_runs() {
        for (status, finished) in [("enqueued", false), ("processing", false), ("succeeded", true), ("failed", true)] {
            assert_eq!(is_finished(&json!({"status": status})), finished);
        }
    }
}
