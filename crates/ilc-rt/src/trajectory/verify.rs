//! Verification of set points against the limits, by their finite differences over the cycle.
//!
//! A plan knows derivatives at points; a drive gets positions, one per cycle. Every path, whatever
//! its plan, is accepted only after its own set points have been checked here, with rest before the
//! first and after the last.

use super::error::TrajectoryError;
use crate::interpolate::{AxisLimits, MAX_AXES, Quantity};

/// Relative violation of a limit that is tolerated.
pub(super) const TOLERANCE: f64 = 1e-9;
/// Rows of rest after the last one that count too: the last jerk acts until the acceleration is
/// back at 0.
pub(super) const ROWS_AFTER: usize = 3;

/// Velocity, acceleration and jerk over the cycle, row by row, from rest at the first.
#[derive(Clone, Debug)]
pub(super) struct Differences {
    dt_s: f64,
    /// Position, velocity and acceleration of the previous row.
    before: [[f64; 3]; MAX_AXES],
}

impl Differences {
    /// Starts at rest at a point of up to [`MAX_AXES`] coordinates.
    pub(super) fn from_rest(first_m: &[f64], dt_s: f64) -> Self {
        let mut before = [[0.0; 3]; MAX_AXES];
        for (axis, &position_m) in before.iter_mut().zip(first_m) {
            axis[0] = position_m;
        }
        Self { dt_s, before }
    }

    /// Returns velocity, acceleration and jerk of each axis on the way to the next row.
    pub(super) fn next(&mut self, row_m: &[f64]) -> [[f64; 3]; MAX_AXES] {
        let mut found = [[0.0; 3]; MAX_AXES];
        for ((before, found), &position_m) in self.before.iter_mut().zip(&mut found).zip(row_m) {
            let velocity = (position_m - before[0]) / self.dt_s;
            let acceleration = (velocity - before[1]) / self.dt_s;
            *found = [velocity, acceleration, (acceleration - before[2]) / self.dt_s];
            *before = [position_m, velocity, acceleration];
        }
        found
    }
}

/// Noise in the differences of rounded positions, for velocity (0) to jerk (2).
pub(super) fn rounding_noise(farthest_m: f64, order: usize, dt_s: f64) -> f64 {
    let power = i32::try_from(order).unwrap_or(2) + 1;
    8.0 * f64::EPSILON * (2.0 + farthest_m) / dt_s.powi(power)
}

/// A row at which a limit is violated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excess {
    pub(super) row: usize,
    pub(super) axis: usize,
    pub(super) quantity: Quantity,
    pub(super) reached: f64,
    pub(super) limit: f64,
}

/// Compares rows with limits, and records each violation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verification<'a> {
    pub(super) limits: &'a [AxisLimits],
    pub(super) dt_s: f64,
    /// Farthest position of an axis, and the position that its rounding refers to: if a motion is
    /// computed from the time, including the distance travelled meanwhile.
    pub(super) farthest_m: f64,
}

impl<'a> Verification<'a> {
    /// Creates the verification of a table's rows, whose positions are exact.
    pub(super) fn of_rows(position_m: &[f64], limits: &'a [AxisLimits], dt_s: f64) -> Self {
        let farthest_m = position_m.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
        Self { limits, dt_s, farthest_m }
    }

    /// Creates the verification of rows computed from their time, which is rounded as well.
    pub(super) fn of_motion(position_m: &[f64], limits: &'a [AxisLimits], dt_s: f64) -> Self {
        let table = Self::of_rows(position_m, limits, dt_s);
        let lasts_s = position_m.len() as f64 / limits.len().max(1) as f64 * dt_s;
        let gone_m = limits.iter().fold(0.0_f64, |most, l| most.max(l.velocity_max_m_s)) * lasts_s;
        Self { farthest_m: table.farthest_m + gone_m, ..table }
    }

    /// Returns the first violation; `None` if every limit is satisfied at every row.
    pub(super) fn first_excess(&self, position_m: &[f64]) -> Option<Excess> {
        let mut first = None;
        self.each_excess(position_m, |excess| {
            first = Some(excess);
            false
        });
        first
    }

    /// Visits every violation in order, while `goes_on` returns true.
    pub(super) fn each_excess(&self, position_m: &[f64], mut goes_on: impl FnMut(Excess) -> bool) {
        let n_axes = self.limits.len();
        let Some(first_m) = position_m.get(..n_axes) else { return };
        let last_m = &position_m[position_m.len() - n_axes..];
        let allowed: [[f64; 3]; MAX_AXES] = std::array::from_fn(|axis| {
            let Some(limits) = self.limits.get(axis) else { return [f64::INFINITY; 3] };
            let mut allowed = limits.named().map(|(_, limit)| limit * (1.0 + TOLERANCE));
            for (order, allowed) in allowed.iter_mut().enumerate() {
                *allowed += rounding_noise(self.farthest_m, order, self.dt_s);
            }
            allowed
        });
        let mut differences = Differences::from_rest(first_m, self.dt_s);
        let rows = position_m.chunks_exact(n_axes).chain(std::iter::repeat_n(last_m, ROWS_AFTER));
        for (row, row_m) in rows.enumerate() {
            let found = differences.next(row_m);
            for (axis, limits) in self.limits.iter().enumerate() {
                for (order, (quantity, limit)) in limits.named().into_iter().enumerate() {
                    let reached = found[axis][order];
                    let holds = reached.abs() <= allowed[axis][order];
                    if !holds && !goes_on(Excess { row, axis, quantity, reached, limit }) {
                        return;
                    }
                }
            }
        }
    }

    /// Refuses a planned motion at its first violation.
    ///
    /// # Errors
    /// [`TrajectoryError::SetPoint`] with the time, the value and the limit.
    pub(super) fn accept(&self, position_m: &[f64]) -> Result<(), TrajectoryError> {
        match self.first_excess(position_m) {
            None => Ok(()),
            Some(Excess { row, axis, quantity, reached, limit }) => {
                let at_s = row as f64 * self.dt_s;
                Err(TrajectoryError::SetPoint { at_s, axis, quantity, reached, limit })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    const LIMITS: AxisLimits =
        AxisLimits { velocity_max_m_s: 1.0, acceleration_max_m_s2: 10.0, jerk_max_m_s3: 500.0 };

    #[test]
    fn differences_are_those_of_a_cubic() {
        let dt_s = 0.01;
        let position = |k: i32| 5.0 * (f64::from(k) * dt_s).powi(3);
        let mut differences = Differences::from_rest(&[position(0), 2.0], dt_s);
        let found: Vec<_> = (1..9).map(|k| differences.next(&[position(k), 2.0])).collect();
        for [[_, _, jerk], second, ..] in &found[2..] {
            // 5 t³ has the third derivative 30.
            assert!((jerk - 30.0).abs() < 1e-9 && second.iter().all(|d| *d == 0.0), "{found:?}");
        }
    }

    #[test]
    fn each_order_each_axis_and_both_ends_are_seen() {
        let dt_s = 0.01;
        let n = 60;
        for axis in 0..3 {
            for (at, jump) in [(0, 0.02), (30, 0.02), (n - 1, 0.02), (30, 0.002), (30, 1e-3)] {
                let mut rows = vec![0.1; 3 * n];
                for row in at..n {
                    rows[3 * row + axis] += jump;
                }
                // A step at the first row is where the motion begins.
                let found = Verification::of_rows(&rows, &[LIMITS; 3], dt_s).first_excess(&rows);
                assert_eq!(found.is_some(), at > 0, "{at} {jump}");
                if let Some(excess) = found {
                    assert_eq!((excess.row, excess.axis), (at, axis));
                    assert!(excess.reached.abs() > excess.limit);
                    let wanted = match jump {
                        0.02 => Quantity::Velocity,
                        0.002 => Quantity::Acceleration,
                        _ => Quantity::Jerk,
                    };
                    assert_eq!(excess.quantity, wanted);
                }
            }
        }
        // Stopping at once from full speed is detected after the last row.
        let rows: Vec<f64> = (0..n).map(|k| 0.5 * (k as f64 * dt_s).powi(2)).collect();
        let found = Verification::of_rows(&rows, &[LIMITS], dt_s).first_excess(&rows).unwrap();
        assert_eq!((found.row, found.quantity), (n, Quantity::Acceleration));
    }

    #[test]
    fn rounding_is_no_excess_at_the_shortest_cycles_and_far_away() {
        let mut random = Random(61);
        for dt_s in [1e-5, 1e-4, 1e-3] {
            for far in [0.0, 1.0, 1000.0] {
                let rows: Vec<f64> = (0..500)
                    .map(|k| {
                        let t = f64::from(k) / 499.0;
                        let smooth = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
                        far + 1e-7 * smooth + 0.5 * f64::EPSILON * far * random.signed()
                    })
                    .collect();
                let lasts_s = 499.0 * dt_s;
                let limits = AxisLimits {
                    velocity_max_m_s: 1.9e-7 / lasts_s,
                    acceleration_max_m_s2: 5.8e-7 / (lasts_s * lasts_s),
                    jerk_max_m_s3: 6.1e-6 / lasts_s.powi(3),
                };
                let found = Verification::of_rows(&rows, &[limits], dt_s).first_excess(&rows);
                assert_eq!(found, None, "{dt_s} {far}");
            }
        }
    }

    #[test]
    fn what_is_not_a_number_is_an_excess() {
        let rows = [0.0, 0.0, f64::NAN, 0.0];
        let found = Verification::of_rows(&rows, &[LIMITS], 0.01).first_excess(&rows).unwrap();
        assert_eq!(found.row, 2);
        assert!(Verification::of_rows(&[], &[LIMITS], 0.01).first_excess(&[]).is_none());
    }
}
