//! Connections for reading a library, which create and change nothing, also beside the file.
//!
//! A file at rest is read without a lock, and therefore examined afterwards: a writer that came
//! meanwhile may have spoiled what was read.

use std::fmt::Write as _;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, OpenFlags};

use super::error::{LibraryError, told};
use super::file::{BUSY_TIMEOUT, Found, beside, found, metadata, plain};

/// Looks at a file, each of which a writer may have spoiled.
pub(super) const LOOKS_MAX: u32 = 5;

/// Age of a file whose next change certainly has another time: some file systems count in steps of
/// two seconds.
const SETTLED: Duration = Duration::from_secs(3);

/// State of a file that is read without a lock, as no writer has left a log.
#[derive(Debug)]
pub(super) struct AtRest {
    path: PathBuf,
    identity: (u64, u64),
    size_and_time: (u64, i64, i64),
    is_settled: bool,
}

impl AtRest {
    fn of(path: &Path, metadata: &Metadata) -> Self {
        let identity = (metadata.dev(), metadata.ino());
        let size_and_time = (metadata.len(), metadata.mtime(), metadata.mtime_nsec());
        let age = metadata.modified().map(|time| time.elapsed().unwrap_or_default());
        let is_settled = age.is_ok_and(|age| age > SETTLED);
        Self { path: path.to_owned(), identity, size_and_time, is_settled }
    }

    /// True if any later change gives the file another time, so that it is noticed.
    pub(super) fn is_settled(&self) -> bool {
        self.is_settled
    }

    /// No writer has been there since.
    pub(super) fn lasts(&self) -> bool {
        !has_log(&self.path)
            && std::fs::metadata(&self.path).is_ok_and(|metadata| {
                let now = Self::of(&self.path, &metadata);
                (now.identity, now.size_and_time) == (self.identity, self.size_and_time)
            })
    }
}

/// A connection for reading.
#[derive(Debug)]
pub(super) struct Reader {
    pub(super) connection: Connection,
    pub(super) version: i64,
    /// The file as it was found, if it is read without a lock.
    pub(super) at_rest: Option<AtRest>,
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
    look(path).map(|look| look.found)
}

/// Opens a library read-only; leaves no trace beside it.
///
/// # Errors
/// [`LibraryError::Missing`], or as [`inspect`].
pub(super) fn reader(path: &Path) -> Result<Reader, LibraryError> {
    let name = || path.display().to_string();
    let Some(metadata) = metadata(path)? else {
        return Err(LibraryError::Missing { path: name() });
    };
    if metadata.len() == 0 {
        return Err(LibraryError::Empty { path: name() });
    }
    match look(path)? {
        Look { connection, found: Found::Library(version), is_at_rest } => {
            let at_rest = is_at_rest.then(|| AtRest::of(path, &metadata));
            Ok(Reader { connection, version, at_rest })
        }
        _ => Err(LibraryError::Empty { path: name() }),
    }
}

/// A connection and the contents of its file.
pub(super) struct Look {
    connection: Connection,
    pub(super) found: Found,
    is_at_rest: bool,
}

/// Connects read-only and examines the file. If no writer has left a log, no side files are created
/// or needed, so that an archive without write permission can be read; for a file of another
/// program not even the log is opened.
///
/// A writer that ends moves its log into the file; what is read of it meanwhile may not fit together, so a
/// damaged file is looked at again: by then the log is there, or the file is whole.
pub(super) fn look(path: &Path) -> Result<Look, LibraryError> {
    let mut n_looks = 0;
    loop {
        n_looks += 1;
        let at_rest = examine(path, true);
        let is_foreign =
            matches!(at_rest, Err(LibraryError::Foreign { .. } | LibraryError::Version { .. }));
        if !is_foreign && has_log(path) {
            return examine(path, false);
        }
        if !is_damaged(&at_rest) || n_looks == LOOKS_MAX {
            return at_rest;
        }
    }
}

fn has_log(path: &Path) -> bool {
    std::fs::metadata(beside(path, "-wal")).is_ok_and(|log| log.len() > 0)
}

fn examine(path: &Path, is_at_rest: bool) -> Result<Look, LibraryError> {
    let connection = connect(path, is_at_rest)?;
    let found = found(&connection, path)?;
    Ok(Look { connection, found, is_at_rest })
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
    use super::super::tests::{Folder, meta, record};
    use super::*;

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

    /// Runs are read while a writer begins, stores one and ends: nothing old, nothing torn.
    #[test]
    fn readers_meet_writers_that_begin() {
        let folder = Folder::new("begins");
        let path = folder.0.join("begins.db");
        drop(Library::open(&path).unwrap());
        let write = |number: usize| {
            let library = Library::open(&path).unwrap();
            library.append(&meta(&number.to_string()), &record(0)).unwrap();
        };
        let mut n_readings = 0;
        let seen = Library::read_with(&path, |library| {
            n_readings += 1;
            if n_readings == 1 {
                write(0);
            }
            library.list(None)
        });
        assert_eq!((seen.unwrap().len(), n_readings), (1, 2));
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| (1..100).for_each(write));
            let mut n_seen = 1;
            while !writer.is_finished() {
                let rows = Library::read_with(&path, |library| {
                    let rows = library.list(None)?;
                    rows.iter().map(|row| library.load(row.id)).collect::<Result<Vec<_>, _>>()
                });
                let n_rows = rows.unwrap().len();
                assert!(n_rows >= n_seen, "{n_rows} after {n_seen}");
                n_seen = n_rows;
            }
        });
    }
}
