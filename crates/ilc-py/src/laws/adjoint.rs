//! `AdjointIlc`.

use ilc_rt::learning::Law;
use ilc_rt::learning::law::adjoint::Adjoint;
use ilc_rt::learning::law::q_filter::QFilter;
use pyo3::prelude::*;

use super::fixed_size::FixedSize;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::model_argument::read_model;
use crate::signal::{kind, read_filter};
use crate::whole;

/// Gradient learning: the error run backward through the model.
///
/// ``u' = Q (u + gain P' e)``, P the lifted operator of the model
///
/// Parameters
/// ----------
/// model : StateSpace or compatible
///     Sampled model from the learned input to the measurement, delays of the
///     bus included.
/// n_samples : int
///     Samples of a run.
/// gain : float or None
///     Step alpha; ``1 / |P|^2``, half the limit, unless given.
/// q_filter : ButterworthFilter, GaussianFilter, SwitchedFilter, FirFilter, array or None
///     Filter Q, applied without lag unless it is causal; an array holds the taps
///     of a symmetric one.
///
/// Raises
/// ------
/// LearningError
///     If the gain is not positive, or from `gain_limit` on without a filter; if
///     the model answers to nothing.
/// ModelError, SignalError, TypeError
///     If the model is continuous or no model, or the filter is none or too long
///     for the run.
///
/// Notes
/// -----
/// With the model right the error falls in every run if the gain is less than
/// `gain_limit`, which is ``2 / |P|^2``. The norm is approached from below, to
/// about one part in 1000. Of the laws with a model this one suffers least from a
/// wrong one; it is also the slowest where the gain of the model is small.
///
/// References
/// ----------
/// [barton2010], Ch. 3: the gradient of Eq. (3.13) with S = R = 0.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import AdjointIlc, from_transfer_function
/// >>> model = from_transfer_function([2.0], [1.0, 0.0], dt_s=1.0)
/// >>> law = AdjointIlc(model, 3)
/// >>> law.update(np.zeros(3), np.array([1.0, 2.0, 4.0])).round(9)
/// array([1., 2., 0.])
#[pyclass(name = "AdjointIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyAdjointIlc {
    made: Made,
    q_filter: QFilter,
    law: FixedSize<Adjoint>,
}

impl PyAdjointIlc {
    /// Makes the law anew.
    pub(super) fn own(&self) -> Box<dyn Law> {
        Box::new(self.law.look(Adjoint::clone))
    }

    pub(super) fn n_samples(&self) -> usize {
        self.law.n_samples()
    }
}

#[pymethods]
impl PyAdjointIlc {
    #[new]
    #[pyo3(signature = (model, n_samples, gain=None, q_filter=None))]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
        gain: Option<f64>,
        q_filter: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let made = made!(model, n_samples, gain, q_filter);
        let model = read_model("model", model)?;
        let q_filter = read_filter("q_filter", q_filter)?;
        let law =
            detached(py, || Adjoint::new(&model, n_samples, gain, q_filter.clone())).or_raise()?;
        Ok(Self { made, q_filter, law: FixedSize::new(law, &model, n_samples) })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Gain of the step.
    #[getter]
    fn gain(&self) -> f64 {
        self.law.look(Adjoint::gain)
    }

    /// Gain from which on the error grows, ``2 / |P|^2``.
    #[getter]
    fn gain_limit(&self) -> f64 {
        self.law.look(Adjoint::gain_limit)
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
            "AdjointIlc(n_samples={}, gain={}, q_filter={})",
            self.law.n_samples(),
            self.gain(),
            kind(&self.q_filter)
        )
    }
}
