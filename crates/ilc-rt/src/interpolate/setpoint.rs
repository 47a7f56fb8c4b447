//! What an interpolator gives the servo loop in one tick.

use super::MAX_AXES;

/// The set point of one tick; axes beyond the plan's own stay at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Where each axis shall be at this tick.
    pub position_m: [f64; MAX_AXES],
    /// How fast the set point moves at this tick.
    pub velocity_m_s: [f64; MAX_AXES],
    /// Whether this is the last set point of the plan, at rest; later ticks repeat it.
    pub done: bool,
}

impl Setpoint {
    /// A set point at rest that is not the last one.
    pub(crate) fn at_rest(position_m: [f64; MAX_AXES]) -> Self {
        Self { position_m, velocity_m_s: [0.0; MAX_AXES], done: false }
    }
}
