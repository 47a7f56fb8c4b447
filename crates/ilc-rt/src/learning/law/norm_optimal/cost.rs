//! Quadratic cost of the next input.

use crate::learning::weights::Weight;
use crate::learning::{LearningError, Result};

/// The same cost for every channel and every sample.
///
/// `J = sum_k q |z[k]|^2 + s |u'[k]|^2 + r |v[k]|^2 + sum_{k>=1} rate^2 |v[k] - v[k-1]|^2`
///
/// with `z` the predicted error, `u'` the next input and `v` its change.
///
/// # Units
/// - only the ratios matter; with error and input in metres all four are dimensionless
/// # Source
/// - \[barton2010\], Eq. (3.13): `q`, `s`, `r`; \[haas2016\], Eq. (7): `rate`, there `d`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Weight of the predicted error.
    pub q: f64,
    /// Weight of the next input: keeps it small, at the price of a remaining error.
    pub s: f64,
    /// Weight of the change of the input: slows learning down, and averages noise.
    pub r: f64,
    /// Weight of the change from one sample to the next: keeps the input smooth. Enters squared.
    pub rate: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self { q: 1.0, s: 0.0, r: 0.0, rate: 0.0 }
    }
}

/// A cost that may vary from sample to sample and couple the channels.
///
/// `J = sum_k |z[k]|^2_{q[k]} + |u'[k]|^2_{s[k]} + |v[k]|^2_{r[k]} + rate^2 |v[k] - v[k-1]|^2`
///
/// with `v[-1] = v[0]`.
///
/// `q[k]` weights the error at sample `k`, whichever input affects it.
///
/// # Shapes
/// - `q`: of the outputs; `s`, `r`: of the inputs
/// # Source
/// - \[barton2010\], Eq. (3.13) and (5.1); \[haas2016\], Eq. (7).
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// Weight of the predicted error.
    pub q: Weight,
    /// Weight of the next input.
    pub s: Weight,
    /// Weight of the change of the input.
    pub r: Weight,
    /// Weight of the change from one sample to the next. Enters squared.
    pub rate: f64,
}

impl From<Weights> for Cost {
    fn from(weights: Weights) -> Self {
        let Weights { q, s, r, rate } = weights;
        Self { q: Weight::Scalar(q), s: Weight::Scalar(s), r: Weight::Scalar(r), rate }
    }
}

impl Cost {
    /// Refuses weights that are invalid or do not match a model.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a number that is negative or not finite.
    /// - [`LearningError::Weight`] for any other invalid weight.
    pub fn check(&self, n_samples: usize, n_inputs: usize, n_outputs: usize) -> Result {
        let allowed = "a weight must be finite and not negative";
        let rate = Weight::Scalar(self.rate);
        for (what, weight, channels) in [
            ("q", &self.q, n_outputs),
            ("s", &self.s, n_inputs),
            ("r", &self.r, n_inputs),
            ("rate", &rate, n_inputs),
        ] {
            match *weight {
                Weight::Scalar(value) if !(value.is_finite() && value >= 0.0) => {
                    return Err(LearningError::Parameter { what, value, allowed });
                }
                _ => weight.check(what, n_samples, channels)?,
            }
        }
        Ok(())
    }

    /// Returns the part of the cost of some inputs and outputs, without coupling to others.
    #[must_use]
    pub fn select(&self, inputs: &[usize], outputs: &[usize]) -> Self {
        let Self { q, s, r, rate } = self;
        Self { q: q.select(outputs), s: s.select(inputs), r: r.select(inputs), rate: *rate }
    }

    /// Returns the weights as scalars, if they are.
    pub fn scalars(&self) -> Option<Weights> {
        match (&self.q, &self.s, &self.r) {
            (Weight::Scalar(q), Weight::Scalar(s), Weight::Scalar(r)) => {
                Some(Weights { q: *q, s: *s, r: *r, rate: self.rate })
            }
            _ => None,
        }
    }

    /// Returns true if all weights are the same at every sample.
    pub fn is_constant(&self) -> bool {
        [&self.q, &self.s, &self.r].iter().all(|weight| weight.is_constant())
    }

    /// Returns the text of the weights that determine the input, for errors.
    pub(in crate::learning::law) fn told(&self) -> String {
        format!("s = {}, r = {} and rate = {}", told(&self.s), told(&self.r), self.rate)
    }

    /// Returns the weights as members of a JSON object.
    pub(in crate::learning::law) fn json(&self) -> String {
        let json = |weight: &Weight| match weight {
            Weight::Scalar(value) => value.to_string(),
            other => format!(r#""{}""#, told(other)),
        };
        let Self { q, s, r, rate } = self;
        format!(r#""q":{},"s":{},"r":{},"rate":{rate}"#, json(q), json(s), json(r))
    }
}

fn told(weight: &Weight) -> String {
    match weight {
        Weight::Scalar(value) => value.to_string(),
        Weight::PerSample(_) => "one number a sample".to_owned(),
        Weight::Block(block) => format!("one block of {} x {}", block.nrows(), block.ncols()),
        Weight::Blocks(_) => "one block a sample".to_owned(),
    }
}
