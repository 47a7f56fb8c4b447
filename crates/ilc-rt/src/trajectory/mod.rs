//! From a program of segments to set points, and the geometry of contours.
//!
//! Planning is cold and answers with a [`TrajectoryError`]; what a plan leaves behind gives one set
//! point a tick without allocating. It stands on row 1: `servo`, `supervisor` and the Python glue
//! import it, and it imports nothing of the crate, the cell description included.

mod blend;
pub mod contour;
mod error;
mod exact_stop;
mod interpolator;
mod limits;
mod path;
mod point_to_point;
mod profile;
mod proof;
#[cfg(test)]
mod random;
mod setpoint;
mod stop;

pub use contour::contour_error_m;
pub use error::{Quantity, TrajectoryError};
pub use interpolator::Interpolator;
pub use limits::{AxisLimits, PathLimits};
pub use path::{CornerRule, PathSegment, PathSpec};
pub use point_to_point::PointToPoint;
pub use profile::{JerkLimited, PathState};
pub use setpoint::Setpoint;
pub use stop::ControlledStop;

/// Most axes that move together; every array of the tick has this length.
pub const MAX_AXES: usize = 6;
