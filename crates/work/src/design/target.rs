//! The field that an alignment draws a design to.

use chladni_spectral::field::{DirectionField, curvature_tensors, direction_in_frame, principal_directions};
use chladni_spectral::operator::transport::FieldKind;

use super::request::{AlignmentRequest, NamedTarget, NamedWeights, PerFace, Target, refused};
use super::stored::{FieldTable, ReferencedFields, no_stored_fields};
use super::{DesignFault, Setting};

/// The field to align to, in stored numbers, and weights of faces; `kept` has the stored fields that the request names.
pub fn field(
    setting: &Setting,
    wanted: &AlignmentRequest,
    kept: &ReferencedFields,
) -> Result<DirectionField, DesignFault> {
    let (surface, kind) = (&setting.surface.surface, setting.kind());
    let faces = surface.faces();
    let curvature = || -> Result<Vec<f64>, DesignFault> {
        surface.sides("curvature has a sign only where sides are told apart, which needs an oriented surface:")?;
        curvature_tensors(surface).map_err(|error| DesignFault::Curvature(error.to_string()))
    };
    let directions = |tensors: &[f64], n: u32| {
        principal_directions(tensors, n).map_err(|misfit| DesignFault::Curvature(misfit.to_string()))
    };
    let anisotropy = |tensors: &[f64]| directions(tensors, 2).map(|field| field.weights);
    let (target, known) = match (&wanted.to, kind) {
        (Target::Named(NamedTarget::Curvature), FieldKind::Tensor {}) => {
            let tensors = curvature()?;
            let weights = anisotropy(&tensors)?;
            (tensors, Some(weights))
        }
        (Target::Named(NamedTarget::Curvature), FieldKind::NVector { n }) if n % 2 == 0 => {
            let field = directions(&curvature()?, n)?;
            (field.target, Some(field.weights))
        }
        (Target::Named(NamedTarget::Curvature), _) => {
            let reason = "principal directions exist for tensor fields and for n-fields with even n";
            return Err(refused("alignment", "alignment.to", reason));
        }
        (Target::Field(FieldTable::Table(table)), _) => {
            let rows = table.values.len().checked_div(table.columns).unwrap_or(0);
            let fits = rows == faces && table.values.len() == rows * table.columns;
            if !fits || !table.values.iter().all(|x| x.is_finite()) {
                let reason = format!("must be a table of finite numbers with {faces} rows, one for each face");
                return Err(refused("alignment", "alignment.to", reason));
            }
            (given(setting, table.columns, &table.values)?, None)
        }
        (Target::Field(FieldTable::Stored(_)), _) => {
            let place = "alignment.to.stored";
            (kept.to.as_ref().ok_or_else(|| no_stored_fields(place))?.stored(setting, place)?, None)
        }
    };
    let weights = match (&wanted.per_face, known) {
        (None, _) => Vec::new(),
        (Some(PerFace::Named(NamedWeights::Anisotropy)), Some(weights)) => weights,
        (Some(PerFace::Named(NamedWeights::Anisotropy)), None) => anisotropy(&curvature()?)?,
        (Some(PerFace::Values(values)), _) => {
            if values.len() != faces {
                let reason = format!("{} weights are given for {faces} faces", values.len());
                return Err(refused("alignment", "alignment.per_face", reason));
            }
            values.clone()
        }
        (Some(PerFace::Stored(_)), _) => {
            let place = "alignment.per_face.stored";
            kept.per_face.as_ref().ok_or_else(|| no_stored_fields(place))?.weights(setting, place)?
        }
    };
    Ok(DirectionField { target, weights })
}

/// A client's field in stored numbers. Three columns are vectors in ℝ³, unless the field is of tensors.
pub(super) fn given(setting: &Setting, columns: usize, values: &[f64]) -> Result<Vec<f64>, DesignFault> {
    let (kind, frames) = (setting.kind(), setting.surface.surface.frames());
    if columns == kind.block() {
        return Ok(values.to_vec());
    }
    if columns != 3 {
        let reason = format!("{columns} columns are given; {} or 3 are needed", kind.block());
        return Err(refused("alignment", "alignment.to", reason));
    }
    let mut stored = Vec::with_capacity(2 * frames.faces());
    for (face, v) in values.as_chunks::<3>().0.iter().enumerate() {
        // Where a vector has no part in the face, there is nothing to be close to but zero.
        let [x, y, _] = direction_in_frame(kind, frames, face, *v).unwrap_or_default();
        stored.extend([x, y]);
    }
    Ok(stored)
}
