//! Jobs, meshes, bases and blobs in SQL: the only room that names sqlx.

mod error;
pub mod fault;
mod page;
mod records;
mod stub;

pub use error::StoreError;
pub use page::{Page, PageRequest};
pub use records::{
    BasisFilter, BasisRecord, CacheStatistics, EnqueueOutcome, Enqueued, IdempotencyKey, JobEvent, JobFilter,
    JobProblem, JobRecord, JobStatus, MeshRecord, NewJob, NewMesh, StoreHealth, Stored, UnknownStatus,
};
pub use stub::*;
