//! The parameters as a client writes them: one flat object, of which each method takes its own members.

use chladni_spectral::basis::Precision;
use chladni_spectral::operator::{Boundary, MassKind, OperatorKind};
use chladni_spectral::spectrum::Refinement;
use chladni_spectral::spectrum::heat::HeatParameters;
use chladni_spectral::spectrum::radial::RadialParameters;
use serde::{Deserialize, Serialize};

use super::nested::is_nested;
use super::{Accuracy, Construction, Start, StorageKind};
use crate::ParameterError;
use crate::packed::Packed;

/// How eigenpairs are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodName {
    /// What is cheaper for the mesh and the count: the exact method where it takes about a second or less, else the approximation.
    #[default]
    Auto,
    /// The fast approximation: Ritz pairs in a subspace of locally supported functions.
    Approximate,
    /// The hierarchical subspace iteration method: pairs to a tolerance, proven complete.
    Hsim,
    /// Plain subspace iteration: a baseline.
    Sim,
}

impl MethodName {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Approximate => "approximate",
            Self::Hsim => "hsim",
            Self::Sim => "sim",
        }
    }
}

/// How the hierarchical method goes about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HsimVariant {
    /// Better starting spaces, every group of eigenvalues with its own shift.
    #[default]
    Sliced,
    /// The thesis' Algorithms 1 to 3.
    Published,
}

/// Every member that some method takes; `None` is what was not given.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    pub method: MethodName,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<OperatorKind>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass: Option<MassKind>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boundary: Option<Boundary>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dimension: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub construction: Option<Construction>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<HeatParameters>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radial: Option<RadialParameters>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certify: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refinement: Option<Refinement>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variant: Option<HsimVariant>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Start>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub levels: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_ratio: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subspace_factor: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub storage: Option<StorageKind>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<Precision>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

const APPROXIMATE: &[MethodName] = &[MethodName::Approximate];
const HSIM: &[MethodName] = &[MethodName::Hsim];
const SIM: &[MethodName] = &[MethodName::Sim];
const EXACT: &[MethodName] = &[MethodName::Hsim, MethodName::Sim];

/// The members that not every method takes, with those that do.
const BELONGINGS: &[(&str, &[MethodName])] = &[
    ("dimension", APPROXIMATE),
    ("construction", APPROXIMATE),
    ("accuracy", APPROXIMATE),
    ("heat", APPROXIMATE),
    ("radial", APPROXIMATE),
    ("certify", APPROXIMATE),
    ("refinement", APPROXIMATE),
    ("below", HSIM),
    ("between", HSIM),
    ("at_most", HSIM),
    ("tolerance", EXACT),
    ("variant", HSIM),
    ("start", SIM),
    ("levels", HSIM),
    ("sigma", HSIM),
    ("shift_ratio", HSIM),
    ("subspace_factor", EXACT),
    ("storage", EXACT),
];

impl Request {
    /// Reads an object; `null` stands for an empty one.
    ///
    /// # Errors
    /// [`ParameterError::Form`] names a member that does not exist or does not parse, [`ParameterError::Value`] one that belongs to
    /// another method.
    pub fn read(value: &Packed) -> Result<Self, ParameterError> {
        let form = |reason| ParameterError::Form { kind: "eigenbasis", reason };
        match value {
            Packed::Null => return Ok(Self::default()),
            Packed::Object(_) => {}
            _ => return Err(form("expected a JSON object".to_owned())),
        }
        let mut request: Self = serde_path_to_error::deserialize(value).map_err(|error| form(error.to_string()))?;
        let given = |name: &str| value.get(name).is_some_and(|value| !value.is_null());
        if request.method == MethodName::Auto {
            request.method = request.method_of_members(given);
        }
        for (name, methods) in BELONGINGS {
            if given(name) && !methods.contains(&request.method) {
                let owners: Vec<String> = methods.iter().map(|method| format!("\"{}\"", method.name())).collect();
                let reason =
                    format!("belongs to the method {}, not to \"{}\"", owners.join(" and "), request.method.name());
                return Err(ParameterError::Value { name, reason });
            }
        }
        Ok(request)
    }
}

impl Request {
    /// The method that a request leaves open, where its members leave it open too: one that a single method takes names that method.
    fn method_of_members(&self, given: impl Fn(&str) -> bool) -> MethodName {
        let any_of = |group: &[MethodName]| BELONGINGS.iter().any(|(name, methods)| *methods == group && given(name));
        if any_of(APPROXIMATE) {
            MethodName::Approximate
        } else if any_of(HSIM)
            || any_of(EXACT)
            || self.precision.is_some()
            || self.operator.as_ref().is_some_and(|own| *own == OperatorKind::Hodge || is_nested(own))
        {
            MethodName::Hsim
        } else if any_of(SIM) {
            MethodName::Sim
        } else {
            MethodName::Auto
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_member_is_some_method_s() {
        let common = ["method", "count", "operator", "mass", "boundary", "seed"];
        for (name, _) in BELONGINGS {
            assert!(!common.contains(name));
            // An unknown member would be refused as such; these are refused for their value or their method.
            let refused = Request::read(&Packed::from(&json!({"method": "magic", *name: []}))).unwrap_err().to_string();
            assert!(!refused.contains("unknown field"), "{name}: {refused}");
        }
    }
}
