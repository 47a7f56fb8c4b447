//! What can be wrong with a model.

use thiserror::Error;

/// Why a model was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// A matrix does not fit the others.
    #[error(
        "matrix {matrix} has shape ({found_rows}, {found_cols}); ({rows}, {cols}) is needed to fit \
         the other matrices"
    )]
    Shape {
        /// Name of the matrix: `a`, `b`, `c` or `d`.
        matrix: &'static str,
        /// Rows needed.
        rows: usize,
        /// Columns needed.
        cols: usize,
        /// Rows given.
        found_rows: usize,
        /// Columns given.
        found_cols: usize,
    },
    /// A coefficient is infinite or not a number.
    #[error("{what} holds {value} at ({row}, {col}); only finite numbers are allowed")]
    NotFinite {
        /// Which matrix or polynomial.
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
    /// A discrete model was needed.
    #[error("{action} needs a discrete model, but this one is continuous: discretize it first")]
    Continuous {
        /// What was asked for.
        action: &'static str,
    },
    /// A continuous model was needed.
    #[error("{action} needs a continuous model, but this one is sampled at dt_s = {dt_s} s")]
    Discrete {
        /// What was asked for.
        action: &'static str,
        /// Sample time of the model given, in seconds.
        dt_s: f64,
    },
    /// Two models with different time bases were connected.
    #[error("cannot {action} models of different time: {first} and {second}")]
    TimeMismatch {
        /// The connection asked for.
        action: &'static str,
        /// Time base of the first model.
        first: String,
        /// Time base of the second model.
        second: String,
    },
    /// Two models whose numbers of signals do not match were connected.
    #[error("cannot {action}: {first} signals meet {second}")]
    SignalMismatch {
        /// The connection asked for.
        action: &'static str,
        /// Signals on the first side.
        first: usize,
        /// Signals on the second side.
        second: usize,
    },
    /// A signal has the wrong number of values.
    #[error("{what} holds {found} values; {allowed}")]
    Length {
        /// Which signal.
        what: &'static str,
        /// Values given.
        found: usize,
        /// The rule, as a sentence.
        allowed: String,
    },
    /// The model of one sample does not fit the others.
    #[error("at sample {sample}: {source}")]
    AtSample {
        /// The first such sample.
        sample: usize,
        /// What is wrong there.
        source: Box<ModelError>,
    },
    /// More was asked for than is given.
    #[error("{what} = {value}; at most {allowed} are allowed here")]
    TooMany {
        /// What was asked for.
        what: &'static str,
        /// How many.
        value: usize,
        /// How many there may be.
        allowed: usize,
    },
    /// The model's answer leaves the range of floating-point numbers.
    #[error("{what} is not finite: the model's answer grows beyond all numbers")]
    Overflow {
        /// What was computed.
        what: &'static str,
    },
    /// The instantaneous loop has no solution.
    #[error("the feedback loop is not well posed: I + D_c D_p is singular")]
    AlgebraicLoop,
    /// A transfer function that no state-space model has.
    #[error(
        "numerator of degree {numerator} over denominator of degree {denominator}; a proper transfer function is needed"
    )]
    Improper {
        /// Degree of the numerator.
        numerator: usize,
        /// Degree of the denominator.
        denominator: usize,
    },
    /// A denominator that is zero, or a model coefficient outside its range.
    #[error("{what} = {value}; {allowed}")]
    Parameter {
        /// Name of the parameter.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule, as a sentence.
        allowed: &'static str,
    },
    /// An iteration of the linear algebra gave no result.
    #[error("{what} could not be computed: {reason}")]
    Numerics {
        /// What was computed.
        what: &'static str,
        /// Why it failed.
        reason: &'static str,
    },
}
