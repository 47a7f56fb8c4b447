//! `ModelInverseIlc`.

use ilc_rt::learning::Law;
use ilc_rt::learning::law::model_inverse::ModelInverse;
use ilc_rt::learning::law::q_filter::QFilter;
use pyo3::prelude::*;

use super::fixed_size::FixedSize;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::model_argument::read_model;
use crate::signal::{kind, read_filter};
use crate::whole;

/// Learning with the inverse of the model.
///
/// ``u' = Q (u + gain P^-1 e)``, each output paired with the first sample at which
/// it answers
///
/// Parameters
/// ----------
/// model : StateSpace or compatible
///     Sampled model from the learned input to the measurement, delays of the
///     bus included.
/// n_samples : int
///     Samples of a run.
/// gain : float
///     Step alpha, above 0 and below 2.
/// q_filter : ButterworthFilter, GaussianFilter, SwitchedFilter, FirFilter, array or None
///     Filter Q, applied without lag unless it is causal; an array holds the taps
///     of a symmetric one.
///
/// Raises
/// ------
/// LearningError
///     If the model has a zero on or outside the unit circle (the message names
///     it), no inverse, or the gain is out of range.
/// ModelError, SignalError, TypeError
///     If the model is continuous or no model, or the filter is none or too long
///     for the run.
///
/// Notes
/// -----
/// With gain 1, the model right and no filter the error is gone after one run. The
/// inverse amplifies noise where the gain of the model is small: there the filter
/// belongs. Beyond the end of the run the error is held.
///
/// References
/// ----------
/// [barton2010], Eq. (3.13) to (3.15), whose limit for S = R = 0 it is.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import ModelInverseIlc, from_transfer_function
/// >>> model = from_transfer_function([2.0], [1.0, 0.0], dt_s=1.0)
/// >>> ModelInverseIlc(model, 3).update(np.zeros(3), np.array([1.0, 2.0, 4.0]))
/// array([1., 2., 2.])
#[pyclass(name = "ModelInverseIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyModelInverseIlc {
    made: Made,
    gain: f64,
    q_filter: QFilter,
    law: FixedSize<ModelInverse>,
}

impl PyModelInverseIlc {
    /// Makes the law anew.
    pub(super) fn own(&self) -> Box<dyn Law> {
        Box::new(self.law.look(ModelInverse::clone))
    }

    pub(super) fn n_samples(&self) -> usize {
        self.law.n_samples()
    }
}

#[pymethods]
impl PyModelInverseIlc {
    #[new]
    #[pyo3(signature = (model, n_samples, gain=1.0, q_filter=None))]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
        gain: f64,
        q_filter: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let made = made!(model, n_samples, gain, q_filter);
        let model = read_model("model", model)?;
        let q_filter = read_filter("q_filter", q_filter)?;
        let law = detached(py, || ModelInverse::new(&model, n_samples, gain, q_filter.clone()))
            .or_raise()?;
        Ok(Self { made, gain, q_filter, law: FixedSize::new(law, &model, n_samples) })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Gain of the step.
    #[getter]
    fn gain(&self) -> f64 {
        self.gain
    }

    /// Return the input of the next run.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n_samples,) or (n_samples, n_inputs)
    ///     Input of the run.
    /// e : ndarray of float64, shape (n_samples,) or (n_samples, n_outputs)
    ///     Error of the run, reference minus measurement, on the grid of `u`.
    /// disturbance : object
    ///     Accepted from whoever calls every law alike; this one has no use for it.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, same shape as `u`
    ///     Input of the next run.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If an array has the wrong shape, dtype or a number that is not finite.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let _ = disturbance;
        self.law.update(py, u, e)
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        self.law.reset();
    }

    fn __repr__(&self) -> String {
        format!(
            "ModelInverseIlc(n_samples={}, gain={}, q_filter={})",
            self.law.n_samples(),
            self.gain,
            kind(&self.q_filter)
        )
    }
}
