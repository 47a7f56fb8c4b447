//! Whole motions as tables: sampled from a plan, or given as rows of set points; their tracking
//! index.
//!
//! Every kind of plan that is not evaluated tick by tick becomes a [`SampledMotion`].

mod sampled;
mod set_points;
mod tracking_index;

pub use sampled::{MotionState, SampledMotion};
pub use set_points::set_points;
pub use tracking_index::TrackingIndex;
