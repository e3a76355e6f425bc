//! Coats of fur along designed fields.

use chladni_base::Monitor;
use chladni_spectral::field::{
    Coat, CoatParameters, FieldMisfit, HairStyle, MOST_PAINTED, MOST_POINTS, MOST_STRAND_POINTS, Strand, fur, grow,
    paint,
};
use chladni_spectral::operator::transport::FieldKind;
use serde::Deserialize;

use super::camera::{CameraRequest, sees_nothing};
use super::request::refused;
use super::{DesignFault, FieldSource, Setting};

/// Strands of a picture where their number is not given.
const USUAL_STRANDS: usize = 200_000;

/// Bytes that a pixel of a picture takes while it is painted: up to nine samples with depth, face and colour.
const BYTES_PER_PIXEL: u64 = 9 * 24;

/// Bytes of the picture from the light.
const SHADOW_BYTES: u64 = 1536 * 1536 * 12;

/// Bytes that a point of a coat takes.
const BYTES_PER_POINT: u64 = 2 * 24;

/// A coat of fur: one straight strand for each face, or `strands` by area that bend.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct FurRequest {
    /// `{"design": …}`, `{"coefficients": […]}`, `{"eigenfield": k}` or `{"stored": id}`.
    pub field: FieldSource,
    /// The length of strands in the units of the mesh, above 0.
    pub length: f64,
    /// A factor of the length for each face, 0 or more.
    #[serde(default)]
    pub lengths: Option<Vec<f32>>,
    /// How far strands lean at most, in radians from the normal, up to π.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub tilt: f64,
    /// The length of the field at which strands lean that far, above 0.
    #[serde(default = "one")]
    #[cfg_attr(feature = "schema", schema(default = 1.0))]
    pub full: f64,
    /// So many strands, spread by area; in pictures 200,000 where it is left out. All that follows belongs to them.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 4_000_000))]
    pub strands: Option<usize>,
    /// Points of a strand, its root first: 8 where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = 2, maximum = 32))]
    pub points: Option<usize>,
    /// How much further strands lean at their tip than at their root, in radians: 0.5 where it is left out.
    #[serde(default)]
    pub bend: Option<f64>,
    /// How much they fall towards `down`, 0.15 where it is left out: 1 turns the tip of a strand that stands across as
    /// much downwards as it grows.
    #[serde(default)]
    pub gravity: Option<f64>,
    /// Downwards: `[0, -1, 0]` where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub down: Option<[f64; 3]>,
    /// How much strands differ, as a share of their length and of a radian: 0.15 where it is left out.
    #[serde(default)]
    pub noise: Option<f64>,
    /// How much tips gather in tufts, from 0 to 1: 0.35 where it is left out.
    #[serde(default)]
    pub clump: Option<f64>,
    /// The seed of places and differences: the same one gives the same coat.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Where a picture is seen from.
    #[serde(default)]
    pub camera: Option<CameraRequest>,
    /// How a picture looks.
    #[serde(default)]
    pub look: Option<HairRequest>,
}

/// How a picture of fur looks.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct HairRequest {
    /// Red, green and blue from 0 to 1.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub colour: Option<[f64; 3]>,
    /// Red, green and blue behind the fur: white where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub background: Option<[f64; 3]>,
    /// Towards the light: above the left shoulder of who looks where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub light: Option<[f64; 3]>,
    /// The width of strands at their root, in the units of the mesh: as much as covers the surface where it is left
    /// out.
    #[serde(default)]
    pub thickness: Option<f64>,
}

fn one() -> f64 {
    1.0
}

/// Fur grows on the outside.
fn outside(setting: &Setting) -> Result<(), DesignFault> {
    Ok(setting.surface.surface.sides("fur grows on one of two sides, which needs an oriented surface:")?)
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
        for (name, value) in [("length", self.length), ("full", self.full)] {
            within_reason(name, value)?;
            if !(value > 0.0) {
                return Err(refused("fur", name, format!("must be greater than 0, not {value}")));
            }
        }
        if !(0.0..=std::f64::consts::PI).contains(&self.tilt) {
            return Err(refused("fur", "tilt", format!("must be an angle from 0 to 3.14159, not {}", self.tilt)));
        }
        for &factor in self.lengths.iter().flatten() {
            within_reason("lengths", f64::from(factor))?;
            if !(factor >= 0.0) {
                return Err(refused("fur", "lengths", format!("must not have factors below 0, such as {factor}")));
            }
        }
        let faces = setting.surface.surface.faces();
        match self.lengths.as_ref().map(Vec::len).filter(|&found| found != faces) {
            Some(found) => Err(refused("fur", "lengths", format!("{found} factors are given for {faces} faces"))),
            None => Ok(()),
        }
    }

    /// Checks what numbers are wanted: what belongs to strands by area is not ignored where there are none.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member.
    pub fn check_numbers(&self) -> Result<(), DesignFault> {
        let given = [
            ("points", self.points.is_some()),
            ("bend", self.bend.is_some()),
            ("gravity", self.gravity.is_some()),
            ("down", self.down.is_some()),
            ("noise", self.noise.is_some()),
            ("clump", self.clump.is_some()),
            ("seed", self.seed.is_some()),
        ];
        match given.iter().find(|(_, given)| *given && self.strands.is_none()) {
            Some((name, _)) => Err(refused("fur", name, "belongs to strands by area, and strands is missing")),
            None => Ok(()),
        }
    }

    /// The strands of a lifted field, one for each face.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what is no number.
    pub fn strands(&self, setting: &Setting, field: &[f32]) -> Result<Vec<Strand>, DesignFault> {
        outside(setting)?;
        let strands = fur(&setting.surface.surface, field, self.length, self.tilt, self.full);
        let mut strands = strands.map_err(|misfit| match misfit {
            FieldMisfit::Strands => {
                refused("fur", "length, tilt, full", "must be finite numbers, and full greater than 0")
            }
            other => refused("fur", "field", other.to_string()),
        })?;
        for (strand, &factor) in strands.iter_mut().zip(self.lengths.iter().flatten()) {
            strand.tip = strand.tip.map(|x| x * f64::from(factor));
        }
        Ok(strands)
    }

    /// Strands by area along a lifted field.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what is out of range; [`DesignFault::Cancelled`].
    pub fn coat(&self, setting: &Setting, field: &[f32], monitor: &dyn Monitor) -> Result<Coat, DesignFault> {
        let parameters = CoatParameters {
            strands: self.strands.unwrap_or(USUAL_STRANDS),
            points: self.points.unwrap_or(8),
            length: self.length,
            tilt: self.tilt,
            full: self.full,
            bend: self.bend.unwrap_or(0.5),
            gravity: self.gravity.unwrap_or(0.15),
            down: self.down.unwrap_or([0.0, -1.0, 0.0]),
            noise: self.noise.unwrap_or(0.15),
            clump: self.clump.unwrap_or(0.35),
            seed: self.seed.unwrap_or(0),
        };
        self.check_coat(&parameters)?;
        outside(setting)?;
        let coat = grow(&setting.surface.surface, field, self.lengths.as_deref(), &parameters, monitor)?;
        coat.ok_or_else(|| refused("fur", "field", "has no length on this surface"))
    }

    fn check_coat(&self, p: &CoatParameters) -> Result<(), DesignFault> {
        let wrong = |name: &str, reason: String| Err(refused("fur", name, reason));
        for (name, value) in [("bend", p.bend), ("gravity", p.gravity)] {
            within_reason(name, value)?;
        }
        if !(p.full > 0.0) {
            return wrong("full", format!("must be greater than 0, not {}", p.full));
        }
        if !(0.0..=1.0).contains(&p.noise) {
            return wrong("noise", format!("must be from 0 to 1, not {}", p.noise));
        }
        if !(0.0..=1.0).contains(&p.clump) {
            return wrong("clump", format!("must be from 0 to 1, not {}", p.clump));
        }
        if !(p.down.iter().map(|x| x * x).sum::<f64>() > 0.0 && p.down.iter().all(|x| x.abs() <= 1e12)) {
            return wrong("down", "must be a direction".to_owned());
        }
        if !(2..=MOST_STRAND_POINTS).contains(&p.points) {
            return wrong("points", format!("must be from 2 to {MOST_STRAND_POINTS}, not {}", p.points));
        }
        let most = MOST_POINTS / p.points;
        if !(1..=most).contains(&p.strands) {
            return wrong(
                "strands",
                format!("must be from 1 to {most} for strands of {} points, not {}", p.points, p.strands),
            );
        }
        Ok(())
    }

    /// Bytes that a coat takes, and painting it where that is wanted.
    pub fn bytes(&self, painted: bool) -> u64 {
        let strands = self.strands.unwrap_or(USUAL_STRANDS) as u64;
        let points = strands.saturating_mul(self.points.unwrap_or(8) as u64).min(MOST_POINTS as u64);
        let pixels = self.camera.unwrap_or_default().pixels().min(MOST_PAINTED);
        BYTES_PER_POINT * points + if painted { BYTES_PER_PIXEL * pixels + SHADOW_BYTES } else { 0 }
    }

    /// A picture of a coat, as PNG.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where the camera sees nothing, or more than 4,194,304 pixels;
    /// [`DesignFault::Cancelled`].
    pub fn picture(&self, setting: &Setting, coat: &Coat, monitor: &dyn Monitor) -> Result<Vec<u8>, DesignFault> {
        let surface = &setting.surface.surface;
        let camera = self.camera.unwrap_or_default();
        if camera.pixels() > MOST_PAINTED {
            let reason = format!("has {} pixels; a picture of fur has at most {MOST_PAINTED}", camera.pixels());
            return Err(refused("camera", "camera", reason));
        }
        // Strands that lean stand out by less than their length.
        let camera = camera.camera(surface.mesh(), 0.5 * self.length.abs())?;
        let look = self.look.unwrap_or_default();
        let usual = HairStyle::default();
        let colours = [("look.colour", look.colour), ("look.background", look.background)];
        for (name, colour) in colours {
            if colour.is_some_and(|c| !c.iter().all(|x| (0.0..=1.0).contains(x))) {
                return Err(refused("fur", name, "must be three numbers from 0 to 1"));
            }
        }
        if look.thickness.is_some_and(|width| !(width > 0.0 && width.is_finite())) {
            return Err(refused("fur", "look.thickness", "must be greater than 0"));
        }
        let style = HairStyle {
            colour: look.colour.unwrap_or(usual.colour),
            background: look.background.unwrap_or(usual.background),
            light: direction("look.light", look.light)?,
            thickness: look.thickness,
        };
        paint(surface, coat, &camera, &style, monitor)?.ok_or_else(|| sees_nothing(&camera))
    }
}

/// Numbers that are beyond this are nobody's lengths and angles, and what is computed of them would overflow.
const MOST: f64 = 1e12;

fn within_reason(name: &str, value: f64) -> Result<(), DesignFault> {
    match value.abs() <= MOST {
        true => Ok(()),
        false => Err(refused("fur", name, format!("is {value}, which is beyond 1e12"))),
    }
}

/// A direction that is given has a length.
pub(super) fn direction(name: &str, given: Option<[f64; 3]>) -> Result<Option<[f64; 3]>, DesignFault> {
    let sound = |d: [f64; 3]| d.iter().map(|x| x * x).sum::<f64>() > 0.0 && d.iter().all(|x| x.abs() <= 1e12);
    match given {
        Some(d) if !sound(d) => Err(refused("light", name, "must be a direction")),
        other => Ok(other),
    }
}
