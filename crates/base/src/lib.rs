//! What every crate of Chladni needs and none is about: the hook through which long work reports and is stopped, and a seeded
//! random generator.

mod monitor;
mod random;

pub use monitor::{Cancelled, Monitor, Quiet, Share, StageClock, Unwatched, notes};
pub use random::SplitMix64;
