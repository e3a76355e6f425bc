//! Simulation and sound of stored vibration modes.

use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::sound::{Listening, listen};
use chladni_spectral::analysis::vibration::{Damping, Load, Motion, check_times};
use chladni_spectral::basis::modal::ModalBasis;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body;
use super::client::ClientState;
use super::exchange::{self, Answer, OCTETS};
use super::extract;
use super::ids::BasisId;
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

/// The most loads.
const MOST_LOADS: usize = 10_000;

/// The routes of vibration modes.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(simulate))
}

/// Damping `α M + β K`.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
struct DampingWire {
    /// In 1/time.
    alpha: f64,
    /// In time.
    beta: f64,
}

/// What acts on one vertex.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum LoadWire {
    /// A sudden change of momentum: a tap.
    #[serde(rename_all = "snake_case")]
    Impulse {
        /// Where.
        vertex: usize,
        /// When.
        #[serde(default)]
        time: f64,
        /// By how much, in mass · length / time.
        momentum: [f64; 3],
    },
    /// A constant force over an interval.
    Force {
        /// Where.
        vertex: usize,
        /// Since when.
        from: f64,
        /// Until when.
        to: f64,
        /// In mass · length / time².
        force: [f64; 3],
    },
}

/// What is wanted of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Wanted {
    /// The displacement of every vertex at each time.
    #[default]
    Displacements,
    /// The coordinates of the modes at each time, and their velocities.
    State,
}

/// What is to be heard.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct SoundWire {
    /// Where the ear is, in units of the mesh.
    listener: [f64; 3],
    /// Samples a second, 8000 to 192000.
    #[serde(default = "compact_disc")]
    #[schema(default = 44100)]
    sample_rate: u32,
    /// How long, at most 60.
    #[serde(default = "one_second")]
    #[schema(default = 1.0)]
    seconds: f64,
}

fn compact_disc() -> u32 {
    44_100
}

fn one_second() -> f64 {
    1.0
}

/// What happens to an object at rest, and what is to be told of it.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "damping": {"alpha": 2.0, "beta": 1e-7},
    "loads": [{"impulse": {"vertex": 17, "time": 0.0, "momentum": [0.0, 0.0, -0.01]}}],
    "times": [0.0, 0.001, 0.002]
}))]
struct SimulateRequest {
    /// Damping; none, unless it is given.
    #[serde(default)]
    damping: DampingWire,
    /// Impulses and forces; those on clamped vertices do nothing.
    #[serde(default)]
    loads: Vec<LoadWire>,
    /// Times, ascending.
    #[serde(default)]
    times: Vec<f64>,
    /// What is wanted at each time.
    #[serde(default)]
    #[schema(inline)]
    give: Wanted,
    /// Vertices whose displacements are wanted; all, unless it is given.
    vertices: Option<Vec<usize>>,
    /// A sound instead: the answer is a WAV file.
    sound: Option<SoundWire>,
}

/// A motion at some times.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"times": [0.0, 0.001], "energies": [0.5, 0.49], "displacements": [[0.0, 0.0, 0.0], [0.0, 0.0, -0.001]], "positions": null, "velocities": null}))]
struct SimulateAnswer {
    /// The times.
    times: Vec<f64>,
    /// Kinetic plus elastic energy at each.
    energies: Vec<f64>,
    /// At each time three numbers for each vertex.
    displacements: Option<Vec<Vec<f32>>>,
    /// At each time the coordinates of the modes.
    positions: Option<Vec<Vec<f64>>>,
    /// At each time the velocities of these.
    velocities: Option<Vec<Vec<f64>>>,
}

problems!(SimulateProblems: SOLVE BODY JSON [INVALID_SIMULATION]);

/// Simulates an object in its vibration modes
///
/// For a basis of the kind `vibration_basis`. Every mode is a damped oscillator, `q̈ + (α + βλ) q̇ + λ q = f` (thesis, eq. 2.16), whose motion is
/// evaluated exactly at whatever time is asked for: there are no steps.
///
/// With `Accept: application/octet-stream` displacements come as raw little-endian f32, frame after frame, vertex after vertex, x, y and z of
/// each. With `sound` the answer is a WAV file: what a tap sounds like at a point, by Rayleigh's integral without delays; `Chladni-Peak` has the
/// largest pressure in pascal, if the mesh is in metres and the material in SI units.
#[utoipa::path(
    post, path = "/v1/bases/{id}/simulate", tag = "bases", operation_id = "simulate",
    params(BasisId),
    request_body(content = SimulateRequest, examples(
        ("frames" = (summary = "Three frames after a tap", value = json!({"loads": [{"impulse": {"vertex": 17, "momentum": [0.0, 0.0, -0.01]}}], "times": [0.0, 0.001, 0.002]}))),
        ("sound" = (summary = "The sound of a tap", value = json!({"damping": {"alpha": 5.0, "beta": 2e-7}, "loads": [{"impulse": {"vertex": 17, "momentum": [0.0, 0.0, -0.01]}}], "sound": {"listener": [0.0, 0.0, 1.0], "sample_rate": 44100, "seconds": 2.0}}))),
    )),
    responses(
        (status = 200, description = "The motion, frames, or a sound", content((SimulateAnswer = "application/json"), (super::docs::Binary = "application/octet-stream"), (super::docs::Binary = "audio/wav")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Peak" = f64), ("Server-Timing" = String))),
        SimulateProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn simulate(
    state: ClientState,
    BasisId(id): BasisId,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    extract::require_json(&headers)?;
    let media_type = exchange::answer_type(&headers, false, &[WAV])?;
    let modes = state.store.load_modes(id).await?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    let request: SimulateRequest = exchange::parse(&state, body, exchange::BYTES_PER_NUMBER).await?;
    let surface = match (&request.sound, media_type) {
        (Some(_), _) => Some(state.store.load_mesh(&state.store.basis(id).await?.mesh).await?),
        (None, WAV) => {
            return Err(Problem::new(&problem::INVALID_REQUEST, "sound: is missing, but audio/wav is asked for."));
        }
        (None, _) => None,
    };
    let raw = media_type == OCTETS;
    state.solve("simulate", move |monitor| answer(&modes, surface.as_ref(), request, raw, monitor)).await
}

fn answer(
    modes: &ModalBasis,
    surface: Option<&Arc<TriangleMesh>>,
    request: SimulateRequest,
    raw: bool,
    monitor: &dyn Monitor,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    if request.loads.len() > MOST_LOADS {
        let detail = format!("loads: {} are more than the {MOST_LOADS} of one request.", request.loads.len());
        return Err(Problem::within(&problem::INVALID_SIMULATION, "loads", detail));
    }
    let loads: Vec<Load> = request.loads.iter().map(load).collect();
    let damping = Damping { mass: request.damping.alpha, stiffness: request.damping.beta };
    check_times(&request.times)?;
    if let (Some(sound), Some(surface)) = (&request.sound, surface) {
        let listening = Listening { point: sound.listener, rate: sound.sample_rate, seconds: sound.seconds };
        listening.check()?;
        let motion = Motion::new(modes, damping, &loads)?;
        let sound = listen(modes, &motion, &surface.positions, &surface.faces, &listening)?;
        return Ok(Answer::new(sound.to_wav(), WAV, begin)
            .with("chladni-peak", sound.peak())
            .with("chladni-modes", sound.modes)
            .with("chladni-modes-too-high", sound.too_high));
    }
    let chosen = chosen(modes, request.vertices.as_deref())?;
    let columns = if request.give == Wanted::State {
        2 * modes.count()
    } else {
        3 * chosen.as_ref().map_or(modes.vertices(), Vec::len)
    };
    let numbers = request.times.len().saturating_mul(columns);
    let most = if raw { MOST_FRAME_BYTES / 4 } else { MOST_JSON_NUMBERS };
    if numbers > most {
        let detail =
            format!("times: {} times make {numbers} numbers; one answer may have {most}.", request.times.len());
        return Err(Problem::within(&problem::INVALID_SIMULATION, "times", detail).with("limit", most));
    }
    let motion = Motion::new(modes, damping, &loads)?;
    let mut energies = Vec::with_capacity(request.times.len());
    let mut answer = SimulateAnswer {
        displacements: (request.give == Wanted::Displacements).then(Vec::new),
        positions: (request.give == Wanted::State).then(Vec::new),
        velocities: (request.give == Wanted::State).then(Vec::new),
        energies: Vec::new(),
        times: Vec::new(),
    };
    let mut frames: Vec<f32> = Vec::with_capacity(if raw { numbers } else { 0 });
    let lifter = modes.lifter();
    let mut whole = vec![0f32; 3 * modes.vertices()];
    for &time in &request.times {
        monitor.checkpoint()?;
        let state = motion.at(time);
        energies.push(state.iter().zip(motion.oscillators()).map(|(state, o)| o.energy(*state)).sum());
        let positions: Vec<f64> = state.iter().map(|mode| mode.position).collect();
        if request.give == Wanted::State {
            let velocities: Vec<f64> = state.iter().map(|mode| mode.velocity).collect();
            if raw {
                frames.extend(positions.iter().chain(&velocities).map(|&x| x as f32));
            } else {
                answer.positions.get_or_insert_default().push(positions);
                answer.velocities.get_or_insert_default().push(velocities);
            }
            continue;
        }
        lifter.lift(&positions, &mut whole);
        let frame: Vec<f32> = match &chosen {
            None => whole.clone(),
            Some(vertices) => vertices.iter().flat_map(|&v| whole[3 * v..3 * v + 3].to_vec()).collect(),
        };
        if raw { frames.extend_from_slice(&frame) } else { answer.displacements.get_or_insert_default().push(frame) }
    }
    if raw {
        let bytes: Vec<u8> = frames.iter().flat_map(|x| x.to_le_bytes()).collect();
        return Ok(Answer::new(bytes, OCTETS, begin)
            .with("chladni-rows", request.times.len())
            .with("chladni-columns", columns)
            .with("chladni-dtype", "f32"));
    }
    (answer.times, answer.energies) = (request.times, energies);
    Answer::json(&answer, begin)
}

fn load(load: &LoadWire) -> Load {
    match *load {
        LoadWire::Impulse { vertex, time, momentum } => Load::Impulse { vertex, time, momentum },
        LoadWire::Force { vertex, from, to, force } => Load::Force { vertex, from, to, force },
    }
}

fn chosen(modes: &ModalBasis, vertices: Option<&[usize]>) -> Result<Option<Vec<usize>>, Problem> {
    let n = modes.vertices();
    match vertices {
        None => Ok(None),
        Some(vertices) => match vertices.iter().find(|&&v| v >= n) {
            Some(v) => {
                let detail = format!("vertices: {v} is not one of the {n} vertices.");
                Err(Problem::within(&problem::INVALID_SIMULATION, "vertex-out-of-range", detail))
            }
            None => Ok(Some(vertices.to_vec())),
        },
    }
}
