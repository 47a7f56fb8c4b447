//! Analysis, tuning and repeatability of laws: `analyze`, `refuse_divergent`, `tune`,
//! `repeatability`.
//!
//! Each returns its figures by name; the classes that hold them are those of `ilc_rt.analysis`.

use std::ffi::CString;

use ilc_rt::learning::analysis::{self, Analysis, Question, Uncertainty};
use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};
use ilc_rt::learning::tune::{Knowledge, TuningStep, tune as propose};
use ilc_rt::learning::{self, Law};
use ilc_rt::model::StateSpace;
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answer::{ByName, by_name, give_signal, give_vector};
use crate::argument::{Channels, Signal, misfit, read_array, read_vector};
use crate::arguments::Arguments;
use crate::detached::computed;
use crate::error::OrRaise;
use crate::laws;
use crate::whole::{number, whole};

#[pyfunction]
pub(crate) fn analyze<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let model = a.model("model")?;
    let law = a.get("law")?;
    let given = a.maybe("n_samples", whole)?;
    let reference = read_reference(a, &model, given)?;
    let known = given.map_or_else(|| laws::samples_of(&law), |given| Ok(Some(given)))?;
    let of_reference = reference.as_ref().map(|signal| signal.n_samples);
    let Some(n_samples) = known.or(of_reference) else {
        return Err(PyValueError::new_err(
            "n_samples = None; the samples of a run are needed, as neither law nor reference say them",
        ));
    };
    if let Some(found) = &reference
        && found.n_samples != n_samples
    {
        let rule = format!("({n_samples}, {})", model.n_outputs());
        return Err(misfit("reference", &found.shape(), &rule));
    }
    let question = Question {
        uncertainty: read_uncertainty(a)?,
        reference: reference.map(|signal| signal.values),
        noise_std: a.maybe_number("noise_std")?,
        n_runs: a.whole("n_runs")?,
    };
    let mut law = read_law(&law, &model, n_samples)?;
    let found = computed(a.py(), || analysis::analyze(law.as_mut(), &model, n_samples, &question))?;
    figures(a.py(), &found, &model)
}

/// Returns the figures of an analysis by the names of `ilc_rt.Analysis`.
fn figures<'py>(py: Python<'py>, found: &Analysis, model: &StateSpace) -> ByName<'py> {
    let array = |values: &[f64]| give_vector(py, values.to_vec());
    let signal = |values: &Option<Vec<f64>>, n_channels| {
        let values = values.clone();
        values.map(|values| give_signal(py, values, n_channels, false)).transpose()
    };
    let (factor, condition) = (found.monotonic_factor, found.pd_condition.as_ref());
    Ok(by_name!(py,
        [found => n_samples, converges, monotonic, why, transient_growth]
        [found => critical_frequency_hz, learnable_frequency_hz]
        [found => robust_factor, robust_lifted, uncertainty_allowed]
        [found => initial_error_rms, converged_error_rms, expected_rms_limit]
        method: found.method.name(),
        spectral_radius: found.spectral_radius.value,
        spectral_radius_error: found.spectral_radius.error,
        monotonic_factor: factor.map(|factor| factor.value),
        monotonic_factor_error: factor.map(|factor| factor.error),
        pd_factor: condition.map(|condition| condition.factor),
        pd_gain_range: condition.and_then(|condition| condition.gain_range),
        frequency_hz: array(&found.frequency_hz),
        contraction: array(&found.contraction),
        converged_input: signal(&found.converged_input, model.n_inputs())?,
        converged_error: signal(&found.converged_error, model.n_outputs())?,
        expected_rms: array(&found.expected_rms),
    ))
}

#[pyfunction]
pub(crate) fn refuse_divergent(a: Arguments<'_, '_>) -> PyResult<()> {
    let (model, n_samples) = (a.model("model")?, a.whole("n_samples")?);
    let law = a.get("law")?;
    if laws::is_python(&law)? {
        return Ok(());
    }
    let mut law = laws::apart("law", &law, n_samples, Channels::of(&model), 0)?;
    let found = computed(a.py(), || {
        analysis::refuse_divergent(law.as_mut(), &model, n_samples)?;
        analysis::overreach(law.as_mut(), &model, n_samples)
    })?;
    let Some(found) = found else { return Ok(()) };
    let message = CString::new(found.to_string())?;
    PyErr::warn(a.py(), &a.py().get_type::<PyUserWarning>(), &message, 2)
}

/// Reads a number or a list of gains.
fn read_uncertainty(a: Arguments<'_, '_>) -> PyResult<Option<Uncertainty>> {
    a.maybe("uncertainty", |name, given| {
        if let Ok(gain) = given.extract::<f64>() {
            return Ok(Uncertainty::Scalar(gain));
        }
        read_vector(name, given).map(Uncertainty::Shaped)
    })
}

/// Reads an error with one channel per output.
fn read_reference(
    a: Arguments<'_, '_>,
    model: &StateSpace,
    n_samples: Option<usize>,
) -> PyResult<Option<Signal>> {
    a.maybe("reference", |name, given| {
        let signal = Signal::read(name, given)?.with_channels(name, model.n_outputs())?;
        let n_samples = n_samples.unwrap_or(signal.n_samples);
        signal.with_samples(name, n_samples)
    })
}

/// Reads a law, native or written in Python, or the weights of a norm-optimal one.
fn read_law(
    object: &Bound<'_, PyAny>,
    model: &StateSpace,
    n_samples: usize,
) -> PyResult<Box<dyn Law>> {
    if let Ok(named) = object.cast::<PyDict>() {
        let mut weights = Weights::default();
        for (name, value) in named {
            let name: String = name.extract()?;
            let value = number(&name, &value)?;
            match name.as_str() {
                "q" => weights.q = value,
                "s" => weights.s = value,
                "r" => weights.r = value,
                "rate" => weights.rate = value,
                _ => {
                    return Err(PyValueError::new_err(format!(
                        "law = {{{name:?}: {value}}}; the weights are q, s, r and rate"
                    )));
                }
            }
        }
        return Ok(Box::new(NormOptimal::new(model, n_samples, weights).or_raise()?));
    }
    if !object.hasattr("update")? {
        return Err(PyTypeError::new_err(format!(
            "law = {}; an object with update(u, e, disturbance=None) or a dict of weights is needed",
            object.repr()?
        )));
    }
    laws::apart("law", object, n_samples, Channels::of(model), 0)
}

#[pyfunction]
pub(crate) fn tune<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (model, n_samples) = (a.model("model")?, a.whole("n_samples")?);
    let knowledge = Knowledge {
        uncertainty: read_uncertainty(a)?,
        noise_std: a.maybe_number("noise_std")?,
        reference: read_reference(a, &model, Some(n_samples))?.map(|found| found.values),
        n_runs: a.whole("n_runs")?,
    };
    let found = computed(a.py(), || propose(&model, n_samples, &knowledge))?;
    let analysis = figures(a.py(), &found.analysis, &model)?;
    let step = |step: &TuningStep| -> ByName<'py> {
        let value = Some(step.value).filter(|value| value.is_finite());
        Ok(by_name!(a.py(), [step => name, what, why] value: value))
    };
    let steps: PyResult<Vec<_>> = found.steps.iter().map(step).collect();
    Ok(by_name!(a.py(), [found => q, s, r, smoothing_hz] steps: steps?, analysis: analysis))
}

#[pyfunction]
pub(crate) fn repeatability<'py>(errors: &Bound<'py, PyAny>) -> ByName<'py> {
    let py = errors.py();
    let (values, shape) = read_array("errors", errors)?;
    let (count, n_samples, n_channels) = match shape[..] {
        [count, n_samples] if !values.is_empty() => (count, n_samples, 1),
        [count, n_samples, n_channels] if !values.is_empty() => (count, n_samples, n_channels),
        _ => {
            let rule = "(n_runs, n_samples) or (n_runs, n_samples, n_channels)";
            return Err(misfit("errors", &shape, rule));
        }
    };
    let is_flat = shape.len() == 2;
    let found = computed(py, || learning::repeatability(&values, count, n_samples, n_channels))?;
    Ok(by_name!(py,
        [found => mean_rms, spread_rms, ratio, learnable, least_rms, largest_rms]
        mean: give_signal(py, found.mean, n_channels, is_flat)?,
        spread: give_signal(py, found.spread, n_channels, is_flat)?,
    ))
}
