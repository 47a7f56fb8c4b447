//! The file of a library: its identity before anything is written, and its continued existence.
//!
//! A data file of another program must never be changed, not even by switching its journal on. So
//! the file is examined through a read-only connection, and opened for writing only if it has the
//! mark and the table of this program.

use std::fmt::Write as _;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, OpenFlags};

use super::error::{LibraryError, told};
use super::schema::{self, ARRAYS, COLUMNS};
use crate::record::figure_fields;

/// Time-out for another writing process: a run that cannot be stored has to stop the axes.
pub(super) const BUSY_TIMEOUT: Duration = Duration::from_millis(1500);

/// Looks at a damaged file, each of which a writer may have spoiled by its end.
const LOOKS_MAX: u32 = 5;

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

/// Inspects a path without changing anything.
///
/// # Errors
/// [`LibraryError::Foreign`] for a file that is not a library; [`LibraryError::Version`] for one of
/// a later version; [`LibraryError::Open`] if it cannot be read.
pub(super) fn inspect(path: &Path) -> Result<Found, LibraryError> {
    let Some(metadata) = metadata(path)? else { return Ok(Found::Nothing) };
    if metadata.len() == 0 {
        return Ok(Found::Nothing);
    }
    look(path).map(|(_, found)| found)
}

/// Opens a library read-only; leaves no trace beside it.
///
/// # Errors
/// [`LibraryError::Missing`], or as [`inspect`].
pub(super) fn reader(path: &Path) -> Result<(Connection, i64), LibraryError> {
    let name = || path.display().to_string();
    match metadata(path)? {
        None => return Err(LibraryError::Missing { path: name() }),
        Some(metadata) if metadata.len() == 0 => {
            return Err(LibraryError::Empty { path: name() });
        }
        Some(_) => {}
    }
    match look(path)? {
        (connection, Found::Library(version)) => Ok((connection, version)),
        (_, Found::Nothing | Found::Empty) => Err(LibraryError::Empty { path: name() }),
    }
}

/// Opens a file for writing, creating it if it is missing. To be called after [`inspect`].
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
fn metadata(path: &Path) -> Result<Option<Metadata>, LibraryError> {
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

/// Connects read-only and examines the file. If no writer has left a log, no side files are created
/// or needed, so that an archive without write permission can be read; for a file of another
/// program not even the log is opened.
///
/// A writer that ends moves its log into the file; what is read of it meanwhile may not fit together, so a
/// damaged file is looked at again: by then the log is there, or the file is whole.
fn look(path: &Path) -> Result<(Connection, Found), LibraryError> {
    let mut n_looks = 0;
    loop {
        n_looks += 1;
        let at_rest = connect(path, true).and_then(|connection| tell(connection, path));
        let log = std::fs::metadata(beside(path, "-wal"));
        let is_foreign =
            matches!(at_rest, Err(LibraryError::Foreign { .. } | LibraryError::Version { .. }));
        if !is_foreign && log.is_ok_and(|log| log.len() > 0) {
            return tell(connect(path, false)?, path);
        }
        if !is_damaged(&at_rest) || n_looks == LOOKS_MAX {
            return at_rest;
        }
    }
}

fn is_damaged<T>(found: &Result<T, LibraryError>) -> bool {
    let Err(LibraryError::Open { source, .. }) = found else { return false };
    source.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt)
}

fn connect(path: &Path, at_rest: bool) -> Result<Connection, LibraryError> {
    let name = path.display().to_string();
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let fail = |source: rusqlite::Error| match source.sqlite_error_code() {
        Some(ErrorCode::NotADatabase) => {
            LibraryError::Foreign { path: name.clone(), found: "not a database".to_owned() }
        }
        Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => told(&name, source),
        Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly) if !at_rest => LibraryError::ReadOnly {
            path: name.clone(),
            found: "its last runs are in the log beside it (-wal), which can be read in a folder only \
                    that can be written: copy both files to one",
        },
        _ => LibraryError::Open { path: name.clone(), source },
    };
    let connection = if at_rest {
        Connection::open_with_flags(immutable(path), flags | OpenFlags::SQLITE_OPEN_URI)
    } else {
        Connection::open_with_flags(plain(path), flags)
    };
    let connection = connection.map_err(fail)?;
    connection.busy_timeout(BUSY_TIMEOUT).map_err(fail)?;
    // The first access to the file: until now nothing was read.
    connection.query_row("SELECT count(*) FROM sqlite_master", [], |_| Ok(())).map_err(fail)?;
    Ok(connection)
}

fn tell(connection: Connection, path: &Path) -> Result<(Connection, Found), LibraryError> {
    let found = found(&connection, path)?;
    Ok((connection, found))
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
fn plain(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// The address of a file that no program changes while it is read.
fn immutable(path: &Path) -> String {
    let path = plain(path);
    let mut address = "file://".to_owned();
    for byte in path.as_os_str().as_encoded_bytes() {
        match byte {
            b'/' | b'.' | b'-' | b'_' | b'0'..=b'9' | b'A'..=b'Z' | b'a'..=b'z' => {
                address.push(char::from(*byte));
            }
            byte => {
                let _ = write!(address, "%{byte:02X}");
            }
        }
    }
    address.push_str("?immutable=1");
    address
}

#[cfg(test)]
mod tests {
    use super::super::Library;
    use super::super::tests::{meta, record};
    use super::*;

    /// A temporary folder, deleted when dropped.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("ilc-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn names(&self) -> Vec<String> {
            let entries = std::fs::read_dir(&self.0).unwrap();
            let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name();
            let mut names: Vec<String> =
                entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect();
            names.sort();
            names
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

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
    fn readers_see_what_a_writer_has_kept_and_leave_nothing_behind() {
        let folder = Folder::new("readers");
        let path = folder.0.join("a #1?.db");
        assert!(matches!(Library::read(&path), Err(LibraryError::Missing { .. })));
        let library = Library::open(&path).unwrap();
        library.append(&meta("a"), &record(0)).unwrap();
        assert_eq!(Library::read(&path).unwrap().list(None).unwrap().len(), 1, "in the log");
        drop(library);
        assert_eq!(Library::read(&path).unwrap().list(None).unwrap().len(), 1);
        assert!(Library::read(&path).unwrap().append(&meta("a"), &record(1)).is_err());
        assert_eq!(folder.names(), ["a #1?.db"]);
    }

    /// A writer that ends moves its log into the file at any moment of a reader's first look.
    #[test]
    fn readers_meet_writers_that_end() {
        let folder = Folder::new("ends");
        let path = folder.0.join("ends.db");
        drop(Library::open(&path).unwrap());
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for number in 0..150 {
                    let library = Library::open(&path).unwrap();
                    library.append(&meta(&number.to_string()), &record(0)).unwrap();
                }
            });
            while !writer.is_finished() {
                Library::read(&path).unwrap();
            }
        });
        assert_eq!(Library::read(&path).unwrap().list(None).unwrap().len(), 150);
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
