//! The set points of a run, one per tick: line and arc elements, jerk-limited moves (S-curve
//! profiles), controlled stops.
//!
//! A planned run yields one set point per tick without allocating; moves and stops are planned
//! between two ticks. It belongs to row 0 and imports nothing of the crate: `trajectory` plans the
//! runs and `servo` executes them.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

pub(crate) mod arc;
pub(crate) mod blend;
pub(crate) mod element;
mod error;
pub(crate) mod exact_stop;
pub(crate) mod interpolator;
pub(crate) mod limits;
pub(crate) mod line;
mod playback;
mod point_to_point;
mod profile;
mod quantity;
#[cfg(test)]
pub(crate) mod random;
mod setpoint;
mod stop;
pub(crate) mod table;

pub use error::MoveError;
pub use interpolator::Interpolator;
pub use limits::{AxisLimits, PathLimits};
pub use playback::Playback;
pub use point_to_point::PointToPoint;
pub use profile::{JerkLimited, PathState};
pub use quantity::{AxisUnit, Quantity};
pub use setpoint::Setpoint;
pub use stop::ControlledStop;

/// Largest number of axes that move together; every array of the tick has this length.
pub const MAX_AXES: usize = 12;
