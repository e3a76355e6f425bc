//! The accept loop: connections with a header timeout, a limit on their number, a stall timeout on writes, and a drain.
//!
//! `axum::serve` would let an unfinished header hang for ever, so connections are served by hyper directly.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};
use tower_http::add_extension::AddExtension;

use super::connection::Unstalled;
use super::seats::{Seat, Seats};
use super::state::AppState;

/// The most bytes of a request line and its headers that are held.
const HEADER_BYTES: usize = 64 * 1024;

/// The longest that a connection of the reserve may take for its header.
const RESERVE_HEADER: Duration = Duration::from_secs(2);

/// The other end of a connection.
#[derive(Debug, Clone, Copy)]
pub struct Peer {
    /// Where it is.
    pub address: SocketAddr,
    /// Whether the connection is one of the reserve, for health and metrics alone.
    pub reserve: bool,
}

/// Serves the API on `listener` until `shutdown` resolves, then lets running requests end within the configured drain
/// time.
///
/// # Errors
/// None at present: a failing accept (out of file handles) is logged and tried again.
pub async fn serve(listener: TcpListener, state: AppState, shutdown: impl Future<Output = ()>) -> io::Result<()> {
    let config = &state.config;
    let router = super::router(state.clone());
    let seats = Seats::new(config.max_connections);
    let graceful = GracefulShutdown::new();
    let ordinary = http(config.header_seconds);
    let mut reserve = http(config.header_seconds.min(RESERVE_HEADER));
    reserve.keep_alive(false);
    let mut shutdown = std::pin::pin!(shutdown);
    loop {
        let (stream, address) = tokio::select! {
            () = &mut shutdown => break,
            accepted = listener.accept() => match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    tracing::warn!(%error, "a connection could not be accepted");
                    sleep(Duration::from_millis(50)).await;
                    continue;
                }
            },
        };
        let seat = seats.take(address);
        let (http, is_reserve) = match &seat {
            Seat::Ordinary { .. } => (&ordinary, false),
            Seat::Reserve(_) => (&reserve, true),
        };
        let peer = Peer { address, reserve: is_reserve };
        let service = TowerToHyperService::new(AddExtension::new(router.clone(), peer));
        let io = TokioIo::new(stream_of(stream, config.body_seconds));
        let connection = graceful.watch(http.serve_connection(io, service));
        let state = state.clone();
        tokio::spawn(async move {
            let leave = match &seat {
                Seat::Ordinary { .. } => None,
                Seat::Reserve(seat) => Some(seat.leave.clone()),
            };
            let taken_away = async {
                match leave {
                    Some(leave) => leave.cancelled_owned().await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                ended = connection => {
                    if let Err(error) = ended {
                        note(&state, address, &error);
                    }
                }
                () = taken_away => tracing::debug!(peer = %address, "closing an idle connection of the reserve to make room"),
            }
            drop(seat);
        });
    }
    drop(listener);
    // Event streams and long polls end at once; other requests get the drain time.
    state.begin_drain();
    state.closing.cancel();
    let limit = state.config.drain_seconds;
    if timeout(limit, graceful.shutdown()).await.is_err() {
        tracing::warn!(drain_seconds = limit.as_secs_f64(), "requests were still running when the drain time ended");
    }
    Ok(())
}

/// Answers are flushed one by one: gathered for pipelined requests (`pipeline_flush`), they would pile up without bound
/// for a client that reads nothing, and the refusal of a malformed request would be lost with them.
fn http(header: Duration) -> http1::Builder {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(header).max_buf_size(HEADER_BYTES).half_close(false);
    http
}

fn stream_of(stream: TcpStream, patience: Duration) -> Unstalled {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "could not disable Nagle's algorithm");
    }
    Unstalled::new(stream, patience)
}

/// Logs why a connection ended, and counts the malformed requests, which hyper answers before they come to a route.
fn note(state: &AppState, peer: SocketAddr, error: &hyper::Error) {
    if !error.is_parse() {
        tracing::debug!(%peer, %error, "a connection ended early");
        return;
    }
    let status = match error.is_parse_too_large() {
        // The two are told apart by their text alone.
        true if error.to_string().contains("URI") => "414",
        true => "431",
        false => "400",
    };
    tracing::info!(%peer, %error, status, "a malformed request was refused");
    state.metrics.http_requests.with_label_values(&["malformed", "other", status]).inc();
}
