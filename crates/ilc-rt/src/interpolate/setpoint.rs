//! The set point that an interpolator passes to the servo loop in one tick.

use super::MAX_AXES;

/// The set point of one tick; axes beyond those planned stay at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Position of each axis at this tick.
    pub position_m: [f64; MAX_AXES],
    /// Velocity of each axis at this tick.
    pub velocity_m_s: [f64; MAX_AXES],
    /// True for the last set point of the plan, at rest; later ticks repeat it.
    pub done: bool,
}

impl Setpoint {
    /// Returns a set point at rest that is not the last one.
    pub(crate) fn at_rest(position_m: [f64; MAX_AXES]) -> Self {
        Self { position_m, velocity_m_s: [0.0; MAX_AXES], done: false }
    }
}
