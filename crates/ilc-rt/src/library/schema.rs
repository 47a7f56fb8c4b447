//! The tables: names, columns, creation.
//!
//! `iteration` has provenance and figures of each run, in short rows, so that a listing reads few
//! pages; `signals` has the arrays. What many runs share is kept once: set points (`reference`) and
//! the texts of program and law (`description`). `place` has the disturbances that runs were made
//! under, and `near` the same as an R*Tree.

use std::fmt::Write as _;

use rusqlite::Connection;

use super::figures;
use crate::record::{Field, figure_fields};

/// Mark of this program's files, in SQLite's `application_id`: "ILCL".
pub(super) const MARK: i64 = 0x494C_434C;
/// First version with an index of disturbances.
pub(super) const INDEXED: i64 = 2;
/// First version with arrays in a table of their own.
pub(super) const PARTED: i64 = 4;

/// Version of the schema, in SQLite's `user_version`.
pub(super) const VERSION: i64 = 4;
/// The oldest version that can be read.
///
/// Version 1 had an unused column for the disturbance. Version 2 had a contour error for every run,
/// also for paths without a contour, no figures of individual axes, and no status of the learning.
/// Version 3 had one table, with the arrays of a run before its figures.
pub(super) const OLDEST: i64 = 1;

/// Columns of a run beside its arrays and its figures, with their types before version 4.
pub(super) const COLUMNS: [(&str, &str); 17] = [
    ("id", "INTEGER PRIMARY KEY"),
    ("created_utc", "TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))"),
    ("cell", "TEXT NOT NULL"),
    ("campaign", "TEXT NOT NULL"),
    ("fingerprint", "TEXT NOT NULL"),
    ("iteration", "INTEGER NOT NULL"),
    ("program", "TEXT NOT NULL"),
    ("law", "TEXT NOT NULL"),
    ("law_parameters", "TEXT NOT NULL"),
    ("measure", "TEXT NOT NULL"),
    ("cycle_s", "REAL NOT NULL"),
    ("n_axes", "INTEGER NOT NULL"),
    ("axis_names", "TEXT NOT NULL"),
    ("input_units", "TEXT NOT NULL"),
    ("n_samples", "INTEGER NOT NULL"),
    ("disturbance", "TEXT"),
    ("digest", "TEXT NOT NULL"),
];

/// Columns of version 4 that are keys of [`TABLES`]: those of the texts, which were texts before,
/// and those that are new.
const KEYS: [(&str, &str); 3] =
    [("program", "INTEGER NOT NULL"), ("law_parameters", "INTEGER NOT NULL"), ("place", "INTEGER")];

/// Columns of the arrays of a run.
pub(super) const ARRAYS: [&str; 6] =
    ["reference_m", "input", "encoder_m", "tool_m", "error_m", "contour_m"];

/// The tables beside `iteration`. Arrays are little-endian float64, time first. Digests are SHA-256.
const TABLES: &str = "
CREATE TABLE IF NOT EXISTS description (
    id INTEGER PRIMARY KEY, digest BLOB NOT NULL UNIQUE, content TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS reference (
    id INTEGER PRIMARY KEY, digest BLOB NOT NULL UNIQUE, reference_m BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS cell (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS place (
    id INTEGER PRIMARY KEY, cell INTEGER NOT NULL, disturbance TEXT NOT NULL,
    UNIQUE (cell, disturbance));
CREATE VIRTUAL TABLE IF NOT EXISTS near USING rtree (
    id, cell_min, cell_max, a_min, a_max, b_min, b_max, c_min, c_max, d_min, d_max);
CREATE TABLE IF NOT EXISTS signals (
    id INTEGER PRIMARY KEY, reference INTEGER NOT NULL, computed INTEGER NOT NULL,
    input BLOB NOT NULL, encoder_m BLOB, tool_m BLOB, error_m BLOB, contour_m BLOB NOT NULL);
";

/// Indices, created if missing.
const INDICES: &str = "
CREATE INDEX IF NOT EXISTS iteration_by_fingerprint ON iteration (fingerprint, id);
CREATE INDEX IF NOT EXISTS iteration_by_place ON iteration (place, id) WHERE place IS NOT NULL;
CREATE INDEX IF NOT EXISTS signals_by_reference ON signals (reference);
";

/// The table of runs. Lists of names, figures of axes and disturbances are JSON; times are UTC in
/// ISO 8601.
fn table() -> String {
    let kind = |(name, kind): (&'static str, &'static str)| {
        (name, KEYS.iter().find(|(key, _)| *key == name).map_or(kind, |(_, kind)| kind))
    };
    let figures =
        figure_fields().iter().map(|field| (field.name.as_str(), figures::column_type(field)));
    let new = [KEYS[2], ("error_squares", "REAL")];
    let mut table = "CREATE TABLE IF NOT EXISTS iteration (\n".to_owned();
    for (name, kind) in COLUMNS.map(kind).into_iter().chain(new).chain(figures) {
        let _ = writeln!(table, "    {name:<24}{kind},");
    }
    table + "    UNIQUE (campaign, iteration)\n);"
}

/// Sets the options that must precede the first page of a file: pages of deleted runs can be
/// returned to the system (incremental vacuum).
pub(super) fn prepare(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "auto_vacuum", "INCREMENTAL")
}

/// Creates the tables and indices that are missing.
pub(super) fn create(connection: &Connection) -> rusqlite::Result<()> {
    connection.execute_batch(&table())?;
    connection.execute_batch(TABLES)?;
    connection.execute_batch(INDICES)
}

/// Returns the figures missing in an older table.
pub(super) fn missing(
    connection: &Connection,
    table: &str,
) -> rusqlite::Result<Vec<&'static Field>> {
    let mut statement = connection.prepare_cached("SELECT name FROM pragma_table_info(?1)")?;
    let there: Vec<String> =
        statement.query_map([table], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?;
    Ok(figure_fields().iter().filter(|field| !there.contains(&field.name)).collect())
}

/// Returns the start of a query for runs in a file of this version: columns, in the order of
/// [`COLUMNS`] and of the figures, then the arrays if wanted, and the tables.
///
/// Columns that an older file lacks are NULL. The table of runs is `iteration` in the conditions that follow.
pub(super) fn query(
    connection: &Connection,
    version: i64,
    table: &str,
    with_arrays: bool,
) -> rusqlite::Result<String> {
    let missing = missing(connection, table)?;
    let is_parted = version >= PARTED;
    let mut query = "SELECT ".to_owned();
    for (name, _) in COLUMNS {
        let _ = match name {
            "program" | "law_parameters" if is_parted => {
                write!(
                    query,
                    "(SELECT content FROM description WHERE description.id = iteration.{name}) AS {name}, "
                )
            }
            name => write!(query, "iteration.{name} AS {name}, "),
        };
    }
    for field in figure_fields() {
        let name = &field.name;
        let _ = if missing.contains(&field) {
            write!(query, "NULL AS {name}, ")
        } else {
            write!(query, "iteration.{name} AS {name}, ")
        };
    }
    if with_arrays {
        query += &ARRAYS.join(", ");
        query += if is_parted { ", computed" } else { ", 0 AS computed" };
    } else {
        query += "0";
    }
    let _ = write!(query, " FROM {table} AS iteration");
    if with_arrays && is_parted {
        query += " JOIN signals ON signals.id = iteration.id \
            JOIN reference ON reference.id = signals.reference";
    }
    Ok(query)
}
