//! A straight, time-synchronised move of all axes from rest to rest, planned between two ticks.

use super::MAX_AXES;
use super::error::MoveError;
use super::limits::{AxisLimits, PathLimits};
use super::line::Line;
use super::profile::JerkLimited;
use super::setpoint::Setpoint;

/// A move to a target, e.g. the return to the start between two runs.
#[derive(Clone, Copy, Debug)]
pub struct PointToPoint {
    line: Line,
    /// `None` if the axes are at the target already.
    profile: Option<JerkLimited>,
    time_s: f64,
}

impl PointToPoint {
    /// Plans the move; entries beyond `n_axes` are ignored.
    ///
    /// # Real Time
    /// Hot: does not allocate; computes a few roots.
    /// # Errors
    /// [`MoveError`] if a position is not finite, or a limit or the feed not positive.
    pub fn new(
        from_m: &[f64; MAX_AXES],
        to_m: &[f64; MAX_AXES],
        n_axes: usize,
        limits: &[AxisLimits; MAX_AXES],
        feed_m_s: f64,
    ) -> Result<Self, MoveError> {
        if !(1..=MAX_AXES).contains(&n_axes) {
            return Err(MoveError::Axes { n_axes });
        }
        let (mut start_m, mut end_m) = ([0.0; MAX_AXES], [0.0; MAX_AXES]);
        for axis in 0..n_axes {
            for (position_m, copy) in
                [(from_m[axis], &mut start_m[axis]), (to_m[axis], &mut end_m[axis])]
            {
                if !position_m.is_finite() {
                    return Err(MoveError::Position {
                        axis,
                        position: position_m,
                        limit: f64::MAX,
                    });
                }
                *copy = position_m;
            }
            limits[axis].check(axis)?;
        }
        let line = Line::new(start_m, end_m);
        let profile = if line.length_m > 0.0 {
            let along = PathLimits::along(&line.direction[..n_axes], &limits[..n_axes], feed_m_s);
            Some(JerkLimited::along(line.length_m, &along)?)
        } else {
            None
        };
        Ok(Self { line, profile, time_s: 0.0 })
    }

    /// Returns the duration of the move.
    pub fn duration_s(&self) -> f64 {
        self.profile.map_or(0.0, |profile| profile.duration_s())
    }

    /// Returns the set point one `dt_s` later; the first call gives the point after the start. The
    /// last one is exactly the target, is marked `done`, and is repeated.
    ///
    /// # Real Time
    /// Hot, allocates nothing.
    pub fn next(&mut self, dt_s: f64) -> Setpoint {
        self.time_s += dt_s;
        match self.profile {
            Some(profile) if self.time_s < profile.duration_s() => {
                let state = profile.at(self.time_s);
                Setpoint {
                    position_m: self.line.point_m(state.s_m),
                    velocity_m_s: self.line.along(state.v_m_s),
                    done: false,
                }
            }
            _ => Setpoint { done: true, ..Setpoint::at_rest(self.line.to_m) },
        }
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
    use crate::interpolate::random::Random;

    const LIMITS: AxisLimits =
        AxisLimits { velocity_max_m_s: 0.5, acceleration_max_m_s2: 8.0, jerk_max_m_s3: 1000.0 };

    #[test]
    fn all_axes_arrive_together_on_a_straight_line_within_the_limits() {
        let mut random = Random(3);
        let cycle_s = 0.002;
        for _ in 0..500 {
            let from_m: [f64; MAX_AXES] = std::array::from_fn(|_| random.signed());
            let to_m: [f64; MAX_AXES] = std::array::from_fn(|_| random.signed());
            let mut plan = PointToPoint::new(&from_m, &to_m, 3, &[LIMITS; MAX_AXES], 0.3).unwrap();
            let mut before = [from_m; 4];
            let mut n_ticks = 0;
            loop {
                let setpoint = plan.next(cycle_s);
                n_ticks += 1;
                assert!(n_ticks < 20_000, "never done");
                before = [setpoint.position_m, before[0], before[1], before[2]];
                let share = (setpoint.position_m[0] - from_m[0]) / (to_m[0] - from_m[0]);
                let mut squares = 0.0;
                for axis in 0..3 {
                    let on_line = from_m[axis] + share * (to_m[axis] - from_m[axis]);
                    assert!((setpoint.position_m[axis] - on_line).abs() < 1e-9);
                    let [p, q, r, s] = before.map(|point| point[axis]);
                    squares += ((p - q) / cycle_s).powi(2);
                    let acceleration = (p - 2.0 * q + r) / cycle_s.powi(2);
                    let jerk = (p - 3.0 * q + 3.0 * r - s) / cycle_s.powi(3);
                    assert!(acceleration.abs() <= 8.0 + 1e-6, "{acceleration}");
                    assert!(jerk.abs() <= 1000.0 + 1e-3, "{jerk}");
                }
                assert!(squares.sqrt() <= 0.3 + 1e-9);
                if setpoint.done {
                    assert_eq!(setpoint.position_m[..3], to_m[..3]);
                    assert_eq!(setpoint.velocity_m_s, [0.0; MAX_AXES]);
                    break;
                }
            }
            assert!((f64::from(n_ticks) * cycle_s - plan.duration_s()).abs() <= cycle_s);
        }
    }

    #[test]
    fn a_move_to_where_one_is_is_done_at_once() {
        let here = [0.25; MAX_AXES];
        let mut plan = PointToPoint::new(&here, &here, 2, &[LIMITS; MAX_AXES], 0.1).unwrap();
        let setpoint = plan.next(0.001);
        assert!(setpoint.done);
        assert_eq!(setpoint.position_m[..2], here[..2]);
    }

    #[test]
    fn bad_values_are_refused() {
        let here = [0.0; MAX_AXES];
        let mut there = [1.0; MAX_AXES];
        let mut limits = [LIMITS; MAX_AXES];
        assert!(PointToPoint::new(&here, &there, 0, &limits, 0.1).is_err());
        assert!(PointToPoint::new(&here, &there, MAX_AXES + 1, &limits, 0.1).is_err());
        assert!(PointToPoint::new(&here, &there, 2, &limits, f64::NAN).is_err());
        assert!(PointToPoint::new(&here, &there, 2, &limits, 0.0).is_err());
        limits[1].jerk_max_m_s3 = 0.0;
        assert!(PointToPoint::new(&here, &there, 2, &limits, 0.1).is_err());
        assert!(PointToPoint::new(&here, &there, 1, &limits, 0.1).is_ok(), "axis 2 is not there");
        there[0] = f64::NAN;
        assert!(PointToPoint::new(&here, &there, 1, &limits, 0.1).is_err());
    }
}
