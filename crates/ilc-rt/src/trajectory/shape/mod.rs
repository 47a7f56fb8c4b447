//! Shapes that are programs of straight moves.

mod points_program;
mod raster;

pub use points_program::{POINTS_A_PERIOD, points_program};
pub use raster::raster;
