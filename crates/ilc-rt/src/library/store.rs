//! Appending and reading iterations.

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, OptionalExtension, params};

use super::error::{LibraryError, told};
use super::file::{self, BUSY_TIMEOUT, Found};
use super::row::{
    ARRAYS, Row, as_integer, blob, is_old, json_list, json_numbers, read_row, refresh,
};
use super::schema;
use crate::record::{Figures, IterationRecord, Meta};

/// How long to wait for it when there was a wait in vain before.
const HURRIED: Duration = Duration::from_millis(200);
/// SQLite's extended code for a row that is there already.
const UNIQUE: i32 = rusqlite::ffi::SQLITE_CONSTRAINT_UNIQUE;

/// An open iteration library.
#[derive(Debug)]
pub struct Library {
    pub(super) connection: Connection,
    pub(super) path: String,
    /// Path and identity of the file that runs are written to.
    file: Option<(PathBuf, (u64, u64))>,
    /// Version of the schema in the file; below the newest only if it is read.
    pub(super) version: i64,
}

impl Library {
    /// Opens a library for reading and writing, creating file and tables if they are not there.
    ///
    /// # Errors
    /// [`LibraryError::Foreign`] for a file that is no library of this program, which is left as it is;
    /// [`LibraryError::Version`] if it has a later version; [`LibraryError::Open`],
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
        // Asked once more, as what a killed process had begun is undone when the file is opened.
        if file::found(&connection, path)? == Found::Library(schema::VERSION) {
            // Whoever cannot write must hear of it now, and not when the first run is to be kept.
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

    /// Opens a library for reading only; nothing is made or changed, also beside the file.
    ///
    /// # Errors
    /// [`LibraryError::Missing`]; [`LibraryError::Empty`]; [`LibraryError::Foreign`] for a file that is no library;
    /// [`LibraryError::Version`] if it has a later version; [`LibraryError::Open`] if it cannot be read.
    pub fn read(path: &Path) -> Result<Self, LibraryError> {
        let (connection, version) = file::reader(path)?;
        Ok(Self { connection, path: path.display().to_string(), file: None, version })
    }

    /// Opens a library in memory, which is gone when dropped.
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

    /// Keeps one run and returns its key.
    ///
    /// # Errors
    /// [`LibraryError::Taken`] if the campaign has a run of this number already;
    /// [`LibraryError::Gone`] if the file is not there any more; [`LibraryError::Locked`] or
    /// [`LibraryError::Sqlite`] if it cannot be written.
    pub fn append(&self, meta: &Meta, record: &IterationRecord) -> Result<i64, LibraryError> {
        let f = &record.figures;
        let n_samples = record.reference_m.len() / meta.n_axes.max(1);
        let statement = "INSERT INTO iteration (cell, campaign, fingerprint, iteration, program, \
            law, law_parameters, measure, cycle_s, n_axes, n_samples, reference_m, input, \
            encoder_m, tool_m, error_m, contour_m, digest, tracking_inf_m, tracking_rms_m, \
            contour_inf_m, contour_rms_m, encoder_tracking_inf_m, tool_tracking_inf_m, overruns, \
            missing_samples, late_updates, update_ms, rolled_back, axis_names, input_units, \
            disturbance, axes_tracking_inf_m, axes_tracking_rms_m, learning_off, remark) VALUES \
            (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, \
            ?20, ?21, ?22, ?23, ?24, ?25, ?26, ?27, ?28, ?29, ?30, ?31, ?32, ?33, ?34, ?35, ?36)";
        let tool = (!record.tool_m.is_empty()).then(|| blob(&record.tool_m));
        let id = self
            .connection
            .prepare_cached(statement)
            .and_then(|mut insert| {
                insert.insert(params![
                    meta.cell,
                    meta.campaign,
                    meta.fingerprint,
                    record.index,
                    meta.program,
                    meta.law,
                    meta.law_parameters,
                    meta.measure,
                    meta.cycle_s,
                    as_integer(meta.n_axes),
                    as_integer(n_samples),
                    blob(&record.reference_m),
                    blob(&record.input),
                    blob(&record.encoder_m),
                    tool,
                    blob(&record.error_m),
                    blob(&record.contour_m),
                    record.digest(),
                    f.tracking_inf_m,
                    f.tracking_rms_m,
                    f.contour_inf_m,
                    f.contour_rms_m,
                    f.encoder_tracking_inf_m,
                    f.tool_tracking_inf_m,
                    f.overruns,
                    f.missing_samples,
                    f.late_updates,
                    f.update_ms,
                    f.rolled_back,
                    json_list(&meta.axis_names),
                    json_list(&meta.input_units),
                    (!record.disturbance.is_empty()).then(|| json_numbers(&record.disturbance)),
                    json_numbers(&f.axes_tracking_inf_m),
                    json_numbers(&f.axes_tracking_rms_m),
                    f.learning_off,
                    f.remark,
                ])
            })
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

    /// Makes sure that what was written is where others will look for it.
    fn require_file(&self) -> Result<(), LibraryError> {
        let Some((path, identity)) = &self.file else { return Ok(()) };
        let is_there =
            file::identity(path) == Some(*identity) && file::beside(path, "-wal").exists();
        if is_there { Ok(()) } else { Err(LibraryError::Gone { path: self.path.clone() }) }
    }

    /// Lists the runs kept, oldest first, without their arrays; of one campaign if asked.
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

    /// Adds to a run that is kept what the law decided on it later.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be written.
    pub fn judge(&self, id: i64, figures: &Figures) -> Result<(), LibraryError> {
        let statement = "UPDATE iteration SET rolled_back = ?2, learning_off = ?3, remark = ?4 \
            WHERE id = ?1";
        let values = params![id, figures.rolled_back, figures.learning_off, figures.remark];
        self.connection.execute(statement, values).map(drop).map_err(|source| self.fail(source))
    }

    /// Reads one run with its arrays, and checks them against their digest.
    ///
    /// # Errors
    /// [`LibraryError::NoSuchRow`]; [`LibraryError::Damaged`] if the digest does not match.
    pub fn load(&self, id: i64) -> Result<Row, LibraryError> {
        let row = self.whole(id)?;
        if row.record.digest() != row.digest {
            return Err(LibraryError::Damaged { path: self.path.clone(), id });
        }
        Ok(row)
    }

    /// Reads one run with its arrays, as they are.
    fn whole(&self, id: i64) -> Result<Row, LibraryError> {
        let query = format!("SELECT {}, {ARRAYS} FROM iteration WHERE id = ?1", self.columns()?);
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
            row.record.figures = self.whole(id)?.record.figures;
        }
        Ok(row)
    }

    fn columns(&self) -> Result<String, LibraryError> {
        schema::columns(&self.connection).map_err(|source| self.fail(source))
    }

    /// Returns the number that the next run of a campaign gets.
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

    /// Waits for other programs no longer than an instant from now on.
    pub fn hurry(&self) {
        // What cannot be set leaves the longer wait, which is not wrong.
        let _ = self.connection.busy_timeout(HURRIED);
    }

    pub(super) fn fail(&self, source: rusqlite::Error) -> LibraryError {
        told(&self.path, source)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::PathBuf;

    use super::super::recall::Task;
    use super::*;

    pub(in crate::library) fn meta(campaign: &str) -> Meta {
        Meta {
            cell: "gantry".into(),
            campaign: campaign.into(),
            fingerprint: "f".into(),
            law: "norm_optimal".into(),
            law_parameters: "{}".into(),
            measure: "tcp".into(),
            program: "[]".into(),
            cycle_s: 0.002,
            n_axes: 2,
            axis_names: vec!["x".into(), "y".into()],
            input_units: vec!["m".into(), "m/s".into()],
        }
    }

    pub(in crate::library) fn record(index: u32) -> IterationRecord {
        IterationRecord {
            index,
            reference_m: vec![1.0, 2.0, 3.0, 4.0],
            input: vec![0.0, -0.0, f64::MIN_POSITIVE, 1e300],
            encoder_m: vec![0.1; 4],
            tool_m: vec![0.2; 4],
            error_m: vec![0.3; 4],
            contour_m: vec![0.4; 2],
            disturbance: vec![0.1 + 0.2, -1e300],
            figures: Figures {
                update_ms: 0.5,
                rolled_back: true,
                axes_tracking_inf_m: vec![0.3, 0.3],
                axes_tracking_rms_m: vec![0.3, 0.3],
                contour_inf_m: Some(0.4),
                learning_off: true,
                remark: Some("the error grew".into()),
                ..Default::default()
            },
        }
    }

    #[test]
    fn what_was_appended_is_read_back_bit_by_bit() {
        let library = Library::in_memory().unwrap();
        let id = library.append(&meta("a"), &record(0)).unwrap();
        let row = library.load(id).unwrap();
        assert_eq!(row.record, record(0));
        assert_eq!(row.meta, meta("a"));
        assert_eq!(row.n_samples, 2);
    }

    #[test]
    fn a_run_cannot_be_kept_twice() {
        let library = Library::in_memory().unwrap();
        library.append(&meta("a"), &record(0)).unwrap();
        assert!(library.append(&meta("a"), &record(0)).is_err());
        assert_eq!(library.list(Some("a")).unwrap().len(), 1);
        assert!(library.list(Some("b")).unwrap().is_empty());
    }

    #[test]
    fn a_flipped_bit_is_noticed() {
        let library = Library::in_memory().unwrap();
        let id = library.append(&meta("a"), &record(0)).unwrap();
        library.connection.execute("UPDATE iteration SET input = zeroblob(32)", []).unwrap();
        assert!(matches!(library.load(id), Err(LibraryError::Damaged { .. })));
    }

    #[test]
    fn the_newest_campaign_is_found_by_fingerprint() {
        let library = Library::in_memory().unwrap();
        library.append(&meta("a"), &record(0)).unwrap();
        library.append(&meta("b"), &record(0)).unwrap();
        assert_eq!(library.newest_campaign("f").unwrap().as_deref(), Some("b"));
        assert_eq!(library.newest_campaign("g").unwrap(), None);
    }

    /// Makes a file as the first two versions did, with one run.
    fn old_file(
        name: &str,
        version: i64,
        meta: &Meta,
        run: &IterationRecord,
        contour_m: f64,
    ) -> PathBuf {
        let path = std::env::temp_dir().join(format!("ilc-library-{name}-{}", std::process::id()));
        let library = Library::open(&path).unwrap();
        library.append(meta, run).unwrap();
        for name in ["axes_tracking_inf_m", "axes_tracking_rms_m", "learning_off", "remark"] {
            let statement = format!("ALTER TABLE iteration DROP COLUMN {name}");
            library.connection.execute_batch(&statement).unwrap();
        }
        // Older versions had a figure for every run.
        let statement = "UPDATE iteration SET contour_inf_m = ?1, contour_rms_m = ?1";
        library.connection.execute(statement, [contour_m]).unwrap();
        library
            .connection
            .execute_batch(
                "PRAGMA writable_schema = ON;
                 UPDATE sqlite_schema SET sql = replace(replace(sql,
                     'contour_inf_m           REAL,', 'contour_inf_m           REAL NOT NULL,'),
                     'contour_rms_m           REAL,', 'contour_rms_m           REAL NOT NULL,')
                     WHERE name = 'iteration';
                 PRAGMA writable_schema = RESET;",
            )
            .unwrap();
        if version == 1 {
            library.connection.execute_batch("DROP INDEX iteration_by_disturbance").unwrap();
        }
        library.connection.pragma_update(None, "user_version", version).unwrap();
        path
    }

    fn remove(path: &Path) {
        for ending in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(format!("{}{ending}", path.display()));
        }
    }

    #[test]
    fn a_file_of_the_first_version_is_brought_up_to_date() {
        let old = IterationRecord { disturbance: Vec::new(), ..record(0) };
        let path = old_file("v1", 1, &meta("a"), &old, 0.4);
        let library = Library::open(&path).unwrap();
        let loaded = library.load(1).unwrap().record;
        assert_eq!(loaded.digest(), old.digest());
        let figures = &loaded.figures;
        assert_eq!(figures.axes_tracking_inf_m, [0.3, 0.3]);
        assert_eq!(figures.contour_inf_m, Some(0.4));
        assert!(!figures.learning_off && figures.remark.is_none());
        let mut straight = record(1);
        (straight.figures.contour_inf_m, straight.contour_m) = (None, Vec::new());
        let id = library.append(&meta("a"), &straight).unwrap();
        let kept = library.load(id).unwrap();
        assert_eq!((kept.record, kept.n_samples), (straight, 2));
        assert_eq!(library.recall(&[0.3, 0.0], 5, &Task::default()).unwrap().len(), 1);
        drop(library);
        let connection = Connection::open(&path).unwrap();
        let version: i64 =
            connection.pragma_query_value(None, "user_version", |row| row.get(0)).unwrap();
        assert_eq!(version, schema::VERSION);
        let sound: String =
            connection.pragma_query_value(None, "integrity_check", |row| row.get(0)).unwrap();
        assert_eq!(sound, "ok");
        drop(connection);
        remove(&path);
    }

    #[test]
    fn an_older_run_without_a_contour_is_told_as_one() {
        // One axis of two moves: what was kept as contour error is rounding.
        let straight = IterationRecord { reference_m: vec![0.0, 0.5, 0.02, 0.5], ..record(0) };
        let path = old_file("straight", 2, &meta("a"), &straight, 1e-20);
        let library = Library::open(&path).unwrap();
        let listed = library.list(None).unwrap().remove(0).record.figures;
        assert_eq!((listed.contour_inf_m, listed.contour_rms_m), (None, None));
        assert_eq!(listed, library.load(1).unwrap().record.figures);
        drop(library);
        remove(&path);
        // An angle beside a length: neither is part of the other's figure.
        let turning = Meta { input_units: vec!["m".into(), "rad".into()], ..meta("a") };
        let mixed = IterationRecord { error_m: vec![1e-3, 0.5, -2e-3, 0.7], ..record(0) };
        let path = old_file("mixed", 2, &turning, &mixed, 0.4);
        let figures = Library::open(&path).unwrap().list(None).unwrap().remove(0).record.figures;
        assert_eq!(figures.contour_inf_m, None);
        assert_eq!(figures.axes_tracking_inf_m, [2e-3, 0.7]);
        assert!((figures.tracking_inf_m - 2e-3).abs() < 1e-18);
        remove(&path);
    }

    #[test]
    fn what_a_law_decides_later_is_added() {
        let library = Library::in_memory().unwrap();
        let mut run = record(0);
        (run.figures.rolled_back, run.figures.learning_off, run.figures.remark) =
            (false, false, None);
        let id = library.append(&meta("a"), &run).unwrap();
        run.figures.rolled_back = true;
        run.figures.remark = Some("it grew".into());
        library.judge(id, &run.figures).unwrap();
        assert_eq!(library.load(id).unwrap().record, run);
    }

    #[test]
    fn a_file_that_is_no_library_is_refused() {
        let path = std::env::temp_dir().join(format!("ilc-not-a-library-{}", std::process::id()));
        std::fs::write(&path, "this is no database, it only looks like a file").unwrap();
        let refused = Library::open(&path);
        std::fs::remove_file(&path).unwrap();
        assert!(refused.unwrap_err().to_string().contains("not a database"));
    }
}
