//! A scalar along the run: the share or scale of one term of a weight.

use crate::learning::{LearningError, Result};

/// A scalar that is constant or given for each sample.
///
/// # Shapes
/// - `PerSample`: `n_samples` numbers
#[derive(Debug, Clone, PartialEq)]
pub enum Gain {
    /// Constant along the run.
    Constant(f64),
    /// One number per sample, e.g. from a [`Schedule`](super::Schedule).
    PerSample(Vec<f64>),
}

impl Gain {
    /// Returns the number at sample `k`.
    ///
    /// # Panics
    /// If `k` is beyond the end of the run; the builders check the lengths first.
    pub fn at(&self, k: usize) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::PerSample(values) => values[k],
        }
    }

    /// Returns true if it is constant along the run.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }

    /// Refuses a wrong length, and numbers outside 0 to `highest`.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] naming `what` and the sample.
    pub fn check(&self, what: &'static str, n_samples: usize, highest: f64) -> Result {
        let refused =
            |sample: usize, reason: String| Err(LearningError::Weight { what, sample, reason });
        let number = |sample: usize, value: f64| {
            if value.is_finite() && (0.0..=highest).contains(&value) {
                return Ok(());
            }
            let rule = if highest.is_finite() {
                format!("it must lie between 0 and {highest}")
            } else {
                "it must be finite and not negative".to_owned()
            };
            refused(sample, format!("{value}; {rule}"))
        };
        match self {
            Self::Constant(value) => number(0, *value),
            Self::PerSample(values) if values.len() != n_samples => {
                let count = values.len();
                refused(0, format!("{count} samples given; {n_samples} are needed"))
            }
            Self::PerSample(values) => {
                values.iter().enumerate().try_for_each(|(k, value)| number(k, *value))
            }
        }
    }
}

impl From<f64> for Gain {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

impl From<Vec<f64>> for Gain {
    fn from(values: Vec<f64>) -> Self {
        Self::PerSample(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        for (gain, word) in [
            (Gain::from(-0.1), "-0.1"),
            (Gain::from(1.1), "between 0 and 1"),
            (Gain::from(f64::NAN), "NaN"),
            (Gain::from(vec![0.5; 2]), "2 samples"),
            (Gain::from(vec![0.5, 0.5, 2.0]), "sample 2"),
        ] {
            let told = gain.check("gamma", 3, 1.0).unwrap_err().to_string();
            assert!(told.starts_with("gamma at sample") && told.contains(word), "{told}");
        }
        assert!(Gain::from(7.0).check("sigma", 3, f64::INFINITY).is_ok());
        assert!(Gain::from(f64::INFINITY).check("sigma", 3, f64::INFINITY).is_err());
    }
}
