//! What every crate of Chladni needs and none is about: the hook through which long work reports and is stopped,
//! parallel loops, a seeded random generator, vectors in space, values that are made once, memory that one piece of
//! work leaves to the next, and memory that the allocator keeps.

mod monitor;
mod once;
pub mod parallel;
mod random;
mod spare;
mod stopped;
mod trim;
mod vector;

pub use monitor::{Cancelled, Monitor, Portion, Quiet, Share, StageClock, Unwatched, notes};
pub use once::made_once;
pub use random::SplitMix64;
pub use spare::Spare;
pub use trim::{set_trim, trim};
pub use vector::Vector3;
