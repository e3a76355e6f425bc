//! Chladni: spectral geometry as a service.
//!
//! A mesh comes in, an eigenproblem is solved on it, and a compact, certified basis goes out. The rooms, in the order in
//! which they may use each other:
//!
//! ```text
//! bytes → mesh → operator → spectrum → basis → analysis
//!                               ↑         ↓
//!             job (what to run)   http · store · queue
//! ```
//!
//! `mesh` to `job` are a pure numerical library: no async runtime, no SQL, no HTTP, no environment, no printing. Long work
//! reports to a [`monitor::Monitor`].

pub mod cli;
pub mod config;
pub mod http;
pub mod queue;
pub mod store;
pub mod telemetry;
