//! Refusals of a learned input, in one line that names the value and what is allowed.

use crate::learning::LearningError;

/// Reason that an input is not used, or not exported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InputError {
    /// There is no library.
    #[error("there is no library {path} to take an input from")]
    NoLibrary {
        /// Its file.
        path: String,
    },
    /// No run of the library fits.
    #[error("library {path}: no undisturbed run of this cell to take the input from{nearest}")]
    NoRun {
        /// Library.
        path: String,
        /// Difference of the newest run that does not fit, or nothing.
        nearest: String,
    },
    /// No run of the library shows parameters of the law.
    #[error(
        "library {path}: no undisturbed run of this cell with law \"{law}\" to take parameters from{nearest}"
    )]
    NoParameters {
        /// Library.
        path: String,
        /// The law of the cell.
        law: String,
        /// Difference of the newest run that does not fit, or nothing.
        nearest: String,
    },
    /// The law has no parameters that another program could show.
    #[error(
        "--parameters-from: law \"{law}\" has no parameters that hold on another program; allowed: \
         \"basis_functions\" and \"position_domain\""
    )]
    Unparametric {
        /// The law of the cell.
        law: String,
    },
    /// The law refuses what a run shows.
    #[error("{place} has no parameters for the law \"{law}\": {source}")]
    Refused {
        /// The run.
        place: String,
        /// The law of the cell.
        law: String,
        /// Its reason.
        source: Box<LearningError>,
    },
    /// The input was learned for something else.
    #[error("{place}: {key} is {there} there and {here} in this cell; allowed: the same")]
    Different {
        /// Origin of the input: a run of the library, or a file.
        place: String,
        /// First key that differs.
        key: String,
        /// Its value where the input comes from.
        there: String,
        /// Its value in the cell.
        here: String,
    },
    /// The file cannot be read or written.
    #[error("{path}: {reason}; allowed: a file of `ilc-rt input export`")]
    Unusable {
        /// File.
        path: String,
        /// Reason.
        reason: String,
    },
    /// The content does not match its digest.
    #[error("{path}: damaged: its content does not match its digest")]
    Damaged {
        /// File.
        path: String,
    },
    /// An input has another size than the program.
    #[error("{place}: {found} samples of the input; allowed: {allowed}, {n_axes} numbers each")]
    Size {
        /// Origin of the input.
        place: String,
        /// Samples found.
        found: usize,
        /// Samples of the program.
        allowed: usize,
        /// Number of axes.
        n_axes: usize,
    },
    /// An input beyond its bound, or not finite.
    #[error(
        "{place}: the input of axis {axis} is {value} {unit} at sample {sample}; allowed: up to \
         {limit} {unit} ([learning])"
    )]
    Bound {
        /// Origin of the input.
        place: String,
        /// Name of the axis.
        axis: String,
        /// Value found.
        value: f64,
        /// Unit of the input.
        unit: String,
        /// Sample.
        sample: usize,
        /// Largest magnitude allowed.
        limit: f64,
    },
}
