//! `chladni._native` as an example: `cargo test --workspace` builds it beside the tests, from crates that are compiled
//! for those anyhow. A wheel has other features in the crates below it, and would compile them all once more.

#[path = "../src/lib.rs"]
mod native;
