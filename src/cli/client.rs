//! A small client of our own API, for `demo`.

use super::CliError;
use bytes::Bytes;
use futures_util::StreamExt;
use http_body_util::{BodyExt, Full};
use hyper::body::Incoming;
use hyper::client::conn::http1;
use hyper::{Request, Response, header};
use hyper_util::rt::TokioIo;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::time::Duration;
use tokio::net::TcpStream;

/// How long a look at a job waits when its event stream has ended early.
const WAIT: &str = "10s";

/// How long the server may take to accept a connection; it is this very process.
const PATIENCE: Duration = Duration::from_secs(5);

/// A client of one server: a connection for each request.
pub struct Client {
    server: SocketAddr,
}

impl Client {
    /// A client of the server that listens at `server`.
    pub fn new(server: SocketAddr) -> Self {
        Self { server }
    }

    /// Uploads a mesh file, as it is or compressed by gzip; answers with the stored mesh.
    pub async fn upload(&self, name: &str, format: Option<&str>, content: Vec<u8>) -> Result<Value, CliError> {
        let mut query = form_urlencoded::Serializer::new(String::new());
        query.append_pair("name", name);
        query.extend_pairs(format.map(|format| ("format", format)));
        let mut request = Request::post(format!("/v1/meshes?{}", query.finish()))
            .header(header::CONTENT_TYPE, "application/octet-stream");
        if content.starts_with(&[0x1f, 0x8b]) {
            request = request.header(header::CONTENT_ENCODING, "gzip");
        }
        self.answer(request.body(content.into())).await
    }

    /// Submits a job; answers with the job, which may be done already.
    pub async fn submit(&self, kind: &str, mesh: &str, parameters: &Value) -> Result<Value, CliError> {
        let body = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
        let request = Request::post("/v1/jobs").header(header::CONTENT_TYPE, "application/json");
        self.answer(request.body(body.to_string().into())).await
    }

    /// What is found at a path, which begins with a slash.
    pub async fn get(&self, path: &str) -> Result<Value, CliError> {
        self.answer(Request::get(path).body(Full::default())).await
    }

    /// Follows a job to its end; tells each change, and answers with the last.
    pub async fn watch(&self, job: &Value, mut changed: impl FnMut(&Value)) -> Result<Value, CliError> {
        let path = text(job, "/links/self")?;
        changed(job);
        if is_finished(job) {
            return Ok(job.clone());
        }
        let request = Request::get(text(job, "/links/events")?).body(Full::default());
        let mut stream = self.send(request).await?.into_body().into_data_stream();
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

    /// Sends a request over a connection of its own, and gives the answer once its header is there.
    async fn send(
        &self,
        request: Result<Request<Full<Bytes>>, hyper::http::Error>,
    ) -> Result<Response<Incoming>, CliError> {
        let mut request = request.map_err(|error| failed("a request", &error))?;
        let host =
            header::HeaderValue::try_from(self.server.to_string()).map_err(|error| failed("a request", &error))?;
        request.headers_mut().insert(header::HOST, host);
        let stream = tokio::time::timeout(PATIENCE, TcpStream::connect(self.server))
            .await
            .map_err(|error| failed("the connection", &error))?
            .map_err(|error| failed("the connection", &error))?;
        let (mut sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(|error| failed("the connection", &error))?;
        // It ends with the body of the answer; what goes wrong on it shows there.
        tokio::spawn(connection);
        sender.send_request(request).await.map_err(|error| failed("a request", &error))
    }

    async fn answer(&self, request: Result<Request<Full<Bytes>>, hyper::http::Error>) -> Result<Value, CliError> {
        let response = self.send(request).await?;
        let status = response.status();
        let body = response.into_body().collect().await.map_err(|error| failed("an answer", &error))?.to_bytes();
        let body: Value = serde_json::from_slice(&body).map_err(|error| failed("an answer", &error))?;
        if status.is_success() {
            return Ok(body);
        }
        let part = |name: &str| body[name].as_str().map(str::to_owned);
        let reason = part("detail").or_else(|| part("title")).unwrap_or_else(|| status.to_string());
        Err(CliError::Refused(reason))
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

/// A failure of the connection, with its causes.
fn failed(what: &str, error: &dyn std::error::Error) -> CliError {
    let mut reason = error.to_string();
    let mut cause = error.source();
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
