//! Appending and reading iterations.

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, params_from_iter};

use super::error::{LibraryError, told};
use super::figures;
use super::file::{self, BUSY_TIMEOUT, Found};
use super::row::{
    ARRAYS, Row, as_integer, blob, is_old, json_list, json_numbers, read_row, refresh,
};
use super::schema;
use crate::record::{Figures, IterationRecord, Meta};

/// Time-out after a failed attempt.
const HURRIED: Duration = Duration::from_millis(200);
/// SQLite's extended code for a row that already exists.
const UNIQUE: i32 = rusqlite::ffi::SQLITE_CONSTRAINT_UNIQUE;

/// An open iteration library.
#[derive(Debug)]
pub struct Library {
    pub(super) connection: Connection,
    pub(super) path: String,
    /// Path and identity of the file that runs are written to.
    file: Option<(PathBuf, (u64, u64))>,
    /// Schema version of the file; below the newest only if read-only.
    pub(super) version: i64,
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
        let found = file::inspect(path)?;
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
        if is_newest && schema::missing(&connection).map_err(fail)?.is_empty() {
            // A program that cannot write must fail now, not when the first run is stored.
            connection.execute_batch("BEGIN IMMEDIATE; ROLLBACK").map_err(fail)?;
        } else {
            schema::bring_up_to_date(&connection).map_err(fail)?;
        }
        Ok(Self {
            connection,
            path: name,
            file: file::identity(path).map(|identity| (path.to_owned(), identity)),
            version: schema::VERSION,
        })
    }

    /// Opens a library read-only; nothing is created or changed, also beside the file.
    ///
    /// # Errors
    /// [`LibraryError::Missing`]; [`LibraryError::Empty`]; [`LibraryError::Foreign`] for a file
    /// that is not a library; [`LibraryError::Version`] if it has a later version;
    /// [`LibraryError::Open`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Self, LibraryError> {
        let (connection, version) = file::reader(path)?;
        Ok(Self { connection, path: path.display().to_string(), file: None, version })
    }

    /// Opens a library in memory, deleted when dropped.
    ///
    /// # Errors
    /// [`LibraryError::Open`] if SQLite refuses.
    pub fn in_memory() -> Result<Self, LibraryError> {
        let path = file::IN_MEMORY.to_owned();
        let fail = |source| LibraryError::Open { path: path.clone(), source };
        let connection = Connection::open_in_memory().map_err(fail)?;
        schema::bring_up_to_date(&connection).map_err(fail)?;
        Ok(Self { connection, path, file: None, version: schema::VERSION })
    }

    /// Stores one run and returns its key.
    ///
    /// # Errors
    /// [`LibraryError::Taken`] if the campaign already has a run of this number;
    /// [`LibraryError::Gone`] if the file does not exist any more; [`LibraryError::Locked`] or
    /// [`LibraryError::Sqlite`] if it cannot be written.
    pub fn append(&self, meta: &Meta, record: &IterationRecord) -> Result<i64, LibraryError> {
        let n_samples = record.reference_m.len() / meta.n_axes.max(1);
        let text = |text: &String| Value::Text(text.clone());
        let tool = Some(&record.tool_m).filter(|tool_m| !tool_m.is_empty());
        let disturbance = Some(&record.disturbance).filter(|measured| !measured.is_empty());
        let mut run = vec![
            ("cell", text(&meta.cell)),
            ("campaign", text(&meta.campaign)),
            ("fingerprint", text(&meta.fingerprint)),
            ("iteration", Value::Integer(record.index.into())),
            ("program", text(&meta.program)),
            ("law", text(&meta.law)),
            ("law_parameters", text(&meta.law_parameters)),
            ("measure", text(&meta.measure)),
            ("cycle_s", Value::Real(meta.cycle_s)),
            ("n_axes", Value::Integer(as_integer(meta.n_axes))),
            ("axis_names", Value::Text(json_list(&meta.axis_names))),
            ("input_units", Value::Text(json_list(&meta.input_units))),
            ("n_samples", Value::Integer(as_integer(n_samples))),
            ("disturbance", disturbance.map(|measured| json_numbers(measured)).into()),
            ("digest", Value::Text(record.digest())),
            ("reference_m", Value::Blob(blob(&record.reference_m))),
            ("input", Value::Blob(blob(&record.input))),
            ("encoder_m", Value::Blob(blob(&record.encoder_m))),
            ("tool_m", tool.map(|tool_m| blob(tool_m)).into()),
            ("error_m", Value::Blob(blob(&record.error_m))),
            ("contour_m", Value::Blob(blob(&record.contour_m))),
        ];
        run.extend(figures::values(&record.figures));
        let (names, values): (Vec<_>, Vec<_>) = run.into_iter().unzip();
        let places = vec!["?"; names.len()].join(", ");
        let statement = format!("INSERT INTO iteration ({}) VALUES ({places})", names.join(", "));
        let id = self
            .connection
            .prepare_cached(&statement)
            .and_then(|mut insert| insert.insert(params_from_iter(values)))
            .map_err(|source| match source.sqlite_error() {
                Some(error) if error.extended_code == UNIQUE => LibraryError::Taken {
                    path: self.path.clone(),
                    campaign: meta.campaign.clone(),
                    index: record.index,
                },
                _ => self.fail(source),
            })?;
        self.require_file()?;
        Ok(id)
    }

    /// Ensures that the file written to is still the one at the path.
    fn require_file(&self) -> Result<(), LibraryError> {
        let Some((path, identity)) = &self.file else { return Ok(()) };
        let is_there =
            file::identity(path) == Some(*identity) && file::beside(path, "-wal").exists();
        if is_there { Ok(()) } else { Err(LibraryError::Gone { path: self.path.clone() }) }
    }

    /// Lists the stored runs, oldest first, without their arrays; optionally those of one campaign.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn list(&self, campaign: Option<&str>) -> Result<Vec<Row>, LibraryError> {
        let columns = self.columns()?;
        let query = format!(
            "SELECT {columns} FROM iteration WHERE ?1 IS NULL OR campaign = ?1 ORDER BY id"
        );
        let mut statement = self.connection.prepare(&query).map_err(|e| self.fail(e))?;
        let rows = statement.query_map([campaign], |row| read_row(row, false));
        let mut rows: Vec<Row> =
            rows.and_then(Iterator::collect).map_err(|source| self.fail(source))?;
        for row in rows.iter_mut().filter(|row| is_old(row)) {
            row.record.figures = self.figures(row.id)?.record.figures;
        }
        Ok(rows)
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
    fn load_unchecked(&self, id: i64) -> Result<Row, LibraryError> {
        let arrays = ARRAYS.map(|(name, _)| name).join(", ");
        let query = format!("SELECT {}, {arrays} FROM iteration WHERE id = ?1", self.columns()?);
        let mut row = self
            .connection
            .query_row(&query, [id], |row| read_row(row, true))
            .optional()
            .map_err(|source| self.fail(source))?
            .ok_or_else(|| LibraryError::NoSuchRow { path: self.path.clone(), id })?;
        if is_old(&row) {
            refresh(&mut row);
        }
        Ok(row)
    }

    /// Reads one run without its arrays.
    pub(super) fn figures(&self, id: i64) -> Result<Row, LibraryError> {
        let query = format!("SELECT {} FROM iteration WHERE id = ?1", self.columns()?);
        let mut row = self
            .connection
            .query_row(&query, [id], |row| read_row(row, false))
            .optional()
            .map_err(|source| self.fail(source))?
            .ok_or_else(|| LibraryError::NoSuchRow { path: self.path.clone(), id })?;
        if is_old(&row) {
            row.record.figures = self.load_unchecked(id)?.record.figures;
        }
        Ok(row)
    }

    fn columns(&self) -> Result<String, LibraryError> {
        schema::columns(&self.connection).map_err(|source| self.fail(source))
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
