//! Tangential fields in small spaces: locally supported bases and design (chapter 3 of the thesis).

mod basis;
mod heat;
mod hierarchy;
mod smooth;
mod space;

pub use basis::{Construction, FieldBasis, FieldError, FieldParameters, FieldSurface, field_basis};
pub use heat::FieldHeat;
pub use space::{FieldSpace, SpaceError};
