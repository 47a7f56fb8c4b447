//! Controllers that run in the tick: PID, cascade, cross-coupled control, saturation and rate
//! limit.
//!
//! Hot throughout: plain numbers in, plain numbers and Copy errors out. `servo` imports it; it
//! imports nothing of the crate.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

mod cascade;
mod cross_coupled;
mod feedforward;
mod limits;
mod pid;
mod position_loop;
mod slew;

pub use cascade::{Cascade, CascadeGains, CascadeReference};
pub use cross_coupled::{CrossCoupled, variable_gains};
pub use feedforward::Feedforward;
pub use limits::{Bounded, clamp_finite};
pub use pid::{Derivative, Pid, PidGains, PidMatrices};
pub use position_loop::PositionLoop;
pub use slew::SlewLimiter;
