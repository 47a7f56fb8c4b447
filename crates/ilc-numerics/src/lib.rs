//! Numerical libraries behind functions that are not generic: dense matrices (faer), Fourier
//! transforms (rustfft) and nearest neighbours (kiddo). Only `ilc-rt` imports it.
//!
//! Generic code is compiled in the crate that calls it. Here that happens once, beside other
//! dependencies, and not with every change of the controller.

pub mod fourier;
mod matrix;
mod neighbours;

pub use matrix::Matrix;
pub use neighbours::{COORDINATES_MAX, Neighbours, neighbours};
