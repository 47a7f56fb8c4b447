//! `analyze`, `Analysis` and `refuse_divergent`: what a law will do, before its first run.

use ilc_rt::learning::Law;
use ilc_rt::learning::analysis::{self, Analysis, Estimate, Method, PdCondition, Question, Uncertainty};
use ilc_rt::learning::law::norm_optimal::Weights;
use ilc_rt::model::StateSpace;
use numpy::IntoPyArray;
use numpy::ndarray::Array1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::{Signal, give_signal, misfit, read_vector};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::laws;
use crate::model_argument::read_model;
use crate::python_law::PythonLaw;

/// What a law will do with a model.
///
/// ``u[j+1] = T u[j] + L_e r`` with ``T = L_u - L_e P``.
///
/// Attributes
/// ----------
/// converges, monotonic : bool
///     Whether the error converges; whether every run brings the input nearer
///     to its end.
/// why : str
///     The verdict as a sentence with its figures.
/// spectral_radius, spectral_radius_error : float
///     Largest absolute eigenvalue of T, and how far off it may be.
/// monotonic_factor, monotonic_factor_error : float or None
///     Largest singular value of T; None where it cannot be had.
/// transient_growth : float
///     How far an error may grow before it falls.
/// critical_frequency_hz, learnable_frequency_hz : float or None
///     First frequency at which a run makes the error grow, with the law's
///     filter and without; None if there is none.
/// robust_factor, robust_lifted, uncertainty_allowed : float or None
///     Worst factor of a run within the uncertainty given, over frequency and
///     over the whole run; the largest uncertainty that would do.
/// initial_error_rms, converged_error_rms : float or None
///     RMS error before learning and in the end, for the reference given.
/// expected_rms_limit : float or None
///     Expected RMS error in the end under the noise given.
#[pyclass(name = "Analysis", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyAnalysis {
    analysis: Analysis,
    n_inputs: usize,
    n_outputs: usize,
}

impl PyAnalysis {
    pub(crate) fn new(analysis: Analysis, model: &StateSpace) -> Self {
        Self { analysis, n_inputs: model.n_inputs(), n_outputs: model.n_outputs() }
    }
}

fn array<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyAny> {
    Array1::from(values.to_vec()).into_pyarray(py).into_any()
}

#[pymethods]
impl PyAnalysis {
    /// Samples of a run.
    #[getter]
    fn n_samples(&self) -> usize {
        self.analysis.n_samples
    }

    /// How the figures were found: `dense` or `structured`.
    #[getter]
    fn method(&self) -> &'static str {
        match self.analysis.method {
            Method::Dense => "dense",
            Method::Structured => "structured",
        }
    }

    /// Whether the error converges, without growing beyond all measure before.
    #[getter]
    fn converges(&self) -> bool {
        self.analysis.converges
    }

    /// Whether every run brings the input nearer to its end.
    #[getter]
    fn monotonic(&self) -> bool {
        self.analysis.monotonic
    }

    /// The verdict as a sentence with its figures.
    #[getter]
    fn why(&self) -> &str {
        &self.analysis.why
    }

    /// Largest absolute eigenvalue of T.
    #[getter]
    fn spectral_radius(&self) -> f64 {
        self.analysis.spectral_radius.value
    }

    /// How far off `spectral_radius` may be.
    #[getter]
    fn spectral_radius_error(&self) -> f64 {
        self.analysis.spectral_radius.error
    }

    /// Largest singular value of T: the worst factor of a run.
    #[getter]
    fn monotonic_factor(&self) -> Option<f64> {
        self.analysis.monotonic_factor.map(|factor| factor.value)
    }

    /// How far off `monotonic_factor` may be.
    #[getter]
    fn monotonic_factor_error(&self) -> Option<f64> {
        self.analysis.monotonic_factor.map(|Estimate { error, .. }| error)
    }

    /// How far an error may grow before it falls.
    #[getter]
    fn transient_growth(&self) -> f64 {
        self.analysis.transient_growth
    }

    /// Frequencies of `contraction` in Hz.
    #[getter]
    fn frequency_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        array(py, &self.analysis.frequency_hz)
    }

    /// Largest singular value of T at each frequency.
    #[getter]
    fn contraction<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        array(py, &self.analysis.contraction)
    }

    /// First frequency at which a run makes the error grow.
    #[getter]
    fn critical_frequency_hz(&self) -> Option<f64> {
        self.analysis.critical_frequency_hz
    }

    /// The same for the law without its filter.
    #[getter]
    fn learnable_frequency_hz(&self) -> Option<f64> {
        self.analysis.learnable_frequency_hz
    }

    /// Worst factor of a run within the uncertainty, over frequency.
    #[getter]
    fn robust_factor(&self) -> Option<f64> {
        self.analysis.robust_factor
    }

    /// The same over the whole run, for uncertainty that changes along it.
    #[getter]
    fn robust_lifted(&self) -> Option<f64> {
        self.analysis.robust_lifted
    }

    /// Largest uncertainty, the same at all frequencies, that would do.
    #[getter]
    fn uncertainty_allowed(&self) -> Option<f64> {
        self.analysis.uncertainty_allowed
    }

    /// RMS error before learning, for the reference given.
    #[getter]
    fn initial_error_rms(&self) -> Option<f64> {
        self.analysis.initial_error_rms
    }

    /// RMS error in the end, for the reference given.
    #[getter]
    fn converged_error_rms(&self) -> Option<f64> {
        self.analysis.converged_error_rms
    }

    /// Input in the end, shape (n_samples, n_inputs); None if not known.
    #[getter]
    fn converged_input<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let input = self.analysis.converged_input.clone();
        input.map(|input| give_signal(py, input, self.n_inputs, false)).transpose()
    }

    /// Error in the end, shape (n_samples, n_outputs); None if not known.
    #[getter]
    fn converged_error<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let error = self.analysis.converged_error.clone();
        error.map(|error| give_signal(py, error, self.n_outputs, false)).transpose()
    }

    /// Expected RMS error of each run under the noise given; may be empty.
    #[getter]
    fn expected_rms<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        array(py, &self.analysis.expected_rms)
    }

    /// Expected RMS error in the end under the noise given.
    #[getter]
    fn expected_rms_limit(&self) -> Option<f64> {
        self.analysis.expected_rms_limit
    }

    /// ``|1 - (kp + kd) p_1|`` of a proportional-derivative law.
    #[getter]
    fn pd_factor(&self) -> Option<f64> {
        self.analysis.pd_condition.as_ref().map(|condition| condition.factor)
    }

    /// Range of kp + kd in which that factor is below 1.
    #[getter]
    fn pd_gain_range(&self) -> Option<(f64, f64)> {
        self.analysis.pd_condition.as_ref().and_then(|condition: &PdCondition| condition.gain_range)
    }

    /// Return the figures as a dict of numbers, texts and None.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Everything but the signals; ready for JSON, infinities as None.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let figures = PyDict::new(py);
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let a = &self.analysis;
        figures.set_item("n_samples", a.n_samples)?;
        figures.set_item("method", self.method())?;
        figures.set_item("converges", a.converges)?;
        figures.set_item("monotonic", a.monotonic)?;
        figures.set_item("why", &a.why)?;
        for (name, value) in [
            ("spectral_radius", Some(a.spectral_radius.value)),
            ("spectral_radius_error", Some(a.spectral_radius.error)),
            ("monotonic_factor", self.monotonic_factor()),
            ("monotonic_factor_error", self.monotonic_factor_error()),
            ("transient_growth", Some(a.transient_growth)),
            ("critical_frequency_hz", a.critical_frequency_hz),
            ("learnable_frequency_hz", a.learnable_frequency_hz),
            ("robust_factor", a.robust_factor),
            ("robust_lifted", a.robust_lifted),
            ("uncertainty_allowed", a.uncertainty_allowed),
            ("initial_error_rms", a.initial_error_rms),
            ("converged_error_rms", a.converged_error_rms),
            ("expected_rms_limit", a.expected_rms_limit),
            ("pd_factor", self.pd_factor()),
        ] {
            figures.set_item(name, finite(value))?;
        }
        figures.set_item("expected_rms", a.expected_rms.clone())?;
        Ok(figures)
    }

    fn __str__(&self) -> String {
        let a = &self.analysis;
        let verdict = match (a.converges, a.monotonic) {
            (false, _) => "will not converge",
            (true, false) => "converges, not in every run",
            (true, true) => "converges in every run",
        };
        let mut lines = vec![format!("{verdict}: {}", a.why)];
        for (name, value) in [
            ("spectral radius", Some(a.spectral_radius.value)),
            ("worst factor of a run", self.monotonic_factor()),
            ("critical frequency in Hz", a.critical_frequency_hz),
            ("learnable frequency in Hz", a.learnable_frequency_hz),
            ("worst factor within the uncertainty", a.robust_factor),
            ("uncertainty allowed", a.uncertainty_allowed),
            ("RMS error before learning", a.initial_error_rms),
            ("RMS error in the end", a.converged_error_rms),
            ("expected RMS error in the end", a.expected_rms_limit),
        ] {
            if let Some(value) = value {
                lines.push(format!("  {name:36} {value:.6e}"));
            }
        }
        lines.join("\n")
    }

    fn __repr__(&self) -> String {
        let a = &self.analysis;
        let flag = |value: bool| if value { "True" } else { "False" };
        format!(
            "Analysis(converges={}, monotonic={}, spectral_radius={})",
            flag(a.converges),
            flag(a.monotonic),
            a.spectral_radius.value
        )
    }
}

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
/// updates; it should keep nothing from run to run. Up to 640 inputs whole
/// matrices are formed, beyond that products with signals.
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
    n_samples: Option<usize>,
    uncertainty: Option<&Bound<'_, PyAny>>,
    reference: Option<&Bound<'_, PyAny>>,
    noise_std: Option<f64>,
    n_runs: usize,
) -> PyResult<PyAnalysis> {
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
    Ok(PyAnalysis::new(found.or_raise()?, &model))
}

/// Refuse a law that will not converge with a model.
///
/// The quick part of `analyze`: less than a second up to 60 000 samples. A law
/// written in Python is let through.
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
    n_samples: usize,
) -> PyResult<()> {
    let model = read_model("model", model)?;
    let Some(mut law) = laws::own_law(law, n_samples, model.n_inputs())? else { return Ok(()) };
    detached(py, || analysis::refuse_divergent(law.as_mut(), &model, n_samples)).or_raise()
}

/// Reads a number or a list of gains.
pub(crate) fn read_uncertainty(
    object: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<Uncertainty>> {
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
    module.add_class::<PyAnalysis>()?;
    module.add_function(wrap_pyfunction!(analyze, module)?)?;
    module.add_function(wrap_pyfunction!(refuse_divergent, module)?)
}
