//! Averaged spectra of two signals.

use std::f64::consts::TAU;

use ilc_numerics::fourier::{self, Complex};

use crate::model::ModelError;

/// Division of two signals into segments that are averaged over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Averaging {
    /// Whole periods of a periodic excitation, unwindowed: exact, without leakage.
    Periods {
        /// Samples in a period.
        period_samples: usize,
    },
    /// Welch's method for any excitation: overlapping segments with their mean removed, under a
    /// Hann window.
    Welch {
        /// Samples in a segment.
        segment_samples: usize,
        /// Samples that a segment shares with the next one.
        overlap_samples: usize,
    },
}

impl Averaging {
    /// Returns Welch's method for signals of `n_samples`: by default eight segments' worth of samples, and half of a
    /// segment shared with the next one.
    pub fn welch(
        n_samples: usize,
        segment_samples: Option<usize>,
        overlap_samples: Option<usize>,
    ) -> Self {
        let segment_samples = segment_samples.unwrap_or(n_samples / 8);
        let overlap_samples = overlap_samples.unwrap_or(segment_samples / 2);
        Self::Welch { segment_samples, overlap_samples }
    }
}

/// Averages over all segments, for frequencies 0 to Nyquist.
pub(super) struct Spectra {
    /// Samples in a segment.
    pub(super) n: usize,
    /// Power of the input.
    pub(super) input: Vec<f64>,
    /// Power of the output.
    pub(super) output: Vec<f64>,
    /// Cross power, `conj(U) Y`.
    pub(super) cross: Vec<Complex<f64>>,
    /// Equivalent number of independent segments.
    pub(super) n_averages: f64,
}

impl Spectra {
    /// # Errors
    /// [`ModelError::Length`] or [`ModelError::Parameter`] if the signals contain no segment.
    pub(super) fn of(u: &[f64], y: &[f64], averaging: Averaging) -> Result<Self, ModelError> {
        let n = match averaging {
            Averaging::Periods { period_samples: n }
            | Averaging::Welch { segment_samples: n, .. } => n,
        };
        if n < 8 || n > u.len() {
            return Err(ModelError::Parameter {
                what: "samples of a period or segment",
                value: n as f64,
                allowed: "at least 8, and no more than the signals hold, are needed",
            });
        }
        let (n, step, window) = match averaging {
            Averaging::Periods { period_samples: n } => (n, n, vec![1.0; n]),
            Averaging::Welch { segment_samples: n, overlap_samples } => {
                if overlap_samples >= n {
                    return Err(ModelError::Parameter {
                        what: "overlap_samples",
                        value: overlap_samples as f64,
                        allowed: "it must be below the samples of a segment",
                    });
                }
                let hann = |k: usize| 0.5 * (1.0 - (TAU * k as f64 / n as f64).cos());
                (n, n - overlap_samples, (0..n).map(hann).collect())
            }
        };
        let bins = n / 2 + 1;
        let mut sums = Self {
            n,
            input: vec![0.0; bins],
            output: vec![0.0; bins],
            cross: vec![Complex::new(0.0, 0.0); bins],
            n_averages: 0.0,
        };
        let fft = fourier::forward(n);
        let transform = |signal: &[f64]| {
            let mean = match averaging {
                Averaging::Periods { .. } => 0.0,
                Averaging::Welch { .. } => signal.iter().sum::<f64>() / n as f64,
            };
            let mut piece: Vec<Complex<f64>> = signal
                .iter()
                .zip(&window)
                .map(|(value, weight)| Complex::new((value - mean) * weight, 0.0))
                .collect();
            fft.process(&mut piece);
            piece
        };
        let mut count = 0_usize;
        for start in (0..=u.len() - n).step_by(step) {
            crate::interrupt::point();
            let (u, y) = (transform(&u[start..start + n]), transform(&y[start..start + n]));
            for bin in 0..bins {
                sums.input[bin] += u[bin].norm_sqr();
                sums.output[bin] += y[bin].norm_sqr();
                sums.cross[bin] += u[bin].conj() * y[bin];
            }
            count += 1;
        }
        sums.n_averages = independent(&window, step, count);
        Ok(sums)
    }
}

/// Returns the equivalent number of independent segments.
///
/// `K / (1 + 2 sum_j (1 - j/K) rho_j^2)` with `rho_j` the correlation of windows `j` steps apart.
fn independent(window: &[f64], step: usize, count: usize) -> f64 {
    let power: f64 = window.iter().map(|w| w * w).sum();
    let k = count as f64;
    let mut shared = 0.0;
    for j in 1..count {
        let Some(later) = window.get(j * step..).filter(|later| !later.is_empty()) else { break };
        let rho = later.iter().zip(window).map(|(a, b)| a * b).sum::<f64>() / power;
        shared += (1.0 - j as f64 / k) * rho * rho;
    }
    k / (1.0 + 2.0 * shared)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_of_whole_cycles_has_one_line() {
        let u: Vec<f64> = (0..64).map(|k| (TAU * 3.0 * f64::from(k) / 16.0).sin()).collect();
        let y: Vec<f64> = u.iter().map(|u| -2.0 * u).collect();
        let spectra = Spectra::of(&u, &y, Averaging::Periods { period_samples: 16 }).unwrap();
        assert!((spectra.input[3] - 4.0 * 64.0).abs() < 1e-10);
        assert!((spectra.cross[3] / spectra.input[3] + 2.0).norm() < 1e-13);
        assert!(spectra.input[2] < 1e-20 && (spectra.n_averages - 4.0).abs() < 1e-15);
    }

    #[test]
    fn half_overlapping_hann_segments_are_worth_nearly_as_many() {
        let u = vec![1.0; 1000];
        let averaging = Averaging::Welch { segment_samples: 100, overlap_samples: 50 };
        let n = Spectra::of(&u, &u, averaging).unwrap().n_averages;
        assert!((n - 19.0 / (1.0 + 2.0 * (18.0 / 19.0) / 36.0)).abs() < 1e-3, "{n}");
    }
}
