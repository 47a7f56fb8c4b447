//! Slew-rate limiter for inputs computed elsewhere.

/// A rate limiter: follows a target by at most `step_max` per tick.
///
/// A sound law gives a bounded, smooth input. Should it fail to, the axis sees a ramp instead of a
/// step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlewLimiter {
    step_max: f64,
    value: f64,
}

impl SlewLimiter {
    /// Starts at 0. `step_max` is the largest change in one tick, in the unit of the value; a
    /// negative or NaN limit locks the output.
    pub fn new(step_max: f64) -> Self {
        Self { step_max: if step_max >= 0.0 { step_max } else { 0.0 }, value: 0.0 }
    }

    /// Returns the value of this tick; a non-finite target keeps the last value.
    ///
    /// # Real Time
    /// Hot.
    pub fn next(&mut self, target: f64) -> f64 {
        if target.is_finite() {
            let step = target - self.value;
            // The target itself rather than value + step, so that it is reached exactly.
            self.value = if step.abs() <= self.step_max {
                target
            } else {
                self.value + self.step_max.copysign(step)
            };
        }
        self.value
    }

    /// Resets to a value; a non-finite one counts as 0.
    pub fn reset(&mut self, value: f64) {
        self.value = if value.is_finite() { value } else { 0.0 };
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
    fn a_step_becomes_a_ramp_that_ends_exactly() {
        let mut slew = SlewLimiter::new(0.3);
        let values: Vec<f64> = (0..5).map(|_| slew.next(1.0)).collect();
        assert!((values[0] - 0.3).abs() < 1e-15 && (values[2] - 0.9).abs() < 1e-15);
        assert_eq!(values[3..], [1.0, 1.0]);
        assert!((slew.next(-1.0) - 0.7).abs() < 1e-15);
    }

    #[test]
    fn what_is_not_finite_changes_nothing() {
        let mut slew = SlewLimiter::new(1.0);
        slew.reset(0.5);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(slew.next(bad), 0.5);
        }
        slew.reset(f64::NAN);
        assert_eq!(slew.next(0.0), 0.0);
        assert_eq!(SlewLimiter::new(f64::NAN).next(1.0), 0.0);
        assert_eq!(SlewLimiter::new(-1.0).next(1.0), 0.0);
    }
}
