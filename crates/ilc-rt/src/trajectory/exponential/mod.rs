//! Exponential and sigmoid (E/S) interpolation: a move that is on its programmed path, and on time,
//! soon after its start, where a jerk-limited one lags behind for good.
//!
//! A start is exponential, a transition between two legs of one line is a pair of sigmoids, an end is
//! the mirror image of a start: with `v₂ = 0` the blending ratio would be 0 and no sigmoid comes to
//! rest at its corner. Corners that are not on one line are an end and a start, as sigmoids would
//! leave the path there.

mod alpha;
mod choice;
mod equations;
mod leg;
pub mod listing;
mod peaks;
mod plan;
mod points_program;

pub use alpha::AlphaInterval;
pub use choice::{AlphaChoice, AlphaMax};
pub use plan::{ExponentialSigmoid, ModulatedSegment};
pub use points_program::{POINTS_A_PERIOD, points_program};
