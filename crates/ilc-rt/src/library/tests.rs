//! Tests of the library as a whole: stored data are read back, also from files of older versions.

use std::path::{Path, PathBuf};

use rusqlite::Connection;

use super::*;
use crate::record::{Figures, IterationRecord, Meta};

pub(super) fn meta(campaign: &str) -> Meta {
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

pub(super) fn record(index: u32) -> IterationRecord {
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

/// Creates a file like the first two versions, with one run.
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
    // One of two axes moves: the stored contour error is rounding.
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
    (run.figures.rolled_back, run.figures.learning_off, run.figures.remark) = (false, false, None);
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

/// The table as created by versions 1 and 3 of the schema.
fn old_table(version: i64) -> String {
    let contour = if version == 1 { " NOT NULL" } else { "" };
    let later = if version == 1 {
        ""
    } else {
        "axes_tracking_inf_m TEXT, axes_tracking_rms_m TEXT, learning_off INTEGER, remark TEXT,"
    };
    format!(
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
        PRAGMA application_id = 0x494C434C; PRAGMA user_version = {version};"
    )
}

#[test]
fn files_of_older_programs_open_and_go_on() {
    for version in [1, 3] {
        let name = format!("ilc-library-by-sql-{version}-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let old = IterationRecord { disturbance: Vec::new(), ..record(0) };
        let connection = Connection::open(&path).unwrap();
        connection.execute_batch(&old_table(version)).unwrap();
        if version == 3 {
            let index = "CREATE INDEX iteration_by_disturbance ON iteration (cell, disturbance)
                WHERE disturbance IS NOT NULL";
            connection.execute_batch(index).unwrap();
        }
        let blob = |values: &[f64]| -> Vec<u8> {
            values.iter().flat_map(|value| value.to_le_bytes()).collect()
        };
        let insert = "INSERT INTO iteration (cell, campaign, fingerprint, iteration, program, law,
            law_parameters, measure, cycle_s, n_axes, axis_names, input_units, n_samples,
            reference_m, input, encoder_m, tool_m, error_m, contour_m, digest, tracking_inf_m,
            tracking_rms_m, contour_inf_m, contour_rms_m, encoder_tracking_inf_m, overruns,
            missing_samples, late_updates, update_ms, rolled_back) VALUES ('gantry', 'a', 'f', 0,
            '[]', 'norm_optimal', '{}', 'tcp', 0.002, 2, '[\"x\",\"y\"]', '[\"m\",\"m/s\"]', 2,
            ?1, ?2, ?3, ?4, ?5, ?6, ?7, 0.3, 0.3, 0.4, 0.4, 0.25, 3, 4, 5, 6.5, 1)";
        let run = rusqlite::params![
            blob(&old.reference_m),
            blob(&old.input),
            blob(&old.encoder_m),
            blob(&old.tool_m),
            blob(&old.error_m),
            blob(&old.contour_m),
            old.digest(),
        ];
        connection.execute(insert, run).unwrap();
        drop(connection);
        for library in [Library::read(&path).unwrap(), Library::open(&path).unwrap()] {
            let loaded = library.load(1).unwrap();
            assert_eq!((loaded.meta, loaded.record.digest()), (meta("a"), old.digest()));
            let figures = &library.list(None).unwrap()[0].record.figures;
            let counts = (figures.overruns, figures.missing_samples, figures.late_updates);
            assert_eq!(counts, (3, 4, 5), "version {version}");
            assert!((figures.update_ms - 6.5).abs() < 1e-15 && figures.rolled_back);
            assert!(!figures.learning_off && figures.remark.is_none());
            assert_eq!(figures.axes_tracking_inf_m, [0.3, 0.3], "worked out from the arrays");
            assert_eq!(library.newest_campaign("f").unwrap().as_deref(), Some("a"));
        }
        let library = Library::open(&path).unwrap();
        assert_eq!(library.next_index("a").unwrap(), 1);
        let id = library.append(&meta("a"), &record(1)).unwrap();
        assert_eq!(library.load(id).unwrap().record, record(1));
        drop(library);
        remove(&path);
    }
}
