//! What is accepted wherever a model is expected.

use ilc_rt::learning::law::norm_optimal::Plant;
use ilc_rt::model::{StateSpace, TimeVarying};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::argument::{Matrix, read_matrix};
use crate::error::OrRaise;
use crate::model::PyStateSpace;
use crate::time_varying::PyTimeVarying;

/// Reads a model: one of ours, or any object with the attributes `A`, `B`, `C`, `D` and `dt`, as
/// those of scipy.signal and python-control have.
pub(crate) fn read_model(name: &str, object: &Bound<'_, PyAny>) -> PyResult<StateSpace> {
    if let Ok(own) = object.cast::<PyStateSpace>() {
        return Ok(own.get().model().clone());
    }
    let part = |attribute: &str| -> PyResult<Matrix> {
        let matrix = object.getattr(attribute).map_err(|_| foreign(name, object))?;
        read_matrix(&format!("{name}.{attribute}"), &matrix)
    };
    let (a, b, c, d) = (part("A")?, part("B")?, part("C")?, part("D")?);
    let dt = object.getattr("dt").map_err(|_| foreign(name, object))?;
    if dt.is_instance_of::<PyBool>() {
        return Err(PyValueError::new_err(format!(
            "{name}.dt = {dt} does not say how long a sample is; give a sample time in seconds"
        )));
    }
    StateSpace::new(a, b, c, d, read_sample_time(&format!("{name}.dt"), &dt)?).or_raise()
}

/// A model that may vary along the run.
#[derive(Debug)]
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

    pub(crate) fn n_inputs(&self) -> usize {
        self.plant().at(0).n_inputs()
    }

    pub(crate) fn n_outputs(&self) -> usize {
        self.plant().at(0).n_outputs()
    }
}

/// Reads a `TimeVarying`, or whatever [`read_model`] does.
pub(crate) fn read_any_model(name: &str, object: &Bound<'_, PyAny>) -> PyResult<AnyModel> {
    if let Ok(own) = object.cast::<PyTimeVarying>() {
        return Ok(AnyModel::Varying(own.get().model().clone()));
    }
    read_model(name, object).map(AnyModel::Invariant)
}

/// Reads a sample time: `None` and 0 both mean continuous.
pub(crate) fn read_sample_time(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    if object.is_none() {
        return Ok(None);
    }
    let dt_s: f64 = object.extract().map_err(|_| {
        PyTypeError::new_err(format!("{name} = {object}; a number of seconds or None is needed"))
    })?;
    Ok(if dt_s == 0.0 { None } else { Some(dt_s) })
}

fn foreign(name: &str, object: &Bound<'_, PyAny>) -> PyErr {
    let kind = object.get_type().name().map_or_else(|_| "?".to_owned(), |kind| kind.to_string());
    PyTypeError::new_err(format!(
        "{name} is a {kind}; a StateSpace, or an object with A, B, C, D and dt, is needed"
    ))
}
