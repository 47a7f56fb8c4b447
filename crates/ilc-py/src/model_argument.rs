//! Accepted models: our own, and those of scipy.signal and python-control.

use ilc_rt::learning::law::norm_optimal::Plant;
use ilc_rt::model::{StateSpace, TimeVarying, from_transfer_matrix};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::argument::{Channels, Matrix, read_matrix, read_vector};
use crate::error::OrRaise;
use crate::model::PyStateSpace;
use crate::time_varying::PyTimeVarying;
use crate::whole::number;

/// Reads a model: one of ours, or one of scipy.signal or python-control. State-space objects have the
/// attributes `A`, `B`, `C`, `D` and `dt`; scipy's other kinds have a method `to_ss`, and
/// python-control's transfer functions nested lists `num` and `den`.
pub(crate) fn read_model(name: &str, object: &Bound<'_, PyAny>) -> PyResult<StateSpace> {
    if let Ok(own) = object.cast::<PyStateSpace>() {
        return Ok(own.get().model.clone());
    }
    if !object.hasattr("A")? {
        // python-control's have a to_ss as well, but it refuses matrices; `ninputs` distinguishes
        // them.
        if object.hasattr("ninputs")? && object.hasattr("num")? && object.hasattr("den")? {
            return read_transfer_matrix(name, object);
        }
        if object.hasattr("to_ss")? {
            return read_model(name, &object.call_method0("to_ss")?);
        }
    }
    let part = |attribute: &str| -> PyResult<Matrix> {
        let matrix = object.getattr(attribute).map_err(|_| foreign(name, object))?;
        read_matrix(&format!("{name}.{attribute}"), &matrix)
    };
    let (a, b, c, d) = (part("A")?, part("B")?, part("C")?, part("D")?);
    StateSpace::new(a, b, c, d, read_time_base(name, object)?).or_raise()
}

/// Reads a matrix of transfer functions: one row per output, with one polynomial per input.
fn read_transfer_matrix(name: &str, object: &Bound<'_, PyAny>) -> PyResult<StateSpace> {
    let rows = |part: &str| -> PyResult<Vec<Vec<Bound<'_, PyAny>>>> {
        object.getattr(part)?.extract().map_err(|_| foreign(name, object))
    };
    let (num, den) = (rows("num")?, rows("den")?);
    let read = |part: &str, polynomial: Option<&Bound<'_, PyAny>>| {
        let polynomial = polynomial.ok_or_else(|| foreign(name, object))?;
        read_vector(&format!("{name}.{part}"), polynomial)
    };
    let mut entries = Vec::with_capacity(num.len());
    for (row, numerators) in num.iter().enumerate() {
        let entry = |(col, numerator)| {
            let denominator = den.get(row).and_then(|row| row.get(col));
            Ok((read("num", Some(numerator))?, read("den", denominator)?))
        };
        entries.push(numerators.iter().enumerate().map(entry).collect::<PyResult<Vec<_>>>()?);
    }
    from_transfer_matrix(&entries, read_time_base(name, object)?).or_raise()
}

/// Reads the sample time of an object of scipy.signal or python-control.
fn read_time_base(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    let dt = object.getattr("dt").map_err(|_| foreign(name, object))?;
    if dt.is_instance_of::<PyBool>() {
        return Err(PyValueError::new_err(format!(
            "{name}.dt = {dt} does not say how long a sample is; give a sample time in seconds"
        )));
    }
    read_sample_time(&format!("{name}.dt"), &dt)
}

/// A time-invariant or time-varying model.
#[derive(Debug, Clone)]
pub(crate) enum AnyModel {
    Invariant(StateSpace),
    Varying(TimeVarying),
}

impl AnyModel {
    pub(crate) fn plant(&self) -> Plant<'_> {
        match self {
            Self::Invariant(model) => model.into(),
            Self::Varying(model) => model.into(),
        }
    }

    pub(crate) fn channels(&self) -> Channels {
        Channels::of(self.plant().at(0))
    }
}

/// Reads a `TimeVarying`, or any model that [`read_model`] accepts.
pub(crate) fn read_any_model(name: &str, object: &Bound<'_, PyAny>) -> PyResult<AnyModel> {
    if let Ok(own) = object.cast::<PyTimeVarying>() {
        return Ok(AnyModel::Varying(own.get().model.clone()));
    }
    read_model(name, object).map(AnyModel::Invariant)
}

/// Reads a sample time: `None` and 0 both mean continuous.
pub(crate) fn read_sample_time(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    if object.is_none() {
        return Ok(None);
    }
    let dt_s = number(name, object)?;
    Ok(if dt_s == 0.0 { None } else { Some(dt_s) })
}

fn foreign(name: &str, object: &Bound<'_, PyAny>) -> PyErr {
    let kind = object.get_type().name().map_or_else(|_| "?".to_owned(), |kind| kind.to_string());
    PyTypeError::new_err(format!(
        "{name} is a {kind}; a StateSpace, or a model of scipy.signal or python-control, is needed"
    ))
}
