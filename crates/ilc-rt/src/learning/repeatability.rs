//! Repeatability: the part of the error that repeats, which learning can remove, and the part that does not.

use super::error::{check, check_counts};
use super::{LearningError, Result};

/// Common part of several runs with the same input.
///
/// # Units
/// - those of the error; `ratio` and `learnable` are dimensionless
#[derive(Debug, Clone, PartialEq)]
pub struct Repeatability {
    /// Mean error of the runs, sample by sample, time first.
    pub mean: Vec<f64>,
    /// Standard deviation from run to run, sample by sample.
    pub spread: Vec<f64>,
    /// RMS of the mean error: the part that learning can remove.
    pub mean_rms: f64,
    /// RMS of the standard deviation: the part that it cannot.
    pub spread_rms: f64,
    /// `spread_rms / mean_rms`; infinite if the mean is zero and the spread is not, 0 if both are.
    pub ratio: f64,
    /// Repeatable share of the mean square error of one run, from 0 to 1, corrected for the noise
    /// left in the mean of the runs.
    pub learnable: f64,
    /// Smallest RMS of any run.
    pub least_rms: f64,
    /// Largest RMS of any run.
    pub largest_rms: f64,
}

/// Compares the errors of runs with the same input.
///
/// `m = mean_j e_j`, `s^2[k] = sum_j (e_j[k] - m[k])^2 / (n - 1)`,
/// `learnable = (ms(m) - ms(s)/n) / (ms(m) - ms(s)/n + ms(s))`
///
/// A ratio well below 1 means that learning is worthwhile; whatever the law, the error of a run
/// does not fall below `spread_rms`.
///
/// # Shapes
/// - `errors`: run after run, each time first, `n_samples` x `n_channels`
/// # Errors
/// - [`LearningError::Parameter`] for fewer than two runs.
/// - [`LearningError::Empty`] for 0 samples or channels.
/// - [`LearningError::Length`] or [`LearningError::NotFinite`].
/// # Source
/// - \[filter-based\], Section 6.1: check of the system's repeatability, there by the range of the
///   RMS over ten runs.
pub fn repeatability(
    errors: &[f64],
    n_runs: usize,
    n_samples: usize,
    n_channels: usize,
) -> Result<Repeatability> {
    check_counts(&[("n_samples", n_samples), ("n_channels", n_channels)])?;
    if n_runs < 2 {
        let allowed = "a spread needs at least 2 runs";
        return Err(LearningError::Parameter { what: "n_runs", value: n_runs as f64, allowed });
    }
    check("errors", errors, n_runs * n_samples, n_channels)?;
    let size = n_samples * n_channels;
    let runs = || errors.chunks_exact(size);
    let mean_square = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>() / size as f64;

    let mut mean = vec![0.0; size];
    for run in runs() {
        for (mean, error) in mean.iter_mut().zip(run) {
            *mean += error / n_runs as f64;
        }
    }
    let mut spread = vec![0.0; size];
    for run in runs() {
        for ((spread, mean), error) in spread.iter_mut().zip(&mean).zip(run) {
            *spread += (error - mean).powi(2);
        }
    }
    for spread in &mut spread {
        *spread = (*spread / (n_runs - 1) as f64).sqrt();
    }

    let (of_mean, of_spread) = (mean_square(&mean), mean_square(&spread));
    let largest = runs().map(&mean_square).fold(of_mean.max(of_spread), f64::max);
    if !largest.is_finite() {
        let allowed = "squares of the errors must be finite";
        return Err(LearningError::Parameter { what: "mean square", value: largest, allowed });
    }
    let repeatable = (of_mean - of_spread / n_runs as f64).max(0.0);
    let whole = repeatable + of_spread;
    let figures = || runs().map(|run| mean_square(run).sqrt());
    Ok(Repeatability {
        mean_rms: of_mean.sqrt(),
        spread_rms: of_spread.sqrt(),
        ratio: if of_spread > 0.0 { (of_spread / of_mean).sqrt() } else { 0.0 },
        learnable: if whole > 0.0 { repeatable / whole } else { 0.0 },
        least_rms: figures().fold(f64::INFINITY, f64::min),
        largest_rms: figures().fold(0.0, f64::max),
        mean,
        spread,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_runs_by_hand() {
        // Means 2 and 0, deviations 1 each: variance 2 and 2.
        let found = repeatability(&[1.0, 1.0, 3.0, -1.0], 2, 2, 1).unwrap();
        assert_eq!(found.mean, [2.0, 0.0]);
        assert!(found.spread.iter().all(|s| (s - 2_f64.sqrt()).abs() < 1e-15));
        assert!((found.mean_rms - 2_f64.sqrt()).abs() < 1e-15);
        assert!((found.ratio - 1.0).abs() < 1e-15);
        // (2 - 2/2) / (1 + 2)
        assert!((found.learnable - 1.0 / 3.0).abs() < 1e-15);
        assert!((found.least_rms - 1.0).abs() < 1e-15);
        assert!((found.largest_rms - 5_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn what_repeats_exactly_is_all_learnable_and_silence_is_not() {
        let same = repeatability(&[3.0, -4.0, 3.0, -4.0, 3.0, -4.0], 3, 1, 2).unwrap();
        assert!(same.spread_rms < 1e-15 && (same.learnable - 1.0).abs() < 1e-15);
        let silent = repeatability(&[0.0; 6], 3, 2, 1).unwrap();
        assert_eq!((silent.ratio.to_bits(), silent.learnable.to_bits()), (0, 0));
        let noise = repeatability(&[1.0, -1.0], 2, 1, 1).unwrap();
        assert!(noise.ratio.is_infinite() && noise.learnable.to_bits() == 0);
    }

    #[test]
    fn too_few_runs_and_wrong_arrays_are_refused() {
        let refuse =
            |errors: &[f64], n, k, m| repeatability(errors, n, k, m).unwrap_err().to_string();
        assert!(refuse(&[1.0], 1, 1, 1).contains("n_runs = 1"));
        assert!(refuse(&[], 2, 0, 1).contains("n_samples = 0"));
        assert!(refuse(&[], 2, 1, 0).contains("n_channels = 0"));
        assert!(refuse(&[1.0; 5], 2, 3, 1).contains("errors holds 5 values"));
        assert!(refuse(&[1.0, f64::NAN], 2, 1, 1).contains("NaN"));
    }
}
