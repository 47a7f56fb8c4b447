//! The tables, and how they come to be.

use rusqlite::Connection;

/// Mark of this program's files, in SQLite's `application_id`: "ILCL".
pub(super) const MARK: i64 = 0x494C_434C;
/// The version from which on there is an index of disturbances.
pub(super) const INDEXED: i64 = 2;

/// Version of the schema, in SQLite's `user_version`.
pub(super) const VERSION: i64 = 2;
/// The oldest version that [`create`] brings up to date: it names only what is missing.
///
/// Version 1 had the column for the disturbance, and nothing in it.
pub(super) const OLDEST: i64 = 1;

/// Arrays are little-endian float64, time first; lists of names and disturbances are JSON; times are UTC in ISO 8601.
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
    contour_inf_m           REAL NOT NULL,
    contour_rms_m           REAL NOT NULL,
    encoder_tracking_inf_m  REAL NOT NULL,
    tool_tracking_inf_m     REAL,
    overruns                INTEGER NOT NULL,
    missing_samples         INTEGER NOT NULL,
    late_updates            INTEGER NOT NULL,
    update_ms               REAL NOT NULL,
    rolled_back             INTEGER NOT NULL,
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

/// Makes the tables in an empty file, or brings an older library up to date: all of it or nothing, so that
/// a process that is killed leaves a file that is still empty, or a library.
pub(super) fn create(connection: &Connection) -> rusqlite::Result<()> {
    connection.execute_batch(&format!(
        "BEGIN IMMEDIATE;{CREATE}PRAGMA application_id = {MARK};PRAGMA user_version = {VERSION};COMMIT"
    ))
}
