//! Smooth (bumpless) schedules of a scalar along the run.

use super::Gain;
use crate::learning::error::check_counts;
use crate::learning::{LearningError, Result};
use crate::signal::GaussianFilter;

/// A piecewise constant schedule, smoothed by a Gaussian filter.
///
/// # Units
/// - starts in samples; bandwidth in Hz: the frequency at which a ripple keeps `1 / sqrt 2` of its
///   amplitude. A transition from 10 % to 90 % takes `0.34 / bandwidth_hz` seconds.
/// # Source
/// - \[barton2010\], sections 5.4.2 and 5.4.3 and listing H.3.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    segments: Vec<(usize, f64)>,
    filter: Option<GaussianFilter>,
}

impl Schedule {
    /// Creates a schedule that steps from one value to the next.
    ///
    /// # Shapes
    /// - `segments`: first sample and value of each, the first at sample 0
    /// # Errors
    /// - [`LearningError::Weight`] unless the starts increase from 0 and the values are finite.
    pub fn new(segments: &[(usize, f64)]) -> Result<Self> {
        let refused = |sample: usize, reason: String| {
            Err(LearningError::Weight { what: "schedule", sample, reason })
        };
        match segments.first() {
            None => return refused(0, "no segments; at least 1 is needed".to_owned()),
            Some((start, _)) if *start > 0 => {
                return refused(0, format!("the first segment starts at {start}; 0 is needed"));
            }
            Some(_) => {}
        }
        for pair in segments.windows(2) {
            let ((before, _), (start, _)) = (pair[0], pair[1]);
            if start <= before {
                return refused(start, format!("a segment starts there after one at {before}"));
            }
        }
        if let Some((start, value)) = segments.iter().find(|(_, value)| !value.is_finite()) {
            return refused(*start, format!("{value}; only finite values are allowed"));
        }
        Ok(Self { segments: segments.to_vec(), filter: None })
    }

    /// Smooths the transitions.
    ///
    /// # Errors
    /// - [`LearningError::Signal`] unless the bandwidth lies between 0 and the Nyquist frequency.
    pub fn smoothed(self, bandwidth_hz: f64, dt_s: f64) -> Result<Self> {
        Ok(Self { filter: Some(GaussianFilter::new(bandwidth_hz, dt_s)?), ..self })
    }

    /// Returns the value at each sample; all lie between the lowest and the highest value of the
    /// schedule.
    ///
    /// The run is extended by its mirror image (half-sample reflection), so that the ends keep
    /// their values.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] if a segment starts after the end of the run.
    /// - [`LearningError::Signal`] if half the filter is longer than the run.
    /// - [`LearningError::Empty`] for no samples; [`LearningError::TooMany`] for a run beyond memory.
    pub fn samples(&self, n_samples: usize) -> Result<Vec<f64>> {
        check_counts(&[("n_samples", n_samples)])?;
        let last = self.segments.len() - 1;
        let (start, _) = self.segments[last];
        if start >= n_samples {
            let reason = format!("a segment starts there; the run has {n_samples} samples");
            return Err(LearningError::Weight { what: "schedule", sample: start, reason });
        }
        let mut steps = Vec::with_capacity(n_samples);
        for (place, (_, value)) in self.segments.iter().enumerate() {
            let end = self.segments.get(place + 1).map_or(n_samples, |next| next.0);
            steps.resize(end, *value);
        }
        if let Some(filter) = &self.filter {
            filter.for_samples(n_samples)?.apply(&mut steps, 0, 1)?;
            // Rounding could push a weight of 0 below 0.
            let values = self.segments.iter().map(|(_, value)| *value);
            let lowest = values.clone().fold(f64::INFINITY, f64::min);
            let highest = values.fold(f64::NEG_INFINITY, f64::max);
            for step in &mut steps {
                *step = step.clamp(lowest, highest);
            }
        }
        Ok(steps)
    }

    /// Returns the schedule as a gain of runs of `n_samples` samples.
    ///
    /// # Errors
    /// - as [`Schedule::samples`].
    pub fn gain(&self, n_samples: usize) -> Result<Gain> {
        Ok(Gain::PerSample(self.samples(n_samples)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::SignalError;
    use proptest::prelude::*;

    #[test]
    fn values_hold_from_their_start_on() {
        let schedule = Schedule::new(&[(0, 1.0), (2, 30.0), (3, 2.0)]).unwrap();
        assert_eq!(schedule.samples(5).unwrap(), [1.0, 1.0, 30.0, 2.0, 2.0]);
    }

    #[test]
    fn a_step_becomes_the_integral_of_a_gaussian() {
        let (n, dt_s, bandwidth_hz) = (400, 1e-3, 15.0);
        let schedule = Schedule::new(&[(0, 0.0), (200, 1.0)]).unwrap();
        let found = schedule.smoothed(bandwidth_hz, dt_s).unwrap().samples(n).unwrap();
        // By the point symmetry about the middle between samples 199 and 200.
        for k in 0..n {
            assert!((found[k] + found[n - 1 - k] - 1.0).abs() < 1e-12);
        }
        assert!(found.windows(2).all(|pair| pair[1] >= pair[0]));
        let low = found.iter().position(|value| *value >= 0.1).unwrap();
        let high = found.iter().position(|value| *value >= 0.9).unwrap();
        let rise_s = (high - low) as f64 * dt_s;
        assert!((rise_s * bandwidth_hz - 0.34).abs() < 0.02, "{rise_s}");
        assert!(found[0] < 1e-12 && found[n - 1] > 1.0 - 1e-12);
    }

    #[test]
    fn a_ripple_at_the_bandwidth_keeps_the_root_of_one_half() {
        // A square wave of 20 samples: its first harmonic lies at 50 Hz, the others far above.
        let (n, dt_s) = (400, 1e-3);
        let segments: Vec<(usize, f64)> =
            (0..n / 10).map(|i| (10 * i, f64::from(u8::from(i % 2 == 0)))).collect();
        let harmonic = |samples: &[f64]| {
            let phase = |k: usize| std::f64::consts::TAU * 50.0 * dt_s * k as f64;
            // Whole periods away from the ends.
            let span = 100..300;
            let (mut re, mut im) = (0.0, 0.0);
            for k in span {
                re += samples[k] * phase(k).cos();
                im += samples[k] * phase(k).sin();
            }
            f64::hypot(re, im)
        };
        let steps = Schedule::new(&segments).unwrap();
        let before = harmonic(&steps.samples(n).unwrap());
        let after = harmonic(&steps.smoothed(50.0, dt_s).unwrap().samples(n).unwrap());
        assert!((after / before - 0.5_f64.sqrt()).abs() < 2e-4, "{}", after / before);
    }

    #[test]
    fn a_filter_wider_than_the_run_is_refused() {
        let schedule = Schedule::new(&[(0, 0.0), (1, 4.0)]).unwrap().smoothed(1e-3, 1.0).unwrap();
        let told = schedule.samples(4).unwrap_err();
        assert!(matches!(told, LearningError::Signal(SignalError::TooShort { .. })), "{told}");
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let told = |segments: &[(usize, f64)]| Schedule::new(segments).unwrap_err().to_string();
        assert!(told(&[]).contains("no segments"));
        assert!(told(&[(1, 1.0)]).contains("starts at 1"));
        assert!(told(&[(0, 1.0), (5, 2.0), (5, 3.0)]).contains("sample 5"));
        assert!(told(&[(0, 1.0), (5, f64::NAN)]).contains("NaN"));
        let good = Schedule::new(&[(0, 1.0), (5, 2.0)]).unwrap();
        assert!(good.samples(5).unwrap_err().to_string().contains("5 samples"));
        assert!(good.clone().smoothed(0.0, 1.0).unwrap_err().to_string().contains("bandwidth_hz"));
        assert!(good.smoothed(1.0, f64::NAN).unwrap_err().to_string().contains("dt_s"));
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn no_value_leaves_the_range_of_those_given(
            values in prop::collection::vec(0.0..50.0_f64, 1..8),
            length in 10..20_usize, bandwidth_hz in 60.0..400.0_f64,
        ) {
            let segments: Vec<(usize, f64)> =
                values.iter().enumerate().map(|(i, value)| (i * length, *value)).collect();
            let schedule = Schedule::new(&segments).unwrap().smoothed(bandwidth_hz, 1e-3).unwrap();
            let found = schedule.samples(values.len() * length).unwrap();
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(0.0, f64::max);
            prop_assert!(found.iter().all(|value| (low..=high).contains(value)));
            // Mirror images at the ends keep the mean.
            let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
            let steps = Schedule::new(&segments).unwrap().samples(found.len()).unwrap();
            prop_assert!((mean(&found) - mean(&steps)).abs() < 1e-9);
        }
    }
}
