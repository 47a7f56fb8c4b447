//! Symmetric (zero-phase) FIR smoothing with given taps.

use super::SignalError;
use super::symmetric::{Ends, Symmetric};

/// Largest number of taps: each costs a multiplication per sample.
const MAX_TAPS: usize = 20_001;

/// Largest difference of mirrored taps, relative to the largest tap.
const ASYMMETRY: f64 = 1e-12;

/// A symmetric, zero-phase FIR filter.
///
/// `y[k] = sum_i h[i] x[k + i - r]`, `2 r + 1` taps, `h[i] = h[2 r - i]`; the end values are held
/// beyond the ends
///
/// # Shapes
/// - `taps`: an odd number
/// # Source
/// - \[dimarco2016\], Eq. (3.2), needs such a filter and gives no taps; `[-1, 4, 10, 4, -1] / 16`
///   convolved six times, 25 taps, serves.
/// # Examples
/// ```
/// use ilc_rt::signal::FirFilter;
///
/// let once = FirFilter::new(&[-1.0 / 16.0, 0.25, 0.625, 0.25, -1.0 / 16.0])?;
/// assert_eq!(once.repeated(6)?.taps().len(), 25);
/// # Ok::<(), ilc_rt::signal::SignalError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FirFilter {
    taps: Vec<f64>,
}

impl FirFilter {
    /// Creates the filter from its taps.
    ///
    /// # Errors
    /// - [`SignalError::TapCount`] for an even number of taps, [`SignalError::TooManyTaps`] for more
    ///   than 20 001.
    /// - [`SignalError::TapValue`] for a tap that is infinite or NaN.
    /// - [`SignalError::TapSymmetry`] for asymmetric taps.
    pub fn new(taps: &[f64]) -> Result<Self, SignalError> {
        if taps.len() > MAX_TAPS {
            return Err(SignalError::TooManyTaps { found: taps.len(), max: MAX_TAPS });
        }
        if taps.len().is_multiple_of(2) {
            return Err(SignalError::TapCount { found: taps.len() });
        }
        if let Some(index) = taps.iter().position(|tap| !tap.is_finite()) {
            return Err(SignalError::TapValue { index, value: taps[index] });
        }
        let largest = taps.iter().fold(0.0, |largest: f64, tap| largest.max(tap.abs()));
        for (index, (value, mirrored)) in taps.iter().zip(taps.iter().rev()).enumerate() {
            if (value - mirrored).abs() > ASYMMETRY * largest {
                let (value, mirrored) = (*value, *mirrored);
                return Err(SignalError::TapSymmetry { index, value, mirrored });
            }
        }
        Ok(Self { taps: taps.to_vec() })
    }

    /// Returns the filter that equals `times` passes of this one.
    ///
    /// The signal's ends are extended once, not before each pass.
    ///
    /// # Errors
    /// - [`SignalError::TapCount`] for `times` = 0.
    /// - [`SignalError::TapValue`] if a product overflows.
    /// - [`SignalError::TooManyTaps`] if the result would have more than 20 001 taps.
    pub fn repeated(&self, times: usize) -> Result<Self, SignalError> {
        if times == 0 {
            return Err(SignalError::TapCount { found: 0 });
        }
        let found = (self.taps.len() - 1).saturating_mul(times).saturating_add(1);
        // With a single tap the product never grows; `times` bounds the work.
        if found > MAX_TAPS || times > MAX_TAPS {
            return Err(SignalError::TooManyTaps { found: found.max(times), max: MAX_TAPS });
        }
        let mut product = self.taps.clone();
        for _ in 1..times {
            let mut longer = vec![0.0; product.len() + self.taps.len() - 1];
            for (i, left) in product.iter().enumerate() {
                for (j, right) in self.taps.iter().enumerate() {
                    longer[i + j] += left * right;
                }
            }
            product = longer;
        }
        Self::new(&product)
    }

    /// Returns the taps.
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// Sets the filter up for signals of `n_samples` samples.
    ///
    /// # Errors
    /// - [`SignalError::TooShort`] for a signal without samples.
    pub fn for_samples(&self, n_samples: usize) -> Result<Symmetric, SignalError> {
        Symmetric::new(self.taps[self.taps.len() / 2..].to_vec(), Ends::Held, n_samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_taps_than_anybody_filters_with_are_refused_at_once() {
        let once = FirFilter::new(&ONCE).unwrap();
        for times in [5001, 10_000_000, usize::MAX] {
            let line = once.repeated(times).unwrap_err().to_string();
            assert!(line.contains("at most 20001"), "{line}");
        }
        assert!(FirFilter::new(&[1.0]).unwrap().repeated(usize::MAX).is_err());
        assert!(FirFilter::new(&vec![0.0; 20_003]).is_err());
    }

    const ONCE: [f64; 5] = [-1.0 / 16.0, 0.25, 0.625, 0.25, -1.0 / 16.0];

    #[test]
    fn a_pulse_shows_the_taps() {
        let mut pulse = [0.0; 9];
        pulse[4] = 1.0;
        FirFilter::new(&ONCE).unwrap().for_samples(9).unwrap().apply(&mut pulse, 0, 1).unwrap();
        assert_eq!(pulse[2..7].to_vec(), ONCE);
        assert_eq!(pulse[..2].to_vec(), [0.0; 2]);
    }

    #[test]
    fn repeated_taps_pass_cubics_and_sum_to_one() {
        let smoother = FirFilter::new(&ONCE).unwrap().repeated(6).unwrap();
        assert_eq!(smoother.taps().len(), 25);
        assert!((smoother.taps().iter().sum::<f64>() - 1.0).abs() < 1e-14);
        let cubic: Vec<f64> = (0..80).map(|k| (f64::from(k) - 40.0).powi(3)).collect();
        let mut smooth = cubic.clone();
        smoother.for_samples(80).unwrap().apply(&mut smooth, 0, 1).unwrap();
        for k in 12..68 {
            assert!((smooth[k] - cubic[k]).abs() < 1e-9);
        }
    }

    #[test]
    fn a_signal_shorter_than_the_taps_is_held_on_both_sides() {
        let mut short = [2.0, 4.0];
        FirFilter::new(&ONCE).unwrap().for_samples(2).unwrap().apply(&mut short, 0, 1).unwrap();
        // 0.625 2 + 0.25 (2 + 4) - (2 + 4) / 16
        assert_eq!(short.to_vec(), [2.375, 3.625]);
    }

    #[test]
    fn taps_that_would_lag_are_refused() {
        assert_eq!(FirFilter::new(&[]), Err(SignalError::TapCount { found: 0 }));
        assert_eq!(FirFilter::new(&[0.5, 0.5]), Err(SignalError::TapCount { found: 2 }));
        let error = FirFilter::new(&[0.2, 0.5, 0.3]).unwrap_err();
        assert_eq!(error, SignalError::TapSymmetry { index: 0, value: 0.2, mirrored: 0.3 });
        assert!(matches!(FirFilter::new(&[f64::NAN]), Err(SignalError::TapValue { index: 0, .. })));
        assert!(FirFilter::new(&ONCE).unwrap().repeated(0).is_err());
    }
}
