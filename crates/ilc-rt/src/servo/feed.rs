//! Scale of time along the path: feed override, and pause as a scale of 0.
//!
//! The set point at path time `τ` moves with `v s`, accelerates with `a s² + v ṡ` and has the jerk
//! `j s³ + 3 a s ṡ + v s̈`. Between two scales `s` follows a logistic curve,
//! `|ṡ| = c |s - s_from| |s - s_to| / |s_to - s_from|`, for which `|ṡ| <= c (1 - s)` and
//! `|s̈| <= c² (1 - s)`. A path that is within its limits at scale 1, even at all of them at once,
//! stays within them if, for every axis,
//! `c V <= A` (acceleration), `c² V <= J / 2` and `c A <= 0.8 J` (jerk), with its largest velocity `V`
//! on the path. A new scale is taken when the last one is reached: no curve is left halfway.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use crate::interpolate::AxisLimits;

/// Share of the jerk limit that leaving and reaching a scale may take beyond the curve.
const JERK_SHARE: f64 = 0.01;
/// Largest change of the curve's exponent in a tick, so that it is smooth.
const EXPONENT_MAX: f64 = 0.05;

/// The scale, and the curve to the next one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Feed {
    scale: f64,
    from: f64,
    to: f64,
    /// `c` times the cycle.
    exponent: f64,
    /// Distance with which a scale is left, and at which it is reached.
    leave: f64,
    reach: f64,
}

impl Feed {
    /// Creates it at scale 1, for axes with these limits and largest velocities on the path. Cold.
    pub(super) fn new(limits: &[AxisLimits], velocity_m_s: &[f64], dt_s: f64) -> Self {
        let mut feed = Self {
            scale: 1.0,
            from: 1.0,
            to: 1.0,
            exponent: EXPONENT_MAX,
            leave: 1e-3,
            reach: 1e-4,
        };
        let moving = || limits.iter().zip(velocity_m_s).filter(|(_, velocity)| **velocity > 0.0);
        for (limits, &velocity_m_s) in moving() {
            let (a, j) = (limits.acceleration_max_m_s2, limits.jerk_max_m_s3);
            let rate_per_s =
                (a / velocity_m_s).min((0.5 * j / velocity_m_s).sqrt()).min(0.8 * j / a);
            feed.exponent = feed.exponent.min(rate_per_s * dt_s);
        }
        for (limits, &velocity_m_s) in moving() {
            let jerk_steps = JERK_SHARE * limits.jerk_max_m_s3 * dt_s * dt_s / velocity_m_s;
            feed.leave = feed.leave.min(jerk_steps / feed.exponent);
            feed.reach = feed.reach.min(jerk_steps);
        }
        feed
    }

    /// Returns the scale of the coming step along the path, on its way to `wanted`.
    pub(super) fn next(&mut self, wanted: f64) -> f64 {
        if self.scale.to_bits() == self.to.to_bits() {
            (self.from, self.to) = (self.scale, wanted);
        }
        let span = (self.to - self.from).abs();
        if span <= self.reach {
            self.scale = self.to;
            return self.scale;
        }
        let left = (self.scale - self.from).abs().max(self.leave.min(0.5 * span));
        let ahead = (self.to - self.scale).abs();
        let step = self.exponent * left * ahead / span;
        self.scale += step.copysign(self.to - self.scale);
        if (self.to - self.scale).abs() <= self.reach {
            self.scale = self.to;
        }
        self.scale
    }

    /// Returns the scale of the last step.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns true if the path is held.
    pub(super) fn is_paused(&self) -> bool {
        self.scale <= 0.0
    }

    /// Takes a scale at once: between two runs nothing moves along the path.
    pub(super) fn reset(&mut self, scale: f64) {
        (self.scale, self.from, self.to) = (scale, scale, scale);
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    reason = "tests are cold"
)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn feed() -> Feed {
        let limits =
            AxisLimits { velocity_max_m_s: 0.5, acceleration_max_m_s2: 8.0, jerk_max_m_s3: 400.0 };
        Feed::new(&[limits], &[0.1], 1e-3)
    }

    #[test]
    fn without_an_order_the_scale_is_exactly_one() {
        let mut feed = feed();
        assert!((0..1000).all(|_| feed.next(1.0).to_bits() == 1.0_f64.to_bits()));
    }

    #[test]
    fn a_pause_ends_at_exactly_zero_and_a_resumption_at_exactly_one() {
        let mut feed = feed();
        let ticks = (1..5000).find(|_| feed.next(0.0) <= 0.0).unwrap();
        assert!(ticks < 2000, "{ticks} ticks");
        assert!(feed.is_paused());
        assert!((0..5000).any(|_| feed.next(1.0).to_bits() == 1.0_f64.to_bits()));
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        /// The worst case: velocity, acceleration and jerk of the path all at their limits.
        #[test]
        fn the_limits_hold_at_any_change(
            orders in prop::collection::vec((0.0..=1.0_f64, 1_usize..800), 1..12),
            velocity in 1e-3..0.5_f64,
            acceleration in 0.1..20.0_f64,
            jerk in 10.0..5000.0_f64,
        ) {
            let limits = AxisLimits {
                velocity_max_m_s: 0.5, acceleration_max_m_s2: acceleration, jerk_max_m_s3: jerk,
            };
            let dt_s = 1e-3;
            let mut feed = Feed::new(&[limits], &[velocity], dt_s);
            let mut scales = vec![1.0; 3];
            for (wanted, ticks) in orders {
                scales.extend((0..ticks).map(|_| feed.next(wanted)));
            }
            for s in scales.windows(3) {
                prop_assert!((0.0..=1.0).contains(&s[2]));
                let rate = (s[2] - s[1]) / dt_s;
                let bend = (s[2] - 2.0 * s[1] + s[0]) / (dt_s * dt_s);
                let reached = acceleration * s[1] * s[1] + velocity * rate.abs();
                prop_assert!(reached <= 1.03 * acceleration + 0.03 * jerk * dt_s, "a {reached}");
                let jerks = jerk * s[1].powi(3)
                    + 3.0 * acceleration * s[1] * rate.abs()
                    + velocity * bend.abs();
                prop_assert!(jerks <= 1.1 * jerk, "j {jerks} of {jerk}");
            }
        }
    }
}
