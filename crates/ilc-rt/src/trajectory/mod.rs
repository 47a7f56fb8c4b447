//! From a program of segments to set points, and the geometry of contours.
//!
//! Planning is cold and answers with a [`TrajectoryError`]; what a plan leaves behind gives one set
//! point a tick without allocating. It stands on row 1: `servo`, `supervisor` and the Python glue
//! import it, and it imports nothing of the crate, the cell description included.

mod arc;
mod blend;
pub mod contour;
pub mod curve;
mod element;
mod error;
mod exact_stop;
pub mod exponential;
mod interpolator;
mod limits;
mod linear;
mod modulated;
mod motion;
mod path;
mod point_to_point;
mod profile;
pub mod program;
#[cfg(test)]
mod promises;
mod proof;
#[cfg(test)]
mod random;
mod raster;
mod set_points;
mod setpoint;
mod stop;
mod table;
mod to_rest;
mod tracking_index;
mod verification;

pub use contour::{contour_error_m, path_tangents};
pub use error::{Quantity, TrajectoryError};
pub use exponential::{ExponentialSigmoid, ModulatedSegment};
pub use interpolator::Interpolator;
pub use limits::{AxisLimits, PathLimits};
pub use linear::{Linear, LinearSetting};
pub use modulated::{POINTS_A_PERIOD, points_program};
pub use motion::{MotionState, SampledMotion};
pub use path::{ArcSpec, CornerRule, PathSegment, PathSpec};
pub use point_to_point::PointToPoint;
pub use profile::{JerkLimited, PathState};
pub use raster::raster;
pub use set_points::set_points;
pub use setpoint::Setpoint;
pub use stop::ControlledStop;
pub use tracking_index::TrackingIndex;

/// Most axes that move together; every array of the tick has this length.
pub const MAX_AXES: usize = 12;
