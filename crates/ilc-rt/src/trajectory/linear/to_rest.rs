//! One axis from any state to rest at a target, limited in velocity, acceleration and jerk: planned
//! when a move begins before the previous one is complete.
//!
//! The axis goes to a cruising velocity and from it to rest; [`Approach`] finds the one that arrives.

use super::approach::{Approach, Ramps};
use super::axis_state::AxisState;
use crate::interpolate::AxisLimits;

/// Seven phases of constant jerk.
#[derive(Clone, Copy, Debug)]
pub(super) struct ToRest {
    start: AxisState,
    way: Approach,
    ramps: Ramps,
    phases: [(f64, f64); 7],
    target_m: f64,
}

impl ToRest {
    /// Plans the fastest such motion.
    ///
    /// The state must be within the limits, and able to stay within them.
    pub(super) fn fastest(
        start: AxisState,
        target_m: f64,
        limits: &AxisLimits,
        cruise_max_m_s: f64,
    ) -> Self {
        let way = Approach::new(start, target_m, limits);
        let ramps = way.fastest(cruise_max_m_s);
        Self { start, way, phases: way.phases(&ramps), ramps, target_m }
    }

    /// Returns the motion that arrives at `duration_s` by cruising slower, or as late before it as
    /// possible; the same one if it is not earlier.
    pub(super) fn slowed(self, duration_s: f64) -> Self {
        if self.ramps.cruise == 0.0 || self.duration_s() >= duration_s {
            return self;
        }
        let ramps = self.way.slower(&self.ramps, duration_s);
        Self { phases: self.way.phases(&ramps), ramps, ..self }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.phases.iter().map(|phase| phase.0).sum()
    }

    /// Returns the state at a time from the start; exactly at rest at the target when it is over.
    pub(super) fn at(&self, t_s: f64) -> AxisState {
        let (mut state, mut left_s) = (self.start, t_s);
        for (duration_s, jerk) in self.phases {
            if left_s <= duration_s {
                return state.after(left_s, jerk);
            }
            state = state.after(duration_s, jerk);
            left_s -= duration_s;
        }
        AxisState { p: self.target_m, ..AxisState::default() }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests;
