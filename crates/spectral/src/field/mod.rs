//! Tangential fields in small spaces: locally supported bases and design (chapter 3 of the thesis).

mod adaptive;
mod alignment;
mod basis;
#[cfg(test)]
mod bounded_tests;
mod column_energies;
mod compliance;
mod constraints;
mod cover;
mod cycle;
mod decomposition;
mod design;
mod direct;
mod drawing;
mod eigenfields;
mod harmonic;
mod heat;
mod hierarchy;
mod idle;
mod idle_parts;
mod kernel;
#[cfg(test)]
mod kernel_tests;
mod least;
#[cfg(test)]
mod least_tests;
mod local;
mod loops;
mod many;
mod nearby;
#[cfg(test)]
mod one_sided_tests;
#[cfg(test)]
mod patch_tests;
mod pencil;
mod pencil_inverse;
mod poisson;
mod prescribed;
mod principal;
pub mod quad;
mod reading;
#[cfg(test)]
mod real_meshes;
mod refine;
mod refine_pulls;
mod refine_response;
#[cfg(test)]
mod refine_tests;
mod roots;
mod samples;
mod singularity;
mod slack;
mod smooth;
mod space;
mod streamline;
mod surface;
mod transport;
mod unity;
mod weighted;
mod whole;
mod windings;

pub use adaptive::adaptive_weights;
pub use alignment::{Alignment, Prescription};
pub use basis::{Construction, FieldError, FieldParameters, field_basis, full_biharmonic};
pub use column_energies::{ColumnEnergy, column_energies};
pub use decomposition::{HodgeDecomposition, HodgeParts};
pub use design::{BENDING, Constraint, Design, DesignError, DesignModel, EnergyWeights, Hold, MOST_DIMENSIONS};
pub use direct::{USUAL_ROOM, most_factored_faces};
pub use drawing::{
    Camera, Coat, CoatParameters, Drawing, HairStyle, HatchedLines, HatchingStyle, MOST_PAINTED, MOST_PIXELS,
    MOST_POINTS, MOST_STRAND_POINTS, Tone, grow, hatch, paint, png,
};
pub use eigenfields::{EigenfieldGoal, LowestFields, WholeField};
pub use harmonic::{HarmonicError, MOST_HARMONIC, harmonic_fields};
pub use heat::FieldHeat;
pub use idle_parts::FaceComponents;
pub use local::LocalEigenfields;
pub use poisson::PoissonError;
pub use prescribed::{Prescribed, PrescribedError, PrescribedField};
pub use principal::{DirectionField, Strand, curvature_tensors, fur, principal_directions};
pub use reading::{
    TensorAxes, direction_in_frame, representation, roots, tensor_axes, tensor_deviator, tensor_in_frame, to_world,
};
pub use refine::{FullSpace, RefineError, Refined};
pub use singularity::{Matching, Singularity, matched_singularities, matching_of_power, singularities};
pub use streamline::{HatchingParameters, Streamline, StreamlineError, streamlines};
pub use surface::{FieldSurface, SurfaceError};
pub use transport::{TransportError, VectorHeat, VectorSource};
pub use weighted::WeightedModel;
pub use whole::whole_space;

pub use crate::basis::{FieldBasis, FieldMisfit, FieldSpace, SpaceError};
