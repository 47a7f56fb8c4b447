//! Exponential and sigmoid (E/S) interpolation: soon after its start a move is on its programmed
//! path and on time, whereas a jerk-limited one keeps lagging.
//!
//! A start is exponential, a transition between two legs of one line is a pair of sigmoids, an end
//! is the mirror image of a start: with `v₂ = 0` the blending ratio would be 0 and no sigmoid comes
//! to rest at its corner. Corners between different lines are an end and a start, as sigmoids would
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
