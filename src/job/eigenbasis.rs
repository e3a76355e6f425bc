//! The job `eigenbasis`: the lowest eigenpairs of the Laplace–Beltrami operator, as a compact basis.

use serde::{Deserialize, Serialize};

use super::{JobError, ParameterError};
use crate::basis::Basis;
use crate::mesh::TriangleMesh;
use crate::mesh::distance::{DistanceKind, STVD_WINDOW_MAX};
use crate::monitor::Monitor;
use crate::operator::{self, MassKind, OperatorParameters};
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::radial::RadialParameters;
use crate::spectrum::{self, ApproximationParameters, Space};

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

/// The most eigenpairs that one job may ask for.
pub const LARGEST_COUNT: usize = 20_000;

/// The largest subspace that one job may ask for; its restricted problem is dense.
pub const LARGEST_DIMENSION: usize = 40_000;

/// How eigenpairs are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The fast approximation: Ritz pairs in a subspace of locally supported functions.
    #[default]
    Approximate,
}

/// What a client asks for; absent members take their defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EigenbasisParameters {
    /// How eigenpairs are computed.
    pub method: Method,
    /// How many eigenpairs are wanted, the kernel included.
    pub count: usize,
    /// The dimension `d` of the subspace; absent: twice the count, three times for the accurate heat construction.
    pub dimension: Option<usize>,
    /// The mass matrix.
    pub mass: MassKind,
    /// How the subspace is built.
    pub construction: Construction,
    /// How far the heat construction goes.
    pub accuracy: Accuracy,
    /// Details of the heat construction; absent: those of `accuracy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<HeatParameters>,
    /// Details of the radial construction; absent: the thesis'.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radial: Option<RadialParameters>,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

impl Default for EigenbasisParameters {
    fn default() -> Self {
        Self {
            method: Method::default(),
            count: 100,
            dimension: None,
            mass: MassKind::default(),
            construction: Construction::default(),
            accuracy: Accuracy::default(),
            heat: None,
            radial: None,
            seed: 0,
        }
    }
}

impl EigenbasisParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn parse(value: &serde_json::Value) -> Result<Self, ParameterError> {
        let form = |reason| ParameterError::Form { kind: "eigenbasis", reason };
        let parameters = match value {
            serde_json::Value::Null => Self::default(),
            serde_json::Value::Object(_) => {
                serde_path_to_error::deserialize(value).map_err(|error| form(error.to_string()))?
            }
            _ => return Err(form("a JSON object is expected".to_owned())),
        };
        parameters.validate()?;
        Ok(parameters)
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// [`ParameterError::Value`] names the first that is outside.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let value = |name, reason| Err(ParameterError::Value { name, reason });
        if !(1..=LARGEST_COUNT).contains(&self.count) {
            return value("count", format!("must lie between 1 and {LARGEST_COUNT}, not be {}", self.count));
        }
        if let Some(dimension) = self.dimension
            && !(self.count..=LARGEST_DIMENSION).contains(&dimension)
        {
            return value(
                "dimension",
                format!("must lie between the count, {}, and {LARGEST_DIMENSION}, not be {dimension}", self.count),
            );
        }
        if self.construction == Construction::Radial && self.accuracy == Accuracy::Accurate {
            return value("accuracy", "\"accurate\" is an option of the construction \"heat\" alone".to_owned());
        }
        if let Some(heat) = &self.heat {
            if self.construction != Construction::Heat {
                return value("heat", "these details need the construction \"heat\"".to_owned());
            }
            if self.accuracy != Accuracy::Standard {
                return value("heat", "give the details or \"accuracy\": \"accurate\", not both".to_owned());
            }
            heat.check().or_else(|error| value("heat", error.to_string()))?;
        }
        if let Some(radial) = &self.radial {
            if self.construction != Construction::Radial {
                return value("radial", "these details need the construction \"radial\"".to_owned());
            }
            if !(1.0..=100.0).contains(&radial.sigma) {
                return value("radial.sigma", format!("must lie between 1 and 100, not be {}", radial.sigma));
            }
            if let DistanceKind::Stvd { window } = radial.distance
                && !(1..=STVD_WINDOW_MAX).contains(&window)
            {
                let reason = format!("the window must lie between 1 and {STVD_WINDOW_MAX}, not be {window}");
                return value("radial.distance", reason);
            }
        }
        Ok(())
    }

    /// The subspace, every detail filled in.
    pub fn space(&self) -> Space {
        match (self.construction, self.accuracy) {
            (Construction::Radial, _) => Space::Radial(self.radial.unwrap_or_default()),
            (Construction::Heat, Accuracy::Accurate) => Space::Heat(HeatParameters::accurate()),
            (Construction::Heat, Accuracy::Standard) => Space::Heat(self.heat.unwrap_or_default()),
        }
    }

    /// The dimension of the subspace before it is bounded by the mesh.
    pub fn dimension(&self) -> usize {
        self.dimension.unwrap_or_else(|| match self.accuracy {
            Accuracy::Standard => 2 * self.count,
            Accuracy::Accurate => 3 * self.count,
        })
    }

    /// The parameters with every default filled in.
    pub fn canonical(&self) -> serde_json::Value {
        let mut full = Self { dimension: Some(self.dimension()), ..self.clone() };
        match self.space() {
            Space::Heat(heat) => full.heat = Some(heat),
            Space::Radial(radial) => full.radial = Some(radial),
        }
        // Serialising a struct of numbers, strings and options cannot fail; null would only make equal work look different.
        serde_json::to_value(full).unwrap_or_default()
    }

    /// Checks the parameters against the size of a mesh.
    ///
    /// # Errors
    /// [`ParameterError::Value`] where more pairs are asked for than the mesh has vertices.
    pub fn check_mesh(&self, vertices: usize) -> Result<(), ParameterError> {
        if self.count > vertices {
            return Err(ParameterError::Value {
                name: "count",
                reason: format!("{} eigenpairs are asked for, but the mesh has {vertices} vertices", self.count),
            });
        }
        Ok(())
    }

    /// An estimate of the memory that the job needs, in bytes: mesh, operator and basis per vertex, the dense problem per
    /// dimension.
    pub fn memory_bytes(&self, vertices: usize, faces: usize) -> u64 {
        let (n, f) = (vertices as u64, faces as u64);
        let d = self.dimension().min(vertices) as u64;
        let m = self.count as u64;
        let mesh = 24 * n + 12 * f;
        let operator = n * (7 * 12 + 8 + 8) + n * (6 * 12 + 8) + f * 12;
        let basis = n * 25 * 2 * 8 + n * 16 * 8;
        let dense = d * d * 8 * 5 + d * m * 8 * 2;
        mesh + operator + basis + dense + (64 << 20)
    }

    /// Computes the basis.
    ///
    /// # Errors
    /// [`JobError`]: parameters that do not fit the mesh, a numerical failure, or cancellation.
    pub fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Basis, JobError> {
        let parameters = ApproximationParameters {
            count: self.count,
            dimension: self.dimension(),
            space: self.space(),
            seed: self.seed,
        };
        let operator = OperatorParameters { mass: self.mass, ..OperatorParameters::default() };
        let operator = operator::assemble(mesh, &operator, monitor)?;
        Ok(spectrum::approximate(mesh, &operator, &parameters, monitor)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn absent_parameters_take_their_defaults() {
        let parameters = EigenbasisParameters::parse(&serde_json::Value::Null).unwrap();
        assert_eq!(parameters, EigenbasisParameters::default());
        assert_eq!(parameters, EigenbasisParameters::parse(&json!({})).unwrap());
    }

    #[test]
    fn a_default_that_is_spelled_out_is_equal_work() {
        let silent = EigenbasisParameters::parse(&json!({"count": 50})).unwrap();
        let spelled =
            EigenbasisParameters::parse(&json!({"count": 50, "dimension": 100, "construction": "heat"})).unwrap();
        assert_eq!(silent.canonical(), spelled.canonical());
    }

    #[test]
    fn what_does_not_fit_is_named() {
        for (parameters, word) in [
            (json!({"count": 0}), "count"),
            (json!({"count": -1}), "count"),
            (json!({"construction": "radial", "radial": {"sigma": "x"}}), "radial.sigma"),
            (json!({"count": 1_000_000_000}), "1000000000"),
            (json!({"dimension": 10}), "dimension"),
            (json!({"methd": "approximate"}), "methd"),
            (json!({"method": "magic"}), "magic"),
            (json!({"construction": "radial", "accuracy": "accurate"}), "accuracy"),
            (json!({"construction": "radial", "heat": {}}), "heat"),
            (json!({"accuracy": "accurate", "heat": {}}), "not both"),
            (json!({"heat": {"steps": 0}}), "steps"),
            (json!({"radial": {}}), "radial"),
            (json!({"construction": "radial", "radial": {"sigma": 0.5}}), "0.5"),
            (json!({"construction": "radial", "radial": {"distance": {"stvd": {"window": 0}}}}), "window"),
            (json!([]), "eigenbasis"),
            (json!("x"), "eigenbasis"),
        ] {
            let error = EigenbasisParameters::parse(&parameters).unwrap_err().to_string();
            assert!(error.contains(word), "{parameters}: {error}");
        }
    }

    #[test]
    fn more_pairs_than_vertices_are_refused() {
        let parameters = EigenbasisParameters::parse(&json!({"count": 50})).unwrap();
        assert!(parameters.check_mesh(50).is_ok());
        assert!(parameters.check_mesh(49).unwrap_err().to_string().contains("49 vertices"));
    }
}
