//! What is made of designed fields: fur and hatchings.

use chladni_base::Monitor;
use chladni_spectral::field::{Camera, HatchingParameters, Strand, Streamline, fur, streamlines, svg, tensor_deviator};
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::request::{DesignRequest, refused};
use super::{DesignFault, Setting};

/// Which field: exactly one of the three.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", try_from = "Sources")]
pub enum FieldSource {
    /// A field that is designed now.
    Design(Box<DesignRequest>),
    /// Coefficients that a design gave.
    Coefficients(Vec<f32>),
    /// An approximate eigenfield, counted from 0.
    Eigenfield(usize),
}

/// The members that a source may have.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sources {
    design: Option<DesignRequest>,
    coefficients: Option<Vec<f32>>,
    eigenfield: Option<usize>,
}

impl TryFrom<Sources> for FieldSource {
    type Error = &'static str;

    fn try_from(sources: Sources) -> Result<Self, Self::Error> {
        match (sources.design, sources.coefficients, sources.eigenfield) {
            (Some(design), None, None) => Ok(Self::Design(Box::new(design))),
            (None, Some(coefficients), None) => Ok(Self::Coefficients(coefficients)),
            (None, None, Some(eigenfield)) => Ok(Self::Eigenfield(eigenfield)),
            (None, None, None) => Err("a field is given by one of design, coefficients and eigenfield"),
            _ => Err("a field is given by one of design, coefficients and eigenfield, not by several"),
        }
    }
}

impl FieldSource {
    /// The coefficients that are given, or those of an eigenfield; `None` where a field is to be designed.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what does not fit the basis.
    pub fn coefficients(&self, setting: &Setting) -> Result<Option<Vec<f32>>, DesignFault> {
        match self {
            Self::Design(_) => Ok(None),
            Self::Coefficients(given) => {
                let (found, wanted) = (given.len(), setting.fields.dimension());
                if found != wanted || !given.iter().all(|x| x.is_finite()) {
                    let reason = format!("{found} numbers are given; {wanted} finite ones are needed");
                    return Err(refused("coefficients", "field.coefficients", reason));
                }
                Ok(Some(given.clone()))
            }
            Self::Eigenfield(k) => {
                let model = setting.model();
                if *k >= model.dimension() {
                    let reason = format!("there is no eigenfield {k}; the basis has {}", model.dimension());
                    return Err(refused("eigenfield", "field.eigenfield", reason));
                }
                Ok(Some(model.eigenfield(*k)))
            }
        }
    }

    /// The stored numbers of all faces, for who keeps nothing between requests.
    ///
    /// # Errors
    /// [`DesignFault`].
    pub fn lifted(&self, setting: &Setting, monitor: &dyn Monitor) -> Result<Vec<f32>, DesignFault> {
        match (self, self.coefficients(setting)?) {
            (_, Some(coefficients)) => setting.lift(&coefficients),
            (Self::Design(request), None) => setting.lifted(&setting.design(request, monitor)?),
            (_, None) => setting.lift(&[]),
        }
    }
}

/// A coat of fur: one strand for each face.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct FurRequest {
    /// `{"design": …}`, `{"coefficients": […]}` or `{"eigenfield": k}`.
    pub field: FieldSource,
    /// The length of strands in the units of the mesh.
    pub length: f64,
    /// A factor of the length for each face.
    #[serde(default)]
    pub lengths: Option<Vec<f32>>,
    /// How far strands lean at most, in radians from the normal.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub tilt: f64,
    /// The length of the field at which strands lean that far.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub full: f64,
}

fn one() -> f64 {
    1.0
}

impl FurRequest {
    /// Checks the request against a basis.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what does not fit.
    pub fn check(&self, setting: &Setting) -> Result<(), DesignFault> {
        if !matches!(setting.kind(), FieldKind::Vector {} | FieldKind::NVector { n: 1 }) {
            return Err(refused("fur", "field", "fur needs a basis of vector fields"));
        }
        let faces = setting.surface.surface.faces();
        match self.lengths.as_ref().map(Vec::len).filter(|&found| found != faces) {
            Some(found) => Err(refused("fur", "lengths", format!("{found} factors are given for {faces} faces"))),
            None => Ok(()),
        }
    }

    /// The strands of a lifted field, one for each face.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what is no number.
    pub fn strands(&self, setting: &Setting, field: &[f32]) -> Result<Vec<Strand>, DesignFault> {
        let strands = fur(&setting.surface.surface, field, self.length, self.tilt, self.full);
        let mut strands = strands
            .ok_or_else(|| refused("fur", "length, tilt, full", "must be finite numbers, and full greater than 0"))?;
        for (strand, &factor) in strands.iter_mut().zip(self.lengths.iter().flatten()) {
            strand.tip = strand.tip.map(|x| x * f64::from(factor));
        }
        Ok(strands)
    }
}

/// How lines are laid and drawn.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct HatchingRequest {
    /// `{"design": …}`, `{"coefficients": […]}` or `{"eigenfield": k}`.
    pub field: FieldSource,
    /// The distance between lines, in units of the square root of the surface's area.
    #[cfg_attr(feature = "schema", schema(default = 0.01))]
    pub spacing: Option<f64>,
    /// Shorter lines are left out, in multiples of the spacing.
    #[cfg_attr(feature = "schema", schema(default = 2.0))]
    pub least_length: Option<f64>,
    /// Lines at most.
    #[cfg_attr(feature = "schema", schema(default = 100_000))]
    pub most_lines: Option<usize>,
    /// Where an SVG is seen from; needed for one.
    #[serde(default)]
    pub camera: Option<CameraRequest>,
    /// The width of lines of an SVG.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub stroke: f64,
}

/// Where a drawing is seen from, in the units of the mesh.
#[derive(Debug, Clone, Copy, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CameraRequest {
    /// The eye.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub eye: [f64; 3],
    /// What it looks at.
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub target: [f64; 3],
    /// What is up in the drawing.
    #[serde(default = "upwards")]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub up: [f64; 3],
    /// The vertical angle of view in degrees.
    #[serde(default = "thirty")]
    #[cfg_attr(feature = "schema", schema(default = 30.0))]
    pub angle: f64,
    /// Width of the drawing.
    pub width: u32,
    /// Height of the drawing.
    pub height: u32,
}

fn upwards() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn thirty() -> f64 {
    30.0
}

/// A hatching.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"lines": [{"points": [[0.1, 0.2, 0.3], [0.11, 0.2, 0.3]], "faces": [17]}]})))]
pub struct HatchingAnswer {
    /// The lines, in the order in which they were laid.
    pub lines: Vec<Line>,
}

/// A line on the surface.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Line {
    /// Its points in the units of the mesh: one for each edge that it crosses, and its ends.
    pub points: Vec<[f64; 3]>,
    /// The face that each piece lies in: one fewer than points.
    pub faces: Vec<u32>,
}

impl From<Streamline> for Line {
    fn from(line: Streamline) -> Self {
        Self { points: line.points, faces: line.faces }
    }
}

impl HatchingRequest {
    /// Lays lines along a lifted field.
    ///
    /// # Errors
    /// [`DesignFault::Lines`] names the parameter; [`DesignFault::Cancelled`] where the monitor ends it.
    pub fn lines(
        &self,
        setting: &Setting,
        field: Vec<f32>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Streamline>, DesignFault> {
        let usual = HatchingParameters::default();
        let parameters = HatchingParameters {
            spacing: self.spacing.unwrap_or(usual.spacing),
            least_length: self.least_length.unwrap_or(usual.least_length),
            most_lines: self.most_lines.unwrap_or(usual.most_lines),
        };
        let (n, field) = match setting.kind() {
            FieldKind::Tensor {} => (2, deviators(&field)),
            kind => (kind.order(), field),
        };
        Ok(streamlines(&setting.surface.surface, n, &field, &parameters, monitor)?)
    }

    /// Draws lines as an SVG.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where there is no camera, or it sees nothing.
    pub fn drawing(&self, setting: &Setting, lines: &[Streamline]) -> Result<String, DesignFault> {
        let camera = self.camera.ok_or_else(|| refused("camera", "camera", "is missing; an SVG needs one"))?;
        let CameraRequest { eye, target, up, angle, width, height } = camera;
        let camera = Camera { eye, target, up, angle, width, height };
        svg(setting.surface.surface.mesh(), lines, &camera, self.stroke)
            .ok_or_else(|| refused("camera", "camera", "looks nowhere, or its drawing has no size or is too large"))
    }
}

/// The 2-field of the eigendirections of tensors.
fn deviators(tensors: &[f32]) -> Vec<f32> {
    let deviator = |t: &[f32; 3]| tensor_deviator(t.map(f64::from)).map(|x| x as f32);
    tensors.as_chunks::<3>().0.iter().flat_map(deviator).collect()
}
