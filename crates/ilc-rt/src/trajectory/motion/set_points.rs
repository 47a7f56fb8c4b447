//! A motion given as set points, and its verification against the limits. Cold.
//!
//! For programs that are tables instead of paths. The campaign calls it.

use crate::interpolate::AxisLimits;
use crate::interpolate::{MAX_AXES, MoveError};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{CYCLE_S, N_SAMPLES_MAX, check_time};
use crate::trajectory::motion::SampledMotion;
use crate::trajectory::verify::{Excess, Verification};

/// Creates a motion from set points, one per cycle, from rest at the first to rest at the last.
///
/// The set points are neither smoothed nor slowed down: they are refused if they violate a limit.
/// Velocities are central differences, and 0 at both ends.
///
/// # Shapes
/// - `position_m`: `n_samples * n_axes`, time first; `limits`: one entry per axis, 1 to
///   [`MAX_AXES`]
/// # Real Time
/// Cold: allocates.
/// # Errors
/// - [`MoveError::Axes`], [`TrajectoryError::Empty`] and [`TrajectoryError::TooLong`] for a table
///   without or with too many columns or rows.
/// - [`TrajectoryError::Row`] for the first row at which velocity, acceleration or jerk over the
///   cycle violate a limit.
pub fn set_points(
    position_m: &[f64],
    limits: &[AxisLimits],
    dt_s: f64,
) -> Result<SampledMotion, TrajectoryError> {
    let n_axes = limits.len();
    if !(1..=MAX_AXES).contains(&n_axes) {
        return Err(MoveError::Axes { n_axes }.into());
    }
    check_time("sample time", dt_s, CYCLE_S)?;
    for (axis, limit) in limits.iter().enumerate() {
        limit.check(axis)?;
    }
    let n_samples = position_m.len() / n_axes;
    if n_samples == 0 {
        return Err(TrajectoryError::Empty);
    }
    if n_samples > N_SAMPLES_MAX {
        let duration_s = n_samples as f64 * dt_s;
        let n_samples = n_samples as f64;
        return Err(TrajectoryError::TooLong {
            duration_s,
            n_samples,
            n_samples_max: N_SAMPLES_MAX,
        });
    }
    if let Some(excess) = Verification::of_rows(position_m, limits, dt_s).first_excess(position_m) {
        let Excess { row, axis, quantity, reached, limit } = excess;
        return Err(TrajectoryError::Row { row, axis, quantity, reached, limit });
    }
    let mut motion = SampledMotion {
        dt_s,
        n_axes,
        position_m: position_m.to_vec(),
        programmed_m: position_m.to_vec(),
        ..SampledMotion::default()
    };
    let at = |row: usize, axis: usize| position_m[row.min(n_samples - 1) * n_axes + axis];
    for row in 0..n_samples {
        let inside = row > 0 && row + 1 < n_samples;
        for axis in 0..n_axes {
            let (before, now, after) =
                (at(row.saturating_sub(1), axis), at(row, axis), at(row + 1, axis));
            motion.velocity_m_s.push(if inside { (after - before) / (2.0 * dt_s) } else { 0.0 });
            motion.acceleration_m_s2.push((after - 2.0 * now + before) / (dt_s * dt_s));
        }
    }
    Ok(motion)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolate::Quantity;

    const DT_S: f64 = 0.01;
    const LIMITS: AxisLimits =
        AxisLimits { velocity_max_m_s: 1.0, acceleration_max_m_s2: 10.0, jerk_max_m_s3: 500.0 };

    /// A move of 0.1 m in 0.5 s on the first of two axes, at rest at both ends.
    fn smooth(n_axes: usize) -> Vec<f64> {
        (0..=50_u32)
            .flat_map(|k| {
                let t = f64::from(k) / 50.0;
                let s = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
                (0..n_axes).map(move |axis| if axis == 0 { 0.1 * s } else { 0.02 })
            })
            .collect()
    }

    #[test]
    fn rows_go_out_as_they_are_with_velocities_of_their_own() {
        let rows = smooth(2);
        let motion = set_points(&rows, &[LIMITS; 2], DT_S).unwrap();
        assert_eq!(motion.position_m, rows);
        assert_eq!((motion.n_axes, motion.n_samples()), (2, 51));
        // The fastest, in the middle: 0.1 m / 0.5 s * 15/8.
        assert!((motion.velocity_m_s[50] - 0.375).abs() < 1e-3);
        assert!(
            motion.velocity_m_s[..2].iter().chain(&motion.velocity_m_s[100..]).all(|v| *v == 0.0)
        );
    }

    #[test]
    fn each_limit_refuses_the_first_row_that_breaks_it() {
        let refused = |limits: AxisLimits| match set_points(&smooth(1), &[limits], DT_S) {
            Err(TrajectoryError::Row { row, axis: 0, quantity, reached, limit }) => {
                assert!(reached.abs() > limit, "{reached} {limit}");
                (row, quantity)
            }
            other => panic!("{other:?}"),
        };
        let (row, quantity) = refused(AxisLimits { velocity_max_m_s: 0.3, ..LIMITS });
        assert!((10..25).contains(&row) && quantity == Quantity::Velocity, "{row}");
        let (row, quantity) = refused(AxisLimits { acceleration_max_m_s2: 1.0, ..LIMITS });
        assert!((1..10).contains(&row) && quantity == Quantity::Acceleration, "{row}");
        let (row, quantity) = refused(AxisLimits { jerk_max_m_s3: 10.0, ..LIMITS });
        assert!(row < 4 && quantity == Quantity::Jerk, "{row}");
    }

    #[test]
    fn a_table_that_ends_at_speed_is_refused() {
        let rows = smooth(1);
        let cut = &rows[..26];
        assert!(matches!(
            set_points(cut, &[LIMITS], DT_S),
            Err(TrajectoryError::Row { row: 26, quantity: Quantity::Acceleration, .. })
        ));
        let backwards: Vec<f64> = cut.iter().rev().copied().collect();
        assert!(matches!(
            set_points(&backwards, &[LIMITS], DT_S),
            Err(TrajectoryError::Row { row: 1, .. })
        ));
    }

    #[test]
    fn no_rows_no_axes_and_numbers_that_are_none_are_refused() {
        assert!(set_points(&[], &[LIMITS], DT_S).is_err());
        assert!(set_points(&[0.0], &[], DT_S).is_err());
        assert!(set_points(&[0.0, f64::NAN], &[LIMITS], DT_S).is_err());
        assert!(set_points(&smooth(1), &[LIMITS], 0.0).is_err());
    }
}
