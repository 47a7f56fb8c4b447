//! Controller against simulated drives, over a bus in memory and in lock-step unless said otherwise.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "set-up shared by the tests must not fail"
)]

mod bench;
mod bring_up;
mod determinism;
mod faults;
mod garbage;
mod motion;
mod objects;
