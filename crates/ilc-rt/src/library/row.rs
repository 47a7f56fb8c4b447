//! One row of the table: writing and reading.

use super::figures;
use crate::record::{AxisKinds, IterationRecord, Meta, distances_m};

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

/// Columns of a run beside its arrays and its figures, with their types.
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

/// Columns of the arrays of a run, with their types.
pub(super) const ARRAYS: [(&str, &str); 6] = [
    ("reference_m", "BLOB NOT NULL"),
    ("input", "BLOB NOT NULL"),
    ("encoder_m", "BLOB NOT NULL"),
    ("tool_m", "BLOB"),
    ("error_m", "BLOB NOT NULL"),
    ("contour_m", "BLOB NOT NULL"),
];

pub(super) fn read_row(row: &rusqlite::Row<'_>, with_arrays: bool) -> rusqlite::Result<Row> {
    let count = |name: &str| row.get::<_, i64>(name).map(|n| usize::try_from(n).unwrap_or(0));
    let list = |name: &str| -> rusqlite::Result<Vec<String>> {
        Ok(serde_json::from_str(&row.get::<_, String>(name)?).unwrap_or_default())
    };
    let array = |name: &str| -> rusqlite::Result<Vec<f64>> {
        if with_arrays {
            Ok(floats(&row.get::<_, Option<Vec<u8>>>(name)?.unwrap_or_default()))
        } else {
            Ok(Vec::new())
        }
    };
    Ok(Row {
        id: row.get("id")?,
        created_utc: row.get("created_utc")?,
        meta: Meta {
            cell: row.get("cell")?,
            campaign: row.get("campaign")?,
            fingerprint: row.get("fingerprint")?,
            law: row.get("law")?,
            law_parameters: row.get("law_parameters")?,
            measure: row.get("measure")?,
            program: row.get("program")?,
            cycle_s: row.get("cycle_s")?,
            n_axes: count("n_axes")?,
            axis_names: list("axis_names")?,
            input_units: list("input_units")?,
        },
        digest: row.get("digest")?,
        n_samples: count("n_samples")?,
        record: IterationRecord {
            index: row.get("iteration")?,
            reference_m: array("reference_m")?,
            input: array("input")?,
            encoder_m: array("encoder_m")?,
            tool_m: array("tool_m")?,
            error_m: array("error_m")?,
            contour_m: array("contour_m")?,
            disturbance: numbers(row.get::<_, Option<String>>("disturbance")?.as_deref()),
            figures: figures::read(row)?,
        },
    })
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

pub(super) fn blob(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f64> {
    let mut word = [0; 8];
    bytes
        .chunks_exact(8)
        .map(|chunk| {
            word.copy_from_slice(chunk);
            f64::from_le_bytes(word)
        })
        .collect()
}
