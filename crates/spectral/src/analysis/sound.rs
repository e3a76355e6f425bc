//! The sound of a vibrating object.
//!
//! Every bit of the surface is a simple source: air that its acceleration pushes away. At a point `p` far enough from
//! the object the pressure is `ρ_air / 4π ∫ ⟨ü(x), n⟩ / |x − p| dA` (Rayleigh's integral without the delays within the
//! object), which is one number for each mode.

use chladni_base::Vector3;

use super::vibration::{Motion, SimulationError};
use crate::basis::modal::ModalBasis;

/// The density of air, in kg/m³.
const AIR: f64 = 1.2;

/// What is to be heard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Listening {
    /// Where the ear is, in units of the mesh.
    pub point: [f64; 3],
    /// Samples a second: 8000 to 192000.
    pub rate: u32,
    /// Seconds: more than 0, at most 60.
    pub seconds: f64,
}

/// A sound.
#[derive(Debug, Clone, PartialEq)]
pub struct Sound {
    /// Samples a second.
    pub rate: u32,
    /// Pressures, in pascal if lengths are in metres.
    pub pressures: Vec<f64>,
    /// Modes that are heard.
    pub modes: usize,
    /// Modes above half the sampling rate, which were left out: they would be heard at false pitches.
    pub too_high: usize,
}

impl Listening {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`SimulationError::Sound`] names the first that is outside.
    pub fn check(&self) -> Result<(), SimulationError> {
        let wrong = |name, reason| Err(SimulationError::Sound { name, reason });
        if !(8_000..=192_000).contains(&self.rate) {
            return wrong("sample_rate", format!("must be between 8000 and 192000, not {}", self.rate));
        }
        if !(self.seconds > 0.0 && self.seconds <= 60.0) {
            return wrong("seconds", format!("must be more than 0 and at most 60, not {}", self.seconds));
        }
        if !self.point.iter().all(|x| x.is_finite()) {
            return wrong("listener", "must be three finite numbers".to_owned());
        }
        Ok(())
    }
}

/// What is heard of a motion. `positions` and `faces` are the surface of the object, whose vertices are the first of
/// the basis.
///
/// # Errors
/// [`SimulationError`]: values out of range, or a surface that is not that of the basis.
pub fn listen(
    basis: &ModalBasis,
    motion: &Motion,
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    listening: &Listening,
) -> Result<Sound, SimulationError> {
    listening.check()?;
    let mut sources = vec![Vector3::ZERO; basis.vertices()];
    for face in faces {
        let Some([a, b, c]) = corners(positions, face) else { continue };
        let normal = (b - a).cross(c - a);
        for (&vertex, position) in face.iter().zip([a, b, c]) {
            // An ear on the surface hears it from a little away.
            let distance = (position - Vector3(listening.point)).norm().max(0.01 * basis.length);
            let share = AIR / (4.0 * std::f64::consts::PI) / distance / 6.0;
            if let Some(source) = sources.get_mut(vertex as usize) {
                *source += share * normal;
            }
        }
    }
    let mut weights = basis.transposed_times(Vector3::arrays(&sources))?;
    let half = std::f64::consts::PI * f64::from(listening.rate);
    let (mut modes, mut too_high) = (0, 0);
    for (weight, &value) in weights.iter_mut().zip(&basis.eigenvalues) {
        if value == 0.0 {
            *weight = 0.0;
        } else if value.sqrt() >= half {
            *weight = 0.0;
            too_high += 1;
        } else {
            modes += 1;
        }
    }
    let count = (listening.seconds * f64::from(listening.rate)).ceil() as usize;
    let pressures = motion.accelerations(&weights, f64::from(listening.rate), count);
    if let Some(at) = pressures.iter().position(|pressure| !pressure.is_finite()) {
        return Err(SimulationError::Overflow { time: at as f64 / f64::from(listening.rate) });
    }
    Ok(Sound { rate: listening.rate, pressures, modes, too_high })
}

fn corners(positions: &[[f64; 3]], face: &[u32; 3]) -> Option<[Vector3; 3]> {
    let [a, b, c] = face.map(|v| positions.get(v as usize).copied().map(Vector3));
    Some([a?, b?, c?])
}

impl Sound {
    /// The largest magnitude of a pressure.
    pub fn peak(&self) -> f64 {
        self.pressures.iter().fold(0.0, |most, p| p.abs().max(most))
    }

    /// A WAV file: one channel of 16-bit samples, the peak at 0.9 of the full scale.
    pub fn to_wav(&self) -> Vec<u8> {
        let bytes = 2 * self.pressures.len() as u32;
        let mut wav = Vec::with_capacity(44 + bytes as usize);
        wav.extend_from_slice(b"RIFF");
        wav.extend_from_slice(&(36 + bytes).to_le_bytes());
        wav.extend_from_slice(b"WAVEfmt ");
        wav.extend_from_slice(&16u32.to_le_bytes());
        // PCM, one channel.
        wav.extend_from_slice(&[1, 0, 1, 0]);
        wav.extend_from_slice(&self.rate.to_le_bytes());
        wav.extend_from_slice(&(2 * self.rate).to_le_bytes());
        wav.extend_from_slice(&[2, 0, 16, 0]);
        wav.extend_from_slice(b"data");
        wav.extend_from_slice(&bytes.to_le_bytes());
        let peak = self.peak();
        let scale = if peak > 0.0 && peak.is_finite() { 0.9 * f64::from(i16::MAX) / peak } else { 0.0 };
        for pressure in &self.pressures {
            wav.extend_from_slice(&((pressure * scale).round() as i16).to_le_bytes());
        }
        wav
    }
}
