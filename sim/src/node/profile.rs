//! The drive's own trajectory generator: a trapezoidal velocity profile, one step at a time.

/// Limits of a profile, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileLaw {
    /// Highest speed.
    pub velocity_m_s: f64,
    /// Acceleration.
    pub acceleration_m_s2: f64,
    /// Deceleration.
    pub deceleration_m_s2: f64,
}

/// Aim of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Rest at a position.
    Place {
        /// The position.
        position_m: f64,
    },
    /// Pass a position at a velocity, in its direction.
    Through {
        /// The position.
        position_m: f64,
        /// The velocity.
        velocity_m_s: f64,
    },
    /// Keep a velocity.
    Speed {
        /// The velocity.
        velocity_m_s: f64,
    },
}

/// The state of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Position.
    pub position_m: f64,
    /// Velocity.
    pub velocity_m_s: f64,
}

impl Profile {
    /// Advances by one step. A place is reached to the last bit and without overshoot, unless the
    /// profile was already too fast for it.
    pub fn step(&mut self, goal: Goal, law: &ProfileLaw, dt_s: f64) {
        let wanted_m_s = match goal {
            Goal::Speed { velocity_m_s } => velocity_m_s.clamp(-law.velocity_m_s, law.velocity_m_s),
            Goal::Place { position_m } => {
                let way_m = position_m - self.position_m;
                let speed_m_s = brakeable_m_s(way_m.abs(), law.deceleration_m_s2, dt_s);
                speed_m_s.min(law.velocity_m_s).copysign(way_m)
            }
            Goal::Through { position_m, velocity_m_s } => {
                let way_m = position_m - self.position_m;
                let slower_m_s = brakeable_m_s(way_m.abs(), law.deceleration_m_s2, dt_s);
                slower_m_s.hypot(velocity_m_s).min(law.velocity_m_s).copysign(velocity_m_s)
            }
        };
        self.velocity_m_s = reachable_m_s(self.velocity_m_s, wanted_m_s, law, dt_s);
        let before_m = self.position_m;
        self.position_m += self.velocity_m_s * dt_s;
        if let Goal::Place { position_m } = goal {
            let left_m = position_m - self.position_m;
            let is_slow = self.velocity_m_s.abs() <= law.deceleration_m_s2 * dt_s;
            let is_there = left_m.abs() <= 1e-12 || left_m.abs() <= f64::EPSILON * position_m.abs();
            if is_slow && (is_there || (position_m - before_m) * left_m < 0.0) {
                *self = Self { position_m, velocity_m_s: 0.0 };
            }
        }
    }

    /// Returns whether it rests where its goal is, or has passed it.
    pub fn has_reached(&self, goal: Goal) -> bool {
        let is_there = match goal {
            Goal::Through { position_m, velocity_m_s } => {
                return (self.position_m - position_m) * velocity_m_s.signum() >= 0.0;
            }
            Goal::Place { position_m } => self.position_m.to_bits() == position_m.to_bits(),
            Goal::Speed { velocity_m_s } => {
                return self.velocity_m_s.to_bits() == velocity_m_s.to_bits();
            }
        };
        is_there && self.velocity_m_s.abs() <= 0.0
    }
}

/// Returns the highest speed for one step from which `way_m` still suffices to stop:
/// `v dt + v²/2a = way`.
pub fn brakeable_m_s(way_m: f64, deceleration_m_s2: f64, dt_s: f64) -> f64 {
    let change_m_s = deceleration_m_s2 * dt_s;
    // The difference of a root and its part, without cancellation for a short way.
    let root_m_s = change_m_s.mul_add(change_m_s, 2.0 * deceleration_m_s2 * way_m).sqrt();
    if root_m_s + change_m_s > 0.0 {
        2.0 * deceleration_m_s2 * way_m / (root_m_s + change_m_s)
    } else {
        0.0
    }
}

/// Returns the velocity nearest to `wanted_m_s` after one step; on its way through zero an axis
/// decelerates first.
fn reachable_m_s(now_m_s: f64, wanted_m_s: f64, law: &ProfileLaw, dt_s: f64) -> f64 {
    let turns = now_m_s * wanted_m_s < 0.0;
    let slows = turns || wanted_m_s.abs() < now_m_s.abs();
    let max_m_s2 = if slows { law.deceleration_m_s2 } else { law.acceleration_m_s2 };
    let change_m_s = max_m_s2 * dt_s;
    let aim_m_s = if turns { 0.0 } else { wanted_m_s };
    if (aim_m_s - now_m_s).abs() <= change_m_s {
        aim_m_s
    } else {
        now_m_s + change_m_s.copysign(aim_m_s - now_m_s)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn a_place_is_reached_within_the_limits_and_without_overshoot(
            target_m in -1.0_f64..1.0, velocity_m_s in 0.001_f64..1.0, acceleration in 0.1_f64..50.0,
            deceleration in 0.1_f64..50.0
        ) {
            let law = ProfileLaw {
                velocity_m_s, acceleration_m_s2: acceleration, deceleration_m_s2: deceleration,
            };
            let goal = Goal::Place { position_m: target_m };
            let dt_s = 125e-6;
            let mut profile = Profile { position_m: 0.0, velocity_m_s: 0.0 };
            let least_s = target_m.abs() / velocity_m_s
                + velocity_m_s / acceleration + velocity_m_s / deceleration;
            let mut n_steps = 0.0;
            while !profile.has_reached(goal) {
                let before = profile;
                profile.step(goal, &law, dt_s);
                n_steps += 1.0;
                prop_assert!(n_steps * dt_s < least_s + 0.1, "still at {profile:?}");
                let change_m_s2 = (profile.velocity_m_s - before.velocity_m_s) / dt_s;
                prop_assert!(change_m_s2.abs() <= acceleration.max(deceleration) * (1.0 + 1e-6));
                prop_assert!(profile.velocity_m_s.abs() <= velocity_m_s * (1.0 + 1e-12));
                prop_assert!(profile.position_m.abs() <= target_m.abs() + 1e-12);
            }
            prop_assert_eq!(profile.position_m.to_bits(), target_m.to_bits());
        }
    }

    #[test]
    fn a_reversal_passes_zero_at_the_deceleration() {
        let law = ProfileLaw { velocity_m_s: 1.0, acceleration_m_s2: 1.0, deceleration_m_s2: 10.0 };
        let mut profile = Profile { position_m: 0.0, velocity_m_s: 0.1 };
        let mut speeds = Vec::new();
        for _ in 0..4 {
            profile.step(Goal::Speed { velocity_m_s: -0.01 }, &law, 0.005);
            speeds.push(profile.velocity_m_s);
        }
        for (found, expected) in speeds.iter().zip([0.05, 0.0, -0.005, -0.01]) {
            assert!((found - expected).abs() < 1e-12, "{speeds:?}");
        }
    }
}
