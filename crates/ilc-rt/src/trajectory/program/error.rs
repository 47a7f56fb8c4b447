//! Error of a part program.

/// A refused program: the line from 1, the word, and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {word}: {allowed}")]
pub struct GcodeError {
    /// Line of the text, from 1.
    pub line: usize,
    /// The word, as written.
    pub word: String,
    /// The defect, and what is allowed.
    pub allowed: String,
}
