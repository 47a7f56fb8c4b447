//! Smooth curves, and how fast they may be run: speed limited by feed, curvature and every axis.
//!
//! A shape gives its point and three derivatives; [`Run::plan`] walks it from rest to rest with the
//! jerk of every axis within its limit. Cold: what the loop plays is the table that comes out.

mod arc_length;
mod butterfly;
mod excess;
mod frame;
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

/// A curve that is smooth but for jumps of its third derivative at the breaks.
pub trait Curve {
    /// Number of axes, 1 to [`MAX_AXES`].
    fn n_axes(&self) -> usize;

    /// Parameters of the start, of every jump of the third derivative, and of the end.
    fn breaks(&self) -> Vec<f64>;

    /// The point at a parameter, and its derivatives by it.
    fn at(&self, parameter: f64) -> Derivatives;
}
