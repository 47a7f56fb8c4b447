//! Refusals of paths and arcs.

use thiserror::Error;

/// A refused path or arc.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ContourError {
    /// A path without samples.
    #[error("a path of 0 samples; at least 1 is needed")]
    Empty,
    /// A coordinate that is infinite or NaN.
    #[error("sample {sample}, axis {}: {value}; only finite values are allowed", axis + 1)]
    NotFinite {
        /// The sample.
        sample: usize,
        /// The axis.
        axis: usize,
        /// The value given.
        value: f64,
    },
    /// Numbers that do not define an arc.
    #[error("arc: {reason}")]
    Arc {
        /// The rule, as a sentence.
        reason: &'static str,
    },
}
