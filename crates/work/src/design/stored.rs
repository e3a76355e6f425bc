//! Fields that a server keeps: a request names them by their ids instead of giving their numbers.

use std::sync::Arc;

use chladni_spectral::operator::frames::power;
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::fault::refused;
use super::target::given;
use super::{DesignFault, Setting};
use crate::table::{Table, some_numbers};

/// A stored field by its id.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct StoredField {
    /// The id: that of an upload (`POST /v1/meshes/{id}/fields`) or of a saved design (`POST /v1/bases/{id}/designs`)
    /// on the same mesh.
    #[cfg_attr(feature = "schema", schema(example = "5c1f7e0a93b84d6f8e21a7b0c4d95f36"))]
    pub stored: String,
}

/// A table with a row for each face: itself, or the id of one that is stored.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(untagged, try_from = "Members")]
pub enum FieldTable {
    /// The numbers.
    Table(Table),
    /// The id.
    Stored(StoredField),
}

/// The members that either has.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Members {
    columns: Option<usize>,
    #[serde(default, deserialize_with = "some_numbers")]
    values: Option<Vec<f64>>,
    stored: Option<String>,
}

impl TryFrom<Members> for FieldTable {
    type Error = &'static str;

    fn try_from(members: Members) -> Result<Self, Self::Error> {
        match members {
            Members { columns: None, values: None, stored: Some(stored) } => Ok(Self::Stored(StoredField { stored })),
            Members { columns, values: Some(values), stored: None } => {
                Ok(Self::Table(Table { columns: columns.unwrap_or(1), values }))
            }
            Members { values: None, stored: None, .. } => {
                Err("a field is given by its values, or by the id of a stored one as \"stored\"")
            }
            _ => Err("a field is given either by columns and values, or by the id of a stored one, not by both"),
        }
    }
}

/// What a server keeps of a field.
#[derive(Debug, Clone)]
pub struct KeptField {
    /// What its numbers are, where it was designed; they are then those that are stored in a face. Of an upload nobody
    /// knows but who names it.
    pub kind: Option<FieldKind>,
    /// Numbers for each face.
    pub columns: usize,
    /// The numbers, face after face.
    pub values: Arc<Vec<f32>>,
}

/// The stored fields that a request names, found by who keeps them.
#[derive(Debug, Clone, Default)]
pub struct KeptFields {
    /// That which an alignment is to.
    pub to: Option<KeptField>,
    /// Its weights of faces.
    pub per_face: Option<KeptField>,
}

/// Where nobody keeps anything.
pub(super) fn nowhere(place: &str) -> DesignFault {
    refused("stored", place, "stored fields are known to a server alone: give the numbers themselves")
}

impl KeptField {
    /// Its numbers as the basis stores them. Fields of fewer directions are fields of more where the one number divides
    /// the other; of the three columns of an upload, vectors in ℝ³ are meant unless the basis is of tensors.
    ///
    /// # Errors
    /// [`DesignFault::Request`] says what does not fit.
    pub fn stored(&self, setting: &Setting, place: &str) -> Result<Vec<f64>, DesignFault> {
        let (own, wanted) = (self.kind, setting.kind());
        let values: Vec<f64> = self.values.iter().map(|&x| f64::from(x)).collect();
        let faces = setting.surface.surface.faces();
        if values.len() != self.columns * faces {
            let reason = format!("the stored field has {} numbers for {faces} faces", values.len());
            return Err(refused("stored", place, reason));
        }
        let tensors = |kind| kind == FieldKind::Tensor {};
        match own {
            None => given(setting, self.columns, &values),
            Some(kind) if tensors(kind) == tensors(wanted) && kind.order() == wanted.order() => Ok(values),
            Some(kind) if !tensors(kind) && !tensors(wanted) && wanted.order().is_multiple_of(kind.order()) => {
                let times = wanted.order() / kind.order();
                let turned = |own: &[f64; 2]| {
                    let length = own[0].hypot(own[1]);
                    if length > 0.0 { power(own.map(|x| x / length), times).map(|x| x * length) } else { [0.0; 2] }
                };
                Ok(values.as_chunks::<2>().0.iter().flat_map(turned).collect())
            }
            Some(kind) => {
                let reason = format!("a stored field of {} makes none of {}", told(kind), told(wanted));
                Err(refused("stored", place, reason))
            }
        }
    }

    /// Its numbers as weights of faces.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where it has not one number for each face.
    pub fn weights(&self, setting: &Setting, place: &str) -> Result<Vec<f64>, DesignFault> {
        let faces = setting.surface.surface.faces();
        if self.columns != 1 || self.values.len() != faces {
            let reason = format!("the stored field has {} numbers for each face; weights have one", self.columns);
            return Err(refused("stored", place, reason));
        }
        Ok(self.values.iter().map(|&x| f64::from(x)).collect())
    }
}

fn told(kind: FieldKind) -> String {
    match kind {
        FieldKind::Tensor {} => "tensors".to_owned(),
        FieldKind::Vector {} | FieldKind::NVector { n: 1 } => "vectors".to_owned(),
        FieldKind::NVector { n } => format!("{n}-vectors"),
    }
}
