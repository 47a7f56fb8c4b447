//! The tables, how they come to be, and how older ones are brought up to date.

use rusqlite::Connection;

/// Mark of this program's files, in SQLite's `application_id`: "ILCL".
pub(super) const MARK: i64 = 0x494C_434C;
/// The version from which on there is an index of disturbances.
pub(super) const INDEXED: i64 = 2;

/// Version of the schema, in SQLite's `user_version`.
pub(super) const VERSION: i64 = 3;
/// The oldest version that [`bring_up_to_date`] knows.
///
/// Version 1 had the column for the disturbance, and nothing in it. Version 2 had a contour error for
/// every run, also for paths without a contour, no figures for single axes, and no word on the learning.
pub(super) const OLDEST: i64 = 1;

/// Arrays are little-endian float64, time first; lists of names, figures of axes and disturbances are JSON;
/// times are UTC in ISO 8601.
const CREATE: &str = "
CREATE TABLE IF NOT EXISTS iteration (
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
    contour_inf_m           REAL,
    contour_rms_m           REAL,
    encoder_tracking_inf_m  REAL NOT NULL,
    tool_tracking_inf_m     REAL,
    overruns                INTEGER NOT NULL,
    missing_samples         INTEGER NOT NULL,
    late_updates            INTEGER NOT NULL,
    update_ms               REAL NOT NULL,
    rolled_back             INTEGER NOT NULL,
    axes_tracking_inf_m     TEXT,
    axes_tracking_rms_m     TEXT,
    learning_off            INTEGER,
    remark                  TEXT,
    UNIQUE (campaign, iteration)
);
CREATE INDEX IF NOT EXISTS iteration_by_fingerprint ON iteration (fingerprint, id);
CREATE INDEX IF NOT EXISTS iteration_by_disturbance ON iteration (cell, disturbance)
    WHERE disturbance IS NOT NULL;
";

/// Sets what must be said before the first page of a file is written: the pages of runs that are deleted
/// can be given back to the system.
pub(super) fn prepare(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "auto_vacuum", "INCREMENTAL")
}

/// Columns that older versions do not have, with their types.
const ADDED: [(&str, &str); 4] = [
    ("axes_tracking_inf_m", "TEXT"),
    ("axes_tracking_rms_m", "TEXT"),
    ("learning_off", "INTEGER"),
    ("remark", "TEXT"),
];

/// Makes the tables of a new file, or gives those of an older version what they lack: all or nothing.
///
/// No run is rewritten: what older runs lack is worked out when they are read.
pub(super) fn bring_up_to_date(connection: &Connection) -> rusqlite::Result<()> {
    let transaction =
        rusqlite::Transaction::new_unchecked(connection, rusqlite::TransactionBehavior::Immediate)?;
    transaction.execute_batch(CREATE)?;
    for (name, kind) in missing(&transaction)? {
        transaction.execute_batch(&format!("ALTER TABLE iteration ADD COLUMN {name} {kind}"))?;
    }
    allow_no_contour(&transaction)?;
    transaction.pragma_update(None, "application_id", MARK)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}

/// Takes the constraint from the contour errors, by the procedure that SQLite documents for it: the
/// rows stay as they are.
fn allow_no_contour(connection: &Connection) -> rusqlite::Result<()> {
    let version: i64 = connection.pragma_query_value(None, "schema_version", |row| row.get(0))?;
    connection.execute_batch("PRAGMA writable_schema = ON")?;
    let edited = ["contour_inf_m", "contour_rms_m"].into_iter().try_for_each(|name| {
        let was = format!("{name}           REAL NOT NULL");
        let is = format!("{name}           REAL");
        let edit = "UPDATE sqlite_schema SET sql = replace(sql, ?1, ?2) \
            WHERE type = 'table' AND name = 'iteration'";
        connection.execute(edit, [was, is]).map(drop)
    });
    edited?;
    connection.pragma_update(None, "schema_version", version + 1)?;
    connection.execute_batch("PRAGMA writable_schema = RESET")
}

fn missing(connection: &Connection) -> rusqlite::Result<Vec<(&'static str, &'static str)>> {
    let mut statement = connection.prepare("SELECT name FROM pragma_table_info('iteration')")?;
    let there: Vec<String> =
        statement.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?;
    Ok(ADDED.into_iter().filter(|(name, _)| !there.iter().any(|known| known == name)).collect())
}

/// The columns of a run without its arrays, also in a file of an older version that can only be read.
pub(super) fn columns(connection: &Connection) -> rusqlite::Result<String> {
    let missing = missing(connection)?;
    let added = ADDED.iter().map(|(name, _)| {
        if missing.iter().any(|(lacking, _)| lacking == name) {
            format!(", NULL AS {name}")
        } else {
            format!(", {name}")
        }
    });
    Ok(super::row::COLUMNS.to_owned() + &added.collect::<String>())
}
