//! Fields that turn by more than half a turn between two faces: what makes their singularities those that were asked
//! for, as it is told and kept beside their numbers.

use chladni_mesh::numbering::Translation;
use chladni_spectral::basis::FieldMisfit;
use chladni_spectral::field::quad::crosses_of;
use chladni_spectral::field::{FieldSurface, Matching, matching_of_power};
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::quads::Crosses;

/// Two neighbouring faces between which a field does not turn by the least angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct MatchedFaces {
    /// The faces.
    pub faces: [u32; 2],
    /// Full turns of the representation from the first face to the second, beyond the least angle: of n directions
    /// number k goes on as the `turns` next one after that which is nearest to it.
    pub turns: i32,
}

impl MatchedFaces {
    /// A matching in the faces of the file.
    pub fn in_file_faces(matching: &[Matching], to: &Translation) -> Vec<Self> {
        matching.iter().map(|m| Self { faces: m.faces.map(|face| to.file_face(face)), turns: m.turns }).collect()
    }

    /// A matching in the faces of the kept mesh.
    pub fn in_mesh_faces(matching: &[Matching]) -> Vec<Self> {
        matching.iter().map(|m| Self { faces: m.faces, turns: m.turns }).collect()
    }

    /// The matching across edges of a surface; `None` where faces are no neighbours there.
    pub fn on(matched: &[Self], surface: &FieldSurface) -> Option<Vec<Matching>> {
        let dual = surface.dual();
        let one = |m: &Self| {
            let first = (m.faces[0] as usize) < surface.faces();
            let k = first.then(|| dual.neighbours(m.faces[0] as usize).iter().position(|&f| f == m.faces[1]))??;
            let edge = dual.edges(m.faces[0] as usize)[k];
            let faces = dual.edge_faces()[edge as usize];
            let turns = if faces[0] == m.faces[0] { m.turns } else { -m.turns };
            Some(Matching { edge, faces, turns })
        };
        matched.iter().map(one).collect()
    }
}

/// Stored numbers of a field with the matching that goes with them, if it has one.
#[derive(Debug, Clone)]
pub struct Lifted {
    /// What is stored in a face.
    pub kind: FieldKind,
    /// `block` numbers for each face.
    pub field: Vec<f32>,
    /// The edges across which it turns by more than half a turn; without it, none is known to.
    pub matching: Option<Vec<Matching>>,
}

impl Lifted {
    /// The crosses that it makes, with their matching: singular vertices stay where they are. `None` where a field of
    /// this kind makes none.
    ///
    /// # Errors
    /// [`FieldMisfit`]: it is of another surface.
    pub fn crosses(&self, surface: &FieldSurface) -> Result<Option<Crosses>, FieldMisfit> {
        let Some(field) = crosses_of(self.kind, &self.field) else { return Ok(None) };
        let of_crosses = |own: &Vec<Matching>| {
            matching_of_power(surface, (self.kind, &self.field, own), (FieldKind::NVector { n: 4 }, &field))
        };
        let matching = self.matching.as_ref().map(of_crosses).transpose()?.unwrap_or_default();
        Ok(Some(Crosses { field, matching, error: None }))
    }
}
