//! The set points of a run, one a tick: line and arc elements, jerk-limited moves, controlled stops.
//!
//! A planned run gives one set point a tick without allocating, and moves and stops are planned
//! between two ticks. It stands on row 0 and imports nothing of the crate: `trajectory` plans what is
//! played here, and `servo` plays it.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

pub(crate) mod arc;
pub(crate) mod blend;
pub(crate) mod element;
mod error;
pub(crate) mod exact_stop;
pub(crate) mod interpolator;
pub(crate) mod limits;
pub(crate) mod line;
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
pub use point_to_point::PointToPoint;
pub use profile::{JerkLimited, PathState};
pub use quantity::{AxisUnit, Quantity};
pub use setpoint::Setpoint;
pub use stop::ControlledStop;

/// Most axes that move together; every array of the tick has this length.
pub const MAX_AXES: usize = 12;
