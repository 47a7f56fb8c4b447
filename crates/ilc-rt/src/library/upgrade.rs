//! Files of versions 1 to 3, whose single table had the arrays of a run between its columns.
//!
//! Every run is written again, with its key, its time and its digest, and what older versions did not
//! know is computed from its arrays. All of it is one transaction: an interrupted upgrade, or one for
//! which the disk is too small, leaves the file as it was.

use rusqlite::Connection;

use super::figures;
use super::new_run::NewRun;
use super::row::{is_old, read_row, refresh};
use super::schema;

/// Name of the table of an older version meanwhile.
const OLDER: &str = "older_iteration";

/// Creates the tables of a new file, or upgrades those of an older version: all or nothing.
///
/// Returns true if runs of an older version were moved.
pub(super) fn bring_up_to_date(connection: &Connection) -> rusqlite::Result<bool> {
    let transaction =
        rusqlite::Transaction::new_unchecked(connection, rusqlite::TransactionBehavior::Immediate)?;
    let is_old = renew(&transaction)?;
    transaction.commit()?;
    Ok(is_old)
}

/// Does the work of [`bring_up_to_date`] in a transaction.
pub(super) fn renew(transaction: &Connection) -> rusqlite::Result<bool> {
    // Read inside the transaction: another program may have upgraded the file meanwhile.
    let version: i64 = transaction.pragma_query_value(None, "user_version", |row| row.get(0))?;
    let is_old = (schema::OLDEST..schema::PARTED).contains(&version);
    if is_old {
        set_aside(transaction)?;
    }
    schema::create(transaction)?;
    for field in schema::missing(transaction, "iteration")? {
        let (name, kind) = (&field.name, figures::column_type(field));
        transaction.execute_batch(&format!("ALTER TABLE iteration ADD COLUMN {name} {kind}"))?;
    }
    if is_old {
        move_runs(transaction)?;
    }
    transaction.pragma_update(None, "application_id", schema::MARK)?;
    transaction.pragma_update(None, "user_version", schema::VERSION)?;
    Ok(is_old)
}

/// Gives the table of an older version another name, and drops its indices.
fn set_aside(connection: &Connection) -> rusqlite::Result<()> {
    connection.execute_batch(&format!(
        "DROP INDEX IF EXISTS iteration_by_fingerprint;
        DROP INDEX IF EXISTS iteration_by_disturbance;
        ALTER TABLE iteration RENAME TO {OLDER};"
    ))
}

/// Moves all runs to the tables of this version.
fn move_runs(connection: &Connection) -> rusqlite::Result<()> {
    let ids: Vec<i64> = connection
        .prepare(&format!("SELECT id FROM {OLDER} ORDER BY id"))?
        .query_map([], |row| row.get(0))?
        .collect::<rusqlite::Result<_>>()?;
    let select = schema::query(connection, schema::PARTED - 1, OLDER, true)?;
    let mut select = connection.prepare(&format!("{select} WHERE iteration.id = ?1"))?;
    // At once, so that its space is used again: the file need not grow.
    let mut delete = connection.prepare(&format!("DELETE FROM {OLDER} WHERE id = ?1"))?;
    for id in ids {
        let mut row = select.query_row([id], |row| read_row(row, true))?;
        if is_old(&row) {
            refresh(&mut row);
        }
        delete.execute([id])?;
        let run = NewRun {
            id: Some(id),
            created_utc: Some(&row.created_utc),
            meta: &row.meta,
            record: &row.record,
            n_samples: row.n_samples,
            digest: &row.digest,
        };
        run.write(connection)?;
    }
    drop((select, delete));
    connection.execute_batch(&format!("DROP TABLE {OLDER}"))
}

#[cfg(test)]
mod tests;
