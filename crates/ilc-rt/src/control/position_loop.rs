//! P position control with velocity feed-forward, for drives that close the velocity loop (CSV).

/// `v_cmd = k_v (r − y) + f ṙ`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionLoop {
    /// Position gain `k_v`: velocity per position error.
    pub gain_per_s: f64,
    /// Velocity feed-forward `f`, 0 to 1: share of the reference velocity.
    pub velocity_feedforward: f64,
}

impl PositionLoop {
    /// Returns the velocity command.
    ///
    /// # Units
    /// - positions in metres, velocities in metres per second
    /// # Real Time
    /// Hot. Non-finite values pass through: saturate the result with [`super::clamp_finite`].
    pub fn command_m_s(&self, reference_m: f64, reference_m_s: f64, actual_m: f64) -> f64 {
        self.gain_per_s * (reference_m - actual_m) + self.velocity_feedforward * reference_m_s
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
    fn hand_computed_command() {
        let control = PositionLoop { gain_per_s: 50.0, velocity_feedforward: 0.5 };
        assert!((control.command_m_s(0.102, 0.2, 0.1) - 0.2).abs() < 1e-12);
        assert!((control.command_m_s(0.1, -0.2, 0.102) + 0.2).abs() < 1e-12);
    }

    #[test]
    fn full_feedforward_follows_a_ramp_without_lag_and_none_lags_by_v_over_kv() {
        for (velocity_feedforward, lag_m) in [(1.0, 0.0), (0.0, 0.1 / 50.0), (0.25, 0.075 / 50.0)] {
            let control = PositionLoop { gain_per_s: 50.0, velocity_feedforward };
            let (dt, mut actual_m) = (1e-4, 0.0);
            for tick in 0..20_000 {
                let reference_m = 0.1 * f64::from(tick) * dt;
                actual_m += dt * control.command_m_s(reference_m, 0.1, actual_m);
            }
            let error_m = 0.1 * 2.0 - actual_m;
            assert!((error_m - lag_m).abs() < 1e-9, "{velocity_feedforward}: {error_m}");
        }
    }
}
