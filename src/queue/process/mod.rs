//! Jobs in processes of their own: docs/decisions/0032.
//!
//! The server claims, leases, beats and stores as it does for jobs on threads; a runner of this module hands each job
//! to a child through a pipe and passes on what comes back. So a job that aborts, or takes more memory than it was
//! promised, takes no server with it, and one that does not stop when it is asked to is killed.

mod child;
mod delivery;
mod frame;
mod limit;
mod messages;
mod piped_parts;
mod processes;
mod worker;

pub use processes::{ProcessOptions, Processes};
pub use worker::work;
