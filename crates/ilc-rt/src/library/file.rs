//! The file of a library: its identity before anything is written, and its continued existence.
//!
//! A data file of another program must never be changed, not even by switching its journal on. So
//! the file is examined through a read-only connection, and opened for writing only if it has the
//! mark and the table of this program.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use super::error::LibraryError;
use super::schema::{self, ARRAYS, COLUMNS};
use crate::record::figure_fields;

/// Time-out for another writing process: a run that cannot be stored has to stop the axes.
pub(super) const BUSY_TIMEOUT: Duration = Duration::from_millis(1500);

/// The name of a library in memory.
pub(crate) const IN_MEMORY: &str = ":memory:";

/// Target of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// No file, or one of 0 bytes.
    Nothing,
    /// A database without contents, e.g. after an interrupted creation.
    Empty,
    /// A library of this version.
    Library(i64),
}

/// Opens a file for writing, creating it if it is missing. To be called after it was inspected.
///
/// # Errors
/// [`LibraryError::Open`] or [`LibraryError::ReadOnly`].
pub(super) fn writer(path: &Path) -> Result<Connection, LibraryError> {
    let name = path.display().to_string();
    let fail = |source| LibraryError::Open { path: name.clone(), source };
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE
        | OpenFlags::SQLITE_OPEN_CREATE
        | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(plain(path), flags).map_err(fail)?;
    // SQLite silently opens an unwritable file for reading.
    if connection.is_readonly("main").map_err(fail)? {
        return Err(LibraryError::ReadOnly { path: name, found: "the file is read-only" });
    }
    Ok(connection)
}

/// Identity of the file behind a path: device and number; `None` if there is no file.
pub(super) fn identity(path: &Path) -> Option<(u64, u64)> {
    std::fs::metadata(path).ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

/// Returns the path of the file beside a library that ends in `ending`.
pub(super) fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// Target of a path, if it is a regular file. The path is only examined, since opening a pipe would
/// block.
pub(super) fn metadata(path: &Path) -> Result<Option<Metadata>, LibraryError> {
    let name = || path.display().to_string();
    let foreign = |found: &str| LibraryError::Foreign { path: name(), found: found.to_owned() };
    if path.as_os_str().is_empty() {
        return Err(foreign("an empty name"));
    }
    match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => Ok(Some(metadata)),
        Ok(metadata) if metadata.is_dir() => Err(foreign("a folder")),
        Ok(_) => Err(foreign("no regular file")),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(foreign(&format!("cannot be read ({error})"))),
    }
}

/// Identifies a library by its application id, its version and the columns of its table.
pub(super) fn found(connection: &Connection, path: &Path) -> Result<Found, LibraryError> {
    let name = path.display().to_string();
    let fail = |source| LibraryError::Open { path: name.clone(), source };
    let pragma = |pragma| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let mark = pragma("application_id").map_err(fail)?;
    let version = pragma("user_version").map_err(fail)?;
    let n_objects: i64 = connection
        .query_row("SELECT count(*) FROM sqlite_master", [], |row| row.get(0))
        .map_err(fail)?;
    if mark == 0 && version == 0 && n_objects == 0 {
        return Ok(Found::Empty);
    }
    // Older libraries had no mark; their table distinguishes them from other databases.
    let may_be_ours = mark == schema::MARK
        || mark == 0 && (n_objects == 0 || has_columns(connection, version).map_err(fail)?);
    if may_be_ours && version > schema::VERSION {
        return Err(LibraryError::Version {
            path: name,
            found: version,
            expected: schema::VERSION,
        });
    }
    let is_ours = may_be_ours
        && (schema::OLDEST..=schema::VERSION).contains(&version)
        && has_columns(connection, version).map_err(fail)?;
    if is_ours {
        return Ok(Found::Library(version));
    }
    Err(LibraryError::Foreign { path: name, found: "the database of another program".to_owned() })
}

fn has_columns(connection: &Connection, version: i64) -> rusqlite::Result<bool> {
    let mut statement = connection.prepare("SELECT name FROM pragma_table_info('iteration')")?;
    let names: Vec<String> =
        statement.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?;
    let figures = figure_fields().iter().filter(|field| field.is_required);
    let arrays = ARRAYS.into_iter().filter(|_| version < schema::PARTED);
    let mut wanted = COLUMNS
        .map(|(name, _)| name)
        .into_iter()
        .chain(arrays)
        .chain(figures.map(|field| field.name.as_str()));
    Ok(wanted.all(|column| names.iter().any(|name| name == column)))
}

/// Returns a path that SQLite takes literally: an absolute one is never parsed as a URI.
pub(super) fn plain(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::super::Library;
    use super::super::tests::{Folder, meta, record};
    use super::*;

    #[test]
    fn a_foreign_database_is_neither_opened_nor_changed() {
        let folder = Folder::new("foreign");
        for (number, sql) in [
            "CREATE TABLE customers (id)",
            "CREATE TABLE customers (id); PRAGMA user_version = 2",
            "CREATE TABLE iteration (id); PRAGMA user_version = 3",
            "CREATE TABLE iteration (id); PRAGMA application_id = 7",
        ]
        .into_iter()
        .enumerate()
        {
            let path = folder.0.join(format!("{number}.db"));
            let connection = Connection::open(&path).unwrap();
            connection.execute_batch(sql).unwrap();
            drop(connection);
            let before = std::fs::read(&path).unwrap();
            for refused in [Library::open(&path), Library::read(&path)] {
                assert!(matches!(refused, Err(LibraryError::Foreign { .. })), "{sql}: {refused:?}");
            }
            assert_eq!(std::fs::read(&path).unwrap(), before);
        }
        assert_eq!(folder.names(), ["0.db", "1.db", "2.db", "3.db"], "nothing is beside them");
    }

    #[test]
    fn what_a_killed_process_had_begun_to_make_is_made_whole() {
        let folder = Folder::new("begun");
        let path = folder.0.join("begun.db");
        let connection = Connection::open(&path).unwrap();
        connection.pragma_update(None, "journal_mode", "WAL").unwrap();
        drop(connection);
        assert!(matches!(Library::read(&path), Err(LibraryError::Empty { .. })));
        Library::open(&path).unwrap().append(&meta("a"), &record(0)).unwrap();
        assert_eq!(Library::read(&path).unwrap().list(None).unwrap().len(), 1);
    }

    #[test]
    fn a_run_is_not_kept_in_a_file_that_is_gone() {
        let folder = Folder::new("gone");
        let path = folder.0.join("gone.db");
        let library = Library::open(&path).unwrap();
        library.append(&meta("a"), &record(0)).unwrap();
        std::fs::remove_file(&path).unwrap();
        let refused = library.append(&meta("a"), &record(1));
        assert!(matches!(refused, Err(LibraryError::Gone { .. })));
    }

    #[test]
    fn another_writer_is_named_and_a_run_kept_twice_too() {
        let folder = Folder::new("busy");
        let path = folder.0.join("busy.db");
        let library = Library::open(&path).unwrap();
        library.append(&meta("a"), &record(0)).unwrap();
        let twice = library.append(&meta("a"), &record(0));
        assert!(matches!(twice, Err(LibraryError::Taken { index: 0, .. })));
        let other = Connection::open(&path).unwrap();
        other.execute_batch("BEGIN IMMEDIATE").unwrap();
        library.hurry();
        let refused = library.append(&meta("a"), &record(1));
        assert!(matches!(refused, Err(LibraryError::Locked { .. })), "{refused:?}");
        drop(other);
        library.append(&meta("a"), &record(1)).unwrap();
    }
}
