//! Analytic signal (Hilbert transform) and instantaneous frequency.

use std::f64::consts::PI;

use ilc_numerics::fourier::{self, Complex};

use super::SignalError;
use super::channel::check_sample_time;

/// Returns the analytic signal: the signal itself and, as imaginary part, its Hilbert transform.
///
/// `a = x + i H(x)`: the spectrum of `x` with its negative frequencies removed and its positive ones
/// doubled
///
/// The signal is treated as one period of a periodic one; if its ends do not match, the first and
/// last samples are distorted.
///
/// # Shapes
/// - `x`: one channel; the result has as many samples
/// # Real Time
/// Cold path: allocates. `O(n log n)` for any length.
/// # Source
/// - \[oppenheim2009\], Ch. 12: discrete Hilbert transforms.
pub fn analytic(x: &[f64]) -> Vec<Complex<f64>> {
    let n = x.len();
    let mut signal: Vec<Complex<f64>> = x.iter().map(|value| Complex::new(*value, 0.0)).collect();
    if n == 0 {
        return signal;
    }
    fourier::forward(n).process(&mut signal);
    for (k, value) in signal.iter_mut().enumerate() {
        // The zero and, for an even length, the Nyquist frequency are their own mirror images.
        *value *= match (2 * k).cmp(&n) {
            _ if k == 0 => 1.0,
            std::cmp::Ordering::Less => 2.0,
            std::cmp::Ordering::Equal => 1.0,
            std::cmp::Ordering::Greater => 0.0,
        } / n as f64;
    }
    fourier::inverse(n).process(&mut signal);
    signal
}

/// Returns the instantaneous frequency between each sample and the next, in hertz.
///
/// `f[k] = wrap(arg a[k+1] - arg a[k]) / (2 pi T)`, `a` the analytic signal, the phase difference
/// wrapped to -pi to pi
///
/// Meaningful for a signal that oscillates about zero: subtract the mean of a position first, or
/// use the velocity. Where the amplitude is small it is noisy, and may be negative.
///
/// # Shapes
/// - `x`: one channel of `n` samples; the result has `n - 1`
/// # Units
/// - `dt_s` in seconds; the result in hertz
/// # Errors
/// - [`SignalError::SampleTime`]; [`SignalError::TooShort`] for fewer than two samples.
/// # Source
/// - \[filter-based\], Section 5: time-frequency analysis of the input trajectory.
pub fn instantaneous_frequency(x: &[f64], dt_s: f64) -> Result<Vec<f64>, SignalError> {
    check_sample_time(dt_s)?;
    if x.len() < 2 {
        return Err(SignalError::TooShort { n_samples: x.len(), padding: 1 });
    }
    let signal = analytic(x);
    Ok(signal
        .windows(2)
        .map(|pair| wrapped(pair[1].arg() - pair[0].arg()) / (2.0 * PI * dt_s))
        .collect())
}

/// Wraps an angle to -pi to pi.
fn wrapped(angle: f64) -> f64 {
    if angle.abs() <= PI { angle } else { angle - 2.0 * PI * angle.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_analytic_signal_of_a_cosine_is_a_rotation() {
        for n in [16, 17] {
            let angle = |k: usize| 2.0 * PI * 3.0 * k as f64 / n as f64;
            let x: Vec<f64> = (0..n).map(|k| angle(k).cos()).collect();
            for (k, value) in analytic(&x).iter().enumerate() {
                assert!((value - Complex::from_polar(1.0, angle(k))).norm() < 1e-14);
            }
        }
        assert!(analytic(&[]).is_empty());
    }

    #[test]
    fn a_sine_has_one_frequency() {
        let x: Vec<f64> = (0..500).map(|k| (2.0 * PI * 8.0 * f64::from(k) * 2e-3).sin()).collect();
        let found = instantaneous_frequency(&x, 2e-3).unwrap();
        assert_eq!(found.len(), 499);
        assert!(found.iter().all(|f| (f - 8.0).abs() < 1e-9));
    }

    #[test]
    fn what_has_no_frequency_is_refused() {
        assert!(matches!(instantaneous_frequency(&[1.0], 0.1), Err(SignalError::TooShort { .. })));
        assert!(instantaneous_frequency(&[1.0, 2.0], -0.1).is_err());
    }
}
