//! Design of tangential fields in a stored space of them, and what is made of designed fields.
//!
//! | file | what |
//! |---|---|
//! | `request` | what a design is asked for with, and the constraints that it means |
//! | `given_value` | the value that a stroke or a pin gives |
//! | `faces` | the faces that its answer is about |
//! | `target` | the field that an alignment draws it to |
//! | `stored` | fields that a server keeps, named by their ids |
//! | `goal` | what a design is drawn to as a whole |
//! | `setting` | from a request to coefficients, in steps |
//! | `forms` | stored numbers as a user reads them |
//! | `matching` | fields that turn by more than half a turn between two faces |
//! | `own_surface` | whether a surface is the one that a basis of a file lives on |
//! | `source` | the field that fur or a hatching is made of |
//! | `fur`, `hatching` | both, as numbers and as pictures |
//! | `camera` | where pictures are seen from |
//! | `transport` | vectors that are carried over a surface |
//! | `quads` | cross fields that follow creases, and parametrisations along them |
//! | `decomposition` | the Hodge decomposition of a field that is given |
//! | `eigenfields` | the lowest fields of the space |
//! | `fault` | why not |

mod camera;
mod decomposition;
mod eigenfields;
mod faces;
mod fault;
mod forms;
mod fur;
mod given_value;
mod goal;
mod hatching;
mod matching;
#[cfg(test)]
mod matching_tests;
mod own_surface;
mod quads;
mod request;
mod setting;
mod source;
mod stored;
mod target;
mod transport;

pub use camera::CameraRequest;
pub use decomposition::{DecompositionAnswer, DecompositionRequest};
pub use eigenfields::{Eigenfield, EigenfieldFault, Eigenfields, MOST_REFINED};
pub use faces::{FaceSample, FacesRequest, MOST_SAMPLED};
pub use fault::DesignFault;
pub use forms::{Form, written, written_at};
pub use fur::{FurRequest, HairRequest};
pub use goal::{ExactGoal, Goal};
pub use hatching::{HatchingAnswer, HatchingRequest, Line, Pen, ToneRequest};
pub use matching::{CrossTable, Crosses, Lifted, MatchedFaces};
pub use own_surface::{StrangeSurface, check_own_surface};
pub use quads::{
    BasisField, CrossRequest, CrossSource, CutEdge, Quads, QuadsAnswer, QuadsFormat, QuadsRequest, SplitFace,
    SplitSurface,
};
pub(crate) use request::refused;
pub use request::{
    AlignmentRequest, BiharmonicEnergy, DesignRequest, DesignSpace, MOST_CONSTRAINTS, NamedTarget, NamedWeights,
    PerFace, Pin, SingularVertex, SingularitiesRequest, Stroke, Target, Weights,
};
pub use setting::{Designed, ExactField, Setting, Surface, numerators};
pub use source::FieldSource;
pub use stored::{FieldContent, FieldTable, ReferencedFields, StoredField};
pub use transport::{TransportRequest, carried};
