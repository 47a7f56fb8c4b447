//! Refusals of a recording: it cannot be begun, or not be read.

use std::path::PathBuf;

/// A refusal, in one line.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be made.
    #[error("{path}: the recording cannot be made: {reason}", path = path.display())]
    Create {
        /// File.
        path: PathBuf,
        /// Reason of the system.
        reason: String,
    },
    /// The file cannot be read.
    #[error("{path}: {reason}", path = path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Reason of the system.
        reason: String,
    },
    /// It is not a recording of this program.
    #[error("{path}: not a recording of ilc-rt: {what}", path = path.display())]
    NotARecording {
        /// File.
        path: PathBuf,
        /// Missing or damaged part.
        what: String,
    },
}
