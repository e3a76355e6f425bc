//! Simulation and sound of stored vibration modes.

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::sound::{Listening, Sound, listen};
use chladni_spectral::analysis::vibration::{Damping, Load, ModeState, Motion, SimulationError, check_times, in_modes};
use chladni_spectral::basis::BasisError;
use chladni_spectral::basis::modal::{FIXED, ModalBasis};
use serde::{Deserialize, Serialize};

/// The most loads.
const MOST_LOADS: usize = 10_000;

/// Damping `α M + β K`.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DampingRequest {
    /// In 1/time.
    pub alpha: f64,
    /// In time.
    pub beta: f64,
}

/// What acts on one vertex, or on all that has mass.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LoadRequest {
    /// A sudden change of momentum: a tap.
    #[serde(rename_all = "snake_case")]
    Impulse {
        /// Where.
        vertex: usize,
        /// When.
        #[serde(default)]
        time: f64,
        /// By how much, in mass · length / time.
        #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
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
        #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
        force: [f64; 3],
    },
    /// A constant acceleration of the whole object, as by its weight.
    Body {
        /// Since when.
        #[serde(default)]
        from: f64,
        /// Until when; without it, for ever.
        to: Option<f64>,
        /// In length / time².
        #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
        acceleration: [f64; 3],
    },
}

/// A state of the modes, as an answer gives it back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ModalState {
    /// The coordinate of each mode.
    pub positions: Vec<f64>,
    /// How fast it changes.
    pub velocities: Vec<f64>,
}

/// In which state an object is at time 0.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum InitialRequest {
    /// In coordinates of the modes.
    State(ModalState),
    /// By a vector for each vertex, or none for zeros. What no mode holds is left out, and told. Vertices of a file
    /// that were dropped may have `null`, as in answers, in place of a vector or of its numbers.
    Vertices {
        /// How far it is displaced, in units of the mesh.
        #[serde(default, deserialize_with = "vectors")]
        #[cfg_attr(feature = "schema", schema(value_type = Option<Vec<Option<Vec<Option<f64>>>>>))]
        displacements: Option<Vec<[f64; 3]>>,
        /// How fast it moves.
        #[serde(default, deserialize_with = "vectors")]
        #[cfg_attr(feature = "schema", schema(value_type = Option<Vec<Option<Vec<Option<f64>>>>>))]
        velocities: Option<Vec<[f64; 3]>>,
    },
}

/// Vectors, in which NaN stands for null.
fn vectors<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<[f64; 3]>>, D::Error> {
    struct Vector([f64; 3]);

    impl<'de> Deserialize<'de> for Vector {
        fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            let numbers = Option::<[Option<f64>; 3]>::deserialize(deserializer)?;
            Ok(Self(numbers.unwrap_or_default().map(|number| number.unwrap_or(f64::NAN))))
        }
    }

    let read = Option::<Vec<Vector>>::deserialize(deserializer)?;
    Ok(read.map(|list| list.into_iter().map(|Vector(numbers)| numbers).collect()))
}

/// What is wanted of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MotionForm {
    /// The displacement of every vertex at each time.
    #[default]
    Displacements,
    /// The coordinates of the modes at each time, and their velocities.
    State,
}

/// What is to be heard.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SoundRequest {
    /// Where the ear is, in units of the mesh.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub listener: [f64; 3],
    /// Samples a second, 8000 to 192000.
    #[serde(default = "compact_disc")]
    #[cfg_attr(feature = "schema", schema(default = 44100))]
    pub sample_rate: u32,
    /// How long, at most 60.
    #[serde(default = "one_second")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub seconds: f64,
}

fn compact_disc() -> u32 {
    44_100
}

fn one_second() -> f64 {
    1.0
}

/// What happens to an object, and what is to be told of it.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({
    "damping": {"alpha": 2.0, "beta": 1e-7},
    "loads": [{"impulse": {"vertex": 17, "time": 0.0, "momentum": [0.0, 0.0, -0.01]}}],
    "times": [0.0, 0.001, 0.002]
})))]
pub struct SimulateRequest {
    /// Damping; none, unless it is given.
    #[serde(default)]
    pub damping: DampingRequest,
    /// In which state it is at time 0, before whatever happens then; at rest, unless it is given.
    pub initial: Option<InitialRequest>,
    /// Impulses, forces and accelerations; those on clamped vertices do nothing, and the answer names them.
    #[serde(default)]
    pub loads: Vec<LoadRequest>,
    /// Times, ascending.
    #[serde(default)]
    pub times: Vec<f64>,
    /// What is wanted at each time.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(inline))]
    pub give: MotionForm,
    /// Vertices whose displacements are wanted; all, unless it is given.
    pub vertices: Option<Vec<usize>>,
    /// A sound instead: the answer is a WAV file. It takes no `times`, `vertices` or `give` beside it.
    pub sound: Option<SoundRequest>,
}

/// A motion at some times.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"times": [0.0, 0.001], "energies": [0.5, 0.49], "displacements": [[0.0, 0.0, 0.0], [0.0, 0.0, -0.001]], "positions": null, "velocities": null, "state": {"positions": [0.1], "velocities": [-2.0]}, "left_out": 0.0, "held_loads": []})))]
pub struct SimulateAnswer {
    /// The times.
    pub times: Vec<f64>,
    /// Kinetic plus elastic energy at each.
    pub energies: Vec<f64>,
    /// At each time three numbers for each vertex.
    pub displacements: Option<Vec<Vec<f32>>>,
    /// At each time the coordinates of the modes.
    pub positions: Option<Vec<Vec<f64>>>,
    /// At each time the velocities of these.
    pub velocities: Option<Vec<Vec<f64>>>,
    /// The state at the last of the times: as `initial` of a further request, whose time 0 that is, it lets the motion
    /// go on.
    pub state: Option<ModalState>,
    /// Which share of initial displacements and velocities, the larger of the two, no mode holds. What held vertices
    /// are given is left out, and counts by its mass.
    pub left_out: f64,
    /// Impulses and forces that do nothing, as their vertex is held: their places among the loads, from 0.
    pub held_loads: Vec<usize>,
}

/// Why nothing can be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulationFault {
    /// There are too many loads.
    #[error("loads: {0} were given; the limit is {MOST_LOADS}")]
    Loads(usize),
    /// The answer would be too large.
    #[error("times: {times} times make {numbers} numbers; one answer may have {most}")]
    Times {
        /// Times that are asked for.
        times: usize,
        /// Numbers that they make.
        numbers: usize,
        /// The most of an answer.
        most: usize,
    },
    /// A sound was asked for, and a motion as well.
    #[error("sound: the answer is only a WAV file; {0} belongs to requests without a sound")]
    SoundAlone(&'static str),
    /// There is no such vertex.
    #[error("vertices: there is no vertex {vertex}; the object has {vertices}")]
    Vertex {
        /// The vertex.
        vertex: usize,
        /// How many there are.
        vertices: usize,
    },
    /// A load, a damping, a time or a sound does not fit.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The modes cannot be lifted.
    #[error(transparent)]
    Basis(#[from] BasisError),
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Frames of a motion, frame after frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// The numbers.
    pub numbers: Vec<f32>,
    /// Frames.
    pub rows: usize,
    /// Numbers of a frame.
    pub columns: usize,
}

impl SimulateRequest {
    /// The motion, and which share of what it begins with no mode holds.
    fn motion(&self, modes: &ModalBasis) -> Result<(Motion, f64), SimulationFault> {
        let damping = Damping { mass: self.damping.alpha, stiffness: self.damping.beta };
        let loads: Vec<Load> = self.loads.iter().map(load).collect();
        let (initial, lost) = self.initial(modes)?;
        Ok((Motion::starting(modes, damping, &loads, &initial)?, lost))
    }

    fn initial(&self, modes: &ModalBasis) -> Result<(Vec<ModeState>, f64), SimulationFault> {
        let m = modes.count();
        let (positions, velocities, lost) = match &self.initial {
            None => (vec![0.0; m], vec![0.0; m], 0.0),
            Some(InitialRequest::State(ModalState { positions, velocities })) => {
                if positions.len() != velocities.len() {
                    let reason = format!("{} positions and {} velocities are given", positions.len(), velocities.len());
                    return Err(SimulationError::Initial(reason).into());
                }
                (positions.clone(), velocities.clone(), 0.0)
            }
            Some(InitialRequest::Vertices { displacements, velocities }) => {
                let project = |vectors: &Option<Vec<[f64; 3]>>| match vectors {
                    Some(vectors) => in_modes(modes, vectors),
                    None => Ok((vec![0.0; m], 0.0)),
                };
                let ((positions, lost), (velocities, also)) = (project(displacements)?, project(velocities)?);
                (positions, velocities, lost.max(also))
            }
        };
        let states = positions.into_iter().zip(velocities);
        Ok((states.map(|(position, velocity)| ModeState { position, velocity }).collect(), lost))
    }

    /// The places of loads that do nothing, as their vertex is held, among all.
    pub fn held_loads(&self, modes: &ModalBasis) -> Vec<usize> {
        let is_held = |load: &LoadRequest| match load {
            LoadRequest::Impulse { vertex, .. } | LoadRequest::Force { vertex, .. } => {
                modes.part.get(*vertex) == Some(&FIXED)
            }
            LoadRequest::Body { .. } => false,
        };
        (0..self.loads.len()).filter(|&at| is_held(&self.loads[at])).collect()
    }

    fn check(&self) -> Result<(), SimulationFault> {
        if self.loads.len() > MOST_LOADS {
            return Err(SimulationFault::Loads(self.loads.len()));
        }
        Ok(check_times(&self.times)?)
    }

    /// The sound that is asked for; `None` where none is.
    ///
    /// # Errors
    /// [`SimulationFault`] names what does not fit.
    pub fn sound(&self, modes: &ModalBasis, surface: &TriangleMesh) -> Result<Option<Sound>, SimulationFault> {
        self.check()?;
        let Some(sound) = &self.sound else { return Ok(None) };
        for (name, given) in [
            ("times", !self.times.is_empty()),
            ("vertices", self.vertices.is_some()),
            ("give", self.give != MotionForm::default()),
        ] {
            if given {
                return Err(SimulationFault::SoundAlone(name));
            }
        }
        let listening = Listening { point: sound.listener, rate: sound.sample_rate, seconds: sound.seconds };
        listening.check()?;
        Ok(Some(listen(modes, &self.motion(modes)?.0, &surface.positions, &surface.faces, &listening)?))
    }

    /// Calls `take` with each frame: the numbers of its form (positions before velocities of a state), and its energy.
    fn each(
        &self,
        modes: &ModalBasis,
        most: usize,
        monitor: &dyn Monitor,
        mut take: impl FnMut(Frame<'_>, f64),
    ) -> Result<MotionSummary, SimulationFault> {
        self.check()?;
        let vertices = modes.vertices();
        if let Some(&vertex) = self.vertices.iter().flatten().find(|&&vertex| vertex >= vertices) {
            return Err(SimulationFault::Vertex { vertex, vertices });
        }
        let columns = match self.give {
            MotionForm::State => 2 * modes.count(),
            MotionForm::Displacements => 3 * self.vertices.as_ref().map_or(vertices, Vec::len),
        };
        let numbers = self.times.len().saturating_mul(columns);
        if numbers > most {
            return Err(SimulationFault::Times { times: self.times.len(), numbers, most });
        }
        let (motion, left_out) = self.motion(modes)?;
        let lifter = modes.lifter();
        let mut whole = vec![0f32; 3 * vertices];
        for &time in &self.times {
            monitor.checkpoint()?;
            let state = motion.at(time);
            let energy: f64 = state.iter().zip(motion.oscillators()).map(|(state, o)| o.energy(*state)).sum();
            let positions: Vec<f64> = state.iter().map(|mode| mode.position).collect();
            let overflow = SimulationError::Overflow { time };
            if !(energy.is_finite() && state.iter().all(|mode| mode.position.is_finite() && mode.velocity.is_finite()))
            {
                return Err(overflow.into());
            }
            if self.give == MotionForm::State {
                take(Frame::State(positions, state.iter().map(|mode| mode.velocity).collect()), energy);
                continue;
            }
            lifter.lift(&positions, &mut whole)?;
            if !whole.iter().all(|x| x.is_finite()) {
                return Err(overflow.into());
            }
            match &self.vertices {
                None => take(Frame::Displacements(&whole), energy),
                Some(chosen) => {
                    let part: Vec<f32> = chosen.iter().flat_map(|&v| whole[3 * v..3 * v + 3].to_vec()).collect();
                    take(Frame::Displacements(&part), energy);
                }
            }
        }
        let last = self.times.last().map(|&time| motion.at(time));
        let state = last.map(|state| ModalState {
            positions: state.iter().map(|mode| mode.position).collect(),
            velocities: state.iter().map(|mode| mode.velocity).collect(),
        });
        Ok(MotionSummary { columns, state, left_out })
    }

    /// The motion at the times, at most `most` numbers.
    ///
    /// # Errors
    /// [`SimulationFault`] names what does not fit.
    pub fn answer(
        &self,
        modes: &ModalBasis,
        most: usize,
        monitor: &dyn Monitor,
    ) -> Result<SimulateAnswer, SimulationFault> {
        let state = self.give == MotionForm::State;
        let (mut displacements, mut positions, mut velocities, mut energies) = (vec![], vec![], vec![], vec![]);
        let summary = self.each(modes, most, monitor, |frame, energy| {
            energies.push(energy);
            match frame {
                Frame::Displacements(frame) => displacements.push(frame.to_vec()),
                Frame::State(own, speeds) => {
                    positions.push(own);
                    velocities.push(speeds);
                }
            }
        })?;
        Ok(SimulateAnswer {
            times: self.times.clone(),
            energies,
            displacements: (!state).then_some(displacements),
            positions: state.then_some(positions),
            velocities: state.then_some(velocities),
            state: summary.state,
            left_out: summary.left_out,
            held_loads: self.held_loads(modes),
        })
    }

    /// The same as plain numbers.
    ///
    /// # Errors
    /// [`SimulationFault`] names what does not fit.
    pub fn frames(&self, modes: &ModalBasis, most: usize, monitor: &dyn Monitor) -> Result<Frames, SimulationFault> {
        let mut numbers = Vec::new();
        let summary = self.each(modes, most, monitor, |frame, _| match frame {
            Frame::Displacements(frame) => numbers.extend_from_slice(frame),
            Frame::State(positions, velocities) => {
                numbers.extend(positions.iter().chain(&velocities).map(|&x| x as f32));
            }
        })?;
        Ok(Frames { numbers, rows: self.times.len(), columns: summary.columns })
    }
}

/// What there is of a motion beside its frames.
struct MotionSummary {
    /// Numbers of a frame.
    columns: usize,
    /// At the last time.
    state: Option<ModalState>,
    left_out: f64,
}

/// One frame of a motion.
enum Frame<'a> {
    Displacements(&'a [f32]),
    State(Vec<f64>, Vec<f64>),
}

fn load(load: &LoadRequest) -> Load {
    match *load {
        LoadRequest::Impulse { vertex, time, momentum } => Load::Impulse { vertex, time, momentum },
        LoadRequest::Force { vertex, from, to, force } => Load::Force { vertex, from, to, force },
        LoadRequest::Body { from, to, acceleration } => {
            Load::Body { from, to: to.unwrap_or(f64::INFINITY), acceleration }
        }
    }
}
