//! Refusals of a data sheet, in one line.

use crate::fieldbus::canopen::ObjectAddress;

/// Refusal of a data sheet, or of its drive.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DataSheetError {
    /// An unreadable file.
    #[error("{file}: cannot be read: {reason}")]
    Read {
        /// The path as given.
        file: String,
        /// Reason.
        reason: String,
    },
    /// A text without objects.
    #[error("{file}: no data sheet: {reason}; allowed: the text of an EDS or DCF (CiA 306)")]
    NoSheet {
        /// The path as given.
        file: String,
        /// Reason.
        reason: String,
    },
    /// A drive without an object that the loop or a stop needs.
    #[error("{file}: the drive has no object {object} ({name}), which is needed {purpose}")]
    Missing {
        /// The path as given.
        file: String,
        /// The object.
        object: ObjectAddress,
        /// Its name.
        name: &'static str,
        /// Purpose.
        purpose: &'static str,
    },
    /// A drive with an object that cannot be used.
    #[error("{file}: object {object} ({name}) = {found}: {needed}")]
    Unfit {
        /// The path as given.
        file: String,
        /// The object.
        object: ObjectAddress,
        /// Its name.
        name: &'static str,
        /// Value or property found.
        found: String,
        /// Requirement.
        needed: String,
    },
    /// A value that depends on the node number, which is not known.
    #[error("{file}: object {object} = {value}: give the node number with --node")]
    NeedsNode {
        /// The path as given.
        file: String,
        /// The object.
        object: ObjectAddress,
        /// The value.
        value: String,
    },
    /// A cell description that cannot take the section.
    #[error("{file}: {reason}")]
    Cell {
        /// The path as given.
        file: String,
        /// Reason, and what is allowed.
        reason: String,
    },
}
