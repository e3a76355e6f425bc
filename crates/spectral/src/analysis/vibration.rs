//! Simulation in modal coordinates (thesis, §2.6): every mode is a damped oscillator whose motion is known exactly, at
//! any time.
//!
//! `q̈ + (α + βλ) q̇ + λ q = f` (eq. 2.16). Loads are impulses, which change velocities at once, and forces and
//! accelerations that are constant over an interval; between their beginnings and ends the exact flow is evaluated, so
//! no step is ever made, and nothing is damped that should not be.

use crate::basis::BasisError;
use crate::basis::modal::ModalBasis;

/// Damping as in Rayleigh's: `α M + β K`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Damping {
    /// `α`, in 1/time.
    pub mass: f64,
    /// `β`, in time.
    pub stiffness: f64,
}

/// What acts on an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Load {
    /// A constant acceleration of all that has mass, as by weight.
    Body {
        /// Since when.
        from: f64,
        /// Until when; infinite: for ever.
        to: f64,
        /// Which.
        acceleration: [f64; 3],
    },
    /// A sudden change of momentum.
    Impulse {
        /// Where.
        vertex: usize,
        /// When.
        time: f64,
        /// By how much.
        momentum: [f64; 3],
    },
    /// A constant force.
    Force {
        /// Where.
        vertex: usize,
        /// Since when.
        from: f64,
        /// Until when.
        to: f64,
        /// Which.
        force: [f64; 3],
    },
}

/// Why something cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// A load acts on no vertex.
    #[error("load {load} acts on vertex {vertex} of {vertices}")]
    Vertex {
        /// The load.
        load: usize,
        /// Its vertex.
        vertex: usize,
        /// The number of vertices.
        vertices: usize,
    },
    /// A number of a load is not what it must be.
    #[error("load {load}: {reason}")]
    Load {
        /// The load.
        load: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// A damping coefficient is negative or not finite.
    #[error("damping: {name} must be a finite number of at least 0, not {value}")]
    Damping {
        /// `alpha` or `beta`.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A state does not fit the modes.
    #[error("initial: {0}")]
    Initial(String),
    /// A time is negative, not finite, or before the one that precedes it.
    #[error("time {index} is {value}; times must be finite, at least 0 and ascending")]
    Time {
        /// The first such time.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A parameter of a sound is out of its range.
    #[error("{name}: {reason}")]
    Sound {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// A motion is beyond what numbers hold: loads, times or damping are.
    #[error("the motion at {time} s overflows: the loads, the damping or the time are too large")]
    Overflow {
        /// The first such time.
        time: f64,
    },
    /// The basis cannot be evaluated.
    #[error(transparent)]
    Basis(#[from] BasisError),
}

/// The coordinate of one mode and its velocity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ModeState {
    /// `q`.
    pub position: f64,
    /// `q̇`.
    pub velocity: f64,
}

/// `q̈ + 2 s q̇ + λ q = f` for constant `f`: its exact flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// `λ ≥ 0`.
    pub stiffness: f64,
    /// `s ≥ 0`: half of what multiplies the velocity.
    pub half_damping: f64,
}

/// The flow of an oscillator over one duration: `q ↦ a q + b q̇ + c f` and `q̇ ↦ −λ b q + d q̇ + b f`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Propagator {
    keep: f64,
    carry: f64,
    forced: f64,
    slow: f64,
    stiffness: f64,
}

impl Oscillator {
    /// The oscillator of a mode.
    pub fn new(eigenvalue: f64, damping: Damping) -> Self {
        let stiffness = eigenvalue.max(0.0);
        Self { stiffness, half_damping: 0.5 * (damping.mass + damping.stiffness * stiffness) }
    }

    /// The flow over a duration `t ≥ 0`.
    pub fn over(&self, t: f64) -> Propagator {
        let (stiffness, s) = (self.stiffness, self.half_damping);
        if stiffness == 0.0 {
            // Drifts, and is only slowed down.
            let x = 2.0 * s * t;
            let lost = -(-x).exp_m1();
            let carry = if x > 0.0 { lost / (2.0 * s) } else { t };
            // (t − carry) / 2s, which cancels for small x.
            let forced = if x > 1e-3 { (t - carry) / (2.0 * s) } else { t * t * (0.5 - x / 6.0 + x * x / 24.0) };
            return Propagator { keep: 1.0, carry, forced, slow: 1.0 - lost, stiffness };
        }
        // e^{−st} cos ωt and e^{−st} sin ωt / ω, or their hyperbolic kin, which share a limit at ω = 0.
        let discriminant = stiffness - s * s;
        let angle = discriminant.abs() * t * t;
        let (even, odd) = if angle < 1e-8 {
            let decay = (-s * t).exp();
            let signed = discriminant * t * t;
            (decay * (1.0 - 0.5 * signed), decay * t * (1.0 - signed / 6.0))
        } else if discriminant > 0.0 {
            let (decay, omega) = ((-s * t).exp(), discriminant.sqrt());
            let (sine, cosine) = (omega * t).sin_cos();
            (decay * cosine, decay * sine / omega)
        } else {
            let mu = (-discriminant).sqrt();
            // μ − s without cancellation; both exponents are negative.
            let (slow, fast) = ((-stiffness / (s + mu) * t).exp(), (-(s + mu) * t).exp());
            (0.5 * (slow + fast), (slow - fast) / (2.0 * mu))
        };
        let keep = even + s * odd;
        // (1 − keep) / λ, which cancels for short times and where the damping is strong.
        let (square, damped) = (stiffness * t * t, 2.0 * s * t);
        let forced = if square < 1e-4 && damped < 2e-2 {
            let third = damped * damped - square;
            t * t * (0.5 - damped / 6.0 + third / 24.0 - damped * (third - square) / 120.0)
        } else if discriminant < 0.0 && angle >= 1e-8 {
            let fast = s + (-discriminant).sqrt();
            let slow = stiffness / fast;
            ((-slow * t).exp_m1() / -slow - (-fast * t).exp_m1() / -fast) / (fast - slow)
        } else {
            (1.0 - keep) / stiffness
        };
        Propagator { keep, carry: odd, forced, slow: even - s * odd, stiffness }
    }

    /// Kinetic plus potential energy.
    pub fn energy(&self, state: ModeState) -> f64 {
        0.5 * (state.velocity * state.velocity + self.stiffness * state.position * state.position)
    }
}

impl Propagator {
    /// What becomes of a state under a constant force.
    pub fn apply(&self, state: ModeState, force: f64) -> ModeState {
        let Self { keep, carry, forced, slow, stiffness } = *self;
        let ModeState { position, velocity } = state;
        ModeState {
            position: keep * position + carry * velocity + forced * force,
            velocity: slow * velocity - stiffness * carry * position + carry * force,
        }
    }
}

/// The motion of an object under loads: can be asked for any time.
#[derive(Debug, Clone)]
pub struct Motion {
    oscillators: Vec<Oscillator>,
    /// Ascending times at which loads begin or end, the first 0.
    times: Vec<f64>,
    /// After what happens at each of them.
    states: Vec<Vec<ModeState>>,
    /// From each of them on.
    forces: Vec<Vec<f64>>,
}

impl Motion {
    /// Prepares the motion of an object that is at rest until the first load.
    ///
    /// # Errors
    /// [`SimulationError`] names the first load or coefficient that does not fit.
    pub fn new(basis: &ModalBasis, damping: Damping, loads: &[Load]) -> Result<Self, SimulationError> {
        Self::starting(basis, damping, loads, &vec![ModeState::default(); basis.count()])
    }

    /// The same for an object that is in some state at time 0, one for each mode, before whatever happens then.
    ///
    /// # Errors
    /// As for [`new`](Self::new); [`SimulationError::Initial`] unless there is a finite state for each mode.
    pub fn starting(
        basis: &ModalBasis,
        damping: Damping,
        loads: &[Load],
        initial: &[ModeState],
    ) -> Result<Self, SimulationError> {
        check_initial(initial, basis.count())?;
        for (name, value) in [("alpha", damping.mass), ("beta", damping.stiffness)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(SimulationError::Damping { name, value });
            }
        }
        let mut times = vec![0.0];
        for (index, load) in loads.iter().enumerate() {
            check(index, load, basis.vertices())?;
            match *load {
                Load::Impulse { time, .. } => times.push(time),
                Load::Force { from, to, .. } => times.extend([from, to]),
                Load::Body { from, to, .. } => times.extend([from, to].into_iter().filter(|time| time.is_finite())),
            }
        }
        times.sort_by(f64::total_cmp);
        times.dedup();
        let oscillators: Vec<Oscillator> =
            basis.eigenvalues.iter().map(|&value| Oscillator::new(value, damping)).collect();
        let m = oscillators.len();
        let mut kicks = vec![vec![0.0; m]; times.len()];
        let mut changes = vec![vec![0.0; m]; times.len()];
        let place = |time: f64| times.partition_point(|&t| t < time);
        for load in loads {
            match *load {
                Load::Impulse { vertex, time, momentum } => {
                    add(&mut kicks[place(time)], &projected(basis, vertex, momentum)?, 1.0);
                }
                Load::Force { vertex, from, to, force } => {
                    let modal = projected(basis, vertex, force)?;
                    add(&mut changes[place(from)], &modal, 1.0);
                    add(&mut changes[place(to)], &modal, -1.0);
                }
                Load::Body { from, to, acceleration } => {
                    let weights: Vec<[f64; 3]> =
                        basis.masses.iter().map(|mass| acceleration.map(|a| mass * a)).collect();
                    let modal = basis.transposed_times(&weights)?;
                    add(&mut changes[place(from)], &modal, 1.0);
                    if to.is_finite() {
                        add(&mut changes[place(to)], &modal, -1.0);
                    }
                }
            }
        }
        let (mut states, mut forces) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
        let (mut state, mut force) = (initial.to_vec(), vec![0.0; m]);
        for (k, &time) in times.iter().enumerate() {
            if k > 0 {
                let duration = time - times[k - 1];
                for ((state, oscillator), force) in state.iter_mut().zip(&oscillators).zip(&force) {
                    *state = oscillator.over(duration).apply(*state, *force);
                }
            }
            state.iter_mut().zip(&kicks[k]).for_each(|(state, kick)| state.velocity += kick);
            add(&mut force, &changes[k], 1.0);
            states.push(state.clone());
            forces.push(force.clone());
        }
        Ok(Self { oscillators, times, states, forces })
    }

    /// The oscillators of the modes.
    pub fn oscillators(&self) -> &[Oscillator] {
        &self.oscillators
    }

    /// The state of all modes at a time, after what happens at that very time.
    pub fn at(&self, time: f64) -> Vec<ModeState> {
        let k = self.times.partition_point(|&t| t <= time).max(1) - 1;
        let duration = (time - self.times[k]).max(0.0);
        let flow = |((oscillator, &state), &force): ((&Oscillator, &ModeState), &f64)| {
            oscillator.over(duration).apply(state, force)
        };
        self.oscillators.iter().zip(&self.states[k]).zip(&self.forces[k]).map(flow).collect()
    }

    /// Kinetic plus elastic energy at a time.
    pub fn energy(&self, time: f64) -> f64 {
        self.at(time).into_iter().zip(&self.oscillators).map(|(state, oscillator)| oscillator.energy(state)).sum()
    }

    /// Samples `Σ_i w_i q̈_i` of the modes with a weight, at `rate` a time unit, `count` of them, from time 0 on.
    pub(super) fn accelerations(&self, weights: &[f64], rate: f64, count: usize) -> Vec<f64> {
        use chladni_base::parallel::*;
        // Some modes a task; tasks are added up in their order.
        let modes: Vec<usize> = (0..self.oscillators.len()).filter(|&mode| weights[mode] != 0.0).collect();
        let parts: Vec<Vec<f64>> = modes
            .par_chunks(16)
            .map(|modes| {
                let mut sum = vec![0.0; count];
                for &mode in modes {
                    self.add_acceleration(mode, weights[mode], rate, &mut sum);
                }
                sum
            })
            .collect();
        let mut total = vec![0.0; count];
        for part in parts {
            add(&mut total, &part, 1.0);
        }
        total
    }

    fn add_acceleration(&self, mode: usize, weight: f64, rate: f64, sum: &mut [f64]) {
        let oscillator = self.oscillators[mode];
        let step = oscillator.over(1.0 / rate);
        let mut k = 0;
        let mut state: Option<ModeState> = None;
        for (sample, sum) in sum.iter_mut().enumerate() {
            let time = sample as f64 / rate;
            let before = k;
            while k + 1 < self.times.len() && self.times[k + 1] <= time {
                k += 1;
            }
            let force = self.forces[k][mode];
            let now = match state {
                Some(state) if k == before => step.apply(state, force),
                _ => oscillator.over(time - self.times[k]).apply(self.states[k][mode], force),
            };
            state = Some(now);
            *sum +=
                weight * (force - 2.0 * oscillator.half_damping * now.velocity - oscillator.stiffness * now.position);
        }
    }
}

/// Checks that times are finite, not negative, and ascend.
///
/// # Errors
/// [`SimulationError::Time`] names the first that does not.
pub fn check_times(times: &[f64]) -> Result<(), SimulationError> {
    let mut last = 0.0;
    for (index, &value) in times.iter().enumerate() {
        if !(value >= last && value.is_finite()) {
            return Err(SimulationError::Time { index, value });
        }
        last = value;
    }
    Ok(())
}

/// Vectors for each vertex in coordinates of the modes, `Φᵀ M u`, and which share of their size, in the norm of the
/// mass, no mode holds: 1 where that is all of it, as at vertices that are held.
///
/// # Errors
/// [`SimulationError::Initial`] unless there is a finite vector for each vertex.
pub fn in_modes(basis: &ModalBasis, vectors: &[[f64; 3]]) -> Result<(Vec<f64>, f64), SimulationError> {
    let n = basis.vertices();
    if vectors.len() != n {
        return Err(SimulationError::Initial(format!(
            "{} vectors are given; the object has {n} vertices",
            vectors.len()
        )));
    }
    if let Some(vertex) = vectors.iter().position(|vector| !vector.iter().all(|x| x.is_finite())) {
        return Err(SimulationError::Initial(format!("the vector of vertex {vertex} is not finite")));
    }
    let weighted: Vec<[f64; 3]> =
        vectors.iter().zip(&basis.masses).map(|(vector, mass)| vector.map(|x| mass * x)).collect();
    let modal = basis.transposed_times(&weighted)?;
    let dots = weighted.iter().zip(vectors).map(|(a, b)| (0..3).map(|k| a[k] * b[k]).sum::<f64>());
    let (whole, held) = (dots.sum::<f64>(), modal.iter().map(|q| q * q).sum::<f64>());
    let lost = match whole > 0.0 {
        true => (1.0 - held / whole).max(0.0).sqrt(),
        // Whatever is where there is no mass is left out as well.
        false => f64::from(u8::from(vectors.as_flattened().iter().any(|&x| x != 0.0))),
    };
    Ok((modal, lost))
}

fn check_initial(initial: &[ModeState], modes: usize) -> Result<(), SimulationError> {
    if initial.len() != modes {
        return Err(SimulationError::Initial(format!(
            "{} states are given; the basis has {modes} modes",
            initial.len()
        )));
    }
    match initial.iter().position(|state| !(state.position.is_finite() && state.velocity.is_finite())) {
        Some(mode) => Err(SimulationError::Initial(format!("the state of mode {mode} is not finite"))),
        None => Ok(()),
    }
}

fn check(load: usize, what: &Load, vertices: usize) -> Result<(), SimulationError> {
    let (vertex, vector, times) = match what {
        Load::Impulse { vertex, time, momentum } => (*vertex, momentum, [*time, *time]),
        Load::Force { vertex, from, to, force } => (*vertex, force, [*from, *to]),
        // Every object has a first vertex.
        Load::Body { from, to, acceleration } => (0, acceleration, [*from, *to]),
    };
    let wrong = |reason| Err(SimulationError::Load { load, reason });
    if vertex >= vertices {
        return Err(SimulationError::Vertex { load, vertex, vertices });
    }
    if !vector.iter().all(|x| x.is_finite()) {
        return wrong("its vector must be finite");
    }
    let endless = matches!(what, Load::Body { .. }) && times[1] == f64::INFINITY;
    if !times[..if endless { 1 } else { 2 }].iter().all(|t| t.is_finite() && *t >= 0.0) {
        return wrong("its times must be finite and at least 0");
    }
    if matches!(what, Load::Force { .. } | Load::Body { .. }) && !(times[0] < times[1]) {
        return wrong("it must end after it begins");
    }
    Ok(())
}

fn projected(basis: &ModalBasis, vertex: usize, vector: [f64; 3]) -> Result<Vec<f64>, SimulationError> {
    let modes = basis.at(vertex)?;
    Ok(modes.iter().map(|mode| (0..3).map(|k| mode[k] * vector[k]).sum()).collect())
}

fn add(sum: &mut [f64], other: &[f64], factor: f64) {
    sum.iter_mut().zip(other).for_each(|(sum, x)| *sum += factor * x);
}

#[cfg(test)]
#[path = "vibration_tests.rs"]
mod tests;
