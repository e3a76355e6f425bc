//! The value that a stroke or a pin gives: a direction in space or in the frame of its face, or a tensor.

use chladni_spectral::field::direction_in_frame;
use chladni_spectral::operator::frames::{complex, power};
use chladni_spectral::operator::transport::FieldKind;

use super::request::{refused, refused_at};
use super::{DesignFault, Surface};

/// Lengths of values beyond these are not told from zero, or from infinity, in single precision.
const LEAST_LENGTH: f64 = 1e-12;
const MOST_LENGTH: f64 = 1e12;

/// The value that a stroke or a pin gives.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GivenValue {
    pub direction: Option<[f64; 3]>,
    pub frame_direction: Option<[f64; 2]>,
    pub values: Option<[f64; 2]>,
    pub tensor: Option<[f64; 3]>,
}

impl GivenValue {
    /// The numbers to store in a face.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member that does not fit.
    pub fn stored(self, surface: &Surface, kind: FieldKind, face: u32, place: &str) -> Result<[f64; 3], DesignFault> {
        let given = self.direction.into_iter().flatten().chain(self.frame_direction.into_iter().flatten());
        if let Some(number) = given.into_iter().find(|x| !(x.abs() <= MOST_LENGTH)) {
            let reason = format!("the number {number:e} of the direction on face {face} is beyond {MOST_LENGTH:e}");
            return Err(refused_at(face, "value", place, reason));
        }
        let stored = self.converted(surface, kind, face, place)?;
        let length = stored.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Fields are single numbers, and energies squares of them.
        let told = !(length > 0.0) || (LEAST_LENGTH..=MOST_LENGTH).contains(&length);
        if length.is_finite() && told {
            return Ok(stored);
        }
        let reason = format!(
            "the length {length:e} of the value on face {face} is not between {LEAST_LENGTH:e} and {MOST_LENGTH:e}"
        );
        Err(refused_at(face, "value", place, reason))
    }

    fn converted(self, surface: &Surface, kind: FieldKind, face: u32, place: &str) -> Result<[f64; 3], DesignFault> {
        let no_direction =
            |why: &str| refused_at(face, "direction", place, format!("the direction on face {face} {why}"));
        let frames = surface.surface.frames();
        if kind == (FieldKind::Tensor {}) {
            let [a, b, c] = match (self.tensor, self.direction, self.frame_direction, self.values) {
                (Some(tensor), None, None, None) => tensor,
                (None, Some(direction), None, Some(values)) => {
                    let planar = direction_in_frame(FieldKind::Vector {}, frames, face as usize, direction);
                    let [x, y, _] = planar.ok_or_else(|| no_direction("has no part in the plane of the face"))?;
                    along(values, [x, y])
                }
                (None, None, Some(planar), Some(values)) if planar[0].hypot(planar[1]) > 0.0 => along(values, planar),
                (None, None, Some(_), Some(_)) => return Err(no_direction("is zero")),
                _ => {
                    let reason = "a tensor is given by tensor, or by values with a direction or a frame_direction";
                    return Err(refused("value", place, reason));
                }
            };
            let stored = [a, b, std::f64::consts::SQRT_2 * c];
            return if stored.iter().all(|x| x.is_finite()) { Ok(stored) } else { Err(no_direction("is not finite")) };
        }
        if self.tensor.is_some() || self.values.is_some() {
            return Err(refused("value", place, "tensor and values belong to bases of tensor fields"));
        }
        match (self.direction, self.frame_direction) {
            (Some(direction), None) => {
                if direction == [0.0; 3] {
                    return Err(no_direction("is zero"));
                }
                direction_in_frame(kind, frames, face as usize, direction)
                    .ok_or_else(|| no_direction("has no part in the plane of the face"))
            }
            (None, Some([x, y])) => {
                let length = x.hypot(y);
                if !(length > 0.0 && length.is_finite()) {
                    return Err(no_direction("is zero or not finite"));
                }
                let unit = power(complex([x / length, y / length]), kind.order());
                Ok([length * unit.re, length * unit.im, 0.0])
            }
            (Some(_), Some(_)) => {
                Err(refused("value", place, "give either a direction or a frame_direction, not both"))
            }
            (None, None) => Err(refused("value", place, "a direction or a frame_direction is missing")),
        }
    }
}

/// The tensor with given eigenvalues along a direction and across it.
fn along(values: [f64; 2], [x, y]: [f64; 2]) -> [f64; 3] {
    let square = x * x + y * y;
    let (xx, yy, xy) = (x * x / square, y * y / square, x * y / square);
    [values[0] * xx + values[1] * yy, values[0] * yy + values[1] * xx, (values[0] - values[1]) * xy]
}
