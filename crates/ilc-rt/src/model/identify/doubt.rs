//! Reasons not to use an identified model.
//!
//! `identification` checks it before it proposes a model for a cell description.

use super::FrequencyResponse;

/// Median coherence below which the output does not follow the input.
const COHERENCE_MIN: f64 = 0.7;
/// Relative residual above which a model does not describe the response.
const RESIDUAL_MAX: f64 = 0.25;

/// Reason not to use a model.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Doubt {
    /// Zero output.
    #[error("the output does not answer at any frequency: the axis sticks or is not connected")]
    Silent,
    /// Most of the output is not caused by the input.
    #[error(
        "the output hardly follows the input (median coherence {median:.2}, {COHERENCE_MIN} is \
         needed): the axis sticks or the amplitude is lost in noise"
    )]
    Incoherent {
        /// Median of the coherence in the band.
        median: f64,
    },
    /// The model does not describe the response.
    #[error(
        "the model leaves {:.0} % unexplained ({:.0} % at most): friction, or a resonance that the \
         model does not have",
        residual_rms * 100.0,
        RESIDUAL_MAX * 100.0
    )]
    Unexplained {
        /// Weighted RMS of the fit's residual, relative to the response.
        residual_rms: f64,
    },
    /// A model out of the range of a cell description.
    #[error("the fit has {what} {value:.4}, a cell takes {low} to {high}")]
    BeyondCell {
        /// Name of the figure, with its unit.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Smallest value in a cell.
        low: f64,
        /// Largest value in a cell.
        high: f64,
    },
}

/// Returns the objection to a model with that residual; `None` if there is none.
///
/// No output at all, a coherence with a median below 0.7, or a relative residual above 0.25.
pub fn doubt(measured: &FrequencyResponse, residual_rms: f64) -> Option<Doubt> {
    let is_silent = measured.response.iter().all(|response| response.norm() <= 0.0);
    if is_silent && !measured.response.is_empty() {
        return Some(Doubt::Silent);
    }
    let mut coherence = measured.coherence.clone();
    coherence.sort_by(f64::total_cmp);
    let n = coherence.len();
    let median = match n {
        0 => 0.0,
        _ => f64::midpoint(coherence[(n - 1) / 2], coherence[n / 2]),
    };
    if median.is_nan() || median < COHERENCE_MIN {
        return Some(Doubt::Incoherent { median });
    }
    (residual_rms.is_nan() || residual_rms > RESIDUAL_MAX)
        .then_some(Doubt::Unexplained { residual_rms })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    fn measured(coherence: &[f64]) -> FrequencyResponse {
        FrequencyResponse {
            frequency_hz: (1..=coherence.len()).map(|k| k as f64).collect(),
            response: vec![Complex::new(1.0, 0.0); coherence.len()],
            coherence: coherence.to_vec(),
            n_averages: 4.0,
        }
    }

    #[test]
    fn a_response_that_follows_and_fits_is_not_doubted() {
        assert_eq!(doubt(&measured(&[0.1, 0.9, 0.99]), 0.2), None);
    }

    #[test]
    fn half_the_band_without_coherence_is_doubted() {
        let found = doubt(&measured(&[0.5, 0.1, 0.8, 0.9]), 0.0).unwrap();
        assert_eq!(found, Doubt::Incoherent { median: 0.65 });
        assert!(found.to_string().contains("median coherence 0.65, 0.7 is needed"), "{found}");
        assert!(
            doubt(&measured(&[]), 0.0).is_some() && doubt(&measured(&[f64::NAN]), 0.0).is_some()
        );
    }

    #[test]
    fn a_model_that_leaves_too_much_is_doubted() {
        let found = doubt(&measured(&[1.0]), 0.4).unwrap();
        assert!(found.to_string().contains("leaves 40 % unexplained (25 % at most)"), "{found}");
        assert!(doubt(&measured(&[1.0]), f64::NAN).is_some());
    }
}
