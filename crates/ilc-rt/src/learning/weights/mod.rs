//! What a good run is, as the matrices of a quadratic cost along the run.
//!
//! A [`Weight`] says what one term of the cost is at each sample; the other files build such weights
//! from what they mean (contour, formation, dynamic filters). Laws, analysis and tuning import it.

mod weight;

pub use weight::Weight;
