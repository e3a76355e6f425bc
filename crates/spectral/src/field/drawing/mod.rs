//! Pictures of what fields are good for: hatchings in ink, and fur, drawn in software.
//!
//! | file | what |
//! |---|---|
//! | `camera` | where a picture is seen from |
//! | `screen` | depth and face of the surface at every pixel, and what hides what |
//! | `light` | normals, brightness and shadows |
//! | `outward` | which side of a surface is its outside |
//! | `outline` | silhouettes, creases and boundaries as chains of pieces |
//! | `hatching` | which parts of lines are drawn, and how wide |
//! | `ink` | strokes as SVG and as pixels |
//! | `coat` | strands of fur and their shape |
//! | `hair` | strands as pixels, and their light |
//! | `strand` | one strand in a part of a picture |
//! | `png` | the file format |

mod camera;
mod coat;
mod hair;
mod hatching;
mod ink;
mod light;
mod outline;
mod outward;
mod png;
mod screen;
mod strand;

use chladni_base::Vector3;

pub use self::png::png;
pub use camera::{Camera, MOST_PIXELS};
pub use coat::{Coat, CoatParameters, MOST_POINTS, MOST_STRAND_POINTS, grow};
pub use hair::{HairStyle, MOST_PAINTED, paint};
pub use hatching::{HatchedLines, HatchingStyle, Tone, hatch};
pub use ink::Drawing;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    Vector3(a).dot(Vector3(b))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    Vector3(a).cross(Vector3(b)).into()
}

/// Along the first axis where there is no length.
fn unit_vector(a: [f64; 3]) -> [f64; 3] {
    crate::operator::frames::unit_vector(a.into()).into()
}
pub(super) use outward::outward;
