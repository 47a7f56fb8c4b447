//! Controllers that run in the tick: the position loop, and what keeps commands within bounds.
//!
//! Hot from end to end: plain numbers in, plain numbers and Copy errors out. `servo` imports it; it
//! imports nothing of the crate.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

mod limits;
mod position_loop;
mod slew;

pub use limits::{Bounded, LimitError, SetpointLimits, clamp_finite};
pub use position_loop::PositionLoop;
pub use slew::SlewLimiter;
