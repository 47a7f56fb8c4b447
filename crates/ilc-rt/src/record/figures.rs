//! The figures of one run, and their two norms.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axes::AxisKinds;
use crate::schema::field_order;
use crate::trajectory::contour_error_m;

/// Time window, before and after its own time, in which a point is compared with the path.
const CONTOUR_WINDOW_S: f64 = 0.25;
/// Distance below which there is only rounding: a picometre.
const ROUNDING_M: f64 = 1e-12;

/// Figures of one run; lengths in metres, angles in radians.
///
/// Lengths and angles are never combined in one figure: one over several axes is over the linear
/// ones, or, if all are rotary, over all of them and in radians.
///
/// This struct is the single description of the figures: columns of the library, events, JSON files
/// and the Python class derive from it. A new field is a new figure everywhere; it needs
/// `#[serde(default)]`, as stored runs do not have it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Figures {
    /// Largest absolute tracking error of any axis, in the measurement learned from.
    pub tracking_inf_m: f64,
    /// RMS over time of the Euclidean norm of the tracking error.
    pub tracking_rms_m: f64,
    /// Largest contour error: distance of the tool from the reference path; absent if the path has
    /// no contour.
    pub contour_inf_m: Option<f64>,
    /// RMS of the contour error.
    pub contour_rms_m: Option<f64>,
    /// Largest absolute tracking error of each axis, in its own unit.
    #[serde(default)]
    pub axes_tracking_inf_m: Vec<f64>,
    /// RMS tracking error of each axis, in its own unit.
    #[serde(default)]
    pub axes_tracking_rms_m: Vec<f64>,
    /// Largest absolute tracking error of any axis at the encoders.
    #[serde(default)]
    pub encoder_tracking_inf_m: f64,
    /// Largest absolute tracking error of any axis at the tool; absent without such a measurement.
    pub tool_tracking_inf_m: Option<f64>,
    /// Servo cycles that began at least a whole cycle late.
    #[serde(default)]
    pub overruns: u32,
    /// Servo cycles at another feed than 100 %, e.g. in a pause: nothing is learned from such a run.
    #[serde(default)]
    pub scaled_cycles: u32,
    /// Samples whose measurement never arrived; the last known one stands in for them.
    #[serde(default)]
    pub missing_samples: u32,
    /// Runs so far that repeated the old input because the learning update was late.
    #[serde(default)]
    pub late_updates: u32,
    /// Computing time of the learning update for this run's input; 0 without one.
    #[serde(default)]
    pub update_ms: f64,
    /// Purpose of a run that only measures, `probing` or `searching`, so that its error does not count; absent
    /// for one that is learned from.
    pub phase: Option<String>,
    /// Error over that of the run a frozen input was taken from; absent when learning.
    pub frozen_ratio: Option<f64>,
    /// True if the best input was restored after this run (rollback), as the error had grown.
    #[serde(default)]
    pub rolled_back: bool,
    /// True if nothing was learned from this run and learning is off, as the error had grown.
    #[serde(default)]
    pub learning_off: bool,
    /// Reason of the decision on the next input, unless the law alone decided; one sentence.
    pub remark: Option<String>,
}

impl Figures {
    /// Sets the tracking error that was learned from, `n_samples * n_axes`.
    pub fn set_tracking(&mut self, error_m: &[f64], kinds: &AxisKinds) {
        let axis = |axis| kinds.columns(error_m, &[axis]);
        let axes = || 0..kinds.n_axes();
        self.axes_tracking_inf_m = axes().map(|i| infinity_norm(&axis(i))).collect();
        self.axes_tracking_rms_m = axes().map(|i| rms(&axis(i), 1)).collect();
        let comparable = kinds.comparable();
        let error_m = kinds.columns(error_m, &comparable);
        self.tracking_inf_m = infinity_norm(&error_m);
        self.tracking_rms_m = rms(&error_m, comparable.len());
    }

    /// Sets the positions of the axes, at the encoders and, if measured (`tool_m` is not empty), at
    /// the tool.
    pub fn set_places(
        &mut self,
        reference_m: &[f64],
        encoder_m: &[f64],
        tool_m: &[f64],
        kinds: &AxisKinds,
    ) {
        let comparable = kinds.comparable();
        let largest = |measured_m: &[f64]| {
            let errors: Vec<_> = reference_m.iter().zip(measured_m).map(|(r, y)| r - y).collect();
            infinity_norm(&kinds.columns(&errors, &comparable))
        };
        self.encoder_tracking_inf_m = largest(encoder_m);
        self.tool_tracking_inf_m = (!tool_m.is_empty()).then(|| largest(tool_m));
    }

    /// Sets the distances from the path; empty if it has no contour.
    pub fn set_contour(&mut self, contour_m: &[f64]) {
        let measured = |value: f64| if value < ROUNDING_M { 0.0 } else { value };
        let there = !contour_m.is_empty();
        self.contour_inf_m = there.then(|| measured(infinity_norm(contour_m)));
        self.contour_rms_m = there.then(|| measured(rms(contour_m, 1)));
    }

    /// Returns true if measurements of the run are missing, or it was not made at the whole feed.
    pub fn is_incomplete(&self) -> bool {
        self.missing_samples > 0 || self.scaled_cycles > 0
    }

    /// Returns true if the run only measured something for the law: its error says nothing about its input.
    pub fn only_measures(&self) -> bool {
        self.phase.is_some()
    }

    /// Returns the figure by which a run is judged, over all axes: a number to compare runs with,
    /// without a unit where the axes have different units.
    pub fn judged_by(&self) -> f64 {
        if self.axes_tracking_rms_m.is_empty() {
            return self.tracking_rms_m;
        }
        self.axes_tracking_rms_m.iter().map(|rms| rms * rms).sum::<f64>().sqrt()
    }
}

/// Returns the distances of measured points from the path near their own time, in the linear axes;
/// empty if the path has no contour.
///
/// # Shapes
/// - `reference_m`, `measured_m`: `n_samples * n_axes`, time first; returns `n_samples` or nothing
pub fn distances_m(
    reference_m: &[f64],
    measured_m: &[f64],
    kinds: &AxisKinds,
    cycle_s: f64,
) -> Vec<f64> {
    if !kinds.has_contour(reference_m) {
        return Vec::new();
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.25 s")]
    let window = (CONTOUR_WINDOW_S / cycle_s) as usize;
    if kinds.is_mixed() {
        let linear = kinds.of_kind(false);
        let only = |signal| kinds.columns(signal, &linear);
        return contour_error_m(&only(reference_m), &only(measured_m), linear.len(), window);
    }
    contour_error_m(reference_m, measured_m, kinds.n_axes(), window)
}

/// Returns the largest absolute value; 0 for an empty array.
pub fn infinity_norm(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| f64::max(largest, value.abs()))
}

/// Returns `sqrt(1/N sum_k |x_k|^2)` with `N` rows of `n_columns`; 0 for an empty array.
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

    fn kinds(units: &[&str]) -> AxisKinds {
        let units: Vec<_> = units.iter().map(|unit| (*unit).to_owned()).collect();
        AxisKinds::new(&units, units.len())
    }

    #[test]
    fn rms_is_over_rows() {
        // Two rows (3, 4) and (0, 0): sqrt((25 + 0) / 2).
        assert!((rms(&[3.0, 4.0, 0.0, 0.0], 2) - 12.5_f64.sqrt()).abs() < 1e-15);
        assert!((infinity_norm(&[3.0, -4.0]) - 4.0).abs() < 1e-15);
    }

    #[test]
    fn an_angle_is_no_part_of_a_length() {
        let mut figures = Figures::default();
        figures.set_tracking(&[3e-3, 0.5, 4e-3, 3e-3, -0.7, 4e-3], &kinds(&["m", "rad", "m"]));
        assert!((figures.tracking_inf_m - 4e-3).abs() < 1e-18);
        assert!((figures.tracking_rms_m - 5e-3).abs() < 1e-18);
        assert!((figures.axes_tracking_inf_m[1] - 0.7).abs() < 1e-15);
        assert!((figures.judged_by() - (25e-6 + 0.37_f64).sqrt()).abs() < 1e-12);
        figures.set_places(&[1e-3, 0.0, 0.0], &[0.0, 9.0, 2e-3], &[], &kinds(&["m", "rad", "m"]));
        assert!((figures.encoder_tracking_inf_m - 2e-3).abs() < 1e-18);
        assert_eq!(figures.tool_tracking_inf_m, None);
        let mut turning = Figures::default();
        turning.set_tracking(&[0.5, -0.7], &kinds(&["rad"]));
        assert!((turning.tracking_inf_m - 0.7).abs() < 1e-15);
    }

    #[test]
    fn contour_is_of_the_linear_axes_and_rounding_is_none() {
        let reference_m = [0.0, 0.0, 0.0, 0.01, 0.0, 1.0, 0.01, 0.01, 2.0];
        let measured_m = [0.0, 0.0, 9.0, 0.01, 0.0, 9.0, 0.011, 0.01, 9.0];
        let seen = distances_m(&reference_m, &measured_m, &kinds(&["m", "m", "rad"]), 0.001);
        assert!((seen[2] - 1e-3).abs() < 1e-15, "{seen:?}");
        let mut figures = Figures::default();
        figures.set_contour(&seen);
        assert!((figures.contour_inf_m.unwrap() - 1e-3).abs() < 1e-15);
        figures.set_contour(&[1e-20, 3e-18]);
        assert_eq!((figures.contour_inf_m, figures.contour_rms_m), (Some(0.0), Some(0.0)));
        let line = distances_m(&[0.0, 0.0, 0.01, 0.0], &[0.0; 4], &kinds(&["m", "m"]), 0.001);
        figures.set_contour(&line);
        assert_eq!((figures.contour_inf_m, figures.contour_rms_m), (None, None));
    }
}
