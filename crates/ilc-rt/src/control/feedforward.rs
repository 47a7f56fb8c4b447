//! Static feed-forward of the program: velocity, acceleration and friction.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// Feed-forward of an axis.
///
/// `v = f r'`, `F = m r'' + b r' + F_c clamp(r' / v_c, -1, 1)`
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedforward {
    /// Share of the reference velocity.
    pub velocity: f64,
    /// Time by which the set point is ahead of the program.
    pub lead_s: f64,
    /// Force per reference acceleration.
    pub mass_kg: f64,
    /// Force per reference velocity.
    pub viscous_n_s_m: f64,
    /// Force in the direction of motion.
    pub coulomb_n: f64,
    /// Velocity from which on that force is whole, so that it does not step at a reversal.
    pub coulomb_velocity_m_s: f64,
}

impl Feedforward {
    /// Returns the friction at a reference velocity.
    ///
    /// # Real Time
    /// Hot. NaN passes through.
    pub fn friction_n(&self, velocity_m_s: f64) -> f64 {
        let direction = if self.coulomb_velocity_m_s > 0.0 {
            (velocity_m_s / self.coulomb_velocity_m_s).clamp(-1.0, 1.0)
        } else {
            0.0
        };
        self.viscous_n_s_m * velocity_m_s + self.coulomb_n * direction
    }

    /// Returns the force of a reference velocity and acceleration.
    ///
    /// # Real Time
    /// Hot. NaN passes through.
    pub fn force_n(&self, velocity_m_s: f64, acceleration_m_s2: f64) -> f64 {
        self.mass_kg * acceleration_m_s2 + self.friction_n(velocity_m_s)
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

    #[test]
    fn hand_computed_force() {
        let forward = Feedforward {
            velocity: 1.0,
            lead_s: 0.0,
            mass_kg: 20.0,
            viscous_n_s_m: 30.0,
            coulomb_n: 15.0,
            coulomb_velocity_m_s: 0.002,
        };
        assert!((forward.force_n(0.1, 2.0) - (40.0 + 3.0 + 15.0)).abs() < 1e-12);
        assert!((forward.force_n(-0.001, 0.0) - (-0.03 - 7.5)).abs() < 1e-12, "no step at 0");
        assert!(forward.force_n(f64::NAN, 0.0).is_nan());
        assert!((Feedforward::default().force_n(0.1, 2.0)).abs() <= 0.0);
    }
}
