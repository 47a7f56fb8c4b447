//! Gaussian low-pass: symmetric, zero-phase, without overshoot, specified by its bandwidth.

use std::f64::consts::{LN_2, PI};

use super::SignalError;
use super::channel::{check_frequency, check_sample_time};
use super::symmetric::{Ends, Symmetric};

/// Truncation of the kernel in standard deviations: 99.99 % of its area.
const REACH: f64 = 3.8906;

/// A Gaussian low-pass filter.
///
/// `w[i] = exp(-(i T / sigma)^2 / 2) / sum`, `sigma = sqrt(ln 2) / (2 pi f)`, so that the gain at the
/// bandwidth `f` is `1/sqrt(2)` and the static gain is exactly 1
///
/// The signal is mirrored at its ends, between two samples. The kernel is truncated to 99.99 % of
/// its area; the bandwidth is accurate as long as the kernel spans several samples, i.e. well below
/// the Nyquist frequency.
///
/// # Units
/// - `bandwidth_hz` in hertz, `dt_s` in seconds
/// # Source
/// - \[barton2010\], H.3: kernel, bandwidth and ends. H.1 applies it to a doubled vector, which
///   doubles the bandwidth; here the bandwidth is the true one.
/// # Examples
/// ```
/// use ilc_rt::signal::GaussianFilter;
///
/// let mut filter = GaussianFilter::new(15.0, 2e-3)?.for_samples(400)?;
/// let mut step: Vec<f64> = (0..400).map(|k| if k < 200 { 1.0 } else { 30.0 }).collect();
/// filter.apply(&mut step, 0, 1)?;
/// assert!((step[199] + step[200] - 31.0).abs() < 1e-9);
/// # Ok::<(), ilc_rt::signal::SignalError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianFilter {
    bandwidth_hz: f64,
    dt_s: f64,
}

impl GaussianFilter {
    /// Designs the filter.
    ///
    /// # Errors
    /// - [`SignalError::Frequency`] or [`SignalError::SampleTime`].
    pub fn new(bandwidth_hz: f64, dt_s: f64) -> Result<Self, SignalError> {
        let limit_hz = check_sample_time(dt_s)?;
        check_frequency("bandwidth_hz", bandwidth_hz, limit_hz)?;
        let filter = Self { bandwidth_hz, dt_s };
        if filter.sigma_samples().is_finite() {
            Ok(filter)
        } else {
            // So low that the kernel's width overflows.
            Err(SignalError::Frequency { what: "bandwidth_hz", value_hz: bandwidth_hz, limit_hz })
        }
    }

    /// Returns the bandwidth in hertz.
    pub fn bandwidth_hz(&self) -> f64 {
        self.bandwidth_hz
    }

    /// Returns the sample time in seconds.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Returns the standard deviation of the kernel, in samples.
    pub fn sigma_samples(&self) -> f64 {
        LN_2.sqrt() / (2.0 * PI * self.bandwidth_hz * self.dt_s)
    }

    /// Sets the filter up for signals of `n_samples` samples.
    ///
    /// # Errors
    /// - [`SignalError::TooShort`] if half the kernel is longer than the signal.
    pub fn for_samples(&self, n_samples: usize) -> Result<Symmetric, SignalError> {
        let sigma = self.sigma_samples();
        let reach = (REACH * sigma).ceil();
        // Compared as floating-point numbers, as the reach of a tiny bandwidth overflows an
        // integer.
        if reach > n_samples as f64 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "positive and bounded"
            )]
            let padding = reach.min(1e15) as usize - 1;
            return Err(SignalError::TooShort { n_samples, padding });
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive and no longer than the signal"
        )]
        let reach = reach as usize;
        let bell = |i: usize| (-0.5 * (i as f64 / sigma).powi(2)).exp();
        let mut weights: Vec<f64> = (0..=reach).map(bell).collect();
        let area = 2.0 * weights.iter().sum::<f64>() - 1.0;
        for weight in &mut weights {
            *weight /= area;
        }
        Symmetric::new(weights, Ends::Mirrored, n_samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_at_the_bandwidth_is_one_over_root_two() {
        for (bandwidth_hz, dt_s) in [(1.0, 2e-3), (5.0, 2e-3), (15.0, 2e-3), (3.0, 1e-3)] {
            let n_samples = 4001;
            let mut filter =
                GaussianFilter::new(bandwidth_hz, dt_s).unwrap().for_samples(n_samples).unwrap();
            let wave = |k: usize| (2.0 * PI * bandwidth_hz * dt_s * (k as f64 - 2000.0)).cos();
            let mut signal: Vec<f64> = (0..n_samples).map(wave).collect();
            filter.apply(&mut signal, 0, 1).unwrap();
            assert!((signal[2000] - 0.5_f64.sqrt()).abs() < 2e-4, "{}", signal[2000]);
        }
    }

    #[test]
    fn a_constant_passes_and_the_sum_is_kept() {
        let mut filter = GaussianFilter::new(10.0, 2e-3).unwrap().for_samples(60).unwrap();
        let mut constant = [3.0; 60];
        filter.apply(&mut constant, 0, 1).unwrap();
        assert!(constant.iter().all(|value| (value - 3.0).abs() < 1e-14));
        // Mirrored ends lose nothing: what leaks out comes back in.
        let mut pulse = [0.0; 60];
        pulse[2] = 1.0;
        filter.apply(&mut pulse, 0, 1).unwrap();
        assert!((pulse.iter().sum::<f64>() - 1.0).abs() < 1e-13);
    }

    #[test]
    fn what_cannot_be_designed_is_refused() {
        assert!(matches!(GaussianFilter::new(0.0, 0.1), Err(SignalError::Frequency { .. })));
        assert!(matches!(GaussianFilter::new(5.0, 0.1), Err(SignalError::Frequency { .. })));
        assert!(matches!(GaussianFilter::new(f64::NAN, 0.1), Err(SignalError::Frequency { .. })));
        assert!(matches!(GaussianFilter::new(1.0, 0.0), Err(SignalError::SampleTime { .. })));
        let slow = GaussianFilter::new(1e-300, 2e-3).unwrap();
        assert!(matches!(slow.for_samples(100), Err(SignalError::TooShort { .. })));
        // Half the kernel is 52 samples long at 10 Hz and 1 ms.
        let filter = GaussianFilter::new(10.0, 1e-3).unwrap();
        assert!(filter.for_samples(52).is_ok());
        let error = filter.for_samples(51).unwrap_err();
        assert_eq!(error, SignalError::TooShort { n_samples: 51, padding: 51 });
    }
}
