//! The method `approximate`: its parameters, defaults and limits.

use serde::{Deserialize, Serialize};

use super::request::Request;
use super::{LARGEST_DIMENSION, value};
use crate::job::ParameterError;
use crate::mesh::distance::{DistanceKind, STVD_WINDOW_MAX};
use crate::spectrum::Space;
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::radial::RadialParameters;

/// How the subspace is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Construction {
    /// Radial bumps, smoothed by implicit heat steps: about twenty times more accurate than `radial` at the same storage.
    #[default]
    Heat,
    /// The thesis' construction: radial bumps of geodesic distance, normalised to a partition of unity.
    Radial,
}

/// How far the heat construction goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// Two heat steps: mean error of the eigenvalues about 0.2 % at d = 2m.
    #[default]
    Standard,
    /// Four heat steps in a space of d = 3m: mean error about 0.05 %.
    Accurate,
}

/// What is approximated, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Approximate {
    /// How many eigenpairs are wanted, the kernel included.
    pub count: usize,
    /// The dimension of the subspace, before it is bounded by the mesh.
    pub dimension: usize,
    /// How far the heat construction goes.
    pub accuracy: Accuracy,
    /// The subspace, every detail filled in.
    pub space: Space,
}

impl Approximate {
    /// Takes the members of the method, with defaults for what is absent.
    ///
    /// # Errors
    /// [`ParameterError::Value`] names the first that is out of its range.
    pub fn from_request(request: &Request, count: usize) -> Result<Self, ParameterError> {
        let accuracy = request.accuracy.unwrap_or_default();
        let dimension = request.dimension.unwrap_or(match accuracy {
            Accuracy::Standard => 2 * count,
            Accuracy::Accurate => 3 * count,
        });
        if !(count..=LARGEST_DIMENSION).contains(&dimension) {
            let reason = format!("must lie between the count, {count}, and {LARGEST_DIMENSION}, not be {dimension}");
            return Err(value("dimension", reason));
        }
        let space = match request.construction.unwrap_or_default() {
            Construction::Heat => Space::Heat(heat(request, accuracy)?),
            Construction::Radial => Space::Radial(radial(request, accuracy)?),
        };
        Ok(Self { count, dimension, accuracy, space })
    }

    /// Writes every member of the method.
    pub fn fill(&self, request: &mut Request) {
        request.count = Some(self.count);
        request.dimension = Some(self.dimension);
        request.accuracy = Some(self.accuracy);
        match self.space {
            Space::Heat(heat) => (request.construction, request.heat) = (Some(Construction::Heat), Some(heat)),
            Space::Radial(radial) => {
                (request.construction, request.radial) = (Some(Construction::Radial), Some(radial));
            }
        }
    }

    /// An estimate of the memory that the work needs beside mesh and operator, in bytes: the basis per vertex, the dense problem per
    /// dimension.
    pub fn memory_bytes(&self, vertices: u64) -> u64 {
        let (d, m) = ((self.dimension as u64).min(vertices), self.count as u64);
        vertices * 25 * 2 * 8 + vertices * 16 * 8 + d * d * 8 * 5 + d * m * 8 * 2
    }
}

fn heat(request: &Request, accuracy: Accuracy) -> Result<HeatParameters, ParameterError> {
    if request.radial.is_some() {
        return Err(value("radial", "these details need the construction \"radial\"".to_owned()));
    }
    let usual = match accuracy {
        Accuracy::Standard => HeatParameters::default(),
        Accuracy::Accurate => HeatParameters::accurate(),
    };
    let Some(heat) = request.heat else { return Ok(usual) };
    // Details that say the same as the accuracy contradict nothing.
    if accuracy == Accuracy::Accurate && heat != usual {
        return Err(value("heat", "give the details or \"accuracy\": \"accurate\", not both".to_owned()));
    }
    heat.check().map_err(|error| value("heat", error.to_string()))?;
    Ok(heat)
}

fn radial(request: &Request, accuracy: Accuracy) -> Result<RadialParameters, ParameterError> {
    if accuracy == Accuracy::Accurate {
        return Err(value("accuracy", "\"accurate\" is an option of the construction \"heat\" alone".to_owned()));
    }
    if request.heat.is_some() {
        return Err(value("heat", "these details need the construction \"heat\"".to_owned()));
    }
    let radial = request.radial.unwrap_or_default();
    if !(1.0..=100.0).contains(&radial.sigma) {
        return Err(value("radial.sigma", format!("must lie between 1 and 100, not be {}", radial.sigma)));
    }
    if let DistanceKind::Stvd { window } = radial.distance
        && !(1..=STVD_WINDOW_MAX).contains(&window)
    {
        let reason = format!("the window must lie between 1 and {STVD_WINDOW_MAX}, not be {window}");
        return Err(value("radial.distance", reason));
    }
    Ok(radial)
}
