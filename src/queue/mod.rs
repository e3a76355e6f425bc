//! Leases, heartbeats, retries and the worker pool.
