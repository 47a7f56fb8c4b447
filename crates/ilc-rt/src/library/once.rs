//! Parts that many runs share and the file has once: texts, set points, places of disturbances.

use std::collections::BTreeSet;

use rusqlite::{Connection, OptionalExtension, params};
use sha2::{Digest, Sha256};

use super::near;
use super::row::json_numbers;
use super::signals::blob;

/// Returns the key of a text, which is stored if it is new.
pub(super) fn description(connection: &Connection, content: &str) -> rusqlite::Result<i64> {
    let digest = Sha256::digest(content.as_bytes());
    let digest = digest.as_slice();
    let found = find(connection, "SELECT id FROM description WHERE digest = ?1", digest)?;
    if let Some(id) = found {
        return Ok(id);
    }
    let insert = "INSERT INTO description (digest, content) VALUES (?1, ?2)";
    connection.prepare_cached(insert)?.insert(params![digest, content])
}

/// Returns the key of set points, which are stored if they are new.
pub(super) fn reference(connection: &Connection, reference_m: &[f64]) -> rusqlite::Result<i64> {
    let bytes = blob(reference_m);
    let digest = Sha256::digest(&bytes);
    let digest = digest.as_slice();
    if let Some(id) = find(connection, "SELECT id FROM reference WHERE digest = ?1", digest)? {
        return Ok(id);
    }
    let insert = "INSERT INTO reference (digest, reference_m) VALUES (?1, ?2)";
    connection.prepare_cached(insert)?.insert(params![digest, bytes])
}

/// Returns the key of a disturbance in a cell, which is stored if it is new.
pub(super) fn place(
    connection: &Connection,
    cell: &str,
    disturbance: &[f64],
) -> rusqlite::Result<i64> {
    let cell = match cell_key(connection, cell)? {
        Some(key) => key,
        None => connection.prepare_cached("INSERT INTO cell (name) VALUES (?1)")?.insert([cell])?,
    };
    let text = json_numbers(disturbance);
    let found = connection
        .prepare_cached("SELECT id FROM place WHERE cell = ?1 AND disturbance = ?2")?
        .query_row(params![cell, text], |row| row.get(0))
        .optional()?;
    if let Some(id) = found {
        return Ok(id);
    }
    let insert = "INSERT INTO place (cell, disturbance) VALUES (?1, ?2)";
    let id = connection.prepare_cached(insert)?.insert(params![cell, text])?;
    near::insert(connection, id, cell, disturbance)?;
    Ok(id)
}

/// Returns the key of a cell; `None` if it has no run with a disturbance.
pub(super) fn cell_key(connection: &Connection, name: &str) -> rusqlite::Result<Option<i64>> {
    connection
        .prepare_cached("SELECT id FROM cell WHERE name = ?1")?
        .query_row([name], |row| row.get(0))
        .optional()
}

/// Deletes those of some places under which no run was made any more.
pub(super) fn forget_places(connection: &Connection, ids: &BTreeSet<i64>) -> rusqlite::Result<()> {
    let mut delete = connection.prepare_cached(
        "DELETE FROM place WHERE id = ?1 AND NOT EXISTS (SELECT 1 FROM iteration WHERE place = ?1)",
    )?;
    let mut gone = Vec::new();
    for id in ids {
        if delete.execute([id])? > 0 {
            gone.push(*id);
        }
    }
    near::delete(connection, &gone)
}

/// Deletes set points if no run has them any more.
pub(super) fn forget_reference(connection: &Connection, id: i64) -> rusqlite::Result<()> {
    let delete = "DELETE FROM reference WHERE id = ?1 \
        AND NOT EXISTS (SELECT 1 FROM signals WHERE reference = ?1)";
    connection.prepare_cached(delete)?.execute([id]).map(drop)
}

/// Deletes all texts that no run has any more; reads all runs.
pub(super) fn forget_descriptions(connection: &Connection) -> rusqlite::Result<()> {
    connection
        .execute(
            "DELETE FROM description WHERE id NOT IN \
            (SELECT program FROM iteration UNION SELECT law_parameters FROM iteration)",
            [],
        )
        .map(drop)
}

fn find(connection: &Connection, query: &str, digest: &[u8]) -> rusqlite::Result<Option<i64>> {
    connection.prepare_cached(query)?.query_row([digest], |row| row.get(0)).optional()
}
