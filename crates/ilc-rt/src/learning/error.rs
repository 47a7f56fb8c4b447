//! What can be wrong with a law or the signals it is given.

use thiserror::Error;

use crate::model::ModelError;
use crate::signal::SignalError;

/// Why a law or a signal was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LearningError {
    /// A signal has the wrong number of values.
    #[error("{what} holds {found} values; {n_samples} samples of {n_channels} channels are needed")]
    Length {
        /// Which signal: `input`, `error` or `next`.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Samples of a run.
        n_samples: usize,
        /// Channels of this signal.
        n_channels: usize,
    },
    /// A signal holds a value that is infinite or not a number.
    #[error(
        "{what} is {value} at sample {sample}, channel {channel}; only finite values are allowed"
    )]
    NotFinite {
        /// Which signal: `input`, `error` or `next`.
        what: &'static str,
        /// The offending sample.
        sample: usize,
        /// The offending channel.
        channel: usize,
        /// The offending value.
        value: f64,
    },
    /// A law that somebody else wrote refused, or gave something that is no input.
    #[error("the law {law} failed: {reason}")]
    User {
        /// Name of the law.
        law: String,
        /// What it said.
        reason: String,
    },
    /// A parameter outside its range.
    #[error("{what} = {value}; {allowed}")]
    Parameter {
        /// Name of the parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule, as a sentence.
        allowed: &'static str,
    },
    /// A weight that is no weight, or does not fit.
    #[error("{what} at sample {sample}: {reason}")]
    Weight {
        /// Name of the weight.
        what: &'static str,
        /// The first sample at which it is wrong.
        sample: usize,
        /// What is wrong, and what is allowed.
        reason: String,
    },
    /// A count that must not be zero.
    #[error("{what} = 0; at least 1 is needed")]
    Empty {
        /// Name of the count.
        what: &'static str,
    },
    /// The weights leave part of the input undetermined.
    #[error(
        "with s = {s}, r = {r} and rate = {rate} the model does not determine the input at sample \
         {sample}; give r, s or rate a value above 0"
    )]
    Undetermined {
        /// Weight of the input.
        s: f64,
        /// Weight of the change.
        r: f64,
        /// Weight of the rate of the change.
        rate: f64,
        /// The last sample at which this happens.
        sample: usize,
    },
    /// The update itself is an unstable filter.
    #[error(
        "with s = {s}, r = {r} and rate = {rate} the input would grow without bound along the run: \
         the model has a zero outside the unit circle; give r or s a value above 0"
    )]
    Unbounded {
        /// Weight of the input.
        s: f64,
        /// Weight of the change.
        r: f64,
        /// Weight of the rate of the change.
        rate: f64,
    },
    /// The analysis of the law says that it will not converge.
    #[error(
        "this law will not converge: {why}; change the law, or allow it with allow_divergent = true"
    )]
    Divergent {
        /// The figures, as a sentence.
        why: String,
    },
    /// A law that cannot be analysed because it is not linear.
    #[error(
        "the law is not linear: two updates differ from their sum's by {difference:.3e} of it; \
         only linear laws can be analysed"
    )]
    NotLinear {
        /// Difference relative to the update.
        difference: f64,
    },
    /// An eigenvalue or a fixed point could not be computed.
    #[error("{what} could not be computed: {reason}")]
    Numerics {
        /// Which figure.
        what: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// The model was refused.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The filter was refused.
    #[error(transparent)]
    Signal(#[from] SignalError),
}

/// Checks the length and the values of a signal.
pub(crate) fn check(
    what: &'static str,
    signal: &[f64],
    n_samples: usize,
    n_channels: usize,
) -> Result<(), LearningError> {
    if signal.len() != n_samples * n_channels {
        return Err(LearningError::Length { what, found: signal.len(), n_samples, n_channels });
    }
    // One pass without a branch: a sum of `x * 0` is 0 unless an `x` is infinite or not a number.
    let poison: f64 = signal.iter().map(|value| value * 0.0).sum();
    if poison.is_finite() {
        return Ok(());
    }
    let index = signal.iter().position(|value| !value.is_finite()).unwrap_or(0);
    Err(LearningError::NotFinite {
        what,
        sample: index / n_channels,
        channel: index % n_channels,
        value: signal[index],
    })
}
