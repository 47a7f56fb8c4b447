//! Files as older versions of this program wrote them: read as they are, and upgraded by a writer.

use std::path::{Path, PathBuf};

use rusqlite::{Connection, params};

use super::super::row::{as_integer, json_list, json_numbers};
use super::super::signals::blob;
use super::super::tests::{meta, record};
use super::super::{Library, LibraryError, Task, schema};
use crate::record::{IterationRecord, Meta};

/// A file of an older version, deleted when dropped.
struct Older {
    path: PathBuf,
    version: i64,
}

impl Older {
    /// Creates the tables of versions 1 to 3.
    fn new(name: &str, version: i64) -> Self {
        let file = format!("ilc-older-{name}-{version}-{}.db", std::process::id());
        let older = Self { path: std::env::temp_dir().join(file), version };
        older.remove();
        let contour = if version < 3 { " NOT NULL" } else { "" };
        let later = if version < 3 {
            ""
        } else {
            "axes_tracking_inf_m TEXT, axes_tracking_rms_m TEXT, learning_off INTEGER, remark TEXT,"
        };
        let index = if version < 2 {
            ""
        } else {
            "CREATE INDEX iteration_by_disturbance ON iteration (cell, disturbance)
                WHERE disturbance IS NOT NULL;"
        };
        let connection = older.connect();
        connection.pragma_update(None, "auto_vacuum", "INCREMENTAL").unwrap();
        connection.pragma_update(None, "journal_mode", "WAL").unwrap();
        let table = format!(
            "CREATE TABLE iteration (
                id              INTEGER PRIMARY KEY,
                created_utc     TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now')),
                cell            TEXT NOT NULL,
                campaign        TEXT NOT NULL,
                fingerprint     TEXT NOT NULL,
                iteration       INTEGER NOT NULL,
                program         TEXT NOT NULL,
                law             TEXT NOT NULL,
                law_parameters  TEXT NOT NULL,
                measure         TEXT NOT NULL,
                cycle_s         REAL NOT NULL,
                n_axes          INTEGER NOT NULL,
                axis_names      TEXT NOT NULL,
                input_units     TEXT NOT NULL,
                n_samples       INTEGER NOT NULL,
                reference_m     BLOB NOT NULL,
                disturbance     TEXT,
                input           BLOB NOT NULL,
                encoder_m       BLOB NOT NULL,
                tool_m          BLOB,
                error_m         BLOB NOT NULL,
                contour_m       BLOB NOT NULL,
                digest          TEXT NOT NULL,
                tracking_inf_m          REAL NOT NULL,
                tracking_rms_m          REAL NOT NULL,
                contour_inf_m           REAL{contour},
                contour_rms_m           REAL{contour},
                encoder_tracking_inf_m  REAL NOT NULL,
                tool_tracking_inf_m     REAL,
                overruns                INTEGER NOT NULL,
                missing_samples         INTEGER NOT NULL,
                late_updates            INTEGER NOT NULL,
                update_ms               REAL NOT NULL,
                rolled_back             INTEGER NOT NULL,
                {later}
                UNIQUE (campaign, iteration)
            );
            CREATE INDEX iteration_by_fingerprint ON iteration (fingerprint, id);
            {index}
            PRAGMA application_id = 0x494C434C; PRAGMA user_version = {version};"
        );
        connection.execute_batch(&table).unwrap();
        older
    }

    fn connect(&self) -> Connection {
        Connection::open(&self.path).unwrap()
    }

    /// Adds a run whose figures are not those of its arrays.
    fn add(&self, meta: &Meta, run: &IterationRecord, contour_m: f64) {
        let disturbance = (self.version > 1).then(|| json_numbers(&run.disturbance));
        let insert = "INSERT INTO iteration (created_utc, cell, campaign, fingerprint, iteration,
            program, law, law_parameters, measure, cycle_s, n_axes, axis_names, input_units,
            n_samples, disturbance, reference_m, input, encoder_m, tool_m, error_m, contour_m,
            digest, tracking_inf_m, tracking_rms_m, contour_inf_m, contour_rms_m,
            encoder_tracking_inf_m, overruns, missing_samples, late_updates, update_ms, rolled_back)
            VALUES ('2024-05-06T07:08:09.000Z', ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?,
            ?, ?, ?, 0.3, 0.3, ?, ?, 0.25, 3, 4, 5, 6.5, 1)";
        let values = params![
            meta.cell,
            meta.campaign,
            meta.fingerprint,
            run.index,
            meta.program,
            meta.law,
            meta.law_parameters,
            meta.measure,
            meta.cycle_s,
            2,
            json_list(&meta.axis_names),
            json_list(&meta.input_units),
            as_integer(run.reference_m.len() / 2),
            disturbance,
            blob(&run.reference_m),
            blob(&run.input),
            blob(&run.encoder_m),
            blob(&run.tool_m),
            blob(&run.error_m),
            blob(&run.contour_m),
            run.digest(),
            contour_m,
            contour_m,
        ];
        assert_eq!(self.connect().execute(insert, values).unwrap(), 1);
    }

    /// Returns the version in the file, which must be sound.
    fn version(&self) -> i64 {
        let connection = self.connect();
        let sound: String =
            connection.pragma_query_value(None, "integrity_check", |row| row.get(0)).unwrap();
        assert_eq!(sound, "ok");
        connection.pragma_query_value(None, "user_version", |row| row.get(0)).unwrap()
    }

    fn size(&self) -> u64 {
        self.connect().query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(())).unwrap();
        std::fs::metadata(&self.path).unwrap().len()
    }

    fn remove(&self) {
        for ending in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(format!("{}{ending}", self.path.display()));
        }
    }
}

impl Drop for Older {
    fn drop(&mut self) {
        self.remove();
    }
}

/// A run as versions with disturbances stored it, and as the first one did.
fn run_of(version: i64, index: u32) -> IterationRecord {
    let run = record(index);
    if version == 1 { IterationRecord { disturbance: Vec::new(), ..run } } else { run }
}

fn of(path: &Path) -> [Library; 2] {
    [Library::read(path).unwrap(), Library::open(path).unwrap()]
}

#[test]
fn files_of_older_versions_open_and_go_on() {
    for version in 1..=3 {
        let file = Older::new("all", version);
        let old = run_of(version, 0);
        file.add(&meta("a"), &old, 0.4);
        file.add(&meta("a"), &run_of(version, 1), 0.4);
        for library in of(&file.path) {
            let loaded = library.load(1).unwrap();
            assert_eq!((loaded.meta, loaded.record.digest()), (meta("a"), old.digest()));
            assert_eq!((loaded.digest, loaded.n_samples), (old.digest(), 2));
            assert_eq!(loaded.created_utc, "2024-05-06T07:08:09.000Z");
            let listed = library.list(None).unwrap();
            let figures = &listed[0].record.figures;
            let counts = (figures.overruns, figures.missing_samples, figures.late_updates);
            assert_eq!(counts, (3, 4, 5), "version {version}");
            assert!((figures.update_ms - 6.5).abs() < 1e-15 && figures.rolled_back);
            assert!(!figures.learning_off && figures.remark.is_none());
            assert_eq!(figures.axes_tracking_inf_m, [0.3, 0.3], "computed from the arrays");
            assert_eq!(figures.contour_inf_m, Some(0.4));
            assert_eq!(listed.iter().map(|row| row.id).collect::<Vec<_>>(), [1, 2]);
            assert_eq!(library.newest_campaign("f").unwrap().as_deref(), Some("a"));
            let near = library.recall(&[0.3, 0.0], 5, &Task::default()).unwrap();
            assert_eq!(near.len(), if version == 1 { 0 } else { 2 });
        }
        assert_eq!(file.version(), schema::VERSION);
        let library = Library::open(&file.path).unwrap();
        assert_eq!(library.next_index("a").unwrap(), 2);
        let mut straight = record(2);
        (straight.figures.contour_inf_m, straight.contour_m) = (None, Vec::new());
        let id = library.append(&meta("a"), &straight).unwrap();
        assert_eq!(library.load(id).unwrap().record, straight);
        assert_eq!(library.recall(&[0.3, 0.0], 1, &Task::default()).unwrap().len(), 1);
        library.discard(&[1, 2]).unwrap();
        assert_eq!(library.list(None).unwrap().len(), 1);
    }
}

#[test]
fn an_older_run_without_a_contour_is_told_as_one() {
    // One of two axes moves: the stored contour error is rounding.
    let straight = IterationRecord { reference_m: vec![0.0, 0.5, 0.02, 0.5], ..record(0) };
    let file = Older::new("straight", 2);
    file.add(&meta("a"), &straight, 1e-20);
    for library in of(&file.path) {
        let listed = library.list(None).unwrap().remove(0).record.figures;
        assert_eq!((listed.contour_inf_m, listed.contour_rms_m), (None, None));
        assert_eq!(listed, library.load(1).unwrap().record.figures);
    }
    // An angle beside a length: neither is part of the other's figure.
    let turning = Meta { input_units: vec!["m".into(), "rad".into()], ..meta("a") };
    let mixed = IterationRecord { error_m: vec![1e-3, 0.5, -2e-3, 0.7], ..record(0) };
    let file = Older::new("mixed", 2);
    file.add(&turning, &mixed, 0.4);
    for library in of(&file.path) {
        let figures = library.list(None).unwrap().remove(0).record.figures;
        assert_eq!(figures.contour_inf_m, None);
        assert_eq!(figures.axes_tracking_inf_m, [2e-3, 0.7]);
        assert!((figures.tracking_inf_m - 2e-3).abs() < 1e-18);
    }
}

/// Runs of 300 samples, many pages each, on one path.
fn long(index: u32) -> IterationRecord {
    let wave = |scale: f64| (0..600).map(|k| scale * f64::from(k * (index + 1)).sin()).collect();
    let (encoder_m, tool_m): (Vec<f64>, Vec<f64>) = (wave(1.0), wave(1e-6));
    let reference_m = vec![0.125; 600];
    let error_m = reference_m.iter().zip(&tool_m).map(|(r, y)| r - y).collect();
    let contour_m = vec![0.5; 300];
    IterationRecord { reference_m, encoder_m, tool_m, error_m, contour_m, ..record(index) }
}

#[test]
fn an_upgrade_keeps_every_bit_and_needs_no_more_space() {
    let file = Older::new("long", 3);
    for index in 0..40 {
        file.add(&meta("a"), &long(index), 0.4);
    }
    let before = file.size();
    let library = Library::open(&file.path).unwrap();
    for index in 0..40 {
        let row = library.load(i64::from(index) + 1).unwrap();
        assert_eq!(
            (&row.digest, row.record.digest()),
            (&long(index).digest(), long(index).digest())
        );
    }
    // Some pages of new tables are made before those of the first run are free.
    assert!(file.size() <= before + 32 * 4096, "{} bytes, {before} before", file.size());
    library.discard(&[40]).unwrap();
    drop(library);
    assert!(file.size() < before * 7 / 10, "{} bytes, {before} before", file.size());
    assert_eq!(file.version(), schema::VERSION);
}

#[test]
fn a_full_disk_leaves_the_older_file_as_it_was() {
    let file = Older::new("full", 3);
    for index in 0..10 {
        file.add(&meta("a"), &long(index), 0.4);
    }
    let connection = file.connect();
    let pages: i64 = connection.pragma_query_value(None, "page_count", |row| row.get(0)).unwrap();
    connection.pragma_update(None, "max_page_count", pages + 4).unwrap();
    let refused = super::bring_up_to_date(&connection).unwrap_err();
    assert_eq!(refused.sqlite_error_code(), Some(rusqlite::ErrorCode::DiskFull));
    drop(connection);
    assert_eq!(file.version(), 3);
    let library = Library::read(&file.path).unwrap();
    assert_eq!(library.load(10).unwrap().record.digest(), long(9).digest());
    drop(library);
    Library::open(&file.path).unwrap();
    assert_eq!(file.version(), schema::VERSION);
}

#[test]
fn an_interrupted_upgrade_leaves_the_older_file_as_it_was() {
    let file = Older::new("cut", 3);
    for index in 0..10 {
        file.add(&meta("a"), &long(index), 0.4);
    }
    // What a kill just before the commit leaves: both files, with most of the pages written.
    let connection = file.connect();
    connection.execute_batch("PRAGMA cache_size = 10; BEGIN IMMEDIATE").unwrap();
    assert!(super::renew(&connection).unwrap());
    let left = Older { path: file.path.with_extension("left.db"), version: 3 };
    left.remove();
    for ending in ["", "-wal"] {
        let name = |path: &Path| format!("{}{ending}", path.display());
        std::fs::copy(name(&file.path), name(&left.path)).unwrap();
    }
    let log = std::fs::metadata(format!("{}-wal", left.path.display())).unwrap().len();
    assert!(log > 20 * 4096, "{log} bytes were written");
    drop(connection);
    for file in [file, left] {
        assert_eq!(file.version(), 3);
        let library = Library::read(&file.path).unwrap();
        assert_eq!(library.load(10).unwrap().record.digest(), long(9).digest());
        drop(library);
        let library = Library::open(&file.path).unwrap();
        assert_eq!(library.load(10).unwrap().record.digest(), long(9).digest());
        assert_eq!(file.version(), schema::VERSION);
    }
}

#[test]
fn a_damaged_run_of_an_older_file_stays_damaged_and_the_others_whole() {
    let file = Older::new("damaged", 3);
    file.add(&meta("a"), &long(0), 0.4);
    file.add(&meta("a"), &long(1), 0.4);
    file.connect().execute("UPDATE iteration SET input = zeroblob(81) WHERE id = 1", []).unwrap();
    for library in of(&file.path) {
        assert!(matches!(library.load(1), Err(LibraryError::Damaged { id: 1, .. })));
        assert_eq!(library.load(2).unwrap().record.digest(), long(1).digest());
    }
}

#[test]
fn the_second_of_two_writers_finds_the_file_upgraded() {
    let file = Older::new("two", 2);
    file.add(&meta("a"), &record(0), 0.4);
    let late = file.connect();
    Library::open(&file.path).unwrap().append(&meta("b"), &record(0)).unwrap();
    assert!(!super::bring_up_to_date(&late).unwrap());
    assert_eq!(Library::read(&file.path).unwrap().list(None).unwrap().len(), 2);
}
