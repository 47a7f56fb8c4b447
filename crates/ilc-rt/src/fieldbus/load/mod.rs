//! Cold: the time that frames take on a CAN bus, and the check that those of a cycle fit.
//!
//! For `design`, which plans the traffic of a cell, and `ilc-rt check`. All figures are worst-case bit
//! stuffing, so that a cell that passes fits with any payload.

mod budget;
mod frame_time;

pub use budget::{Load, LoadError, check};
pub use frame_time::BitRates;
