//! Terms of a parametric law, and its weights.

use super::functions::Function;
use crate::learning::{LearningError, Result};

/// A signal that a parameter weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Input that it is added to.
    pub input: usize,
    /// Name of the parameter.
    pub name: String,
    /// Signal of a run, `n_samples`.
    pub signal: Vec<f64>,
    /// Its function of the set points of the input's axis, if it has one: then the parameter can be taken over
    /// from another program.
    pub function: Option<(Function, usize)>,
}

/// Diagonal weights of a [`Parametric`](super::Parametric) law, one number per sample and channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagonal {
    /// Of the predicted error, `n_samples` x `n_outputs`.
    pub q: Vec<f64>,
    /// Of the next input, `n_samples` x `n_inputs`.
    pub s: Vec<f64>,
    /// Of its change, `n_samples` x `n_inputs`.
    pub r: Vec<f64>,
}

impl Diagonal {
    /// Returns the same weights at every sample and channel.
    pub fn uniform([q, s, r]: [f64; 3], n_inputs: usize, n_outputs: usize) -> Self {
        Self { q: vec![q; n_outputs], s: vec![s; n_inputs], r: vec![r; n_inputs] }
    }

    pub(super) fn roots(weight: &[f64], what: &'static str, n: usize) -> Result<Vec<f64>> {
        if let Some(value) = weight.iter().find(|each| !(each.is_finite() && **each >= 0.0)) {
            let allowed = "a weight must be finite and not negative";
            return Err(LearningError::Parameter { what, value: *value, allowed });
        }
        Ok(weight.iter().cycle().take(n).map(|each| each.sqrt()).collect())
    }
}
