//! What a basis is good for: filters, projections.

pub mod filter;
pub mod projection;
