//! Kinematics between drives and tool: forward, inverse and Jacobian of each mechanism.
//!
//! Hot throughout: plain numbers in, plain numbers and Copy errors out. `learning`, `servo` and the
//! Python bindings may import it; it imports nothing of the crate.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

mod delta;
mod error;
mod gantry;
mod spheres;

pub use delta::Delta;
pub use error::KinematicsError;
pub use gantry::Gantry;
