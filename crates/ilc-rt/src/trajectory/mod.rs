//! From a program of segments to set points, and the geometry of contours. Cold.
//!
//! Planning returns a [`TrajectoryError`] or an [`Interpolator`], which yields one set point per
//! tick. It stands on row 1: `design` and the Python bindings import it, and it imports only
//! `interpolate`, the cell description included.

pub mod contour;
pub mod curve;
mod error;
pub mod exponential;
mod grid;
mod jet;
pub mod kind;
mod linear;
mod motion;
mod path;
mod plan;
pub mod program;
mod refusal;
#[cfg(test)]
mod tests;
mod verify;

pub use crate::interpolate::{
    AxisLimits, AxisUnit, ControlledStop, Interpolator, JerkLimited, MAX_AXES, MoveError,
    PathLimits, PathState, PointToPoint, Quantity, Setpoint,
};
pub use contour::{contour_error_m, path_tangents};
pub use error::TrajectoryError;
pub use exponential::{ExponentialSigmoid, ModulatedSegment, POINTS_A_PERIOD, points_program};
pub use linear::{Linear, LinearSetting};
pub use motion::{MotionState, SampledMotion, TrackingIndex, set_points};
pub use path::{ArcSpec, PathSegment, PathSpec};
pub use refusal::Refusal;
