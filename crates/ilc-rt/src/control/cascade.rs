//! Cascaded control: a P position loop around a PI velocity loop.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{Bounded, clamp_finite};

/// Gains, feed-forward and limits of a [`Cascade`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CascadeGains {
    /// Position gain `k_v`: velocity per position error.
    pub position_gain_per_s: f64,
    /// Velocity gain `k_p`: force per velocity error.
    pub velocity_gain_n_s_m: f64,
    /// Integral time (reset time) `T_n` of the velocity loop; infinite switches the integral off.
    pub integral_time_s: f64,
    /// Velocity feed-forward, 0 to 1: share of the reference velocity.
    pub velocity_feedforward: f64,
    /// Acceleration feed-forward: force per reference acceleration, i.e. the moving mass.
    pub acceleration_feedforward_kg: f64,
    /// Limit of the velocity command.
    pub velocity_max_m_s: f64,
    /// Limit of the force.
    pub force_max_n: f64,
}

/// Reference of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CascadeReference {
    /// Position.
    pub position_m: f64,
    /// Velocity.
    pub velocity_m_s: f64,
    /// Acceleration.
    pub acceleration_m_s2: f64,
}

/// A cascaded position and velocity controller.
///
/// `v* = k_v (r - y) + f r'`, `F = k_p (v* - y') + k_p dt / T_n sum_{i<k} (v* - y')[i] + m r''`
///
/// The force saturates at its limit. Anti-windup: meanwhile the integral ignores errors that would
/// drive it further into saturation (conditional integration).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cascade {
    gains: CascadeGains,
    dt_s: f64,
    integral_n: f64,
    /// Output of the last tick, and what it added to the integral.
    asked_n: f64,
    added_n: f64,
}

impl Cascade {
    /// Creates the controller at rest.
    pub fn new(gains: CascadeGains, dt_s: f64) -> Self {
        Self { gains, dt_s, integral_n: 0.0, asked_n: 0.0, added_n: 0.0 }
    }

    /// Returns the force of this tick; `learned_n` is added before saturation.
    ///
    /// # Real Time
    /// Hot. A non-finite force is replaced by 0 and flagged, and leaves the integral unchanged.
    pub fn step(
        &mut self,
        reference: CascadeReference,
        actual_m: f64,
        actual_m_s: f64,
        learned_n: f64,
    ) -> Bounded {
        let gains = &self.gains;
        let asked = gains.position_gain_per_s * (reference.position_m - actual_m)
            + gains.velocity_feedforward * reference.velocity_m_s;
        let velocity = clamp_finite(asked, gains.velocity_max_m_s);
        let error_m_s = velocity.value - actual_m_s;
        let forward_n = gains.acceleration_feedforward_kg * reference.acceleration_m_s2 + learned_n;
        let force = gains.velocity_gain_n_s_m * error_m_s + self.integral_n + forward_n;
        if !velocity.finite || !force.is_finite() {
            return clamp_finite(f64::NAN, gains.force_max_n);
        }
        let output = clamp_finite(force, gains.force_max_n);
        (self.asked_n, self.added_n) = (output.value, 0.0);
        let winds_up = output.saturated && error_m_s * output.value > 0.0;
        if gains.integral_time_s > 0.0 && !winds_up {
            let share = self.dt_s / gains.integral_time_s;
            self.added_n = gains.velocity_gain_n_s_m * share * error_m_s;
            self.integral_n += self.added_n;
        }
        output
    }

    /// Records the force that was really commanded after a further limit. Anti-windup: if that limit
    /// acts against the error, the integral forgets what it added in this tick.
    ///
    /// # Real Time
    /// Hot.
    pub fn given(&mut self, given_n: f64) {
        if (self.asked_n - given_n) * self.added_n > 0.0 {
            self.integral_n -= self.added_n;
        }
        self.added_n = 0.0;
    }

    /// Resets the controller to rest.
    pub fn reset(&mut self) {
        (self.integral_n, self.asked_n, self.added_n) = (0.0, 0.0, 0.0);
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests {
    use super::*;

    #[test]
    fn hand_computed_force() {
        let gains = CascadeGains {
            position_gain_per_s: 50.0,
            velocity_gain_n_s_m: 100.0,
            integral_time_s: 0.1,
            velocity_feedforward: 1.0,
            acceleration_feedforward_kg: 2.0,
            velocity_max_m_s: f64::INFINITY,
            force_max_n: 30.0,
        };
        let mut cascade = Cascade::new(gains, 0.01);
        let reference =
            CascadeReference { position_m: 0.001, velocity_m_s: 0.1, acceleration_m_s2: 1.0 };
        // v* = 0.05 + 0.1; F = 100 * 0.05 + 2 + 0.5.
        assert!((cascade.step(reference, 0.0, 0.1, 0.5).value - 7.5).abs() < 1e-12);
        // The integral adds 100 * 0.01 / 0.1 * 0.05.
        assert!((cascade.step(reference, 0.0, 0.1, 0.5).value - 8.0).abs() < 1e-12);
        assert_eq!(cascade.step(reference, -1.0, 0.0, 0.0).value, 30.0);
        assert!(!cascade.step(reference, f64::NAN, 0.0, 0.0).finite);
    }

    #[test]
    fn a_limit_behind_it_does_not_wind_it_up() {
        let gains = second_order(94.0, 1.0, 20.0, 0.1);
        let (mut held, mut free) = (Cascade::new(gains, 1e-3), Cascade::new(gains, 1e-3));
        let ahead = CascadeReference { position_m: 1e-3, ..CascadeReference::default() };
        for _ in 0..1000 {
            let asked_n = held.step(ahead, 0.0, 0.0, 0.0).value;
            held.given(asked_n.min(5.0));
            let asked_n = free.step(ahead, 0.0, 0.0, 0.0).value;
            free.given(asked_n);
        }
        let rest = CascadeReference::default();
        assert_eq!(held.step(rest, 0.0, 0.0, 0.0).value, 0.0);
        assert!(free.step(rest, 0.0, 0.0, 0.0).value > 1000.0);
    }

    /// Gains with which a mass follows as `omega^2 / (s^2 + 2 delta omega s + omega^2)`, apart from
    /// the integral part \[haas2016\]: `k_v = omega / (2 delta)`, `k_p = 2 delta omega m`.
    fn second_order(omega: f64, damping: f64, mass_kg: f64, integral_time_s: f64) -> CascadeGains {
        CascadeGains {
            position_gain_per_s: omega / (2.0 * damping),
            velocity_gain_n_s_m: 2.0 * damping * omega * mass_kg,
            integral_time_s,
            velocity_feedforward: 0.0,
            acceleration_feedforward_kg: 0.0,
            velocity_max_m_s: f64::INFINITY,
            force_max_n: f64::INFINITY,
        }
    }

    #[test]
    fn a_mass_follows_a_step_as_the_second_order_it_was_tuned_for() {
        let (omega, damping, mass): (f64, f64, f64) = (94.0, 0.6, 20.0);
        let gains = second_order(omega, damping, mass, f64::INFINITY);
        let dt = 1e-5;
        let mut cascade = Cascade::new(gains, dt);
        let reference = CascadeReference { position_m: 1.0, ..CascadeReference::default() };
        let (mut position, mut velocity) = (0.0, 0.0);
        let damped = omega * (1.0 - damping * damping).sqrt();
        for k in 0..10_000 {
            let t = f64::from(k) * dt;
            let decay = (-damping * omega * t).exp();
            let lag = damping * omega / damped;
            let wanted = 1.0 - decay * ((damped * t).cos() + lag * (damped * t).sin());
            assert!((position - wanted).abs() < 2e-3, "{t}: {position} {wanted}");
            let force = cascade.step(reference, position, velocity, 0.0).value;
            velocity += dt * force / mass;
            position += dt * velocity;
        }
    }

    #[test]
    fn after_saturation_it_does_not_overshoot_for_long() {
        let mut gains = second_order(94.0, 1.0, 20.0, 0.1);
        gains.force_max_n = 10.0;
        let mut cascade = Cascade::new(gains, 1e-3);
        let ahead = CascadeReference { position_m: 1.0, ..CascadeReference::default() };
        for _ in 0..5000 {
            assert_eq!(cascade.step(ahead, 0.0, 0.0, 0.0).value, 10.0);
        }
        assert!(cascade.step(CascadeReference::default(), 0.1, 0.0, 0.0).value < 0.0);
    }
}
