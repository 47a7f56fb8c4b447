//! The tracking index `J` that compares interpolators: weighted tracking error and acceleration.

use crate::trajectory::error::TrajectoryError;

/// The two parts of the index, weighted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingIndex {
    /// `∫ k_e (y_des - y)² dt`.
    pub tracking: f64,
    /// `∫ k_a ÿ² dt`.
    pub acceleration: f64,
}

impl TrackingIndex {
    /// Returns `J = ∫ [k_e (y_des - y)² + k_a ÿ²] dt` by the trapezoidal rule.
    ///
    /// # Shapes
    /// - all three slices: `n_samples * n_axes`, equal in length; the squares of all axes are
    ///   summed
    /// # Errors
    /// [`TrajectoryError::Shape`] for a weight or sample time out of range, or slices of different
    /// lengths.
    /// # Source
    /// - \[dimarco2016\], Eq. 2.19
    pub fn of(
        programmed_m: &[f64],
        position_m: &[f64],
        acceleration_m_s2: &[f64],
        n_axes: usize,
        dt_s: f64,
        (k_e, k_a): (f64, f64),
    ) -> Result<Self, TrajectoryError> {
        for (name, value) in [("k_e", k_e), ("k_a", k_a), ("dt_s", dt_s)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(TrajectoryError::Shape {
                    name,
                    value,
                    allowed: "a finite number not below 0",
                });
            }
        }
        let n = position_m.len();
        for (name, found) in [
            ("samples of programmed_m", programmed_m.len()),
            ("samples of acceleration_m_s2", acceleration_m_s2.len()),
        ] {
            if found != n {
                return Err(TrajectoryError::Shape {
                    name,
                    value: found as f64,
                    allowed: "as many as of position_m",
                });
            }
        }
        let n_samples = n / n_axes.max(1);
        let mut index = Self::default();
        for (i, position_m) in position_m.iter().enumerate() {
            let k = i / n_axes.max(1);
            let edge = k == 0 || k + 1 == n_samples;
            let weight = dt_s * if edge { 0.5 } else { 1.0 };
            index.tracking += weight * k_e * (programmed_m[i] - position_m).powi(2);
            index.acceleration += weight * k_a * acceleration_m_s2[i].powi(2);
        }
        Ok(index)
    }

    /// Returns `J`.
    pub fn total(&self) -> f64 {
        self.tracking + self.acceleration
    }
}
