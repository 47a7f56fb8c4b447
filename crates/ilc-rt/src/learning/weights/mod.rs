//! Weights of a quadratic cost along the run.
//!
//! A [`Weight`] is one term of the cost at each sample; the other files build weights from their
//! meaning (contour, formation, dynamic filters). Laws, analysis and tuning import it.
//!
//! Family: `formation` and `objective` convert into each other.

mod band;
mod contour;
mod coupled;
mod dynamic;
mod filtered_input;
mod formation;
mod gain;
mod objective;
mod schedule;
mod tangent;
mod weight;

pub use band::{Pass, band};
pub use contour::{Contour, ContourTerms};
pub use coupled::Coupled;
pub use dynamic::{Dynamic, ErrorFilter};
pub use filtered_input::FilteredInput;
pub use formation::Formation;
pub use gain::Gain;
pub use objective::Objective;
pub use schedule::Schedule;
pub use tangent::tangents;
pub use weight::Weight;
