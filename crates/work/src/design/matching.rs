//! Fields that turn by more than half a turn between two faces: what makes their singularities those that were asked
//! for, as it is told and kept beside their numbers.

use chladni_base::Vector3;
use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_spectral::basis::FieldMisfit;
use chladni_spectral::field::quad::crosses_of;
use chladni_spectral::field::{FieldSurface, Matching, matching_of_power};
use chladni_spectral::operator::frames::{complex, parts, power};
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::DesignFault;
use super::request::{refused, refused_at};
use crate::table::numbers;

/// More full turns between two faces are nobody's.
const MOST_TURNS: u32 = 1_000_000;

/// A cross field in stored numbers.
#[derive(Debug)]
pub struct Crosses {
    /// Two numbers for each face.
    pub field: Vec<f32>,
    /// Where it turns by more than half a turn from face to face, as far as that is known.
    pub matching: Vec<Matching>,
    /// By how much it misses what it was to follow.
    pub error: Option<[f64; 2]>,
}

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
        Self::in_mesh_faces(matching).into_iter().map(|pair| pair.in_file(to)).collect()
    }

    /// A pair of the kept mesh as the file numbers it. The parts of one polygon have one number there.
    #[must_use]
    pub fn in_file(self, to: &Translation) -> Self {
        Self { faces: self.faces.map(|face| to.file_face(face)), turns: self.turns }
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

/// Numbers that make crosses, a row for each face.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CrossTable {
    /// Numbers in a row: three are a direction of the cross in ℝ³, two its representation in the frame of the face,
    /// whose angle is four times that of the directions.
    pub columns: usize,
    /// The numbers, row after row; null at faces of a file that have none.
    #[serde(deserialize_with = "numbers")]
    pub values: Vec<f64>,
    /// The pairs of neighbouring faces between which directions do not go on as the nearest ones, as a design with
    /// exact singularities tells them; singular vertices are then those of the design.
    #[serde(default)]
    pub matching: Vec<MatchedFaces>,
    /// How many directions a face has in the field whose full turns `matching` counts, 1, 2 or 4: where it is of
    /// vectors, 1, and of lines, 2.
    #[serde(default = "four")]
    #[cfg_attr(feature = "schema", schema(default = 4, minimum = 1, maximum = 4))]
    pub n: u32,
}

fn four() -> u32 {
    4
}

impl CrossTable {
    /// Brings rows and pairs of faces into the numbering of the kept mesh.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member.
    pub(super) fn translate(&mut self, to: &Translation) -> Result<(), DesignFault> {
        let place = "field.table";
        if self.columns == 2
            && let Some(error) = to.refuses_frames()
        {
            return Err(refused("field", place, error));
        }
        let pulled = to.pull_faces(&self.values, self.columns);
        self.values = pulled.map_err(|error| refused("field", place, error))?;
        if to.divides_faces() && !self.matching.is_empty() {
            let reason = "pairs of faces need the numbering \"kept\" on this mesh, since a face of the file is several of its triangles";
            return Err(refused("field", "field.table.matching", reason));
        }
        for (at, face) in self.matching.iter_mut().flat_map(|pair| &mut pair.faces).enumerate() {
            let place = || format!("field.table.matching[{}]", at / 2);
            *face = to.face(*face).map_err(|error: NumberingError| refused("field", &place(), error))?;
        }
        Ok(())
    }

    /// The crosses of the surface.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member that does not fit.
    pub(super) fn crosses(&self, surface: &FieldSurface) -> Result<Crosses, DesignFault> {
        let field = represented(surface, (self.columns, &self.values), 4, "field.table")?;
        if self.matching.is_empty() {
            return Ok(Crosses { field, matching: Vec::new(), error: None });
        }
        let place = "field.table.matching";
        let most = |pair: &&MatchedFaces| pair.turns.unsigned_abs() > MOST_TURNS;
        if let Some(pair) = self.matching.iter().find(most) {
            let reason = format!("{} full turns are out of range; the limit is {MOST_TURNS}", pair.turns);
            return Err(refused("field", place, reason));
        }
        let own = MatchedFaces::on(&self.matching, surface)
            .ok_or_else(|| refused("field", place, "names faces that are not neighbours"))?;
        if !matches!((self.n, self.columns), (4, _) | (1 | 2, 3)) {
            let reason = format!("must be 1, 2 or 4, and 4 of representations in frames, not {}", self.n);
            return Err(refused("field", "field.table.n", reason));
        }
        let (kind, crosses) = (FieldKind::NVector { n: self.n }, FieldKind::NVector { n: 4 });
        let turning = represented(surface, (self.columns, &self.values), self.n, "field.table")?;
        let matching = matching_of_power(surface, (kind, &turning, &own), (crosses, &field));
        let matching = matching.map_err(|misfit| refused("field", place, misfit))?;
        Ok(Crosses { field, matching, error: None })
    }
}

/// Directions in ℝ³, or representations in frames as they are, as the representation of length 1 of `n` directions.
///
/// # Errors
/// [`DesignFault::Request`] names the face without a direction.
pub(super) fn represented(
    surface: &FieldSurface,
    (columns, values): (usize, &[f64]),
    n: u32,
    place: &str,
) -> Result<Vec<f32>, DesignFault> {
    let faces = surface.faces();
    if !matches!(columns, 2 | 3) || values.len() != columns * faces {
        let reason = format!("must be a table of {faces} rows, one for each face, with 2 or 3 columns");
        return Err(refused("field", place, reason));
    }
    let mut field = Vec::with_capacity(2 * faces);
    for (face, row) in values.chunks_exact(columns).enumerate() {
        let own = match *row {
            [x, y, z] => surface.frames().from_world(face, Vector3::new(x, y, z)),
            _ => complex([row[0], row[1]]),
        };
        let length = own.norm();
        if !(length > 1e-12 * row.iter().map(|x| x.abs()).fold(0.0, f64::max) && length.is_finite()) {
            let reason = format!("the row of face {face} has no direction in the plane of the face");
            return Err(refused_at(face as u32, "field", place, reason));
        }
        let unit = own / length;
        field.extend(parts(if columns == 3 { power(unit, n) } else { unit }).map(|x| x as f32));
    }
    Ok(field)
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
