//! Refusals of laws, parameters and signals.

use thiserror::Error;

use crate::learning::Law;
use crate::learning::law::constrained::BoundsError;
use crate::model::ModelError;
use crate::signal::SignalError;

/// Largest number of values of a signal, samples times channels: that of a trajectory.
pub(crate) const MAX_VALUES: usize = 10_000_000;

/// Result of a law or of what it is built from; of `()` if nothing else is said.
pub type Result<T = (), E = LearningError> = std::result::Result<T, E>;

/// A refused law or signal.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LearningError {
    /// A signal of the wrong length.
    #[error("{what} holds {found} values; {n_samples} samples of {n_channels} channels are needed")]
    Length {
        /// Name of the signal: `input`, `error` or `next`.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Samples of a run.
        n_samples: usize,
        /// Channels of this signal.
        n_channels: usize,
    },
    /// A signal with a value that is infinite or NaN.
    #[error(
        "{what} is {value} at sample {sample}, channel {channel}; only finite values are allowed"
    )]
    NotFinite {
        /// Name of the signal: `input`, `error` or `next`.
        what: &'static str,
        /// The offending sample.
        sample: usize,
        /// The offending channel.
        channel: usize,
        /// The offending value.
        value: f64,
    },
    /// A disturbance of the wrong length, or a missing one.
    #[error("the disturbance of a run holds {found} numbers; {expected} needed")]
    Disturbance {
        /// Values given; 0 if none was set.
        found: usize,
        /// Values expected.
        expected: usize,
    },
    /// A law from outside this crate refused, or returned no valid input.
    #[error("the law {law} failed: {reason}")]
    User {
        /// Name of the law.
        law: String,
        /// Its reason.
        reason: String,
    },
    /// Earlier runs that cannot be read.
    #[error("an earlier run cannot be read: {reason}")]
    Shelf {
        /// Reason.
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
    /// An invalid weight, or one of the wrong shape.
    #[error("{what} at sample {sample}: {reason}")]
    Weight {
        /// Name of the weight.
        what: &'static str,
        /// The first sample concerned.
        sample: usize,
        /// Reason, and what is allowed.
        reason: String,
    },
    /// A count that must not be zero.
    #[error("{what} = 0; at least 1 is needed")]
    Empty {
        /// Name of the count.
        what: &'static str,
    },
    /// Weights that leave part of the input undetermined (singular problem).
    #[error(
        "with {weights} the model does not determine the input at sample \
         {sample}; give r, s or rate a value above 0"
    )]
    Undetermined {
        /// The weights of input, change and rate, as text.
        weights: String,
        /// The last sample concerned.
        sample: usize,
    },
    /// Weights for which the update is an unstable filter.
    #[error(
        "with {weights} the input would grow without bound along the run: \
         the model has a zero outside the unit circle; give r or s a value above 0"
    )]
    Unbounded {
        /// The weights of input, change and rate, as text.
        weights: String,
    },
    /// A gain for which learning diverges.
    #[error(
        "gain = {gain}; it must be less than 2 / |P|^2 = {limit} for this model, or the error grows \
         from run to run unless a Q filter takes that part away"
    )]
    GainBound {
        /// The gain given.
        gain: f64,
        /// The gain above which the error grows.
        limit: f64,
    },
    /// A model with different numbers of inputs and outputs.
    #[error(
        "the model has {n_inputs} inputs and {n_outputs} outputs; only one with as many inputs as \
         outputs can be inverted"
    )]
    NotSquare {
        /// Inputs of the model.
        n_inputs: usize,
        /// Outputs of the model.
        n_outputs: usize,
    },
    /// A model without inverse.
    #[error("the model has no inverse: {reason}")]
    NoInverse {
        /// Reason.
        reason: &'static str,
    },
    /// A model with an unstable inverse (non-minimum phase).
    #[error(
        "the model has a zero at {re:.6} {im:+.6}i, {radius:.6} from the origin: its inverse is stable only \
         if all lie inside the unit circle; use norm-optimal learning with r above 0"
    )]
    NonMinimumPhase {
        /// Real part of the outermost zero.
        re: f64,
        /// Imaginary part of it.
        im: f64,
        /// Its distance from the origin.
        radius: f64,
    },
    /// Contradictory bounds.
    #[error(transparent)]
    Bounds(#[from] BoundsError),
    /// A law that makes runs which only measure, in a wrapper that changes their inputs or errors.
    #[error(
        "{wrapper} needs a law that learns from every run; this one makes runs that only measure: {law}"
    )]
    Measures {
        /// Name of the wrapper.
        wrapper: &'static str,
        /// Description of the law.
        law: String,
    },
    /// A law that the analysis predicts to diverge.
    #[error(
        "this law will not converge: {why}; change the law, or allow it with allow_divergent = true"
    )]
    Divergent {
        /// The figures, as a sentence.
        why: String,
    },
    /// A nonlinear law, which cannot be analysed.
    #[error(
        "the law is not linear: two updates differ from their sum's by {difference:.3e} of it; \
         only linear laws can be analysed"
    )]
    NotLinear {
        /// Difference relative to the update.
        difference: f64,
    },
    /// A number above its limit, e.g. a run too long for memory.
    #[error("{what} = {value}; at most {allowed} are allowed here")]
    TooMany {
        /// Name of the count.
        what: &'static str,
        /// The count.
        value: usize,
        /// Largest count allowed.
        allowed: usize,
    },
    /// An eigenvalue or fixed point that could not be computed.
    #[error("{what} could not be computed: {reason}")]
    Numerics {
        /// Name of the figure.
        what: &'static str,
        /// Reason.
        reason: &'static str,
    },
    /// A refused model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A refused filter.
    #[error(transparent)]
    Signal(#[from] SignalError),
}

/// Checks the length and the values of a signal.
pub(crate) fn check(
    what: &'static str,
    signal: &[f64],
    n_samples: usize,
    n_channels: usize,
) -> Result {
    check_length(what, signal, n_samples, n_channels)?;
    if is_finite(signal) {
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

/// Returns true if every value is finite.
pub(crate) fn is_finite(signal: &[f64]) -> bool {
    // One pass without branches: a sum of `x * 0` is 0 unless an `x` is infinite or NaN. Several
    // partial sums, because each addition would wait for the previous one.
    let chunks = signal.chunks_exact(16);
    let rest = chunks.remainder();
    let mut poison = [0.0; 16];
    for chunk in chunks {
        for (sum, value) in poison.iter_mut().zip(chunk) {
            *sum += value * 0.0;
        }
    }
    poison.iter().chain(rest).all(|value| value.is_finite())
}

/// Checks the arguments of [`Law::update`](super::Law::update); `channels` are those of input and error.
pub(crate) fn check_update(
    input: &[f64],
    error: &[f64],
    next: &[f64],
    n_samples: usize,
    [n_inputs, n_outputs]: [usize; 2],
) -> Result {
    check("input", input, n_samples, n_inputs)?;
    check("error", error, n_samples, n_outputs)?;
    check_length("next", next, n_samples, n_inputs)
}

/// Checks the arguments of [`Law::apply_adjoint`](super::Law::apply_adjoint).
pub(crate) fn check_adjoint(
    dual: &[f64],
    to_input: &[f64],
    to_error: &[f64],
    n_samples: usize,
    [n_inputs, n_outputs]: [usize; 2],
) -> Result {
    check("dual", dual, n_samples, n_inputs)?;
    check_length("to_input", to_input, n_samples, n_inputs)?;
    check_length("to_error", to_error, n_samples, n_outputs)
}

/// Refuses to wrap a law that also makes runs which only measure.
pub(crate) fn check_learns_from_every_run(wrapper: &'static str, law: &impl Law) -> Result {
    if law.measures() {
        return Err(LearningError::Measures { wrapper, law: law.describe() });
    }
    Ok(())
}

/// Checks the length of a signal.
pub(crate) fn check_length(
    what: &'static str,
    signal: &[f64],
    n_samples: usize,
    n_channels: usize,
) -> Result {
    if signal.len() == n_samples * n_channels {
        return Ok(());
    }
    Err(LearningError::Length { what, found: signal.len(), n_samples, n_channels })
}

/// Refuses zero counts, and runs too long for memory: the first count is the number of samples, the
/// others are channels.
pub(crate) fn check_counts(counts: &[(&'static str, usize)]) -> Result {
    if let Some((what, _)) = counts.iter().find(|(_, count)| *count == 0) {
        return Err(LearningError::Empty { what });
    }
    let Some(((what, value), channels)) = counts.split_first() else { return Ok(()) };
    let widest = channels.iter().map(|(_, count)| *count).max().unwrap_or(1);
    let allowed = MAX_VALUES / widest;
    if *value > allowed {
        return Err(LearningError::TooMany { what, value: *value, allowed });
    }
    Ok(())
}
