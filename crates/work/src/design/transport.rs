//! Vectors that are given on a few faces, carried over the whole surface.

use chladni_mesh::numbering::Translation;
use chladni_spectral::field::{VectorHeat, VectorSource};
use chladni_spectral::operator::transport::FieldKind;
use serde::Deserialize;

use super::request::{DesignRequest, Pin};
use super::{DesignFault, Surface};

/// Vectors to be carried.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct TransportRequest {
    /// The vectors: each with a `face` or a `point`, and a `direction` or a `frame_direction` whose length is carried
    /// as well.
    pub sources: Vec<Pin>,
}

impl TransportRequest {
    /// The sources in the numbering of the kept mesh.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the source that does not fit.
    pub fn resolve(self, surface: &Surface, to: &Translation) -> Result<Vec<VectorSource>, DesignFault> {
        // What a vector on a face is, and what is wrong with one, is the same as for constraints of designs.
        let mut request = DesignRequest { constraints: self.sources, ..DesignRequest::default() };
        let kind = FieldKind::Vector {};
        let rows = surface.surface.mesh().positions.len();
        let own = |request: &DesignRequest| request.resolve(surface, kind).map_err(|fault| fault.numbered(to));
        let found = request.translate(to, kind, rows).and_then(|()| own(&request));
        let found = found.map_err(|fault| match fault {
            DesignFault::Request { within, place, reason, face } => {
                DesignFault::Request { within, place: place.replacen("constraints", "sources", 1), reason, face }
            }
            other => other,
        })?;
        Ok(found.iter().map(|c| VectorSource { face: c.face, vector: [c.value[0], c.value[1]] }).collect())
    }
}

/// A vector in the frame of each face.
///
/// # Errors
/// [`DesignFault::Transport`] names the face that no vector reaches, in the numbering of the request.
pub fn carried(heat: &VectorHeat, sources: &[VectorSource], to: &Translation) -> Result<Vec<f32>, DesignFault> {
    let field = heat.carried(sources).map_err(|error| DesignFault::from(error).numbered(to))?;
    Ok(field.into_iter().map(|x| x as f32).collect())
}
