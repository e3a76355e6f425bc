//! Stored fields as they go over the wire.

use chladni_mesh::numbering::Translation;
use chladni_spectral::operator::transport::FieldKind;
use chladni_work::design::{DesignRequest, MatchedFaces};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::http::numbering::NumberingName;
use crate::http::problem::Problem;
use crate::store::FieldRecord;

/// A stored field, as lists have it.
#[derive(Debug, Serialize, ToSchema)]
pub struct FieldSummary {
    /// 32 hexadecimal digits of the hash of all but the name: equal fields have an equal id.
    pub id: String,
    /// The mesh it is on.
    pub mesh: String,
    /// The basis it was designed in; null of uploads.
    pub basis: Option<String>,
    /// The name it was given.
    pub name: Option<String>,
    /// Numbers for each face, as they are kept: of a design those that are stored in a face.
    pub columns: u64,
    /// Faces of the mesh.
    pub faces: u64,
    /// What a design is: vectors, n-vectors or tensors; null of uploads.
    #[schema(value_type = Option<FieldKind>)]
    pub field: Value,
    /// Bytes of the stored content.
    pub bytes: u64,
    /// When it was stored.
    pub created_ms: i64,
    /// Where to go from here.
    pub links: FieldLinks,
}

/// A stored field.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "5c1f7e0a93b84d6f8e21a7b0c4d95f36", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "basis": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "name": "combed back",
    "columns": 2, "faces": 5856, "field": {"kind": "vector"}, "bytes": 46976, "created_ms": 1795269602000i64,
    "links": {"self": "/v1/fields/5c1f7e0a93b84d6f8e21a7b0c4d95f36", "content": "/v1/fields/5c1f7e0a93b84d6f8e21a7b0c4d95f36/content",
              "mesh": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "basis": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10"},
    "design": {"field": {"kind": "vector"}, "request": {"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}]}, "numbering": "file", "harmonic_energy": 4.81,
               "biharmonic_energy": 122.4, "alignment_energy": null, "error": null}
}))]
pub struct FieldResource {
    /// What lists have as well.
    #[serde(flatten)]
    pub summary: FieldSummary,
    /// What a design was asked for with, and its energies; null of uploads.
    #[schema(value_type = Option<SavedDesign>)]
    pub design: Value,
}

/// What a saved design was asked for with, and its energies.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
pub struct SavedDesign {
    /// What is stored in a face.
    pub field: FieldKind,
    /// The request, as it can be sent again.
    #[schema(value_type = DesignRequest)]
    pub request: Value,
    /// How the request numbers vertices and faces.
    #[schema(inline)]
    pub numbering: NumberingName,
    /// The harmonic energy of the field, on the surface of unit area.
    pub harmonic_energy: f64,
    /// The biharmonic energy, on the surface of unit area.
    pub biharmonic_energy: f64,
    /// The squared deviation from what the field is aligned to, on the surface of unit area.
    pub alignment_energy: Option<f64>,
    /// With `refine`, how far the field of the basis is from it, as a share of its length.
    pub error: Option<f64>,
    /// With `exact` singularities the pairs of neighbouring faces across which the field turns by more than half a
    /// turn, in the numbering of the request that asks; quads keep its singular vertices by them. Absent from others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matching: Option<Vec<MatchedFaces>>,
}

/// Links of a stored field.
#[derive(Debug, Serialize, ToSchema)]
pub struct FieldLinks {
    /// The field itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its numbers.
    pub content: String,
    /// Its mesh.
    pub mesh: String,
    /// The basis it was designed in; null of uploads.
    pub basis: Option<String>,
}

impl FieldResource {
    /// A record as a request numbers faces: the matching is kept in those of the kept mesh.
    ///
    /// # Errors
    /// `internal` where what is kept is no matching.
    pub fn numbered(mut record: FieldRecord, to: &Translation) -> Result<Self, Problem> {
        if let Some(kept) = record.design.get_mut("matching").filter(|kept| !kept.is_null() && !to.is_identity()) {
            let matched: Vec<MatchedFaces> = serde_json::from_value(kept.take()).map_err(Problem::internal)?;
            let told: Vec<MatchedFaces> = matched.into_iter().map(|pair| pair.in_file(to)).collect();
            *kept = serde_json::to_value(told).map_err(Problem::internal)?;
        }
        Ok(record.into())
    }
}

impl From<FieldRecord> for FieldResource {
    fn from(record: FieldRecord) -> Self {
        let itself = format!("/v1/fields/{}", record.id);
        let summary = FieldSummary {
            links: FieldLinks {
                content: format!("{itself}/content"),
                mesh: format!("/v1/meshes/{}", record.mesh),
                basis: record.basis.map(|basis| format!("/v1/bases/{basis}")),
                itself,
            },
            id: record.id,
            mesh: record.mesh,
            basis: record.basis.map(|basis| basis.to_string()),
            name: record.name,
            columns: record.width,
            faces: record.faces,
            field: record.design["field"].clone(),
            bytes: record.bytes,
            created_ms: record.created_ms,
        };
        Self { summary, design: record.design }
    }
}
