//! The tables: creation, and upgrade of older ones.

use std::fmt::Write as _;

use rusqlite::Connection;

use super::figures;
use super::row::{ARRAYS, COLUMNS};
use crate::record::{Field, figure_fields};

/// Mark of this program's files, in SQLite's `application_id`: "ILCL".
pub(super) const MARK: i64 = 0x494C_434C;
/// First version with an index of disturbances.
pub(super) const INDEXED: i64 = 2;

/// Version of the schema, in SQLite's `user_version`.
pub(super) const VERSION: i64 = 3;
/// The oldest version that [`bring_up_to_date`] knows.
///
/// Version 1 had an unused column for the disturbance. Version 2 had a contour error for every run,
/// also for paths without a contour, no figures of individual axes, and no status of the learning.
pub(super) const OLDEST: i64 = 1;

/// Indices, created if missing.
const INDICES: &str = "
CREATE INDEX IF NOT EXISTS iteration_by_fingerprint ON iteration (fingerprint, id);
CREATE INDEX IF NOT EXISTS iteration_by_disturbance ON iteration (cell, disturbance)
    WHERE disturbance IS NOT NULL;
";

/// The table of runs. Arrays are little-endian float64, time first; lists of names, figures of axes and
/// disturbances are JSON; times are UTC in ISO 8601.
fn table() -> String {
    let figures =
        figure_fields().iter().map(|field| (field.name.as_str(), figures::column_type(field)));
    let columns = COLUMNS.into_iter().chain(ARRAYS).chain(figures);
    let mut table = "CREATE TABLE IF NOT EXISTS iteration (\n".to_owned();
    for (name, kind) in columns {
        let _ = writeln!(table, "    {name:<24}{kind},");
    }
    table + "    UNIQUE (campaign, iteration)\n);"
}

/// Sets the options that must precede the first page of a file: pages of deleted runs can be
/// returned to the system (incremental vacuum).
pub(super) fn prepare(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "auto_vacuum", "INCREMENTAL")
}

/// Creates the tables of a new file, or upgrades those of an older version: all or nothing.
///
/// No run is rewritten: what older runs lack is computed when they are read.
pub(super) fn bring_up_to_date(connection: &Connection) -> rusqlite::Result<()> {
    let transaction =
        rusqlite::Transaction::new_unchecked(connection, rusqlite::TransactionBehavior::Immediate)?;
    transaction.execute_batch(&table())?;
    transaction.execute_batch(INDICES)?;
    for field in missing(&transaction)? {
        let (name, kind) = (&field.name, figures::column_type(field));
        transaction.execute_batch(&format!("ALTER TABLE iteration ADD COLUMN {name} {kind}"))?;
    }
    allow_no_contour(&transaction)?;
    transaction.pragma_update(None, "application_id", MARK)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}

/// Removes the constraint on contour errors, by the procedure that SQLite documents: the rows are
/// unchanged.
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

/// Returns the figures missing in an older file.
pub(super) fn missing(connection: &Connection) -> rusqlite::Result<Vec<&'static Field>> {
    let mut statement = connection.prepare("SELECT name FROM pragma_table_info('iteration')")?;
    let there: Vec<String> =
        statement.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?;
    Ok(figure_fields().iter().filter(|field| !there.contains(&field.name)).collect())
}

/// Returns the columns of a run without its arrays, also for an older, read-only file.
pub(super) fn columns(connection: &Connection) -> rusqlite::Result<String> {
    let missing = missing(connection)?;
    let mut columns: Vec<String> = COLUMNS.map(|(name, _)| name.to_owned()).into();
    columns.extend(figure_fields().iter().map(|field| {
        let name = &field.name;
        if missing.contains(&field) { format!("NULL AS {name}") } else { name.clone() }
    }));
    Ok(columns.join(", "))
}
