//! Design of tangential fields in a stored space of them, and what is made of designed fields.
//!
//! | file | what |
//! |---|---|
//! | `request` | what a design is asked for with, and the constraints that it means |
//! | `target` | the field that an alignment draws it to |
//! | `setting` | from a request to coefficients, in steps |
//! | `forms` | stored numbers as a user reads them |
//! | `drawing` | fur and hatchings |
//! | `fault` | why not |

mod drawing;
mod fault;
mod forms;
mod request;
mod setting;
mod target;

pub use drawing::{CameraRequest, FieldSource, FurRequest, HatchingAnswer, HatchingRequest, Line};
pub use fault::DesignFault;
pub use forms::{Form, written};
pub(crate) use request::refused;
pub use request::{
    AlignmentRequest, BiharmonicEnergy, DesignRequest, MOST_CONSTRAINTS, NamedTarget, NamedWeights, PerFace, Pin,
    SingularVertex, SingularitiesRequest, Stroke, Target, Weights,
};
pub use setting::{Designed, ExactField, Goal, Setting, Surface, numerators};
