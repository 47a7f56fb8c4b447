//! Slew-rate limiter for inputs computed elsewhere, of the first order or with a bounded bend.

/// A rate limiter: follows a target by at most `step_max` per tick.
///
/// A sound law gives a bounded, smooth input. Should it fail to, the axis sees a ramp instead of a
/// step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlewLimiter {
    step_max: f64,
    bend_max: f64,
    value_max: f64,
    value: f64,
    step: f64,
}

impl SlewLimiter {
    /// Starts at 0. `step_max` is the largest change in one tick, in the unit of the value; a
    /// negative or NaN limit locks the output.
    pub fn new(step_max: f64) -> Self {
        Self {
            step_max: if step_max >= 0.0 { step_max } else { 0.0 },
            bend_max: f64::INFINITY,
            value_max: f64::INFINITY,
            value: 0.0,
            step: 0.0,
        }
    }

    /// Bounds the change of the step from tick to tick as well, for targets within `value_max`; a
    /// negative or NaN bound locks the output.
    #[must_use]
    pub fn bending(self, bend_max: f64, value_max: f64) -> Self {
        Self { bend_max: if bend_max >= 0.0 { bend_max } else { 0.0 }, value_max, ..self }
    }

    /// Returns the largest step from which the value comes to rest within a distance:
    /// `s (s + b) / 2b = d`.
    fn stopping(&self, distance: f64) -> f64 {
        if self.bend_max.is_infinite() {
            return f64::INFINITY;
        }
        let half = 0.5 * self.bend_max;
        (half * half + 2.0 * self.bend_max * distance.max(0.0)).sqrt() - half
    }

    /// Returns the value of this tick; a non-finite target keeps the last value.
    ///
    /// # Real Time
    /// Hot.
    pub fn next(&mut self, target: f64) -> f64 {
        if target.is_finite() {
            let step = target - self.value;
            let up = self.step_max.min(self.stopping(self.value_max - self.value));
            let down = self.step_max.min(self.stopping(self.value_max + self.value));
            let before = self.value;
            // The target itself rather than value + step, so that it is reached exactly.
            if step <= up && step >= -down && (step - self.step).abs() <= self.bend_max {
                self.value = target;
            } else {
                let closing = self.stopping(step.abs()).min(step.abs()).copysign(step);
                let next = closing
                    .min(up)
                    .max(-down)
                    .min(self.step + self.bend_max)
                    .max(self.step - self.bend_max);
                self.value = (self.value + next).min(self.value_max).max(-self.value_max);
            }
            self.step = self.value - before;
        }
        self.value
    }

    /// Resets to a value; a non-finite one counts as 0.
    pub fn reset(&mut self, value: f64) {
        self.value = if value.is_finite() { value } else { 0.0 };
        self.step = 0.0;
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
    fn a_bend_is_bounded_too_and_the_bound_of_the_value_holds() {
        let mut slew = SlewLimiter::new(0.3).bending(0.01, 1.0);
        let (mut before, mut step) = (0.0, 0.0);
        let wanted = [[1.0; 40], [-1.0; 40], [0.5; 40], [0.5; 40]].concat();
        for target in
            wanted.iter().copied().chain((0..60).map(|k| if k % 7 < 3 { 1.0 } else { -1.0 }))
        {
            let value = slew.next(target);
            assert!(value.abs() <= 1.0 && (value - before).abs() <= 0.3 + 1e-12);
            assert!((value - before - step).abs() <= 1.2 * 0.01, "{value} {before} {step}");
            (step, before) = (value - before, value);
        }
        slew.reset(0.0);
        // A target that stops at once is overshot by what the bend needs, and then reached.
        let steady: Vec<f64> = (0..120).map(|_| slew.next(0.5)).collect();
        assert!(steady.iter().all(|value| *value <= 0.55) && steady[119] == 0.5);
        let soft = |k: f64| 0.4 * (1.0 - (0.05 * k).cos());
        slew.reset(0.0);
        assert!((0..100).map(f64::from).all(|k| slew.next(soft(k)) == soft(k)));
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
