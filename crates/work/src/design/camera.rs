//! Where pictures are seen from.

use chladni_mesh::TriangleMesh;
use chladni_spectral::field::{Camera, MOST_PIXELS};
use serde::Deserialize;

use super::DesignFault;
use super::request::refused;

/// Where a picture is seen from, in the units of the mesh. Without `eye` it is fitted to the mesh, seen from a
/// direction.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CameraRequest {
    /// The eye; `target` belongs to it.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub eye: Option<[f64; 3]>,
    /// What the eye looks at.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub target: Option<[f64; 3]>,
    /// In place of `eye` and `target`: from the mesh to the eye, which is so far away that all of the mesh is seen.
    /// `[0.4, 0.3, 1]` where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub from: Option<[f64; 3]>,
    /// What is up in the picture: `[0, 1, 0]` where it is left out.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 3))]
    pub up: Option<[f64; 3]>,
    /// The vertical angle of view in degrees.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = 30.0))]
    pub angle: Option<f64>,
    /// Width of the picture.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = 900))]
    pub width: Option<u32>,
    /// Height of the picture.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = 900))]
    pub height: Option<u32>,
}

impl CameraRequest {
    /// The number of pixels.
    pub fn pixels(&self) -> u64 {
        u64::from(self.width.unwrap_or(900)) * u64::from(self.height.unwrap_or(900))
    }

    /// The camera; one that is fitted leaves `margin` around the mesh.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where an eye comes without a target, or with a direction.
    pub fn camera(&self, mesh: &TriangleMesh, margin: f64) -> Result<Camera, DesignFault> {
        let wrong = |reason| Err(refused("camera", "camera", reason));
        let frame = Camera {
            eye: [0.0; 3],
            target: [0.0; 3],
            up: self.up.unwrap_or([0.0, 1.0, 0.0]),
            angle: self.angle.unwrap_or(30.0),
            width: self.width.unwrap_or(900),
            height: self.height.unwrap_or(900),
        };
        match (self.eye, self.target, self.from) {
            (Some(eye), Some(target), None) => Ok(Camera { eye, target, ..frame }),
            (None, None, from) => {
                let from = from.unwrap_or([0.4, 0.3, 1.0]);
                let somewhere = from.iter().map(|x| x * x).sum::<f64>() > 0.0;
                if !(frame.angle > 0.0 && frame.angle < 180.0) {
                    return Err(sees_nothing(&frame));
                }
                if !somewhere {
                    return wrong("looks nowhere: the direction it is seen from is zero");
                }
                Ok(Camera::fitted(mesh, from, margin, frame))
            }
            _ => wrong("takes an eye with its target, or a direction from which the whole mesh is seen"),
        }
    }
}

/// Why no picture is drawn with a camera.
pub(super) fn sees_nothing(camera: &Camera) -> DesignFault {
    let (width, height) = (camera.width, camera.height);
    let reason = if width == 0 || height == 0 {
        format!("its picture of {width} × {height} pixels has no size")
    } else if width.max(height) > MOST_PIXELS {
        format!("its picture of {width} × {height} pixels is too large; {MOST_PIXELS} are the most either way")
    } else if !(camera.angle > 0.0 && camera.angle < 180.0) {
        format!("its angle is {}; it must be above 0 and below 180 degrees", camera.angle)
    } else {
        "looks nowhere: its eye is its target, up is along its view, or a number is not finite".to_owned()
    };
    refused("camera", "camera", reason)
}
