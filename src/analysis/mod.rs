//! What a basis is good for: filters, projections.

pub mod family;
pub mod filter;
pub mod projection;
pub mod sound;
pub mod vibration;
