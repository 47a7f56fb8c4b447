//! One row of the table: reading, and the texts of its lists.

use rusqlite::types::Type;

use super::error::Unreadable;
use super::figures;
use super::schema::COLUMNS;
use super::signals::{Computed, floats};
use crate::record::{AxisKinds, IterationRecord, Meta, distances_m, figure_fields};

/// One stored run with its provenance.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Key in the library.
    pub id: i64,
    /// Time of appending, UTC.
    pub created_utc: String,
    /// Provenance.
    pub meta: Meta,
    /// SHA-256 of the arrays, as they were appended.
    pub digest: String,
    /// Samples in the run.
    pub n_samples: usize,
    /// Arrays and figures; the arrays are empty in listings.
    pub record: IterationRecord,
}

/// Reads a row of `schema::query`, whose columns have the order of [`COLUMNS`], of the figures, and
/// of the arrays.
pub(super) fn read_row(row: &rusqlite::Row<'_>, with_arrays: bool) -> rusqlite::Result<Row> {
    read(row, with_arrays).map_err(|error| unreadable(row, error))
}

/// Names row and column of a value that could not be read.
fn unreadable(row: &rusqlite::Row<'_>, error: rusqlite::Error) -> rusqlite::Error {
    use rusqlite::Error::{FromSqlConversionFailure, IntegralValueOutOfRange, InvalidColumnType};
    let (FromSqlConversionFailure(place, ..)
    | IntegralValueOutOfRange(place, _)
    | InvalidColumnType(place, ..)) = error
    else {
        return error;
    };
    let found = row.get(0).and_then(|id| {
        let column = row.as_ref().column_name(place)?.to_owned();
        Ok(Unreadable { id, column })
    });
    match found {
        Ok(found) => FromSqlConversionFailure(place, Type::Text, Box::new(found)),
        Err(_) => error,
    }
}

fn read(row: &rusqlite::Row<'_>, with_arrays: bool) -> rusqlite::Result<Row> {
    let mut columns = 0..;
    let mut next = || columns.next().unwrap_or_default();
    let list = |text: Option<String>| -> Vec<String> {
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
    };
    let count = |n: i64| usize::try_from(n).unwrap_or(0);
    let (id, created_utc) = (row.get(next())?, row.get(next())?);
    let (cell, campaign, fingerprint) = (row.get(next())?, row.get(next())?, row.get(next())?);
    let index = row.get(next())?;
    let (program, law, law_parameters) = (row.get(next())?, row.get(next())?, row.get(next())?);
    let (measure, cycle_s, n_axes) = (row.get(next())?, row.get(next())?, count(row.get(next())?));
    let (axis_names, input_units) = (list(row.get(next())?), list(row.get(next())?));
    let n_samples = count(row.get(next())?);
    let disturbance = numbers(row.get::<_, Option<String>>(next())?.as_deref());
    let digest = row.get(next())?;
    let figures = figures::read(row, COLUMNS.len())?;
    let mut record = IterationRecord { index, disturbance, figures, ..Default::default() };
    if with_arrays {
        let mut columns = COLUMNS.len() + figure_fields().len()..;
        let mut next = || columns.next().unwrap_or_default();
        let array = |column: usize| -> rusqlite::Result<Vec<f64>> {
            Ok(row.get_ref(column)?.as_blob_or_null()?.map(floats).unwrap_or_default())
        };
        for values in [
            &mut record.reference_m,
            &mut record.input,
            &mut record.encoder_m,
            &mut record.tool_m,
            &mut record.error_m,
            &mut record.contour_m,
        ] {
            *values = array(next())?;
        }
        Computed::of(row.get(next())?).restore(&mut record);
    }
    let meta = Meta {
        cell,
        campaign,
        fingerprint,
        law,
        law_parameters,
        measure,
        program,
        cycle_s,
        n_axes,
        axis_names,
        input_units,
    };
    Ok(Row { id, created_utc, meta, digest, n_samples, record })
}

/// Returns true if a row was written before figures per axis existed.
pub(super) fn is_old(row: &Row) -> bool {
    row.record.figures.axes_tracking_inf_m.is_empty() && row.meta.n_axes > 0
}

/// Computes the figures of a run stored before figures per axis existed: from its arrays, which the
/// row must have.
pub(super) fn refresh(row: &mut Row) {
    let kinds = AxisKinds::new(&row.meta.input_units, row.meta.n_axes);
    let record = &mut row.record;
    record.figures.set_tracking(&record.error_m, &kinds);
    let (encoder_m, tool_m) = (&record.encoder_m, &record.tool_m);
    record.figures.set_places(&record.reference_m, encoder_m, tool_m, &kinds);
    if kinds.is_mixed() || !kinds.has_contour(&record.reference_m) {
        let seen = if record.tool_m.is_empty() { &record.encoder_m } else { &record.tool_m };
        let distances_m = distances_m(&record.reference_m, seen, &kinds, row.meta.cycle_s);
        record.figures.set_contour(&distances_m);
    } else {
        record.figures.set_contour(&record.contour_m);
    }
}

pub(super) fn json_list(names: &[String]) -> String {
    serde_json::Value::from(names).to_string()
}

/// Writes a disturbance so that reading it gives the same bits.
pub(super) fn json_numbers(values: &[f64]) -> String {
    serde_json::Value::from(values.to_vec()).to_string()
}

/// Reads a list of numbers; a text that is not one is an empty list.
pub(super) fn numbers(text: Option<&str>) -> Vec<f64> {
    text.and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}

pub(super) fn as_integer(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}
