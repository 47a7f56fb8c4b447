//! Smooth curves and their feed planning: the speed is limited by feed, curvature and every axis.
//!
//! A shape gives its point and three derivatives; [`Run::plan`] traverses it from rest to rest with
//! the jerk of every axis within its limit. Cold: the loop plays the resulting table.

mod arc_length;
mod butterfly;
mod excess;
mod frame;
mod inverse;
mod run;
mod speed;
mod spiral;
mod spline;
mod time_law;
mod turn;

pub use butterfly::Butterfly;
pub use run::Run;
pub use speed::RunLimits;
pub use spiral::Spiral;
pub use spline::Spline;

use crate::interpolate::MAX_AXES;

/// A point of a curve and its first three derivatives by the parameter.
pub type Derivatives = [[f64; MAX_AXES]; 4];

/// A curve that is smooth except for jumps of its third derivative at the breaks.
pub trait Curve {
    /// Returns the number of axes, 1 to [`MAX_AXES`].
    fn n_axes(&self) -> usize;

    /// Returns the parameters of the start, of every jump of the third derivative, and of the end.
    fn breaks(&self) -> Vec<f64>;

    /// Returns the point at a parameter, and its derivatives by it.
    fn at(&self, parameter: f64) -> Derivatives;
}
