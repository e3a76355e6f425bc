//! The kinds of job, their parameters with defaults and limits, and how one runs: a pure function of its inputs and a
//! [`Monitor`](crate::monitor::Monitor).
