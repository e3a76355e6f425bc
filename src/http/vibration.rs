//! Simulation and sound of stored vibration modes.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_base::Monitor;
use chladni_work::simulate::{SimulateAnswer, SimulateRequest, SimulationFault};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body;
use super::client::ClientState;
use super::exchange::{self, Answer, OCTETS};
use super::extract;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The media type of sounds.
const WAV: &str = "audio/wav";

/// The most bytes of such a request.
const MOST_BYTES: u64 = 16 << 20;

/// The most bytes of frames in one answer.
const MOST_FRAME_BYTES: usize = 256 << 20;

/// The most numbers of frames in an answer as JSON.
const MOST_JSON_NUMBERS: usize = 4 << 20;

/// The routes of vibration modes.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(simulate))
}

problems!(SimulateProblems: SOLVE BODY JSON [INVALID_SIMULATION]);

/// Simulates an object in its vibration modes
///
/// For a basis of the kind `vibration_basis`. Every mode is a damped oscillator, `q̈ + (α + βλ) q̇ + λ q = f` (thesis,
/// eq. 2.16), whose motion is evaluated exactly at whatever time is asked for: there are no steps.
///
/// With `Accept: application/octet-stream` displacements come as raw little-endian f32, frame after frame, vertex after
/// vertex, x, y and z of each. With `sound` the answer is a WAV file: what a tap sounds like at a point, by Rayleigh's
/// integral without delays; `Chladni-Peak` has the largest pressure in pascal, if the mesh is in metres and the
/// material in SI units.
#[utoipa::path(
    post, path = "/v1/bases/{id}/simulate", tag = "bases", operation_id = "simulate",
    params(BasisId, NumberingQuery),
    request_body(content = SimulateRequest, examples(
        ("frames" = (summary = "Three frames after a tap", value = json!({"loads": [{"impulse": {"vertex": 17, "momentum": [0.0, 0.0, -0.01]}}], "times": [0.0, 0.001, 0.002]}))),
        ("sound" = (summary = "The sound of a tap", value = json!({"damping": {"alpha": 5.0, "beta": 2e-7}, "loads": [{"impulse": {"vertex": 17, "momentum": [0.0, 0.0, -0.01]}}], "sound": {"listener": [0.0, 0.0, 1.0], "sample_rate": 44100, "seconds": 2.0}}))),
    )),
    responses(
        (status = 200, description = "The motion, frames, or a sound", content((SimulateAnswer = "application/json"), (super::docs::Binary = "application/octet-stream"), (super::docs::Binary = "audio/wav")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Peak" = f64), ("Chladni-Held-Loads" = u64, description = "Of frames and sounds: how many impulses and forces do nothing, as their vertex is held"), ("Server-Timing" = String))),
        SimulateProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn simulate(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    extract::require_json(&headers)?;
    let media_type = exchange::answer_type(&headers, false, &[WAV])?;
    let modes = state.store.load_modes(id).await?;
    let to = numbered.on_basis(&state, id, &modes.metadata).await?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    let mut request: SimulateRequest = exchange::parse(&state, body, exchange::BYTES_PER_NUMBER).await?;
    request.translate(&to, modes.vertices()).map_err(|error| {
        Problem::within(&problem::INVALID_SIMULATION, "vertex-out-of-range", super::convert::sentence(&error))
    })?;
    let surface = match (&request.sound, media_type) {
        (Some(_), _) => Some(state.store.load_mesh(&state.store.basis(id).await?.mesh).await?),
        (None, WAV) => {
            return Err(Problem::new(&problem::INVALID_REQUEST, "sound: is missing, but audio/wav was requested."));
        }
        (None, _) => None,
    };
    let raw = media_type == OCTETS;
    let work = move |monitor: &dyn Monitor| {
        let begin = Instant::now();
        if let Some(surface) = surface
            && let Some(sound) = request.sound(&modes, &surface)?
        {
            return Ok(Answer::new(sound.to_wav(), WAV, begin)
                .with("chladni-held-loads", request.held_loads(&modes).len())
                .with("chladni-peak", sound.peak())
                .with("chladni-modes", sound.modes)
                .with("chladni-modes-too-high", sound.too_high));
        }
        let (most, numbers) = (
            if raw { MOST_FRAME_BYTES / 4 } else { MOST_JSON_NUMBERS },
            request.answered_numbers(&to, modes.vertices()),
        );
        if numbers > most {
            return Err(SimulationFault::Times { times: request.times.len(), numbers, most }.into());
        }
        if !raw {
            return Answer::json(&request.translated(&to, request.answer(&modes, most, monitor)?), begin);
        }
        let frames = request.translated_frames(&to, request.frames(&modes, most, monitor)?);
        let bytes: Vec<u8> = frames.numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        Ok(Answer::new(bytes, OCTETS, begin)
            .with("chladni-held-loads", request.held_loads(&modes).len())
            .with("chladni-rows", frames.rows)
            .with("chladni-columns", frames.columns)
            .with("chladni-dtype", "f32"))
    };
    state.solve("simulate", work).await
}

impl From<SimulationFault> for Problem {
    fn from(fault: SimulationFault) -> Self {
        let detail = format!("{fault}.");
        let refused = |within| Self::within(&problem::INVALID_SIMULATION, within, detail);
        match fault {
            SimulationFault::Loads(_) => refused("loads"),
            SimulationFault::Times { most, .. } => refused("times").with("limit", most),
            SimulationFault::SoundAlone(_) => refused("sound"),
            SimulationFault::Vertex { .. } => refused("vertex-out-of-range"),
            SimulationFault::Simulation(error) => error.into(),
            SimulationFault::Basis(error) => error.into(),
            SimulationFault::Cancelled(cancelled) => cancelled.into(),
        }
    }
}
