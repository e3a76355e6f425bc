//! Hatchings along designed fields.

use chladni_base::Monitor;
use chladni_spectral::field::{
    Camera, Drawing, HatchedLines, HatchingParameters, HatchingStyle, Streamline, Tone, hatch, streamlines,
    tensor_deviator,
};
use chladni_spectral::operator::frames::parts;
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::camera::{CameraRequest, sees_nothing};
use super::fur::direction;
use super::request::refused;
use super::{DesignFault, FieldSource, Setting};

/// Levels of lines in drawings with a tone.
const USUAL_LEVELS: u32 = 3;

/// The distance of the densest lines of a drawing in widths of the pen, where it is not given.
const WIDTHS_APART: f64 = 4.0;

/// Pixels of a PNG at most.
const MOST_PIXELS: u64 = 16_777_216;

/// Bytes of a pixel of a drawing: what the surface hides, finer than pixels where there are few of them.
const BYTES_PER_PIXEL: u64 = 8;

/// How lines are laid and drawn.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct HatchingRequest {
    /// `{"design": …}`, `{"coefficients": […]}`, `{"eigenfield": k}` or `{"stored": id}`.
    pub field: FieldSource,
    /// The distance between lines, in units of the square root of the surface's area: of lines 0.01 where it is left
    /// out, of drawings four widths of the pen.
    #[serde(default)]
    pub spacing: Option<f64>,
    /// Shorter lines are left out, in multiples of the spacing.
    #[cfg_attr(feature = "schema", schema(default = 2.0))]
    pub least_length: Option<f64>,
    /// Lines at most.
    #[cfg_attr(feature = "schema", schema(default = 100_000))]
    pub most_lines: Option<usize>,
    /// Levels of lines, each at half the distance of the one before, the last at the spacing: of drawings with a tone 3
    /// where it is left out, otherwise 1.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 6))]
    pub levels: Option<u32>,
    /// Where a drawing is seen from.
    #[serde(default)]
    pub camera: Option<CameraRequest>,
    /// The width of the pen in a drawing, in pixels.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub stroke: f64,
    /// Whether lines of a drawing swell where it is darker, or all have the width of the pen, for plotters.
    #[serde(default)]
    pub pen: Pen,
    /// How the light of a drawing becomes lines; `null` draws all of them everywhere.
    #[serde(default = "lit")]
    pub tone: Option<ToneRequest>,
    /// The width of silhouettes, creases and boundaries in a drawing, in widths of the pen; 0 leaves them out.
    #[serde(default = "outlined")]
    #[cfg_attr(feature = "schema", schema(default = 1.6))]
    pub outline: f64,
}

/// What a drawing is drawn with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Pen {
    /// Lines are wider where it is darker.
    #[default]
    Swelling,
    /// All lines have one width.
    Even,
}

/// How light becomes lines.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ToneRequest {
    /// Towards the light: above the left shoulder of who looks where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub light: Option<[f64; 3]>,
    /// The brightness, up to 1, from which on the paper stays white.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = 0.8))]
    pub highlight: Option<f64>,
    /// The darkness, from 0 to 1, from which on lines are crossed by those of another direction, of 2-fields and
    /// vectors by lines across them; 1 and more: never.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = 0.55))]
    pub cross: Option<f64>,
    /// Whether the surface throws shadows on itself.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = true))]
    pub shadows: Option<bool>,
}

fn one() -> f64 {
    1.0
}

fn outlined() -> f64 {
    1.6
}

fn lit() -> Option<ToneRequest> {
    Some(ToneRequest::default())
}

/// A hatching.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"lines": [{"points": [[0.1, 0.2, 0.3], [0.11, 0.2, 0.3]], "faces": [17], "level": 0}]})))]
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
    /// Its level, counted from 0.
    pub level: u32,
}

impl From<Streamline> for Line {
    fn from(line: Streamline) -> Self {
        Self { points: line.points, faces: line.faces, level: line.level }
    }
}

impl HatchingRequest {
    /// Lays lines along a lifted field. What belongs to drawings alone is checked as well: a request that no drawing is
    /// made of is wrong as it stands.
    ///
    /// # Errors
    /// As [`check`](Self::check), and that the camera sees nothing; [`DesignFault::Lines`] names the parameter;
    /// [`DesignFault::Cancelled`] where the monitor ends it.
    pub fn lines(
        &self,
        setting: &Setting,
        field: Vec<f32>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Streamline>, DesignFault> {
        self.check(false)?;
        self.seen_from(setting)?;
        let (n, field) = directions(setting, field);
        let parameters = self.parameters(HatchingParameters::default());
        Ok(streamlines(&setting.surface.surface, n, &field, &parameters, monitor)?)
    }

    /// What is asked for, and the usual where nothing is.
    fn parameters(&self, usual: HatchingParameters) -> HatchingParameters {
        HatchingParameters {
            spacing: self.spacing.unwrap_or(usual.spacing),
            least_length: self.least_length.unwrap_or(usual.least_length),
            most_lines: self.most_lines.unwrap_or(usual.most_lines),
            levels: self.levels.unwrap_or(usual.levels),
        }
    }

    /// The camera of a drawing.
    fn seen_from(&self, setting: &Setting) -> Result<Camera, DesignFault> {
        let camera = self.camera.unwrap_or_default().camera(setting.surface.surface.mesh(), 0.0)?;
        if camera.is_sound() { Ok(camera) } else { Err(sees_nothing(&camera)) }
    }

    /// Checks what belongs to drawings.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member.
    pub fn check(&self, png: bool) -> Result<(), DesignFault> {
        let wrong = |name: &str, reason: String| Err(refused("hatching", name, reason));
        if !(self.stroke > 0.0 && self.stroke <= 100.0) {
            return wrong("stroke", format!("must be greater than 0 and at most 100, not {}", self.stroke));
        }
        if !(0.0..=100.0).contains(&self.outline) {
            return wrong("outline", format!("must be from 0 to 100, not {}", self.outline));
        }
        let tone = self.tone.unwrap_or_default();
        if tone.highlight.is_some_and(|x| !(x > 0.0 && x <= 1.0)) {
            return wrong("tone.highlight", "must be greater than 0 and at most 1".to_owned());
        }
        if tone.cross.is_some_and(|x| !(x >= 0.0 && x.is_finite())) {
            return wrong("tone.cross", "must be a number of at least 0".to_owned());
        }
        direction("tone.light", tone.light)?;
        let pixels = self.camera.unwrap_or_default().pixels();
        if png && pixels > MOST_PIXELS {
            let reason = format!("has {pixels} pixels; a PNG has at most {MOST_PIXELS}");
            return Err(refused("camera", "camera", reason));
        }
        Ok(())
    }

    /// Bytes that a drawing takes while it is made.
    pub fn bytes(&self) -> u64 {
        4 * BYTES_PER_PIXEL * self.camera.unwrap_or_default().pixels()
    }

    /// Lays lines along a lifted field, and draws them as a camera sees them; beside the drawing the number of lines.
    ///
    /// # Errors
    /// As [`check`](Self::check) and [`lines`](Self::lines); [`DesignFault::Request`] where the camera sees nothing.
    pub fn drawing(
        &self,
        setting: &Setting,
        field: Vec<f32>,
        monitor: &dyn Monitor,
    ) -> Result<(Drawing, usize), DesignFault> {
        self.check(false)?;
        let surface = &setting.surface.surface;
        surface.sides("a drawing has light and outlines, which need an oriented surface (lines as JSON do not):")?;
        let camera = self.seen_from(setting)?;
        let paper = Paper { camera: &camera, stroke: self.stroke, area: surface.frames().area() };
        let levels = if self.tone.is_some() { USUAL_LEVELS } else { 1 };
        let spacing = paper.spacing();
        let parameters = self.parameters(HatchingParameters { spacing, levels, ..HatchingParameters::default() });
        let (n, field) = directions(setting, field);
        let tone = self.tone.map(|wanted| {
            let usual = Tone::default();
            Tone {
                light: wanted.light,
                highlight: wanted.highlight.unwrap_or(usual.highlight),
                cross: wanted.cross.unwrap_or(usual.cross),
                shadows: wanted.shadows.unwrap_or(usual.shadows),
            }
        });
        let lines = streamlines(surface, n, &field, &parameters, monitor)?;
        let crossed = n <= 2 && tone.is_some_and(|tone| tone.cross < 1.0);
        let crossing = match crossed {
            true => streamlines(surface, n, &across(n, &field), &parameters, monitor)?,
            false => Vec::new(),
        };
        let kinds = if n.is_multiple_of(2) { n / 2 } else { n };
        let hatched = HatchedLines { lines: &lines, kinds, crossing: &crossing, levels: parameters.levels };
        let style =
            HatchingStyle { stroke: self.stroke, swelling: self.pen == Pen::Swelling, tone, outline: self.outline };
        let drawing = hatch(surface, hatched, &camera, &style, monitor)?.ok_or_else(|| sees_nothing(&camera))?;
        Ok((drawing, lines.len() + crossing.len()))
    }
}

/// What a drawing is on, and how large the surface is in it.
struct Paper<'a> {
    camera: &'a Camera,
    stroke: f64,
    area: f64,
}

impl Paper<'_> {
    /// The usual distance of lines where the camera looks, in units of the root of the area.
    fn spacing(&self) -> f64 {
        let c = self.camera;
        let depth = (0..3).map(|i| (c.target[i] - c.eye[i]).powi(2)).sum::<f64>().sqrt();
        let pixel = 2.0 * depth * (0.5 * c.angle.to_radians()).tan() / f64::from(c.height.max(1));
        let wanted = WIDTHS_APART * self.stroke * pixel / self.area.sqrt();
        if wanted.is_finite() { wanted.clamp(5e-4, 1.0) } else { 0.01 }
    }
}

/// The n-field that lines follow: of tensors that of the eigendirections.
fn directions(setting: &Setting, field: Vec<f32>) -> (u32, Vec<f32>) {
    match setting.kind() {
        FieldKind::Tensor {} => (2, deviators(&field)),
        kind => (kind.order(), field),
    }
}

/// The 2-field of the eigendirections of tensors.
fn deviators(tensors: &[f32]) -> Vec<f32> {
    let deviator = |t: &[f32; 3]| parts(tensor_deviator(t.map(f64::from))).map(|x| x as f32);
    tensors.as_chunks::<3>().0.iter().flat_map(deviator).collect()
}

/// A 1-field or 2-field turned by a right angle.
fn across(n: u32, field: &[f32]) -> Vec<f32> {
    let turned = |z: &[f32; 2]| if n == 1 { [-z[1], z[0]] } else { [-z[0], -z[1]] };
    field.as_chunks::<2>().0.iter().flat_map(turned).collect()
}
