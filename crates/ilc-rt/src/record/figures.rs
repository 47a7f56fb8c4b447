//! The figures of one run, and the two norms they are made of.

use serde::Serialize;

/// Figures of one run; metres unless the name says otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Largest absolute tracking error of any axis, in the measurement learned from.
    pub tracking_inf_m: f64,
    /// Root of the mean over time of the squared length of the tracking error.
    pub tracking_rms_m: f64,
    /// Largest distance of the tool from the reference path.
    pub contour_inf_m: f64,
    /// Root mean square of that distance.
    pub contour_rms_m: f64,
    /// Largest absolute tracking error of any axis at the encoders.
    pub encoder_tracking_inf_m: f64,
    /// Largest absolute tracking error of any axis at the tool; absent without such a measurement.
    pub tool_tracking_inf_m: Option<f64>,
    /// Servo cycles that began a whole cycle late or more.
    pub overruns: u32,
    /// Samples whose measurement never arrived; the last one known stands in for them.
    pub missing_samples: u32,
    /// Runs that had to repeat the old input because the learning update was late, so far.
    pub late_updates: u32,
    /// Time the learning took to compute this run's input; 0 where it computed none.
    pub update_ms: f64,
    /// Whether this run's error had grown so far that the best input was restored after it.
    pub rolled_back: bool,
}

/// Largest absolute value; 0 for an empty array.
pub fn infinity_norm(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| f64::max(largest, value.abs()))
}

/// `sqrt(1/N sum_k |x_k|^2)` with `N` rows of `n_columns`; 0 for an empty array.
pub fn rms(values: &[f64], n_columns: usize) -> f64 {
    let n_rows = values.len() / n_columns.max(1);
    if n_rows == 0 {
        return 0.0;
    }
    (values.iter().map(|value| value * value).sum::<f64>() / n_rows as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rms_is_over_rows() {
        // Two rows (3, 4) and (0, 0): sqrt((25 + 0) / 2).
        assert!((rms(&[3.0, 4.0, 0.0, 0.0], 2) - 12.5_f64.sqrt()).abs() < 1e-15);
        assert!((infinity_norm(&[3.0, -4.0]) - 4.0).abs() < 1e-15);
    }
}
