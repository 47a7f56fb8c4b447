//! One axis from any state to rest at a target, limited in velocity, acceleration and jerk: planned
//! when a move begins before the previous one is complete.
//!
//! The axis goes to a cruising velocity and from it to rest. The distance of the two ramps grows
//! with that velocity, so a bisection finds the one that arrives.

use crate::interpolate::AxisLimits;

/// Bisections of the cruising velocity.
const STEPS: usize = 100;

/// State of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct AxisState {
    pub(super) p: f64,
    pub(super) v: f64,
    pub(super) a: f64,
    pub(super) j: f64,
}

impl AxisState {
    /// Returns the state after `t` under constant jerk.
    fn after(self, t: f64, j: f64) -> Self {
        let Self { p, v, a, .. } = self;
        Self {
            p: p + t * (v + t * (0.5 * a + t * j / 6.0)),
            v: v + t * (a + 0.5 * t * j),
            a: a + t * j,
            j,
        }
    }
}

/// Seven phases of constant jerk.
#[derive(Clone, Copy, Debug)]
pub(super) struct ToRest {
    start: AxisState,
    phases: [(f64, f64); 7],
    target_m: f64,
}

/// Returns a ramp to a velocity: three phases of duration and jerk.
fn ramp(v: f64, a: f64, to: f64, limits: &AxisLimits) -> [(f64, f64); 3] {
    let (most, jerk) = (limits.acceleration_max_m_s2, limits.jerk_max_m_s3);
    // Remaining change of velocity if the acceleration were ramped down at once.
    let missing = to - v - a * a.abs() / (2.0 * jerk);
    let sign = if missing < 0.0 { -1.0 } else { 1.0 };
    let (gap, a) = (sign * (to - v), sign * a);
    let reserve = (gap + a * a / (2.0 * jerk)).max(0.0);
    let peak = (jerk * reserve).sqrt();
    let (peak, hold_s) =
        if peak <= most { (peak, 0.0) } else { (most, (reserve - most * most / jerk) / most) };
    [(((peak - a) / jerk).max(0.0), sign * jerk), (hold_s, 0.0), (peak / jerk, -sign * jerk)]
}

impl ToRest {
    /// Plans the fastest such motion; a longer `duration_s` is met by cruising slower.
    ///
    /// The state must be within the limits, and able to stay within them.
    pub(super) fn plan(
        start: AxisState,
        target_m: f64,
        limits: &AxisLimits,
        cruise_max_m_s: f64,
        duration_s: f64,
    ) -> Self {
        let distance = target_m - start.p;
        let with = |cruise: f64| Self::with_cruise(start, target_m, limits, cruise, 0.0);
        let reaches = |cruise: f64| with(cruise).end().p - start.p;
        let peak = if reaches(cruise_max_m_s) <= distance {
            cruise_max_m_s
        } else if reaches(-cruise_max_m_s) >= distance {
            -cruise_max_m_s
        } else {
            let (mut below, mut above) = (-cruise_max_m_s, cruise_max_m_s);
            for _ in 0..STEPS {
                let middle = 0.5 * (below + above);
                if reaches(middle) <= distance { below = middle } else { above = middle }
            }
            // The one of the two that falls short in its own direction: the remainder is cruised.
            if above > 0.0 { below.max(0.0) } else { above }
        };
        let cruised = |cruise: f64| {
            let left = distance - reaches(cruise);
            let cruise_s = if cruise == 0.0 { 0.0 } else { (left / cruise).max(0.0) };
            Self::with_cruise(start, target_m, limits, cruise, cruise_s)
        };
        let fastest = cruised(peak);
        if peak == 0.0 || fastest.duration_s() >= duration_s {
            return fastest;
        }
        let (mut slow, mut fast) = (0.0, peak);
        for _ in 0..STEPS {
            let middle = 0.5 * (slow + fast);
            if cruised(middle).duration_s() > duration_s { slow = middle } else { fast = middle }
        }
        cruised(fast)
    }

    fn with_cruise(
        start: AxisState,
        target_m: f64,
        limits: &AxisLimits,
        cruise: f64,
        cruise_s: f64,
    ) -> Self {
        let [a, b, c] = ramp(start.v, start.a, cruise, limits);
        let [d, e, f] = ramp(cruise, 0.0, 0.0, limits);
        Self { start, phases: [a, b, c, (cruise_s, 0.0), d, e, f], target_m }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.phases.iter().map(|phase| phase.0).sum()
    }

    fn end(&self) -> AxisState {
        self.phases.iter().fold(self.start, |state, &(t, j)| state.after(t, j))
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
