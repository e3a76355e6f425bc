//! What a design is asked for with, and the constraints that it means.

use chladni_spectral::field::{BENDING, Constraint, FullSpace, Hold};
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::faces::FacesRequest;
use super::given_value::GivenValue;
use super::stored::{FieldTable, StoredField};
use super::{DesignFault, Surface};
use crate::word_or;

/// Weights beyond this are nobody's, and products of them with energies would overflow.
const MOST_WEIGHT: f64 = 1e12;

/// The most constraints of one design: they make a dense system of their own size.
pub const MOST_CONSTRAINTS: usize = 2000;

/// What field is wanted. A front-end sends the whole of it again whenever a stroke moves: what does not change costs
/// nothing.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct DesignRequest {
    /// Weights of the energies.
    #[serde(default)]
    pub weights: Weights,
    /// Where the field should go along, softly.
    #[serde(default)]
    pub strokes: Vec<Stroke>,
    /// What the field has to be.
    #[serde(default)]
    pub constraints: Vec<Pin>,
    /// A field to stay close to.
    pub alignment: Option<AlignmentRequest>,
    /// Where the field is to be singular, and how strongly that is wanted.
    pub singularities: Option<SingularitiesRequest>,
    /// Which fields the design is the one of least energy of: by default all fields of the surface where there is
    /// memory for two sparse factors of it, else those of the space of the basis.
    #[serde(default)]
    pub space: DesignSpace,
    /// Whether to estimate how far the field is from that of least energy among all fields of the surface, as a share
    /// of its length. Where that field is the answer, JSON tells in any case how far the field of the coefficients is
    /// from it.
    #[serde(default)]
    pub error: bool,
    /// Asks for the field of least energy among all fields of the surface itself, in place of that in the space of the
    /// basis: to this relative tolerance, from 1e-10 to below 1.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-10, maximum = 1.0))]
    pub refine: Option<f64>,
    /// The faces that the field is told of; without it, all.
    pub faces: Option<FacesRequest>,
}

/// Which fields a design is the one of least energy of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum DesignSpace {
    /// `surface` where there is memory for factors, else `basis`, and so beside prescribed singularities or the full
    /// biharmonic energy.
    #[default]
    Auto,
    /// The fields of the space of the basis: fast on every surface, and off by what the space does not resolve.
    Basis,
    /// All fields of the surface, on large ones by iterations that take seconds.
    Surface,
}

/// Weights of the energies, on the surface of unit area.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Weights {
    /// Of the harmonic (Dirichlet) energy.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0, minimum = 0.0))]
    pub harmonic: f64,
    /// Of the biharmonic energy, without which a field has no value at a point: with 0 the answer to strokes and
    /// constraints on single faces depends on how fine the mesh is, and in the space of the basis on its dimension. By
    /// default a twentieth of `harmonic`.
    #[cfg_attr(feature = "schema", schema(minimum = 0.0))]
    pub biharmonic: Option<f64>,
    /// Which biharmonic energy: that of the projected Laplacian, which fields of the space can make small, or the full
    /// (unreduced) one of the whole mesh restricted to the space, which sees the noise of its columns. The second is
    /// for comparison; every choice of weights costs a factorisation.
    #[serde(default)]
    pub biharmonic_energy: BiharmonicEnergy,
}

/// Which biharmonic energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum BiharmonicEnergy {
    /// `S̄ M̄⁻¹ S̄`.
    #[default]
    Projected,
    /// `UᵀSM⁻¹SU`, in older clients' words `literal`.
    #[serde(alias = "literal")]
    Full,
}

impl Weights {
    /// The weight of the biharmonic energy: what is given, or in proportion to that of the harmonic one.
    pub fn bending(&self) -> f64 {
        self.biharmonic.unwrap_or(BENDING * self.harmonic)
    }

    /// Whether the design has to do with the full biharmonic energy.
    pub fn full_biharmonic(&self) -> bool {
        self.bending() > 0.0 && self.biharmonic_energy == BiharmonicEnergy::Full
    }
}

fn one() -> f64 {
    1.0
}

impl Default for Weights {
    fn default() -> Self {
        Self { harmonic: 1.0, biharmonic: None, biharmonic_energy: BiharmonicEnergy::default() }
    }
}

/// A soft constraint: one `face` or `point` with a value, or `points`, a line whose own direction the field is to
/// follow. A value is a `direction` in ℝ³ or a `frame_direction`; for tensors a `direction` with `values`, or a
/// `tensor`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// The face.
    pub face: Option<u32>,
    /// A point in the units of the mesh: stands for the face nearest to it.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub point: Option<[f64; 3]>,
    /// A line of points: the faces nearest to them, each with the direction in which the line goes on, of length 1.
    pub points: Option<Vec<[f64; 3]>>,
    /// A direction in ℝ³, projected to the face; its length is the length of the field.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub direction: Option<[f64; 3]>,
    /// A direction in the frame of the face.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub frame_direction: Option<[f64; 2]>,
    /// Of a tensor the eigenvalues, along `direction` and across it.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub values: Option<[f64; 2]>,
    /// A symmetric tensor in the frame of the face: a₁₁, a₂₂, a₁₂.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub tensor: Option<[f64; 3]>,
    /// How firmly the stroke holds, against what the field resists with there: alone, a stroke of strength `s` on one
    /// face misses the share `1 / (1 + 100 s)` of its length. 1 is met to a percent, 0.1 to a tenth, on every surface,
    /// at every scale and with all weights of the energies.
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub strength: Option<f64>,
}

/// A hard constraint: a `face` or `point` with a value, as for strokes.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Pin {
    /// The face.
    pub face: Option<u32>,
    /// A point in the units of the mesh: stands for the face nearest to it.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub point: Option<[f64; 3]>,
    /// A direction in ℝ³, projected to the face; its length is the length of the field.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub direction: Option<[f64; 3]>,
    /// A direction in the frame of the face.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub frame_direction: Option<[f64; 2]>,
    /// Of a tensor the eigenvalues, along `direction` and across it.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub values: Option<[f64; 2]>,
    /// A symmetric tensor in the frame of the face: a₁₁, a₂₂, a₁₂.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub tensor: Option<[f64; 3]>,
}

/// A field to stay close to, with a global weight and optionally one for each face.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct AlignmentRequest {
    /// `curvature`, or a table with a row for each face: three columns are vectors in ℝ³, otherwise the numbers that
    /// are stored in a face; or the id of a stored field.
    pub to: Target,
    /// The weight of the squared deviation.
    pub weight: f64,
    /// A weight for each face, itself or by the id of a stored field, or `anisotropy`: how clearly the principal
    /// directions differ, from 0 to 1. Without it all faces count alike.
    #[serde(default)]
    pub per_face: Option<PerFace>,
}

/// What to align to.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum Target {
    /// What the server knows of the surface.
    Named(NamedTarget),
    /// A field: itself, or the id of one that is stored.
    Field(FieldTable),
}

word_or!(
    Target,
    "the word \"curvature\", a table {\"columns\": k, \"values\": […]} or a stored field {\"stored\": id}",
    Named(NamedTarget),
    object Field
);

/// What the server knows of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum NamedTarget {
    /// The principal directions of curvature, for n-fields with even n; the curvature tensors themselves for tensor
    /// fields.
    Curvature,
}

/// Weights of faces.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum PerFace {
    /// What the server knows of the surface.
    Named(NamedWeights),
    /// One weight for each face, from 0.
    Values(Vec<f64>),
    /// The same by the id of a stored field of one column.
    Stored(StoredField),
}

word_or!(
    PerFace,
    "the word \"anisotropy\", an array of one number for each face, or a stored field {\"stored\": id}",
    Named(NamedWeights),
    array Values,
    object Stored
);

/// Weights that the server knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum NamedWeights {
    /// How clearly the principal directions of curvature differ.
    Anisotropy,
}

/// Prescribed singularities: the smoothest field of unit length that has these and no others is what the design stays
/// close to.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SingularitiesRequest {
    /// The singular vertices; on a component without boundary their indices add up to its Euler characteristic.
    pub at: Vec<SingularVertex>,
    /// The weight of the squared deviation from that field. By default a hundred times what that field resists with in
    /// the space, its energy for each square of its length: it is then missed by about a percent, as a stroke of
    /// strength 1 is, in spaces of all dimensions.
    #[cfg_attr(feature = "schema", schema(minimum = 0.0))]
    pub weight: Option<f64>,
    /// Whether the field itself is wanted: of length 1 everywhere, not of the space, with exactly these singularities,
    /// on each component turned to fit the strokes there, or where there are none the alignment. Coefficients and
    /// energies are those of the design that stays close to it.
    #[serde(default)]
    pub exact: bool,
}

/// A vertex at which a field is singular.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SingularVertex {
    /// The vertex.
    pub vertex: u32,
    /// The index: a multiple of 1/n for n-fields, of 1/2 for tensor fields.
    pub index: f64,
}

/// The strength of a stroke that does not say.
const STRENGTH: f64 = 1.0;

impl Stroke {
    /// Refuses what a line of points does not take: it has its places and directions from the points.
    fn along_points(&self, place: &str) -> Result<(), DesignFault> {
        let others = [
            ("face", self.face.is_some()),
            ("point", self.point.is_some()),
            ("direction", self.direction.is_some()),
            ("frame_direction", self.frame_direction.is_some()),
            ("tensor", self.tensor.is_some()),
        ];
        match others.into_iter().find(|other| other.1) {
            Some((name, _)) => {
                let reason =
                    format!("{name} cannot be given with points, which already define the line and its direction");
                Err(refused("points", place, reason))
            }
            None => Ok(()),
        }
    }
}

/// A refusal that names a member of the request.
pub fn refused(within: &'static str, place: &str, reason: impl std::fmt::Display) -> DesignFault {
    DesignFault::Request { within, place: place.to_owned(), reason: reason.to_string(), face: None }
}

/// The same, about a face.
pub(super) fn refused_at(face: u32, within: &'static str, place: &str, reason: impl std::fmt::Display) -> DesignFault {
    DesignFault::Request { within, place: place.to_owned(), reason: reason.to_string(), face: Some(face) }
}

fn weight_fits(weight: f64, place: &str) -> Result<(), DesignFault> {
    if (0.0..=MOST_WEIGHT).contains(&weight) {
        return Ok(());
    }
    Err(refused("weight", place, format!("must be a number from 0 to 1e12, not {weight:e}")))
}

impl DesignRequest {
    /// Whether all fields of a surface are needed to answer it; `factored` says whether there is room for its factors.
    pub fn needs_full_space(&self, factored: bool) -> bool {
        self.error || self.is_of_surface(factored)
    }

    /// Whether it is one of all fields of a surface that is wanted.
    pub fn is_of_surface(&self, factored: bool) -> bool {
        let fits = || factored && self.singularities.is_none() && !self.weights.full_biharmonic();
        self.must_be_of_surface() || (self.space == DesignSpace::Auto && fits())
    }

    /// Whether no field of the space of the basis will do in its place.
    pub fn must_be_of_surface(&self) -> bool {
        self.refine.is_some() || self.space == DesignSpace::Surface
    }

    /// Refuses what an answer that is made of the whole field has no place for; `place` is where the request stands.
    ///
    /// # Errors
    /// [`DesignFault`] names the member.
    pub fn of_all_faces(&self, place: &str) -> Result<(), DesignFault> {
        let given = [("faces", self.faces.is_some()), ("error", self.error)];
        match given.into_iter().find(|one| one.1) {
            Some((name, _)) => Err(refused(
                name,
                &format!("{place}.{name}"),
                "can be given only where the designed field itself is the answer",
            )),
            None => Ok(()),
        }
    }

    /// Checks what no surface is needed for.
    ///
    /// # Errors
    /// [`DesignFault`] names the member that does not fit.
    pub fn check(&self) -> Result<(), DesignFault> {
        if self.singularities.as_ref().is_some_and(|wanted| wanted.exact) && !self.constraints.is_empty() {
            let reason =
                "a field of length 1 that is turned as a whole cannot meet directions exactly; use strokes instead";
            return Err(refused("singularities", "constraints", reason));
        }
        if self.refine.is_some() && self.space == DesignSpace::Basis {
            let reason = "a refined field is a field of the whole surface, not of the space of the basis; leave out one of the two";
            return Err(refused("refine", "refine", reason));
        }
        if self.singularities.is_some() && (self.error || self.must_be_of_surface()) {
            let place = match (self.error, self.refine) {
                (true, _) => "error",
                (false, Some(_)) => "refine",
                (false, None) => "space",
            };
            let reason = "a design with prescribed singularities does not minimise the energy, so that its error cannot be measured";
            return Err(refused("refine", place, reason));
        }
        self.faces.iter().try_for_each(FacesRequest::check_count)?;
        self.refine.map_or(Ok(()), FullSpace::check_tolerance)?;
        weight_fits(self.weights.harmonic, "weights.harmonic")?;
        self.weights.biharmonic.iter().try_for_each(|&weight| weight_fits(weight, "weights.biharmonic"))?;
        for (at, strength) in self.strokes.iter().enumerate().filter_map(|(at, stroke)| Some((at, stroke.strength?))) {
            // Negative ones are told with their face.
            weight_fits(strength.max(0.0), &format!("strokes[{at}].strength"))?;
        }
        self.alignment.iter().try_for_each(|wanted| weight_fits(wanted.weight, "alignment.weight"))?;
        let singular = self.singularities.iter().filter_map(|wanted| wanted.weight);
        singular.into_iter().try_for_each(|weight| weight_fits(weight, "singularities.weight"))
    }

    /// All constraints, soft ones first.
    ///
    /// # Errors
    /// [`DesignFault`] names the stroke or constraint that does not fit.
    pub fn resolve(&self, surface: &Surface, kind: FieldKind) -> Result<Vec<Constraint>, DesignFault> {
        self.faces.iter().try_for_each(|wanted| wanted.check_faces(surface.surface.faces()))?;
        let mut found = Vec::new();
        for (at, stroke) in self.strokes.iter().enumerate() {
            let place = format!("strokes[{at}]");
            let strength = stroke.strength.unwrap_or(STRENGTH);
            if !(strength > 0.0 && strength.is_finite()) {
                return Err(refused("weight", &place, format!("the strength {strength} is not a positive number")));
            }
            let hold = Hold::Strength(strength);
            let value = GivenValue {
                direction: stroke.direction,
                frame_direction: stroke.frame_direction,
                values: stroke.values,
                tensor: stroke.tensor,
            };
            match &stroke.points {
                None => {
                    let face = face(surface, stroke.face, stroke.point, &place)?;
                    let value = value.stored(surface, kind, face, &place)?;
                    found.push(Constraint { face, value, hold });
                }
                Some(points) => {
                    stroke.along_points(&place)?;
                    line(surface, kind, (points, value.values), hold, &place, &mut found)?;
                }
            }
            if found.len() > MOST_CONSTRAINTS {
                return Err(too_many());
            }
        }
        for (at, pin) in self.constraints.iter().enumerate() {
            let place = format!("constraints[{at}]");
            let value = GivenValue {
                direction: pin.direction,
                frame_direction: pin.frame_direction,
                values: pin.values,
                tensor: pin.tensor,
            };
            let face = face(surface, pin.face, pin.point, &place)?;
            found.push(Constraint { face, value: value.stored(surface, kind, face, &place)?, hold: Hold::Exact });
        }
        if found.len() > MOST_CONSTRAINTS { Err(too_many()) } else { Ok(found) }
    }
}

fn too_many() -> DesignFault {
    let reason = format!("there are more than {MOST_CONSTRAINTS} of them together, counting each face under a line");
    refused("constraints", "strokes and constraints", reason)
}

fn face(surface: &Surface, face: Option<u32>, point: Option<[f64; 3]>, place: &str) -> Result<u32, DesignFault> {
    let faces = surface.surface.faces();
    match (face, point) {
        (Some(face), None) if (face as usize) < faces => Ok(face),
        (Some(face), None) => {
            Err(refused_at(face, "face", place, format!("there is no face {face}; the mesh has {faces}")))
        }
        (None, Some(point)) => nearest(surface, point, place),
        (Some(_), Some(_)) => Err(refused("face", place, "give either a face or a point, not both")),
        (None, None) => Err(refused("face", place, "a face or a point is missing")),
    }
}

fn nearest(surface: &Surface, point: [f64; 3], place: &str) -> Result<u32, DesignFault> {
    let found = surface.tree.nearest(surface.surface.mesh(), point);
    let (face, distance) = found.ok_or_else(|| refused("face", place, "the point is not finite"))?;
    if distance > surface.reach {
        let reason = format!(
            "the point {point:?} is {distance:.3} from the surface, further than the surface is long ({:.3})",
            surface.reach
        );
        return Err(refused_at(face, "face", place, reason));
    }
    Ok(face)
}

/// A line of points: each face once, with the direction of the piece that comes to it or leaves it.
fn line(
    surface: &Surface,
    kind: FieldKind,
    (points, values): (&[[f64; 3]], Option<[f64; 2]>),
    hold: Hold,
    place: &str,
    found: &mut Vec<Constraint>,
) -> Result<(), DesignFault> {
    if points.len() < 2 || points.len() > MOST_CONSTRAINTS {
        let reason = format!("a line must have 2 to {MOST_CONSTRAINTS} points, not {}", points.len());
        return Err(refused("points", place, reason));
    }
    let begin = found.len();
    for (at, &point) in points.iter().enumerate() {
        let face = nearest(surface, point, place)?;
        if found[begin..].iter().any(|c| c.face == face) {
            continue;
        }
        let (from, to) = (points[at.saturating_sub(1)], points[(at + 1).min(points.len() - 1)]);
        let along = [0, 1, 2].map(|i| to[i] - from[i]);
        let length = along.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(length > 0.0) {
            continue;
        }
        let value = GivenValue { direction: Some(along.map(|x| x / length)), values, ..GivenValue::default() };
        // A piece that goes straight into the surface says nothing there.
        if let Ok(value) = value.stored(surface, kind, face, place) {
            found.push(Constraint { face, value, hold });
        }
    }
    if found.len() == begin {
        return Err(refused("direction", place, "no piece of the line runs along the surface"));
    }
    Ok(())
}
