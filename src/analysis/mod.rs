//! What a basis is good for: filters, projections. Everything is evaluated as `U (φ̄ v)`.

pub mod filter;
pub mod projection;
