//! The iteration library: every run of every campaign, in one SQLite file.
//!
//! The campaign appends a run the moment it ends; Python and `--resume` read. Writers and readers
//! of several processes may share a file (write-ahead log); a killed process loses nothing it
//! appended.

mod elsewhere;
mod error;
mod figures;
mod file;
mod recall;
mod row;
mod schema;
mod store;
#[cfg(test)]
mod tests;
mod trim;

pub use elsewhere::{Elsewhere, ElsewhereError};
pub use error::LibraryError;
pub(crate) use file::IN_MEMORY;
pub use recall::{Near, Task};
pub use row::Row;
pub use store::Library;
