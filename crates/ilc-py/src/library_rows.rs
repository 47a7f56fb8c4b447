//! Rows of a library as Python exchanges them with other stores: texts of JSON, arrays as bytes.

use ilc_rt::library::{LibraryError, Row};
use ilc_rt::record::{IterationRecord, Meta};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyIterator, PyString};

use crate::answer::{ByName, by_name};
use crate::error::OrRaise;

/// An exception, of Python or of the library.
#[derive(Debug)]
pub(crate) struct Raised(pub(crate) PyErr);

impl From<LibraryError> for Raised {
    fn from(error: LibraryError) -> Self {
        Self(Err::<(), _>(error).or_raise().err().unwrap_or_else(|| PyValueError::new_err("")))
    }
}

/// Returns a row: names and numbers, lists and figures as JSON, arrays as little-endian float64.
pub(crate) fn give_row<'py>(py: Python<'py>, row: &Row) -> ByName<'py> {
    let Row { meta, record, .. } = row;
    let bytes = |values: &[f64]| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        PyBytes::new(py, &bytes)
    };
    let texts = |names: &[String]| json(names);
    let disturbance = Some(&record.disturbance).filter(|values| !values.is_empty());
    let tool = Some(&record.tool_m).filter(|values| !values.is_empty());
    Ok(by_name!(py,
        [row => id, created_utc]
        [meta => cell, campaign, fingerprint]
        iteration: record.index,
        program: &meta.program,
        law: &meta.law,
        law_parameters: &meta.law_parameters,
        measure: &meta.measure,
        cycle_s: meta.cycle_s,
        n_axes: meta.n_axes,
        axis_names: texts(&meta.axis_names)?,
        input_units: texts(&meta.input_units)?,
        n_samples: row.n_samples,
        disturbance: disturbance.map(json).transpose()?,
        digest: &row.digest,
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
    let get = |name: &str| {
        let missing = || PyKeyError::new_err(name.to_owned());
        row.get_item(name)?.ok_or_else(missing)
    };
    let text = |name: &str| get(name)?.extract::<String>();
    let count = |name: &str| get(name)?.extract::<usize>();
    let floats = |name: &str| {
        let array = get(name)?;
        if array.is_none() {
            return Ok::<Vec<f64>, PyErr>(Vec::new());
        }
        let (words, _) = array.cast::<PyBytes>()?.as_bytes().as_chunks();
        Ok(words.iter().map(|word| f64::from_le_bytes(*word)).collect())
    };
    let disturbance = get("disturbance")?;
    Ok(Row {
        id: get("id")?.extract()?,
        created_utc: text("created_utc")?,
        meta: Meta {
            cell: text("cell")?,
            campaign: text("campaign")?,
            fingerprint: text("fingerprint")?,
            law: text("law")?,
            law_parameters: text("law_parameters")?,
            measure: text("measure")?,
            program: text("program")?,
            cycle_s: get("cycle_s")?.extract()?,
            n_axes: count("n_axes")?,
            axis_names: parsed("axis_names", &get("axis_names")?)?,
            input_units: parsed("input_units", &get("input_units")?)?,
        },
        digest: text("digest")?,
        n_samples: count("n_samples")?,
        record: IterationRecord {
            index: get("iteration")?.extract()?,
            reference_m: floats("reference_m")?,
            input: floats("input")?,
            encoder_m: floats("encoder_m")?,
            tool_m: floats("tool_m")?,
            error_m: floats("error_m")?,
            contour_m: floats("contour_m")?,
            disturbance: if disturbance.is_none() {
                Vec::new()
            } else {
                parsed("disturbance", &disturbance)?
            },
            figures: parsed("figures", &get("figures")?)?,
        },
    })
}

fn json<T: serde::Serialize>(value: T) -> PyResult<String> {
    serde_json::to_string(&value).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Reads a text of JSON.
fn parsed<T: serde::de::DeserializeOwned>(name: &str, text: &Bound<'_, PyAny>) -> PyResult<T> {
    let text = text.cast::<PyString>()?.to_str()?;
    serde_json::from_str(text)
        .map_err(|error| PyValueError::new_err(format!("{name}: {error} in {text:.60}")))
}
