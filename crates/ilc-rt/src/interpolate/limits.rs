//! Limits of the axes, and the resulting limits along a straight path.

use super::MAX_AXES;
use super::error::MoveError;
use super::quantity::Quantity;

/// Limits of one axis's set points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// Velocity limit.
    pub velocity_max_m_s: f64,
    /// Acceleration limit.
    pub acceleration_max_m_s2: f64,
    /// Jerk limit.
    pub jerk_max_m_s3: f64,
}

impl AxisLimits {
    /// Pads the limits to an array of all axes; missing axes get limits of 1.
    pub fn padded(limits: &[Self]) -> [Self; MAX_AXES] {
        let unused = Self { velocity_max_m_s: 1.0, acceleration_max_m_s2: 1.0, jerk_max_m_s3: 1.0 };
        let mut all = [unused; MAX_AXES];
        for (to, from) in all.iter_mut().zip(limits) {
            *to = *from;
        }
        all
    }

    /// Refuses limits that are not positive numbers; `axis` names the axis in the error.
    ///
    /// # Errors
    /// [`MoveError::AxisLimit`].
    pub fn check(&self, axis: usize) -> Result<(), MoveError> {
        for (quantity, value) in self.named() {
            if !is_positive(value) {
                return Err(MoveError::AxisLimit { axis, quantity, value });
            }
        }
        Ok(())
    }

    /// Returns the three limits with their names.
    pub(crate) fn named(&self) -> [(Quantity, f64); 3] {
        [
            (Quantity::Velocity, self.velocity_max_m_s),
            (Quantity::Acceleration, self.acceleration_max_m_s2),
            (Quantity::Jerk, self.jerk_max_m_s3),
        ]
    }
}

/// Limits along a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLimits {
    /// Velocity limit along the path.
    pub velocity_m_s: f64,
    /// Acceleration limit along the path.
    pub acceleration_m_s2: f64,
    /// Jerk limit along the path.
    pub jerk_m_s3: f64,
}

impl PathLimits {
    /// Returns the limits along a unit direction: the tightest `limit_i / |d_i|` over all axes, and
    /// the feed.
    ///
    /// # Shapes
    /// - `direction`, `limits`: one entry per axis; the shorter of the two counts.
    pub fn along(direction: &[f64], limits: &[AxisLimits], feed_m_s: f64) -> Self {
        // `f64::min` would drop a NaN feed, and with it the refusal of the move.
        let tighter = |so_far: f64, limit: f64| if limit < so_far { limit } else { so_far };
        let mut path = Self {
            velocity_m_s: feed_m_s,
            acceleration_m_s2: f64::INFINITY,
            jerk_m_s3: f64::INFINITY,
        };
        for (share, limit) in direction.iter().map(|d| d.abs()).zip(limits) {
            if share > 0.0 {
                path.velocity_m_s = tighter(path.velocity_m_s, limit.velocity_max_m_s / share);
                path.acceleration_m_s2 =
                    tighter(path.acceleration_m_s2, limit.acceleration_max_m_s2 / share);
                path.jerk_m_s3 = tighter(path.jerk_m_s3, limit.jerk_max_m_s3 / share);
            }
        }
        path
    }
}

/// Returns true if a value is finite and above 0.
pub(crate) fn is_positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
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

    fn limits(velocity: f64, acceleration: f64, jerk: f64) -> AxisLimits {
        AxisLimits {
            velocity_max_m_s: velocity,
            acceleration_max_m_s2: acceleration,
            jerk_max_m_s3: jerk,
        }
    }

    #[test]
    fn the_tightest_axis_and_the_feed_bound_the_path() {
        let axes = [limits(0.3, 6.0, 60.0), limits(0.8, 1.6, 800.0)];
        let path = PathLimits::along(&[0.6, -0.8], &axes, 10.0);
        assert!((path.velocity_m_s - 0.5).abs() < 1e-15, "0.3/0.6 before 0.8/0.8");
        assert!((path.acceleration_m_s2 - 2.0).abs() < 1e-15, "1.6/0.8 before 6/0.6");
        assert!((path.jerk_m_s3 - 100.0).abs() < 1e-12, "60/0.6 before 800/0.8");
        let slow = PathLimits::along(&[0.6, -0.8], &axes, 0.1);
        assert!((slow.velocity_m_s - 0.1).abs() < 1e-15);
    }

    #[test]
    fn an_axis_that_stands_still_bounds_nothing() {
        let path =
            PathLimits::along(&[1.0, 0.0], &[limits(1.0, 2.0, 3.0), limits(1e-9, 1e-9, 1e-9)], 9.0);
        assert_eq!((path.velocity_m_s, path.acceleration_m_s2, path.jerk_m_s3), (1.0, 2.0, 3.0));
    }

    #[test]
    fn a_bad_limit_is_named() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = limits(1.0, bad, 1.0).check(1).unwrap_err();
            let MoveError::AxisLimit { axis: 1, quantity: Quantity::Acceleration, .. } = error
            else {
                panic!("{error:?}");
            };
        }
    }
}
