//! Multiplicative uncertainty of a model.

use crate::learning::{LearningError, Result};

/// Multiplicative model uncertainty, `P_true = P (I + W Delta)` with `|Delta| <= 1`.
#[derive(Debug, Clone, PartialEq)]
pub enum Uncertainty {
    /// Frequency-independent; 0.2 is 20 %.
    Scalar(f64),
    /// Gain at equally spaced frequencies from zero to the Nyquist frequency, both included.
    Shaped(Vec<f64>),
}

impl Uncertainty {
    /// Returns the gain at a frequency, interpolated linearly.
    pub fn at(&self, frequency_hz: f64, dt_s: f64) -> f64 {
        match self {
            Self::Scalar(gain) => *gain,
            Self::Shaped(gains) => {
                let last = gains.len() - 1;
                let place = (2.0 * frequency_hz * dt_s * last as f64).clamp(0.0, last as f64);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "between 0 and last"
                )]
                let below = (place as usize).min(last.saturating_sub(1));
                let above = (below + 1).min(last);
                gains[below] + (place - below as f64) * (gains[above] - gains[below])
            }
        }
    }

    /// Returns the largest gain.
    pub fn largest(&self) -> f64 {
        match self {
            Self::Scalar(gain) => *gain,
            Self::Shaped(gains) => gains.iter().copied().fold(0.0, f64::max),
        }
    }

    /// Refuses invalid gains.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a gain that is negative or not finite,
    ///   [`LearningError::Empty`] for an empty list.
    pub fn check(&self) -> Result {
        let gains = match self {
            Self::Scalar(gain) => std::slice::from_ref(gain),
            Self::Shaped(gains) => gains,
        };
        if gains.is_empty() {
            return Err(LearningError::Empty { what: "uncertainty" });
        }
        match gains.iter().find(|gain| !(gain.is_finite() && **gain >= 0.0)) {
            None => Ok(()),
            Some(value) => Err(LearningError::Parameter {
                what: "uncertainty",
                value: *value,
                allowed: "a gain that is finite and not negative, as 0.2 for 20 %",
            }),
        }
    }
}
