//! Refusals of an experiment, before anything moves or when its record is evaluated.

use crate::design::DesignError;
use crate::model::ModelError;

/// A refusal, in one line.
#[derive(Debug, thiserror::Error)]
pub enum IdentificationError {
    /// An experiment beyond the limits of the axis, or one without a result.
    #[error("{file}: axis {axis}: {what} = {value}; {allowed}")]
    Experiment {
        /// Cell description.
        file: String,
        /// Name of the axis.
        axis: String,
        /// Refused quantity.
        what: String,
        /// Its value.
        value: String,
        /// Allowed values.
        allowed: String,
    },
    /// The measured response cannot be fitted.
    #[error("{file}: [axis.model]: {source}")]
    Model {
        /// Cell description.
        file: String,
        /// Reason.
        source: ModelError,
    },
    /// The cell description.
    #[error(transparent)]
    Design(#[from] DesignError),
}
