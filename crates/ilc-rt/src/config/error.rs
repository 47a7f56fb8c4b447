//! Refusals of a cell description: file, place, value and what is allowed, in one line.

use crate::record::{TEXT_MAX, printable};
use crate::schema::Violation;

/// Largest number of characters shown of a refused value.
const VALUE_MAX: usize = 80;

/// A refused cell description.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// An unreadable file.
    #[error("{file}: cannot be read: {reason}")]
    Read {
        /// The path as given.
        file: String,
        /// Reason given by the operating system.
        reason: String,
    },
    /// Invalid TOML, or a key that is unknown, missing or of the wrong type.
    #[error("{file}:{line}: {key}: {reason}")]
    Syntax {
        /// The path as given.
        file: String,
        /// Line of the file, from 1.
        line: usize,
        /// Table and key, e.g. `[axis.limits] position_min_m`.
        key: String,
        /// Reason, and what is allowed.
        reason: String,
    },
    /// A value out of its range, or two contradictory values.
    #[error("{file}: {key} = {value}: {allowed}")]
    Value {
        /// The path as given.
        file: String,
        /// Table and key, e.g. `[[axis]] x: limits.position_min_m`.
        key: String,
        /// The value found.
        value: String,
        /// Allowed values.
        allowed: String,
    },
}

impl ConfigError {
    /// Returns the refusal of a value of a file.
    pub(crate) fn value(file: &str, violation: &Violation) -> Self {
        let Violation { key, value, allowed } = violation;
        Self::Value {
            file: printable(file, TEXT_MAX),
            key: printable(key, TEXT_MAX),
            value: printable(value, VALUE_MAX),
            allowed: printable(allowed, TEXT_MAX),
        }
    }
}
