//! `Analysis`: the figures of what a law will do.

use ilc_rt::learning::analysis::{Analysis, Estimate, Method, PdCondition};
use ilc_rt::model::StateSpace;
use numpy::IntoPyArray;
use numpy::ndarray::Array1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::give_signal;
use crate::made::Made;

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
///     Worst factor of a run within the uncertainty given, over frequency; an
///     upper bound of it over the whole run; the largest uncertainty that would do.
/// initial_error_rms, converged_error_rms : float or None
///     RMS error before learning and in the end, for the reference given.
/// expected_rms_limit : float or None
///     Expected RMS error in the end under the noise given.
#[pyclass(name = "Analysis", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyAnalysis {
    made: Made,
    analysis: Analysis,
    n_inputs: usize,
    n_outputs: usize,
}

impl PyAnalysis {
    pub(crate) fn new(analysis: Analysis, model: &StateSpace, made: Made) -> Self {
        Self { made, analysis, n_inputs: model.n_inputs(), n_outputs: model.n_outputs() }
    }
}

fn array<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyAny> {
    Array1::from(values.to_vec()).into_pyarray(py).into_any()
}

#[pymethods]
impl PyAnalysis {
    /// Pickled and copied as the call that made it, which is made again.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

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

    /// Upper bound of that factor over the whole run.
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

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyAnalysis>()
}
