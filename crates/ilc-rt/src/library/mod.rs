//! The iteration library: every run of every campaign, in one SQLite file.
//!
//! The campaign appends a run the moment it ends; Python and `--resume` read. Writers and readers
//! of several processes may share a file (write-ahead log); a killed process loses nothing it
//! appended.

mod earlier;
mod elsewhere;
mod error;
mod figures;
mod file;
mod fitting;
mod held;
mod insert;
mod listing;
mod near;
mod new_run;
mod once;
mod reader;
mod recall;
mod remove;
mod row;
mod schema;
mod signals;
mod store;
#[cfg(test)]
mod tests;
mod trim;
mod upgrade;

pub use earlier::Earlier;
pub use elsewhere::{Elsewhere, ElsewhereError};
pub use error::{LibraryError, Unreadable};
pub(crate) use file::IN_MEMORY;
pub use fitting::Fitting;
pub use held::Held;
pub use listing::Page;
pub use recall::{Near, Task};
pub use row::Row;
pub use store::Library;
