//! Rows of a library as Python exchanges them with other stores: texts of JSON, arrays as bytes.

use ilc_rt::library::Row;
use ilc_rt::record::{IterationRecord, Meta};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyIterator, PyString};

use crate::answer::{ByName, by_name};
use crate::arguments::read;
use crate::error::Raised;

/// Returns a row: names and numbers, lists and figures as JSON, arrays as little-endian float64.
pub(crate) fn give_row<'py>(py: Python<'py>, row: &Row) -> ByName<'py> {
    let Row { meta, record, .. } = row;
    let bytes = |values: &[f64]| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        PyBytes::new(py, &bytes)
    };
    let disturbance = Some(&record.disturbance).filter(|values| !values.is_empty());
    let tool = Some(&record.tool_m).filter(|values| !values.is_empty());
    Ok(by_name!(py,
        [row => id, created_utc, n_samples, digest]
        [meta => cell, campaign, fingerprint, program, law, law_parameters]
        [meta => measure, cycle_s, n_axes]
        iteration: record.index,
        axis_names: json(&meta.axis_names)?,
        input_units: json(&meta.input_units)?,
        disturbance: disturbance.map(json).transpose()?,
        figures: json(&record.figures)?,
        reference_m: bytes(&record.reference_m),
        input: bytes(&record.input),
        encoder_m: bytes(&record.encoder_m),
        tool_m: tool.map(|values| bytes(values)),
        error_m: bytes(&record.error_m),
        contour_m: bytes(&record.contour_m),
    ))
}

/// Reads the next row of an iterator; `None` after the last.
pub(crate) fn next_row(rows: &Py<PyIterator>) -> Option<Result<Row, Raised>> {
    Python::attach(|py| {
        let next = rows.bind(py).clone().next()?;
        Some(next.and_then(|row| read_row(row.cast()?)).map_err(Raised))
    })
}

/// Reads a row, as [`give_row`] returns it.
fn read_row(row: &Bound<'_, PyDict>) -> PyResult<Row> {
    let row = Columns(row);
    let meta = read!(row, Meta:
        [plain => cell, campaign, fingerprint, program, law, law_parameters]
        [plain => measure, cycle_s, n_axes]
        [parsed => axis_names, input_units]
    );
    let record = read!(row, IterationRecord:
        [floats => reference_m, input, encoder_m, tool_m, error_m, contour_m]
        [parsed => figures]
        index: row.plain("iteration")?,
        disturbance: match row.get("disturbance")? {
            none if none.is_none() => Vec::new(),
            _ => row.parsed("disturbance")?,
        },
    );
    Ok(read!(row, Row:
        [plain => id, created_utc, n_samples, digest]
        meta: meta,
        record: record,
    ))
}

/// The columns of a row by name.
#[derive(Clone, Copy)]
struct Columns<'a, 'py>(&'a Bound<'py, PyDict>);

impl<'py> Columns<'_, 'py> {
    fn get(self, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.0.get_item(name)?.ok_or_else(|| PyKeyError::new_err(name.to_owned()))
    }

    fn plain<T: for<'a> FromPyObject<'a, 'py, Error = PyErr>>(self, name: &str) -> PyResult<T> {
        self.get(name)?.extract()
    }

    /// Reads an array; `None` is an empty one.
    fn floats(self, name: &str) -> PyResult<Vec<f64>> {
        let array = self.get(name)?;
        if array.is_none() {
            return Ok(Vec::new());
        }
        let (words, _) = array.cast::<PyBytes>()?.as_bytes().as_chunks();
        Ok(words.iter().map(|word| f64::from_le_bytes(*word)).collect())
    }

    /// Reads a text of JSON.
    fn parsed<T: serde::de::DeserializeOwned>(self, name: &str) -> PyResult<T> {
        let given = self.get(name)?;
        let text = given.cast::<PyString>()?.to_str()?;
        serde_json::from_str(text)
            .map_err(|error| PyValueError::new_err(format!("{name}: {error} in {text:.60}")))
    }
}

fn json<T: serde::Serialize>(value: T) -> PyResult<String> {
    serde_json::to_string(&value).map_err(|error| PyValueError::new_err(error.to_string()))
}
