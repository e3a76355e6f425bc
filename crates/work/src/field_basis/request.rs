//! The parameters of a job `field_basis` as clients write them.

use chladni_spectral::field::{FieldHeat, LocalEigenfields};
use chladni_spectral::operator::hodge::FieldBoundary;
use serde::{Deserialize, Serialize};

use crate::ParameterError;
use crate::packed::Packed;

/// How far the heat construction of fields goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FieldAccuracy {
    /// Two heat steps.
    #[default]
    Standard,
    /// Four shorter ones, and less shrinking.
    Accurate,
}

/// What is stored in a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FieldName {
    /// A tangent vector.
    #[default]
    Vector,
    /// `n` vectors, equal up to turns by 360°/n.
    NVector,
    /// A symmetric tensor.
    Tensor,
}

/// How columns are constructed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FieldConstruction {
    /// Transported bumps, smoothed by heat steps.
    #[default]
    Heat,
    /// The thesis' construction: eigenfields of the operator on disks.
    LocalEigenfields,
}

/// Every member that a job may have. What is absent is filled in.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = FieldBasisParameters))]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct Request {
    /// What is stored in a face.
    pub field: FieldName,
    /// The `n` of n-vectors.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 64, example = 4))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n: Option<u32>,
    /// The number of locally supported columns.
    #[cfg_attr(feature = "schema", schema(minimum = 2, maximum = 40000, example = 2000))]
    pub dimension: Option<usize>,
    /// How they are constructed.
    pub construction: FieldConstruction,
    /// How far the heat construction goes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<FieldAccuracy>,
    /// The radius of bumps or disks, in the place of the `sigma` of `heat` or `local_eigenfields`.
    #[cfg_attr(feature = "schema", schema(minimum = 4, maximum = 1000, example = 8.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Every detail of the heat construction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<FieldHeat>,
    /// Every detail of the thesis' construction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub local_eigenfields: Option<LocalEigenfields>,
    /// What vector fields do at a boundary.
    pub boundary: Option<FieldBoundary>,
    /// One positive weight per face.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<Vec<f64>>,
    /// Fields to derive the weights from: two or three numbers per face each, in the frames of the faces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub examples: Option<Vec<Vec<f64>>>,
    /// Whether spaces of vector fields carry the harmonic fields of the surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub harmonic_fields: Option<bool>,
    /// Of how many of the lowest eigenfields, besides those without energy, the errors are estimated: without it of 8,
    /// on surfaces of more than 270,000 faces of fewer. 0: of none.
    #[cfg_attr(feature = "schema", schema(maximum = 256, example = 8))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimates: Option<usize>,
    /// Draws the first sample.
    #[cfg_attr(feature = "schema", schema(example = 0))]
    pub seed: Option<u64>,
}

impl Request {
    /// Reads the parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError::Form`] names the member that does not fit.
    pub fn read(value: &Packed) -> Result<Self, ParameterError> {
        let form = |reason| ParameterError::Form { kind: "field_basis", reason };
        match value {
            Packed::Null => Ok(Self::default()),
            Packed::Object(_) => crate::plain::read(value).map_err(form),
            _ => Err(form("expected a JSON object".to_owned())),
        }
    }
}
