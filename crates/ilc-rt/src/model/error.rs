//! Errors of models.

use thiserror::Error;

/// A refused model.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// A matrix whose shape does not match the others.
    #[error(
        "matrix {matrix} has shape ({found_rows}, {found_cols}); ({rows}, {cols}) is needed to fit \
         the other matrices"
    )]
    Shape {
        /// Name of the matrix: `a`, `b`, `c` or `d`.
        matrix: &'static str,
        /// Rows required.
        rows: usize,
        /// Columns required.
        cols: usize,
        /// Rows given.
        found_rows: usize,
        /// Columns given.
        found_cols: usize,
    },
    /// A coefficient that is infinite or NaN.
    #[error("{what} holds {value} at ({row}, {col}); only finite numbers are allowed")]
    NotFinite {
        /// Name of the matrix or polynomial.
        what: &'static str,
        /// Row of the offending number.
        row: usize,
        /// Column of the offending number.
        col: usize,
        /// The offending number.
        value: f64,
    },
    /// A sample time that is not a positive number.
    #[error("dt_s = {dt_s} s; a sample time must be finite and greater than 0 s")]
    SampleTime {
        /// The sample time given, in seconds.
        dt_s: f64,
    },
    /// A discrete model is required.
    #[error("{action} needs a discrete model, but this one is continuous: discretize it first")]
    Continuous {
        /// Requested operation.
        action: &'static str,
    },
    /// A continuous model is required.
    #[error("{action} needs a continuous model, but this one is sampled at dt_s = {dt_s} s")]
    Discrete {
        /// Requested operation.
        action: &'static str,
        /// Sample time of the model given, in seconds.
        dt_s: f64,
    },
    /// Connection of models with different time bases.
    #[error("cannot {action} models of different time: {first} and {second}")]
    TimeMismatch {
        /// Requested connection.
        action: &'static str,
        /// Time base of the first model.
        first: String,
        /// Time base of the second model.
        second: String,
    },
    /// Connection of models whose numbers of signals do not match.
    #[error("cannot {action}: {first} signals meet {second}")]
    SignalMismatch {
        /// Requested connection.
        action: &'static str,
        /// Signals on the first side.
        first: usize,
        /// Signals on the second side.
        second: usize,
    },
    /// A signal of the wrong length.
    #[error("{what} holds {found} values; {allowed}")]
    Length {
        /// Name of the signal.
        what: &'static str,
        /// Values given.
        found: usize,
        /// The rule, as a sentence.
        allowed: String,
    },
    /// A time-varying model whose sample has other sizes than the first.
    #[error("at sample {sample}: {source}")]
    AtSample {
        /// Index of the first such sample.
        sample: usize,
        /// Error of that sample.
        source: Box<ModelError>,
    },
    /// A number above its limit.
    #[error("{what} = {value}; at most {allowed} are allowed here")]
    TooMany {
        /// Name of the number.
        what: &'static str,
        /// Number requested.
        value: usize,
        /// Largest number allowed.
        allowed: usize,
    },
    /// The model's response overflows.
    #[error("{what} is not finite: the model's answer grows beyond all numbers")]
    Overflow {
        /// Name of the result.
        what: &'static str,
    },
    /// A singular algebraic loop.
    #[error("the feedback loop is not well posed: I + D_c D_p is singular")]
    AlgebraicLoop,
    /// An inverse that is not proper.
    #[error("there is no proper inverse: D is singular; delay the inverse, or invert in time")]
    NoInverse,
    /// An improper transfer function, which has no state-space model.
    #[error(
        "numerator of degree {numerator} over denominator of degree {denominator}; a proper transfer function is needed"
    )]
    Improper {
        /// Degree of the numerator.
        numerator: usize,
        /// Degree of the denominator.
        denominator: usize,
    },
    /// A zero denominator, or a parameter outside its range.
    #[error("{what} = {value}; {allowed}")]
    Parameter {
        /// Name of the parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule, as a sentence.
        allowed: &'static str,
    },
    /// A linear-algebra iteration that did not converge.
    #[error("{what} could not be computed: {reason}")]
    Numerics {
        /// Name of the result.
        what: &'static str,
        /// Reason.
        reason: &'static str,
    },
}
