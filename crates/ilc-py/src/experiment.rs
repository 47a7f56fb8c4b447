//! An identification experiment as Python describes it.

use ilc_rt::config::Cell;
use ilc_rt::identification::Experiment;
use ilc_rt::model::identify::{Excitation, Waveform};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::OrRaise;

/// Reads any object with the attributes of `ilc_rt.experiment.Experiment`.
pub(crate) fn read_experiment(object: &Bound<'_, PyAny>, cell: &Cell) -> PyResult<Experiment> {
    let waveform: String = object.getattr("waveform")?.extract()?;
    let amplitude: Option<f64> = object.getattr("amplitude")?.extract()?;
    let experiment = Experiment {
        axis: object.getattr("axis")?.extract()?,
        excitation: Excitation {
            waveform: read_waveform(&waveform)?,
            amplitude: amplitude.unwrap_or(1.0),
            from_hz: object.getattr("from_hz")?.extract()?,
            to_hz: object.getattr("to_hz")?.extract()?,
            period_s: object.getattr("period_s")?.extract()?,
            periods: object.getattr("periods")?.extract()?,
        },
        at_m: object.getattr("at_m")?.extract()?,
    };
    match amplitude {
        Some(_) => Ok(experiment),
        None => experiment.with_default_amplitude(cell).or_raise(),
    }
}

/// Reads the name of a waveform.
pub(crate) fn read_waveform(name: &str) -> PyResult<Waveform> {
    match name {
        "sweep" => Ok(Waveform::LogarithmicSweep),
        "linear-sweep" => Ok(Waveform::LinearSweep),
        "multisine" => Ok(Waveform::Multisine),
        _ => Err(PyValueError::new_err(format!(
            "waveform = '{name}'; 'sweep', 'linear-sweep' or 'multisine' is needed"
        ))),
    }
}
