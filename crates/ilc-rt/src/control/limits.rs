//! Bounds of commands: clamping, and the last check before a set point goes to a drive.

/// A command within bounds, and what had to be done to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// The command, always finite.
    pub value: f64,
    /// Whether it was cut to a bound.
    pub saturated: bool,
    /// Whether it was a number at all; if not, `value` is 0.
    pub finite: bool,
}

/// Cuts a command to `-most..=most`, and flags one that is not finite.
///
/// # Real Time
/// Hot; never panics, whatever the bound: one that is not a number of at least 0 counts as 0.
pub fn clamp_finite(value: f64, most: f64) -> Bounded {
    let most = if most >= 0.0 { most } else { 0.0 };
    if !value.is_finite() {
        return Bounded { value: 0.0, saturated: false, finite: false };
    }
    let bounded = value.clamp(-most, most);
    Bounded { value: bounded, saturated: value.abs() > most, finite: true }
}

/// A set point that must not go to the drive.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LimitError {
    /// It is not a number.
    #[error("set point {value}: must be finite")]
    NotFinite {
        /// The value found.
        value: f64,
    },
    /// It lies outside the axis.
    #[error("set point {position_m} m: allowed {min_m} to {max_m} m")]
    Position {
        /// The value found.
        position_m: f64,
        /// Lowest position.
        min_m: f64,
        /// Highest position.
        max_m: f64,
    },
    /// It moves too fast.
    #[error("set point velocity {velocity_m_s} m/s: allowed up to {max_m_s} m/s")]
    Velocity {
        /// The value found.
        velocity_m_s: f64,
        /// Highest speed.
        max_m_s: f64,
    },
}

/// What every set point of an axis must hold, the learned input included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetpointLimits {
    /// Lowest position.
    pub position_min_m: f64,
    /// Highest position.
    pub position_max_m: f64,
    /// Highest speed.
    pub velocity_max_m_s: f64,
}

impl SetpointLimits {
    /// Checks a position and the velocity with which it moves.
    ///
    /// # Real Time
    /// Hot; the error is a Copy value.
    /// # Errors
    /// [`LimitError`] with the value and what is allowed.
    pub fn check(&self, position_m: f64, velocity_m_s: f64) -> Result<(), LimitError> {
        for value in [position_m, velocity_m_s] {
            if !value.is_finite() {
                return Err(LimitError::NotFinite { value });
            }
        }
        if !(self.position_min_m..=self.position_max_m).contains(&position_m) {
            return Err(LimitError::Position {
                position_m,
                min_m: self.position_min_m,
                max_m: self.position_max_m,
            });
        }
        // A difference of two positions carries their rounding; a set point at the limit is allowed.
        if velocity_m_s.abs() > self.velocity_max_m_s * (1.0 + 1e-9) {
            return Err(LimitError::Velocity { velocity_m_s, max_m_s: self.velocity_max_m_s });
        }
        Ok(())
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
    fn clamping_says_what_it_did() {
        let within = clamp_finite(-0.5, 1.0);
        assert_eq!(within, Bounded { value: -0.5, saturated: false, finite: true });
        let cut = clamp_finite(-3.0, 1.0);
        assert_eq!(cut, Bounded { value: -1.0, saturated: true, finite: true });
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(
                clamp_finite(bad, 1.0),
                Bounded { value: 0.0, saturated: false, finite: false }
            );
        }
        assert_eq!(clamp_finite(1.0, f64::NAN).value, 0.0);
        assert_eq!(clamp_finite(1.0, -1.0).value, 0.0);
    }

    #[test]
    fn each_limit_is_checked_and_named() {
        let limits =
            SetpointLimits { position_min_m: -0.02, position_max_m: 0.1, velocity_max_m_s: 0.5 };
        assert_eq!(limits.check(0.1, -0.5), Ok(()));
        assert_eq!(limits.check(-0.02, 0.5 * (1.0 + 1e-12)), Ok(()));
        let line = |position, velocity| limits.check(position, velocity).unwrap_err().to_string();
        assert_eq!(line(0.2, 0.0), "set point 0.2 m: allowed -0.02 to 0.1 m");
        assert_eq!(line(0.0, -0.6), "set point velocity -0.6 m/s: allowed up to 0.5 m/s");
        assert_eq!(line(f64::NAN, 0.0), "set point NaN: must be finite");
        assert_eq!(line(0.0, f64::INFINITY), "set point inf: must be finite");
    }
}
