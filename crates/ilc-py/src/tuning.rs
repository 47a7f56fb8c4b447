//! `tune` and `Tuning`: weights of norm-optimal learning, with the reasons.

use ilc_rt::learning::tune::{self, Knowledge, Tuning};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::analysis::PyAnalysis;
use crate::analyze::{read_reference, read_uncertainty};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::model_argument::read_model;
use crate::whole;

/// Weights of norm-optimal learning, with the reasons for them.
///
/// Attributes
/// ----------
/// q, s, r : float
///     Weights of error, input and change of input.
/// smoothing_hz : float or None
///     Bandwidth beyond which the learned input holds little but noise.
/// steps : list of dict
///     ``name``, ``what``, ``value`` and ``why`` of each step.
/// analysis : Analysis
///     What the law with these weights will do.
#[pyclass(name = "Tuning", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyTuning {
    made: Made,
    tuning: Tuning,
    analysis: Py<PyAnalysis>,
}

#[pymethods]
impl PyTuning {
    /// Pickled and copied as the call that made it, which is made again.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Weight of the error.
    #[getter]
    fn q(&self) -> f64 {
        self.tuning.q
    }

    /// Weight of the input.
    #[getter]
    fn s(&self) -> f64 {
        self.tuning.s
    }

    /// Weight of the change of the input.
    #[getter]
    fn r(&self) -> f64 {
        self.tuning.r
    }

    /// Bandwidth in Hz beyond which the input holds little but noise.
    #[getter]
    fn smoothing_hz(&self) -> Option<f64> {
        self.tuning.smoothing_hz
    }

    /// What was chosen in each step, and why.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let step = |step: &tune::TuningStep| {
            let entry = PyDict::new(py);
            entry.set_item("name", step.name)?;
            entry.set_item("what", step.what)?;
            entry.set_item("value", Some(step.value).filter(|value| value.is_finite()))?;
            entry.set_item("why", &step.why)?;
            Ok(entry)
        };
        self.tuning.steps.iter().map(step).collect()
    }

    /// What the law with these weights will do.
    #[getter]
    fn analysis(&self, py: Python<'_>) -> Py<PyAnalysis> {
        self.analysis.clone_ref(py)
    }

    fn __str__(&self) -> String {
        let Tuning { q, s, r, steps, .. } = &self.tuning;
        let mut lines = vec![format!("q = {q}, s = {s:.6e}, r = {r:.6e}")];
        lines.extend(
            steps.iter().map(|step| format!("  {:10} {:12} {}", step.name, step.what, step.why)),
        );
        lines.join("\n")
    }

    fn __repr__(&self) -> String {
        let Tuning { q, s, r, .. } = &self.tuning;
        format!("Tuning(q={q}, s={s}, r={r})")
    }
}

/// Propose the weights of norm-optimal learning, with the reasons.
///
/// The guidelines s1 to s4: ``q = 1``; the smallest s that is robust, times 2; r
/// until the error under noise does not get smaller; a check of the result.
///
/// Parameters
/// ----------
/// model : StateSpace or compatible
///     Sampled model from the learned input to the measurement.
/// n_samples : int
///     Samples of a run.
/// uncertainty : float, array_like or None
///     How far the axes may be from the model, 0.2 for 20 %; an array holds gains
///     at equally spaced frequencies from zero to half the sample rate.
/// noise_std : float or None
///     Standard deviation of white noise in the measurement.
/// reference : array_like or None, shape (n_samples,) or (n_samples, n_outputs)
///     Error of a run with input zero.
/// n_runs : int
///     Runs in which learning should be done.
///
/// Returns
/// -------
/// Tuning
///
/// Raises
/// ------
/// LearningError
///     If something given does not fit.
/// ValueError, TypeError
///     If an argument has the wrong shape or kind.
///
/// References
/// ----------
/// [barton2010], Sec. 3.3.4.
///
/// Examples
/// --------
/// >>> from ilc_rt import discretize, second_order, tune
/// >>> axis = discretize(second_order(94.0, 0.7), 0.002)
/// >>> tuning = tune(axis, 300, uncertainty=0.3, noise_std=1e-6)
/// >>> tuning.q, tuning.s, tuning.r > 0
/// (1.0, 0.0, True)
#[pyfunction]
#[pyo3(name = "tune", signature = (model, n_samples, uncertainty=None, noise_std=None, reference=None, n_runs=10))]
fn propose(
    py: Python<'_>,
    model: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
    uncertainty: Option<&Bound<'_, PyAny>>,
    noise_std: Option<f64>,
    reference: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = whole::n_runs)] n_runs: usize,
) -> PyResult<PyTuning> {
    let made = made!("tune": model, n_samples, uncertainty, noise_std, reference, n_runs);
    let model = read_model("model", model)?;
    let knowledge = Knowledge {
        uncertainty: read_uncertainty(uncertainty)?,
        noise_std,
        reference: read_reference(reference, &model, Some(n_samples))?.map(|found| found.values),
        n_runs,
    };
    let tuning = detached(py, || tune::tune(&model, n_samples, &knowledge)).or_raise()?;
    let part = made.part(py, "analysis");
    let analysis = Py::new(py, PyAnalysis::new(tuning.analysis.clone(), &model, part))?;
    Ok(PyTuning { made, tuning, analysis })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyTuning>()?;
    module.add_function(wrap_pyfunction!(propose, module)?)
}
