//! `analyze` and `refuse_divergent`: what a law will do, before its first run.

use std::ffi::CString;

use ilc_rt::learning::Law;
use ilc_rt::learning::analysis::{self, Question, Uncertainty};
use ilc_rt::learning::law::norm_optimal::Weights;
use ilc_rt::model::StateSpace;
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::analysis::PyAnalysis;
use crate::argument::{Signal, misfit, read_vector};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::laws;
use crate::made::made;
use crate::model_argument::read_model;
use crate::python_law::PythonLaw;
use crate::whole;

/// Say before the first run what a law will do with a model.
///
/// ``u[j+1] = T u[j] + L_e (r - d[j])`` with ``T = L_u - L_e P``.
///
/// Parameters
/// ----------
/// law : object or dict
///     A law of this package, any object with ``update(u, e, disturbance=None)``,
///     or the weights of norm-optimal learning, as ``{"q": 1.0, "r": 0.1}``.
/// model : StateSpace or compatible
///     Sampled model from the learned input to the measurement.
/// n_samples : int or None
///     Samples of a run; None where the law or the reference says.
/// uncertainty : float, array_like or None
///     How far the axes may be from the model, 0.2 for 20 %; an array holds gains
///     at equally spaced frequencies from zero to half the sample rate.
/// reference : array_like or None, shape (n_samples,) or (n_samples, n_outputs)
///     Error of a run with input zero: the reference itself where nothing but
///     the learned input moves the axis.
/// noise_std : float or None
///     Standard deviation of white noise in the measurement.
/// n_runs : int
///     Runs for which the expected error is told.
///
/// Returns
/// -------
/// Analysis
///
/// Raises
/// ------
/// LearningError
///     If the law is not linear, or something given does not fit.
/// ValueError, TypeError
///     If an argument has the wrong shape or kind.
///
/// Notes
/// -----
/// A law written in Python is tried for linearity, and reset before each of its
/// updates; it should keep nothing from run to run. Of a `Gate` or a `Ladder` the
/// law inside is analysed, with gain 1, of a law with bounds the same law without
/// them: a bound that is reached can only hold the input there. Up to 640 inputs whole
/// matrices are formed, beyond that products with signals; a law written in Python
/// is tried input by input up to 3000 of them, and has no `monotonic_factor` beyond.
///
/// References
/// ----------
/// [barton2010], Eq. (3.16) to (3.23); [dimarco2016], Eq. (3.4), which is no
/// condition for monotonic convergence: `monotonic_factor` is.
///
/// Examples
/// --------
/// >>> from ilc_rt import PdIlc, analyze, discretize, second_order
/// >>> axis = discretize(second_order(94.0, 0.7), 0.002)
/// >>> analyze({"q": 1.0, "s": 0.01, "r": 0.1}, axis, 200).monotonic
/// True
/// >>> analyze(PdIlc(kp=5.0, kd=0.0), axis, 200).converges
/// False
#[pyfunction]
#[pyo3(signature = (law, model, n_samples=None, uncertainty=None, reference=None, noise_std=None, n_runs=20))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
fn analyze(
    py: Python<'_>,
    law: &Bound<'_, PyAny>,
    model: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::maybe::n_samples)] n_samples: Option<usize>,
    uncertainty: Option<&Bound<'_, PyAny>>,
    reference: Option<&Bound<'_, PyAny>>,
    noise_std: Option<f64>,
    #[pyo3(from_py_with = whole::n_runs)] n_runs: usize,
) -> PyResult<PyAnalysis> {
    let made = made!("analyze": law, model, n_samples, uncertainty, reference, noise_std, n_runs);
    let model = read_model("model", model)?;
    let uncertainty = read_uncertainty(uncertainty)?;
    let reference = read_reference(reference, &model, n_samples)?;
    let known = n_samples.or_else(|| laws::samples_of(law));
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
    let mut law = read_law(law, &model, n_samples)?;
    let reference = reference.map(|signal| signal.values);
    let question = Question { uncertainty, reference, noise_std, n_runs };
    let found = detached(py, || analysis::analyze(law.as_mut(), &model, n_samples, &question));
    Ok(PyAnalysis::new(found.or_raise()?, &model, made))
}

/// Refuse a law that will not converge with a model.
///
/// The quick part of `analyze`: less than a second up to 60 000 samples. A law
/// written in Python is let through; of a `Gate` or a `Ladder` the law inside is
/// looked at, of a law with bounds the same law without them.
///
/// Parameters
/// ----------
/// law : object
///     The law.
/// model : StateSpace or compatible
///     Sampled model from the learned input to the measurement.
/// n_samples : int
///     Samples of a run.
///
/// Raises
/// ------
/// LearningError
///     With the figures.
///
/// Warns
/// -----
/// UserWarning
///     If the low-pass of the law begins above the frequency from which on the
///     law makes the error grow; both are named.
///
/// Examples
/// --------
/// >>> from ilc_rt import PdIlc, discretize, second_order
/// >>> from ilc_rt._native import refuse_divergent
/// >>> axis = discretize(second_order(94.0, 0.7), 0.002)
/// >>> refuse_divergent(PdIlc(kp=5.0, kd=0.0), axis, 400)
/// Traceback (most recent call last):
/// ilc_rt.LearningError: this law will not converge: ...
#[pyfunction]
fn refuse_divergent(
    py: Python<'_>,
    law: &Bound<'_, PyAny>,
    model: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
) -> PyResult<()> {
    let model = read_model("model", model)?;
    let Some(mut law) = laws::own_law(law, n_samples, model.n_inputs())? else { return Ok(()) };
    let found = detached(py, || {
        analysis::refuse_divergent(law.as_mut(), &model, n_samples)?;
        analysis::overreach(law.as_mut(), &model, n_samples)
    });
    match found.or_raise()? {
        Some(found) => warn(py, &found.to_string()),
        None => Ok(()),
    }
}

/// Warns as `warnings.warn` does.
fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let message = CString::new(message)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
}

/// Reads a number or a list of gains.
pub(crate) fn read_uncertainty(object: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Uncertainty>> {
    let Some(object) = object else { return Ok(None) };
    if let Ok(gain) = object.extract::<f64>() {
        return Ok(Some(Uncertainty::Scalar(gain)));
    }
    read_vector("uncertainty", object).map(|gains| Some(Uncertainty::Shaped(gains)))
}

/// Reads an error with a channel for each output.
pub(crate) fn read_reference(
    object: Option<&Bound<'_, PyAny>>,
    model: &StateSpace,
    n_samples: Option<usize>,
) -> PyResult<Option<Signal>> {
    let Some(object) = object else { return Ok(None) };
    let mut signal =
        Signal::read("reference", object)?.with_channels("reference", model.n_outputs())?;
    if let Some(n_samples) = n_samples {
        signal = signal.with_samples("reference", n_samples)?;
    }
    Ok(Some(signal))
}

/// Reads a law of this package, one written in Python, or the weights of an optimal one.
fn read_law(
    object: &Bound<'_, PyAny>,
    model: &StateSpace,
    n_samples: usize,
) -> PyResult<Box<dyn Law>> {
    if let Ok(named) = object.cast::<PyDict>() {
        let mut weights = Weights::default();
        for (name, value) in named {
            let name: String = name.extract()?;
            let value: f64 = value.extract()?;
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
        return laws::optimal(model, n_samples, weights).or_raise();
    }
    if let Some(law) = laws::own_law(object, n_samples, model.n_inputs())? {
        return Ok(law);
    }
    if !object.hasattr("update")? {
        return Err(PyTypeError::new_err(format!(
            "law = {}; an object with update(u, e, disturbance=None) or a dict of weights is needed",
            object.repr()?
        )));
    }
    if model.n_inputs() != model.n_outputs() {
        return Err(PyValueError::new_err(format!(
            "model has {} inputs and {} outputs; a law written in Python needs as many of either",
            model.n_inputs(),
            model.n_outputs()
        )));
    }
    Ok(Box::new(PythonLaw::new(object, model.n_inputs())?))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(analyze, module)?)?;
    module.add_function(wrap_pyfunction!(refuse_divergent, module)?)
}
