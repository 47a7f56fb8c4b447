//! The cascade inside a drive: P position control around PI velocity control.

use super::Demand;

/// Gains of the cascade.
///
/// With `k_v = ω₀/2δ` and the velocity gain `2 δ ω₀ m`, a free mass and an infinite integral time, the
/// position follows as `ω₀² / (s² + 2 δ ω₀ s + ω₀²)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveLoop {
    /// Position gain: velocity per position error.
    pub position_gain_per_s: f64,
    /// Velocity gain: force per velocity error.
    pub velocity_gain_n_s_m: f64,
    /// Integral time of the velocity controller.
    pub integral_time_s: f64,
    /// Force limit of the motor.
    pub force_max_n: f64,
}

impl DriveLoop {
    /// Returns the cascade tuned for a second-order response.
    pub fn tuned(
        mass_kg: f64,
        natural_rad_s: f64,
        damping: f64,
        integral_time_s: f64,
        force_max_n: f64,
    ) -> Self {
        Self {
            position_gain_per_s: natural_rad_s / (2.0 * damping),
            velocity_gain_n_s_m: 2.0 * damping * natural_rad_s * mass_kg,
            integral_time_s,
            force_max_n,
        }
    }

    /// Returns the force of the motor; `integral_n` is the state of the velocity controller.
    ///
    /// `feedforward_n` is added to the output of the velocity controller. A ramp after a force demand
    /// begins with an empty integral: the force of a motion that ends does not brake it, and would
    /// only decay with the integral time.
    ///
    /// At the force limit the integral accepts only errors that lead out of saturation
    /// (anti-windup).
    #[inline]
    pub(super) fn force_n(
        &self,
        demand: Demand,
        position_m: f64,
        velocity_m_s: f64,
        feedforward_n: f64,
        integral_n: &mut f64,
        dt_s: f64,
    ) -> f64 {
        let wanted_m_s = match demand {
            Demand::Off => {
                *integral_n = 0.0;
                return 0.0;
            }
            Demand::Position { position_m: target_m, velocity_m_s: feedforward_m_s } => {
                self.position_gain_per_s * (target_m - position_m) + feedforward_m_s
            }
            Demand::Velocity { velocity_m_s: wanted_m_s } => wanted_m_s,
            Demand::Force { force_n } if force_n.is_finite() => {
                *integral_n = 0.0;
                return force_n.clamp(-self.force_max_n, self.force_max_n);
            }
            Demand::Force { .. } => return 0.0,
        };
        let error_n = self.velocity_gain_n_s_m * (wanted_m_s - velocity_m_s);
        // A NaN demand must not corrupt the state permanently.
        if !error_n.is_finite() {
            return 0.0;
        }
        let asked_n = error_n + *integral_n + feedforward_n;
        let given_n = asked_n.clamp(-self.force_max_n, self.force_max_n);
        if (asked_n - given_n) * error_n <= 0.0 {
            *integral_n += error_n * dt_s / self.integral_time_s;
        }
        given_n
    }
}
