//! `RelevanceWeights`.

use ilc_rt::learning::law::relevance::RelevanceWeights;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::argument::read_disturbance;
use crate::error::OrRaise;
use crate::made::{Made, made};

/// What makes a past run relevant for the coming one.
///
/// ``N_j = 1 / (sum_k [e |e_j|^2 + er |de_j/dt|^2 + sum d (d_i - d_j)^2] + epsilon)``
///
/// Parameters
/// ----------
/// e : float
///     Weight of the error.
/// er : float
///     Weight of the error's rate.
/// d : float, array_like of float64, shape (n_disturbances,), or None
///     Weight of the distance in disturbance; one number holds for each of them,
///     None is 0.5.
/// epsilon : float
///     Added to every sum: below it runs count as equally good. Choose the
///     weights in proportion to it.
/// rate_filter_s : float
///     Time constant in seconds of the filter that gives the error's rate,
///     ``s / (rate_filter_s s + 1)``.
/// error_gain, input_gain : float
///     Gains Gamma_1 of what the core law adds to an input, and Gamma_2 of the
///     input itself.
///
/// Raises
/// ------
/// LearningError
///     If a weight is negative or not finite.
///
/// Notes
/// -----
/// The sum runs over the samples of a run, as in the source's listing. Its
/// integral is the sum times the sample time, a factor that cancels in the
/// weights; only epsilon is then scaled alike. The defaults are the source's,
/// for errors of the order of 1: with errors in metres choose e and er larger.
///
/// References
/// ----------
/// [dimarco2016], Eq. (4.12), (4.13), Appendix C.
///
/// Examples
/// --------
/// >>> from ilc_rt import RelevanceWeights
/// >>> RelevanceWeights(e=10.0, er=2.0, d=0.5).epsilon
/// 1.0
#[pyclass(name = "RelevanceWeights", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyRelevanceWeights {
    made: Made,
    weights: RelevanceWeights,
}

#[pymethods]
impl PyRelevanceWeights {
    #[new]
    #[pyo3(signature = (e=10.0, er=2.0, d=None, epsilon=1.0, rate_filter_s=0.1, error_gain=1.0, input_gain=1.0))]
    fn new(
        e: f64,
        er: f64,
        d: Option<&Bound<'_, PyAny>>,
        epsilon: f64,
        rate_filter_s: f64,
        error_gain: f64,
        input_gain: f64,
    ) -> PyResult<Self> {
        let made = made!(e, er, d, epsilon, rate_filter_s, error_gain, input_gain);
        let disturbance = match d {
            Some(d) => read_disturbance("d", d)?,
            None => vec![0.5],
        };
        let n = disturbance.len();
        let weights = RelevanceWeights {
            error: e,
            error_rate: er,
            disturbance,
            epsilon,
            rate_filter_s,
            error_gain,
            input_gain,
        };
        weights.clone().spread(n).or_raise()?;
        Ok(Self { made, weights })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Weight of the error.
    #[getter]
    fn e(&self) -> f64 {
        self.weights.error
    }

    /// Weight of the error's rate.
    #[getter]
    fn er(&self) -> f64 {
        self.weights.error_rate
    }

    /// Weights of the disturbances, shape (n_disturbances,) or (1,) for all.
    #[getter]
    fn d<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.weights.disturbance.clone().into_pyarray(py)
    }

    /// The sum below which runs count as equally good.
    #[getter]
    fn epsilon(&self) -> f64 {
        self.weights.epsilon
    }

    /// Time constant of the rate's filter in seconds.
    #[getter]
    fn rate_filter_s(&self) -> f64 {
        self.weights.rate_filter_s
    }

    /// Gain of what the core law adds.
    #[getter]
    fn error_gain(&self) -> f64 {
        self.weights.error_gain
    }

    /// Gain of the input itself.
    #[getter]
    fn input_gain(&self) -> f64 {
        self.weights.input_gain
    }

    fn __repr__(&self) -> String {
        let w = &self.weights;
        format!(
            "RelevanceWeights(e={}, er={}, d={:?}, epsilon={}, rate_filter_s={}, error_gain={}, \
             input_gain={})",
            w.error,
            w.error_rate,
            w.disturbance,
            w.epsilon,
            w.rate_filter_s,
            w.error_gain,
            w.input_gain
        )
    }
}

/// Reads `RelevanceWeights` or the three numbers `(e, er, d)`.
pub(super) fn read_weights(weights: &Bound<'_, PyAny>) -> PyResult<RelevanceWeights> {
    if let Ok(weights) = weights.cast::<PyRelevanceWeights>() {
        return Ok(weights.get().weights.clone());
    }
    let (e, er, d): (f64, f64, Bound<'_, PyAny>) = weights.extract().map_err(|_| {
        let shown = weights.repr().map(|text| text.to_string()).unwrap_or_default();
        pyo3::exceptions::PyTypeError::new_err(format!(
            "weights = {shown}: RelevanceWeights or a tuple (e, er, d) is needed"
        ))
    })?;
    PyRelevanceWeights::new(e, er, Some(&d), 1.0, 0.1, 1.0, 1.0).map(|made| made.weights)
}
