//! Controller against simulated drives, over an in-memory bus and in lock-step unless noted.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "set-up shared by the tests must not fail"
)]

mod bench;
mod bring_up;
mod communication;
mod determinism;
mod faults;
mod garbage;
mod motion;
mod objects;
mod profiles;
