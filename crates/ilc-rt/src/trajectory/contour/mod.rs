//! The geometry of contours: distance to a path, its tangent and its normal. Cold.
//!
//! The distance is measured in three ways, from the same points: to the path near each point's own
//! time ([`contour_error_m`]), to a whole sampled path ([`SampledPath`]), and to exact lines and
//! arcs ([`Shape`]); [`coupling`] gives the weights of learning and of cross-coupled control.

pub mod coupling;
mod error;
mod sampled;
mod shape;
mod tangent;
mod windowed;

pub use error::ContourError;
pub use sampled::{Nearest, SampledPath};
pub use shape::{Arc, Line, Shape};
pub use tangent::path_tangents;
pub use windowed::contour_error_m;
