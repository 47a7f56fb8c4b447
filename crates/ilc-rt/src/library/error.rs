//! Reasons that a library cannot be used, in one line that says what is allowed.

use rusqlite::ErrorCode;

/// Reason that the library cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// An error of SQLite.
    #[error("library {path}: {source}")]
    Sqlite {
        /// File.
        path: String,
        /// Error of SQLite.
        source: rusqlite::Error,
    },
    /// Another program was writing for longer than the time-out.
    #[error("library {path}: locked by another program that is writing to it")]
    Locked {
        /// File.
        path: String,
    },
    /// The file cannot be opened or written.
    #[error(
        "library {path}: cannot be opened: {source}; allowed: a library of this program, or a new \
         file in a folder that exists and can be written"
    )]
    Open {
        /// File.
        path: String,
        /// Error of SQLite.
        source: rusqlite::Error,
    },
    /// The file exists and is not a library of this program.
    #[error(
        "library {path}: {found}; allowed: a library of this program, or a new file in a folder \
         that exists and can be written"
    )]
    Foreign {
        /// File.
        path: String,
        /// Its state instead.
        found: String,
    },
    /// The file, or the folder of a growing library, cannot be written.
    #[error("library {path}: cannot be written: {found}")]
    ReadOnly {
        /// File.
        path: String,
        /// Obstacle.
        found: &'static str,
    },
    /// A missing file.
    #[error("library {path}: no such library")]
    Missing {
        /// File.
        path: String,
    },
    /// A file without contents.
    #[error("library {path}: an empty file; there is no run in it")]
    Empty {
        /// File.
        path: String,
    },
    /// The file was deleted or replaced while it was in use.
    #[error("library {path}: the file was deleted or replaced while it was in use")]
    Gone {
        /// File.
        path: String,
    },
    /// The file was written by another version of this program.
    #[error("library {path}: schema version {found}; this program reads version {expected}")]
    Version {
        /// File.
        path: String,
        /// Version in the file.
        found: i64,
        /// Version of this program.
        expected: i64,
    },
    /// The campaign already has a run of this number.
    #[error(
        "library {path}: campaign {campaign} has a run {index} already; is another program going \
         on with it?"
    )]
    Taken {
        /// File.
        path: String,
        /// Campaign.
        campaign: String,
        /// Number of the run.
        index: u32,
    },
    /// Another run of this number is in the campaign already.
    #[error("library {path}: campaign {campaign} has another run of the same number, {index}")]
    Other {
        /// File.
        path: String,
        /// Campaign.
        campaign: String,
        /// Number of the run.
        index: u32,
    },
    /// A missing row.
    #[error("library {path}: no iteration with id {id}")]
    NoSuchRow {
        /// File.
        path: String,
        /// Requested key.
        id: i64,
    },
    /// An invalid disturbance to look for.
    #[error("library {path}: disturbance = {found:?}: at least one number, all finite")]
    Disturbance {
        /// File.
        path: String,
        /// Disturbance.
        found: Vec<f64>,
    },
    /// Runs with different numbers of disturbances, which cannot be compared.
    #[error(
        "library {path}: runs {} and {} have {} and {} disturbances; runs that are trimmed together \
         must have the same number", ids[0], ids[1], found[0], found[1]
    )]
    Disturbances {
        /// File.
        path: String,
        /// Keys of two runs.
        ids: [i64; 2],
        /// Numbers of their disturbances.
        found: [usize; 2],
    },
    /// The stored arrays do not match their stored digest.
    #[error("library {path}: iteration {id} is damaged: its arrays do not match its digest")]
    Damaged {
        /// File.
        path: String,
        /// Key of the row.
        id: i64,
    },
    /// A stored value that the program cannot have written.
    #[error(
        "library {path}: {found}; restore the file from a copy, or delete this row of the table \
         iteration"
    )]
    Unreadable {
        /// File.
        path: String,
        /// Row and column.
        found: Unreadable,
    },
    /// Runs were deleted, but the file could not be made smaller.
    #[error(
        "library {path}: {n_deleted} runs were deleted, but the file could not be made smaller: \
         {source}; their space is used again"
    )]
    NotShrunk {
        /// File.
        path: String,
        /// Runs deleted.
        n_deleted: usize,
        /// Error of SQLite.
        source: rusqlite::Error,
    },
}

/// A value that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("iteration {id} is damaged: its {column} cannot be read")]
pub struct Unreadable {
    /// Key of the row.
    pub id: i64,
    /// Column of the value.
    pub column: String,
}

/// Converts an error of SQLite for a file.
pub(super) fn told(path: &str, source: rusqlite::Error) -> LibraryError {
    let path = path.to_owned();
    if let rusqlite::Error::FromSqlConversionFailure(_, _, cause) = &source
        && let Some(found) = cause.downcast_ref::<Unreadable>()
    {
        return LibraryError::Unreadable { path, found: found.clone() };
    }
    match source.sqlite_error_code() {
        Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => LibraryError::Locked { path },
        _ => LibraryError::Sqlite { path, source },
    }
}
