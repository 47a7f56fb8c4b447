//! Appending and reading iterations.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::types::Value;
use rusqlite::{CachedStatement, Connection, OptionalExtension, params_from_iter};

use super::error::{LibraryError, told};
use super::figures;
use super::file::{self, BUSY_TIMEOUT, Found};
use super::reader::{self, AtRest, LOOKS_MAX, Reader};
use super::row::{Row, is_old, read_row, refresh};
use super::schema;
use super::upgrade;
use crate::record::Figures;

/// Time-out after a failed attempt.
const HURRIED: Duration = Duration::from_millis(200);

/// An open iteration library.
#[derive(Debug)]
pub struct Library {
    pub(super) connection: Connection,
    pub(super) path: String,
    /// Path and identity of the file that runs are written to.
    file: Option<(PathBuf, (u64, u64))>,
    /// The file as it was found, if it is read without a lock.
    at_rest: Option<AtRest>,
    /// Schema version of the file; below the newest only if read-only.
    pub(super) version: i64,
    /// Starts of the queries for runs without and with their arrays.
    queries: OnceCell<[String; 2]>,
}

impl Library {
    /// Opens a library for reading and writing, creating file and tables if they are missing.
    ///
    /// # Errors
    /// [`LibraryError::Foreign`] for a file that is not a library of this program, which is left
    /// unchanged; [`LibraryError::Version`] if it has a later version; [`LibraryError::Open`],
    /// [`LibraryError::ReadOnly`] or [`LibraryError::Locked`] if it cannot be written.
    pub fn open(path: &Path) -> Result<Self, LibraryError> {
        if path.as_os_str() == file::IN_MEMORY {
            return Self::in_memory();
        }
        let found = reader::inspect(path)?;
        let connection = file::writer(path)?;
        let name = path.display().to_string();
        let fail = |source: rusqlite::Error| match told(&name, source) {
            LibraryError::Sqlite { path, source } => LibraryError::Open { path, source },
            error => error,
        };
        connection.busy_timeout(BUSY_TIMEOUT).map_err(fail)?;
        if matches!(found, Found::Nothing | Found::Empty) {
            schema::prepare(&connection).map_err(fail)?;
        }
        connection.pragma_update(None, "journal_mode", "WAL").map_err(fail)?;
        // FULL: an appended run survives not only a kill but a power cut.
        connection.pragma_update(None, "synchronous", "FULL").map_err(fail)?;
        // Checked again, as an interrupted operation of a killed process is undone when the file is
        // opened.
        let is_newest = file::found(&connection, path)? == Found::Library(schema::VERSION);
        if is_newest && schema::missing(&connection, "iteration").map_err(fail)?.is_empty() {
            // A program that cannot write must fail now, not when the first run is stored.
            connection.execute_batch("BEGIN IMMEDIATE; ROLLBACK").map_err(fail)?;
        } else {
            upgrade::bring_up_to_date(&connection).map_err(fail)?;
        }
        Ok(Self {
            connection,
            path: name,
            file: file::identity(path).map(|identity| (path.to_owned(), identity)),
            at_rest: None,
            version: schema::VERSION,
            queries: OnceCell::new(),
        })
    }

    /// Opens a library read-only; nothing is created or changed, also beside the file.
    ///
    /// # Errors
    /// [`LibraryError::Missing`]; [`LibraryError::Empty`]; [`LibraryError::Foreign`] for a file
    /// that is not a library; [`LibraryError::Version`] if it has a later version;
    /// [`LibraryError::Open`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Self, LibraryError> {
        let Reader { connection, version, at_rest } = reader::reader(path)?;
        let (path, queries) = (path.display().to_string(), OnceCell::new());
        Ok(Self { connection, path, file: None, at_rest, version, queries })
    }

    /// Reads from a library that others may write to.
    ///
    /// A file without a log is read without a lock, so the work is done again if a writer has come
    /// meanwhile: what it had read may be old, or torn.
    ///
    /// # Errors
    /// As [`Library::read`], and those of the work.
    pub fn read_with<T>(
        path: &Path,
        work: impl FnMut(&Self) -> Result<T, LibraryError>,
    ) -> Result<T, LibraryError> {
        Self::read_and_keep(path, work).map(|(answer, _)| answer)
    }

    /// The same; also returns the library if it can be read from again as long as it [rests](Self::rests).
    pub(super) fn read_and_keep<T>(
        path: &Path,
        mut work: impl FnMut(&Self) -> Result<T, LibraryError>,
    ) -> Result<(T, Option<Self>), LibraryError> {
        let mut n_looks = 0;
        loop {
            n_looks += 1;
            let library = Self::read(path)?;
            let answer = work(&library);
            let Some(at_rest) = &library.at_rest else { return Ok((answer?, None)) };
            let (lasts, is_settled) = (at_rest.lasts(), at_rest.is_settled());
            if lasts || n_looks == LOOKS_MAX {
                return Ok((answer?, Some(library).filter(|_| lasts && is_settled)));
            }
        }
    }

    /// True if the file was read without a lock, and no writer has been there since.
    pub(super) fn rests(&self) -> bool {
        self.at_rest.as_ref().is_some_and(AtRest::lasts)
    }

    /// Opens a library in memory, deleted when dropped.
    ///
    /// # Errors
    /// [`LibraryError::Open`] if SQLite refuses.
    pub fn in_memory() -> Result<Self, LibraryError> {
        let path = file::IN_MEMORY.to_owned();
        let fail = |source| LibraryError::Open { path: path.clone(), source };
        let connection = Connection::open_in_memory().map_err(fail)?;
        upgrade::bring_up_to_date(&connection).map_err(fail)?;
        let (version, queries) = (schema::VERSION, OnceCell::new());
        Ok(Self { connection, path, file: None, at_rest: None, version, queries })
    }

    /// Ensures that the file written to is still the one at the path.
    pub(super) fn require_file(&self) -> Result<(), LibraryError> {
        let Some((path, identity)) = &self.file else { return Ok(()) };
        let is_there =
            file::identity(path) == Some(*identity) && file::beside(path, "-wal").exists();
        if is_there { Ok(()) } else { Err(LibraryError::Gone { path: self.path.clone() }) }
    }

    /// Replaces the figures of a stored run after a later decision of the law.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be written.
    pub fn judge(&self, id: i64, figures: &Figures) -> Result<(), LibraryError> {
        let (names, mut values): (Vec<_>, Vec<_>) = figures::values(figures).into_iter().unzip();
        values.push(Value::Integer(id));
        let statement = format!("UPDATE iteration SET {} = ? WHERE id = ?", names.join(" = ?, "));
        let values = params_from_iter(values);
        self.connection.execute(&statement, values).map(drop).map_err(|source| self.fail(source))
    }

    /// Reads one run with its arrays, and checks them against their digest.
    ///
    /// # Errors
    /// [`LibraryError::NoSuchRow`]; [`LibraryError::Damaged`] if the digest does not match.
    pub fn load(&self, id: i64) -> Result<Row, LibraryError> {
        let row = self.load_unchecked(id)?;
        if row.record.digest() != row.digest {
            return Err(LibraryError::Damaged { path: self.path.clone(), id });
        }
        Ok(row)
    }

    /// Reads one run with its arrays, unchecked.
    ///
    /// # Errors
    /// [`LibraryError::NoSuchRow`]; [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn load_unchecked(&self, id: i64) -> Result<Row, LibraryError> {
        let mut row = self.row(id, true)?;
        if is_old(&row) {
            refresh(&mut row);
        }
        Ok(row)
    }

    /// Reads one run without its arrays.
    pub(super) fn figures(&self, id: i64) -> Result<Row, LibraryError> {
        let mut row = self.row(id, false)?;
        if is_old(&row) {
            row.record.figures = self.load_unchecked(id)?.record.figures;
        }
        Ok(row)
    }

    /// Reads one run as it is stored.
    fn row(&self, id: i64, with_arrays: bool) -> Result<Row, LibraryError> {
        self.select(with_arrays, "WHERE iteration.id = ?1")?
            .query_row([id], |row| read_row(row, with_arrays))
            .optional()
            .map_err(|source| self.fail(source))?
            .ok_or_else(|| LibraryError::NoSuchRow { path: self.path.clone(), id })
    }

    /// Prepares a query for runs, as [`read_row`] reads them.
    pub(super) fn select(
        &self,
        with_arrays: bool,
        condition: &str,
    ) -> Result<CachedStatement<'_>, LibraryError> {
        let start =
            |with_arrays| schema::query(&self.connection, self.version, "iteration", with_arrays);
        let prepare = || {
            let queries = if let Some(queries) = self.queries.get() {
                queries
            } else {
                let queries = [start(false)?, start(true)?];
                self.queries.get_or_init(|| queries)
            };
            let start = &queries[usize::from(with_arrays)];
            self.connection.prepare_cached(&format!("{start} {condition}"))
        };
        prepare().map_err(|source| self.fail(source))
    }

    /// Returns the number of the next run of a campaign.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn next_index(&self, campaign: &str) -> Result<u32, LibraryError> {
        self.connection
            .query_row(
                "SELECT coalesce(max(iteration) + 1, 0) FROM iteration WHERE campaign = ?1",
                [campaign],
                |row| row.get(0),
            )
            .map_err(|source| self.fail(source))
    }

    /// Returns the name of the newest campaign with this fingerprint, if there is one.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn newest_campaign(&self, fingerprint: &str) -> Result<Option<String>, LibraryError> {
        self.connection
            .query_row(
                "SELECT campaign FROM iteration WHERE fingerprint = ?1 ORDER BY id DESC LIMIT 1",
                [fingerprint],
                |row| row.get(0),
            )
            .optional()
            .map_err(|source| self.fail(source))
    }

    /// Returns a name for a new campaign: the time in UTC and four random digits.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn new_campaign(&self) -> Result<String, LibraryError> {
        self.connection
            .query_row(
                "SELECT strftime('%Y%m%d-%H%M%S', 'now') || '-' || lower(hex(randomblob(2)))",
                [],
                |row| row.get(0),
            )
            .map_err(|source| self.fail(source))
    }

    /// Shortens the timeout for other processes from now on.
    pub fn hurry(&self) {
        // If it cannot be set, the longer timeout remains, which is not wrong.
        let _ = self.connection.busy_timeout(HURRIED);
    }

    pub(super) fn fail(&self, source: rusqlite::Error) -> LibraryError {
        told(&self.path, source)
    }
}
