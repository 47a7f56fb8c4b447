//! Writing a run: its row, its arrays, and the parts that it shares.

use rusqlite::types::Value;
use rusqlite::{Connection, params, params_from_iter};

use super::row::{Row, as_integer, json_list, json_numbers};
use super::signals::{Computed, blob, squares};
use super::{figures, once};
use crate::record::{IterationRecord, Meta};

/// A run that is not in the file yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct NewRun<'a> {
    /// Key; the next one by default.
    pub(super) id: Option<i64>,
    /// Time of appending in UTC; now by default.
    pub(super) created_utc: Option<&'a str>,
    pub(super) meta: &'a Meta,
    pub(super) record: &'a IterationRecord,
    pub(super) n_samples: usize,
    pub(super) digest: &'a str,
}

impl<'a> NewRun<'a> {
    /// Returns a row of another library, to be stored under a new key.
    pub(super) fn of_row(row: &'a Row) -> Self {
        Self {
            id: None,
            created_utc: Some(&row.created_utc),
            meta: &row.meta,
            record: &row.record,
            n_samples: row.n_samples,
            digest: &row.digest,
        }
    }

    /// Writes the run and returns its key. To be called in a transaction.
    pub(super) fn write(self, connection: &Connection) -> rusqlite::Result<i64> {
        let Self { id, created_utc, meta, record, n_samples, digest } = self;
        let text = |text: &str| Value::Text(text.to_owned());
        // A number that is not finite has no place.
        let is_placed = !record.disturbance.is_empty()
            && record.disturbance.iter().all(|value| value.is_finite());
        let place = if is_placed {
            Some(once::place(connection, &meta.cell, &record.disturbance)?)
        } else {
            None
        };
        let disturbance = Some(&record.disturbance).filter(|measured| !measured.is_empty());
        let error_squares = squares(&record.error_m);
        let mut run = vec![
            ("id", id.into()),
            ("cell", text(&meta.cell)),
            ("campaign", text(&meta.campaign)),
            ("fingerprint", text(&meta.fingerprint)),
            ("iteration", Value::Integer(record.index.into())),
            ("program", once::description(connection, &meta.program)?.into()),
            ("law", text(&meta.law)),
            ("law_parameters", once::description(connection, &meta.law_parameters)?.into()),
            ("measure", text(&meta.measure)),
            ("cycle_s", Value::Real(meta.cycle_s)),
            ("n_axes", Value::Integer(as_integer(meta.n_axes))),
            ("axis_names", Value::Text(json_list(&meta.axis_names))),
            ("input_units", Value::Text(json_list(&meta.input_units))),
            ("n_samples", Value::Integer(as_integer(n_samples))),
            ("disturbance", disturbance.map(|measured| json_numbers(measured)).into()),
            ("digest", text(digest)),
            ("place", place.into()),
            ("error_squares", Some(error_squares).filter(|sum| sum.is_finite()).into()),
        ];
        run.extend(created_utc.map(|time| ("created_utc", text(time))));
        run.extend(figures::values(&record.figures));
        let (names, values): (Vec<_>, Vec<_>) = run.into_iter().unzip();
        let places = vec!["?"; names.len()].join(", ");
        let statement = format!("INSERT INTO iteration ({}) VALUES ({places})", names.join(", "));
        let id = connection.prepare_cached(&statement)?.insert(params_from_iter(values))?;
        write_signals(connection, id, record)?;
        Ok(id)
    }
}

/// Writes the arrays of a run, except what follows from the others.
fn write_signals(
    connection: &Connection,
    id: i64,
    record: &IterationRecord,
) -> rusqlite::Result<()> {
    let computed = Computed::from(record);
    let is_error_stored = matches!(computed, Computed::Nothing | Computed::Encoder);
    let tool = Some(&record.tool_m).filter(|tool_m| !tool_m.is_empty());
    connection
        .prepare_cached(
            // A run deleted by another program may have left its arrays.
            "INSERT OR REPLACE INTO signals \
            (id, reference, computed, input, encoder_m, tool_m, error_m, contour_m) \
            VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        )?
        .execute(params![
            id,
            once::reference(connection, &record.reference_m)?,
            computed.number(),
            blob(&record.input),
            (computed != Computed::Encoder).then(|| blob(&record.encoder_m)),
            tool.map(|tool_m| blob(tool_m)),
            is_error_stored.then(|| blob(&record.error_m)),
            blob(&record.contour_m),
        ])
        .map(drop)
}
