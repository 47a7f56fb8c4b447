//! Fuzzing: for any bytes from a wire or a file there is no panic, no hang, and a refusal is one
//! line.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test may panic, and tells what it tried"
)]

mod driver;
mod files;
mod wire;
