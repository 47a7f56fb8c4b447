//! The time grid of a run: servo cycles, and the whole cycles that cover a time.

use super::error::TrajectoryError;

/// Largest number of samples of one run.
pub(super) const N_SAMPLES_MAX: usize = 10_000_000;
/// Range of servo cycles.
pub(super) const CYCLE_S: (f64, f64) = (1e-5, 1.0);
/// Longest rest before or after the motion.
pub(super) const DWELL_MAX_S: f64 = 3600.0;

/// Refuses a time that is not finite or out of range.
pub(super) fn check_time(
    name: &'static str,
    value_s: f64,
    (low_s, high_s): (f64, f64),
) -> Result<(), TrajectoryError> {
    if (low_s..=high_s).contains(&value_s) {
        Ok(())
    } else {
        Err(TrajectoryError::Time { name, value_s, low_s, high_s })
    }
}

/// Returns the number of whole cycles that cover a duration.
///
/// # Errors
/// [`TrajectoryError::TooLong`] if a run may not have so many samples.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "compared with the most samples before the cast; durations are not negative"
)]
pub(super) fn n_ticks(duration_s: f64, cycle_s: f64) -> Result<usize, TrajectoryError> {
    let n_samples = (duration_s / cycle_s - 1e-6).ceil().max(0.0);
    if n_samples <= N_SAMPLES_MAX as f64 {
        Ok(n_samples as usize)
    } else {
        Err(TrajectoryError::TooLong { duration_s, n_samples, n_samples_max: N_SAMPLES_MAX })
    }
}

/// Returns the first tick at or after a time, on the grid as the tick computes it.
///
/// # Errors
/// As [`n_ticks`].
pub(super) fn n_ticks_after(time_s: f64, cycle_s: f64) -> Result<usize, TrajectoryError> {
    let tick = n_ticks(time_s, cycle_s)?;
    Ok(if (tick as f64) * cycle_s < time_s { tick + 1 } else { tick })
}
