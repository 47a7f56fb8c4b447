//! From targets to demands: interpolation between SYNCs, limits, and ramps to standstill.

use super::profile::{Goal, Profile, ProfileLaw};
use crate::plant::Demand;

/// Time after which a ramp counts as over once its demand is zero, even if the axis still creeps.
const SETTLE_MAX_S: f64 = 0.2;
/// Share of the velocity limit below which an axis counts as at rest.
const STANDSTILL: f64 = 1e-3;

/// Limits of every motion, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Lowest position.
    pub position_min_m: f64,
    /// Highest position.
    pub position_max_m: f64,
    /// Velocity limit.
    pub velocity_max_m_s: f64,
    /// Acceleration limit of a demand.
    pub acceleration_max_m_s2: f64,
    /// Deceleration limit of a demand.
    pub deceleration_max_m_s2: f64,
}

/// Phase of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Off,
    /// Interpolates from `start_m` to `end_m`.
    Position {
        start_m: f64,
        end_m: f64,
        elapsed_s: f64,
        period_s: f64,
    },
    Velocity {
        velocity_m_s: f64,
    },
    Force {
        force_n: f64,
    },
    /// Brakes to standstill.
    Ramp {
        velocity_m_s: f64,
        deceleration_m_s2: f64,
        settling_s: f64,
    },
    Hold {
        position_m: f64,
    },
    /// Follows the drive's own profile.
    Profile {
        profile: Profile,
        goal: Goal,
        law: ProfileLaw,
    },
}

/// The target generator of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    phase: Phase,
    /// Position passed to the controller: interpolated, rate-limited and within the limits.
    limited_m: f64,
    last_delta_m: f64,
    /// Velocity of the demand in the last step.
    rate_m_s: f64,
    is_limited: bool,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            phase: Phase::Off,
            limited_m: 0.0,
            last_delta_m: 0.0,
            rate_m_s: 0.0,
            is_limited: false,
        }
    }
}

impl Motion {
    /// Disables the drive.
    pub fn off(&mut self) {
        *self = Self::default();
    }

    /// Holds a position, as on entering operation enabled: there is no target yet.
    pub fn hold(&mut self, position_m: f64) {
        self.phase = Phase::Hold { position_m };
        self.limited_m = position_m;
        self.last_delta_m = 0.0;
        self.rate_m_s = 0.0;
        self.is_limited = false;
    }

    /// Brakes from the current velocity of the axis.
    pub fn ramp_down(&mut self, velocity_m_s: f64, deceleration_m_s2: f64) {
        self.phase = Phase::Ramp { velocity_m_s, deceleration_m_s2, settling_s: 0.0 };
        self.is_limited = false;
    }

    /// Sets a position target to be reached after `period_s`.
    pub fn position_target(&mut self, target_m: f64, period_s: f64) {
        let start_m = match self.phase {
            Phase::Position { .. } | Phase::Hold { .. } => {
                self.demand_m().unwrap_or(self.limited_m)
            }
            Phase::Off
            | Phase::Velocity { .. }
            | Phase::Force { .. }
            | Phase::Ramp { .. }
            | Phase::Profile { .. } => {
                return;
            }
        };
        self.last_delta_m = target_m - start_m;
        self.phase = Phase::Position { start_m, end_m: target_m, elapsed_s: 0.0, period_s };
    }

    /// Extrapolates for one more period, then holds: a single target was lost.
    pub fn extrapolate_once(&mut self, period_s: f64) {
        let Phase::Position { end_m, .. } = self.phase else { return };
        self.phase = Phase::Position {
            start_m: end_m,
            end_m: end_m + self.last_delta_m,
            elapsed_s: 0.0,
            period_s,
        };
        self.last_delta_m = 0.0;
    }

    /// Sets a velocity target.
    pub fn velocity_target(&mut self, velocity_m_s: f64) {
        if matches!(self.phase, Phase::Velocity { .. } | Phase::Hold { .. }) {
            self.phase = Phase::Velocity { velocity_m_s };
        }
    }

    /// Starts, or changes, the drive's own profile; a ramp or an idle drive is left alone.
    pub fn pursue(&mut self, goal: Goal, law: ProfileLaw) {
        let profile = match self.phase {
            Phase::Profile { profile, .. } => profile,
            Phase::Hold { position_m } => Profile { position_m, velocity_m_s: 0.0 },
            Phase::Off
            | Phase::Position { .. }
            | Phase::Velocity { .. }
            | Phase::Force { .. }
            | Phase::Ramp { .. } => {
                return;
            }
        };
        self.phase = Phase::Profile { profile, goal, law };
    }

    /// Returns whether the drive follows its own profile.
    pub fn is_profile(&self) -> bool {
        matches!(self.phase, Phase::Profile { .. })
    }

    /// Returns whether the axis is held, or its profile is where it wants to be.
    pub fn has_arrived(&self) -> bool {
        match self.phase {
            Phase::Profile { profile, goal, .. } => profile.has_reached(goal),
            Phase::Hold { .. } => true,
            Phase::Off
            | Phase::Position { .. }
            | Phase::Velocity { .. }
            | Phase::Force { .. }
            | Phase::Ramp { .. } => false,
        }
    }

    /// Returns whether the axis is held, so that a profile may begin.
    pub fn is_holding(&self) -> bool {
        matches!(self.phase, Phase::Hold { .. })
    }

    /// Sets a force target.
    pub fn force_target(&mut self, force_n: f64) {
        if matches!(self.phase, Phase::Force { .. } | Phase::Hold { .. }) {
            self.phase = Phase::Force { force_n };
        }
    }

    /// Returns the force demand; `None` if the drive closes a loop of its own.
    pub fn demand_n(&self) -> Option<f64> {
        match self.phase {
            Phase::Force { force_n } => Some(force_n),
            _ => None,
        }
    }

    /// Returns the interpolated position before limits; `None` if the drive does not control
    /// position.
    #[inline]
    pub fn demand_m(&self) -> Option<f64> {
        match self.phase {
            Phase::Position { start_m, end_m, elapsed_s, period_s } => {
                let share = if period_s > 0.0 { (elapsed_s / period_s).min(1.0) } else { 1.0 };
                // The end value itself, so that it is reached to the last bit.
                Some(if share < 1.0 { start_m + (end_m - start_m) * share } else { end_m })
            }
            Phase::Hold { position_m } => Some(position_m),
            Phase::Profile { profile, .. } => Some(profile.position_m),
            Phase::Off | Phase::Velocity { .. } | Phase::Force { .. } | Phase::Ramp { .. } => None,
        }
    }

    /// Returns the velocity demand; 0 without a demand.
    pub fn demand_m_s(&self) -> f64 {
        match self.phase {
            Phase::Velocity { velocity_m_s } | Phase::Ramp { velocity_m_s, .. } => velocity_m_s,
            Phase::Position { elapsed_s, period_s, .. } if elapsed_s < period_s => {
                self.last_delta_m / period_s
            }
            Phase::Profile { profile, .. } => profile.velocity_m_s,
            Phase::Off | Phase::Position { .. } | Phase::Force { .. } | Phase::Hold { .. } => 0.0,
        }
    }

    /// Returns true if a limit of the drive changed the demand.
    pub fn is_limited(&self) -> bool {
        self.is_limited
    }

    /// Returns whether a target is being followed, not a ramp or a hold.
    pub fn follows_target(&self) -> bool {
        matches!(self.phase, Phase::Position { .. } | Phase::Velocity { .. } | Phase::Force { .. })
    }

    /// Returns whether there is a ramp under way.
    pub fn is_ramping(&self) -> bool {
        matches!(self.phase, Phase::Ramp { .. })
    }

    /// Advances by one step of the drive's own loop and returns the demand for it. A ramp that has
    /// come to standstill becomes a hold at that position.
    #[inline]
    pub fn step(
        &mut self,
        limits: &MotionLimits,
        position_m: f64,
        velocity_m_s: f64,
        feedforward_m_s: f64,
        dt_s: f64,
    ) -> Demand {
        match &mut self.phase {
            Phase::Off => return Demand::Off,
            Phase::Position { elapsed_s, .. } => *elapsed_s += dt_s,
            Phase::Hold { .. } => {}
            Phase::Profile { profile, goal, law } => {
                profile.step(*goal, law, dt_s);
                let Profile { position_m, velocity_m_s } = *profile;
                (self.limited_m, self.rate_m_s) = (position_m, velocity_m_s);
                // Its own velocity is fed forward, so that the axis does not lag behind.
                return Demand::Position { position_m, velocity_m_s };
            }
            Phase::Force { force_n } => {
                let force_n = *force_n;
                return self.force_demand(force_n, limits, velocity_m_s);
            }
            Phase::Velocity { velocity_m_s: wanted_m_s } => {
                let wanted_m_s = *wanted_m_s;
                return self.velocity_demand(wanted_m_s, limits, position_m, dt_s);
            }
            Phase::Ramp { velocity_m_s: wanted_m_s, deceleration_m_s2, settling_s } => {
                let change_m_s = *deceleration_m_s2 * dt_s;
                *wanted_m_s -= wanted_m_s.clamp(-change_m_s, change_m_s);
                if wanted_m_s.abs() > 0.0 {
                    return Demand::Velocity { velocity_m_s: *wanted_m_s };
                }
                *settling_s += dt_s;
                let stands = velocity_m_s.abs() <= STANDSTILL * limits.velocity_max_m_s;
                if !stands && *settling_s < SETTLE_MAX_S {
                    return Demand::Velocity { velocity_m_s: 0.0 };
                }
                self.hold(position_m);
            }
        }
        self.position_demand(limits, feedforward_m_s, dt_s)
    }

    /// A drive without a velocity loop of its own does not drive beyond its speed limit.
    fn force_demand(&mut self, asked_n: f64, limits: &MotionLimits, velocity_m_s: f64) -> Demand {
        self.is_limited =
            velocity_m_s.abs() >= limits.velocity_max_m_s && asked_n * velocity_m_s > 0.0;
        Demand::Force { force_n: if self.is_limited { 0.0 } else { asked_n } }
    }

    fn velocity_demand(
        &mut self,
        wanted_m_s: f64,
        limits: &MotionLimits,
        position_m: f64,
        dt_s: f64,
    ) -> Demand {
        let top_m_s = limits.velocity_max_m_s;
        let mut velocity_m_s = wanted_m_s.clamp(-top_m_s, top_m_s);
        if position_m >= limits.position_max_m {
            velocity_m_s = velocity_m_s.min(0.0);
        }
        if position_m <= limits.position_min_m {
            velocity_m_s = velocity_m_s.max(0.0);
        }
        let velocity_m_s = self.reachable_m_s(velocity_m_s, limits, dt_s);
        self.rate_m_s = velocity_m_s;
        self.is_limited = velocity_m_s.to_bits() != wanted_m_s.to_bits();
        Demand::Velocity { velocity_m_s }
    }

    /// Returns the velocity nearest to `wanted_m_s` within the acceleration limits.
    #[inline]
    fn reachable_m_s(&self, wanted_m_s: f64, limits: &MotionLimits, dt_s: f64) -> f64 {
        let speeds_up = wanted_m_s.abs() > self.rate_m_s.abs();
        let max_m_s2 =
            if speeds_up { limits.acceleration_max_m_s2 } else { limits.deceleration_max_m_s2 };
        let change_m_s = max_m_s2 * dt_s;
        // Compared first: a demand within the limits must pass to the last bit.
        if (wanted_m_s - self.rate_m_s).abs() <= change_m_s {
            wanted_m_s
        } else {
            self.rate_m_s + change_m_s.copysign(wanted_m_s - self.rate_m_s)
        }
    }

    #[inline]
    fn position_demand(
        &mut self,
        limits: &MotionLimits,
        feedforward_m_s: f64,
        dt_s: f64,
    ) -> Demand {
        let wanted_m = self.demand_m().unwrap_or(self.limited_m);
        let inside_m = if matches!(self.phase, Phase::Hold { .. }) {
            wanted_m
        } else {
            // An axis outside the limits stays there until it is commanded back.
            let (low_m, high_m) = (
                limits.position_min_m.min(self.limited_m),
                limits.position_max_m.max(self.limited_m),
            );
            wanted_m.max(low_m).min(high_m)
        };
        let reach_m = limits.velocity_max_m_s * dt_s;
        let asked_m = (inside_m - self.limited_m).clamp(-reach_m, reach_m);
        let asked_m_s = asked_m / dt_s;
        let given_m_s = self.reachable_m_s(asked_m_s, limits, dt_s);
        self.rate_m_s = given_m_s;
        let moved_m =
            if given_m_s.to_bits() == asked_m_s.to_bits() { asked_m } else { given_m_s * dt_s };
        let reached_m = self.limited_m + moved_m;
        let is_there = (inside_m - reached_m).abs() <= f64::EPSILON * inside_m.abs().max(1.0);
        self.limited_m = if is_there { inside_m } else { reached_m };
        self.is_limited = !is_there || inside_m.to_bits() != wanted_m.to_bits();
        Demand::Position { position_m: self.limited_m, velocity_m_s: feedforward_m_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotionLimits = MotionLimits {
        position_min_m: -1.0,
        position_max_m: 1.0,
        velocity_max_m_s: 1.0,
        acceleration_max_m_s2: f64::INFINITY,
        deceleration_max_m_s2: f64::INFINITY,
    };

    fn position(demand: Demand) -> f64 {
        match demand {
            Demand::Position { position_m, .. } => position_m,
            other => panic!("{other:?} is no position"),
        }
    }

    #[test]
    fn interpolates_linearly_and_meets_the_target_exactly() {
        let mut motion = Motion::default();
        motion.hold(0.1);
        motion.position_target(0.1004, 0.001);
        let places: Vec<f64> =
            (0..4).map(|_| position(motion.step(&LIMITS, 0.1, 0.0, 0.0, 0.000_25))).collect();
        for (found, expected) in places.iter().zip([0.1001, 0.1002, 0.1003, 0.1004]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!(places[3].to_bits(), 0.1004_f64.to_bits());
    }

    #[test]
    fn a_far_target_moves_no_faster_than_the_limit() {
        let mut motion = Motion::default();
        motion.hold(0.5);
        motion.position_target(0.0, 0.001);
        let first = position(motion.step(&LIMITS, 0.5, 0.0, 0.0, 0.001));
        assert!((first - 0.499).abs() < 1e-12, "{first}");
        assert!(motion.is_limited());
        assert_eq!(motion.demand_m(), Some(0.0));
    }

    #[test]
    fn a_lost_target_is_extrapolated_once() {
        let mut motion = Motion::default();
        motion.hold(0.0);
        motion.position_target(0.0005, 0.001);
        motion.step(&LIMITS, 0.0, 0.0, 0.0, 0.001);
        for expected in [0.001, 0.001] {
            motion.extrapolate_once(0.001);
            let found = position(motion.step(&LIMITS, 0.0, 0.0, 0.0, 0.001));
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn a_ramp_ends_in_a_hold_where_the_axis_is() {
        let mut motion = Motion::default();
        motion.ramp_down(0.1, 10.0);
        let mut n_steps = 0;
        while motion.is_ramping() {
            motion.step(&LIMITS, 0.3, 0.0, 0.0, 0.001);
            n_steps += 1;
        }
        // One more if rounding leaves a remainder.
        assert!((10..=11).contains(&n_steps), "{n_steps}");
        assert_eq!(motion.demand_m(), Some(0.3));
    }

    #[test]
    fn velocity_stops_at_the_position_limits() {
        let mut motion = Motion::default();
        motion.hold(0.0);
        motion.velocity_target(0.4);
        let at_limit = motion.step(&LIMITS, 1.0, 0.4, 0.0, 0.001);
        assert_eq!(at_limit, Demand::Velocity { velocity_m_s: 0.0 });
        motion.velocity_target(-0.4);
        let back = motion.step(&LIMITS, 1.0, 0.0, 0.0, 0.001);
        assert_eq!(back, Demand::Velocity { velocity_m_s: -0.4 });
    }
}
