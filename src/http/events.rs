//! Jobs as they change: what long polls wait for, and streams of events.

use std::convert::Infallible;
use std::ops::Deref;
use std::time::{Duration, Instant};

use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, stream};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::client::ClientState;
use super::ids::JobId;
use super::problem::Problem;
use super::problems::problems;
use super::shares::Share;
use super::state::AppState;
use super::wire::JobResource;
use crate::store::{JobRecord, JobWatch};

/// How often an idle event stream sends a comment, so that nothing between takes it for dead.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// How far apart progress events are at least.
const EVENT_PAUSE: Duration = Duration::from_millis(100);

/// The route of events.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(events))
}

/// The job as it is now.
pub async fn look(state: &AppState, id: Uuid) -> Result<JobRecord, Problem> {
    let store = state.store.clone();
    state.off_loop(async move { store.job(id).await }).await
}

problems!(WatchJobProblems: [INVALID_QUERY, UNKNOWN_JOB, BUSY]);

/// Streams the changes of a job
///
/// Server-sent events of the type `job`, each with the whole job as data and its revision as id: the present state
/// first (not repeated where `Last-Event-ID` names it), then every change, until the job has ended. Progress comes at
/// most ten times a second. A client that reconnects after the end is told by 204 to stop.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/events", tag = "jobs", operation_id = "watchJob",
    params(
        JobId,
        ("Last-Event-ID" = Option<String>, Header, description = "The revision that the client has seen; what is no number stands for none", example = "7"),
    ),
    responses(
        (status = 200, description = "The stream", body = String, content_type = "text/event-stream",
            example = "event: job\nid: 8\ndata: {\"id\":\"019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2\",\"status\":\"processing\",\"stage\":\"eigen\",\"progress\":0.5}\n\n"),
        (status = 204, description = "The job has ended, and the client has seen it"),
        WatchJobProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn events(state: ClientState, JobId(id): JobId, headers: HeaderMap) -> Result<Response, Problem> {
    let seen = headers.get("last-event-id").and_then(|value| value.to_str().ok()?.trim().parse::<i64>().ok());
    let changes = state.store.watch_job(id);
    let record = look(&state, id).await?;
    if record.status.is_finished() && seen.is_some_and(|seen| seen >= record.revision) {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let place = state.watch()?;
    let watch = Watch {
        state: state.deref().clone(),
        _place: place,
        id,
        changes,
        seen: seen.unwrap_or(-1),
        first: Some(record),
        sent: None,
    };
    let mut response =
        Sse::new(watch.stream()).keep_alive(KeepAlive::new().interval(KEEP_ALIVE).text("keep-alive")).into_response();
    // Proxies such as nginx would collect events otherwise.
    response.headers_mut().insert("x-accel-buffering", HeaderValue::from_static("no"));
    Ok(response)
}

/// One event stream.
struct Watch {
    state: AppState,
    /// One of the places for streams, held until the client is gone.
    _place: Share,
    id: Uuid,
    changes: JobWatch,
    seen: i64,
    first: Option<JobRecord>,
    sent: Option<Instant>,
}

impl Watch {
    fn stream(self) -> impl Stream<Item = Result<Event, Infallible>> {
        stream::unfold(Some(self), |watch| async move {
            let mut watch = watch?;
            let record = watch.next().await?;
            let ended = record.status.is_finished();
            watch.seen = record.revision;
            watch.sent = Some(Instant::now());
            let event = Event::default().event("job").id(record.revision.to_string());
            let event = event.json_data(JobResource::from(record)).ok()?;
            Some((Ok(event), (!ended).then_some(watch)))
        })
    }

    /// The next state to send; `None` at the end.
    async fn next(&mut self) -> Option<JobRecord> {
        if let Some(record) = self.first.take().filter(|record| record.revision > self.seen) {
            return Some(record);
        }
        loop {
            tokio::select! {
                heard = self.changes.changed() => if !heard { return None },
                () = self.state.closing.cancelled() => return None,
            }
            if let Some(sent) = self.sent {
                tokio::time::sleep_until((sent + EVENT_PAUSE).into()).await;
            }
            match look(&self.state, self.id).await {
                Ok(record) if record.revision > self.seen => return Some(record),
                Ok(_) => {}
                Err(error) => {
                    // The client reconnects with Last-Event-ID.
                    tracing::warn!(job = %self.id, detail = error.detail(), "an event stream ends early");
                    return None;
                }
            }
        }
    }
}
