//! `NormOptimalIlc`.

use std::sync::Mutex;

use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};
use ilc_rt::learning::{Law, LearningError, Structure};
use pyo3::prelude::*;

use super::{held, next};
use crate::argument::{Signal, give_signal, misfit};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::model_argument::read_model;

/// Norm-optimal learning, exact and in linear time.
///
/// Minimises ``sum q |z|^2 + s |u'|^2 + r |v|^2 + rate^2 |v[k] - v[k-1]|^2`` with
/// z the predicted error, u' the next input and v its change.
///
/// Parameters
/// ----------
/// model : StateSpace or compatible
///     Sampled model from the learned input to the measurement, delays of the
///     bus included.
/// n_samples : int
///     Samples of a run.
/// q : float
///     Weight of the predicted error.
/// s : float
///     Weight of the next input.
/// r : float
///     Weight of the change of the input.
/// rate : float
///     Weight of the change from one sample to the next; enters squared.
///
/// Raises
/// ------
/// LearningError
///     If a weight is negative, or s, r and rate are all zero and the model does
///     not determine the input or has an unstable inverse.
/// ModelError, TypeError
///     If the model is continuous, or no model.
///
/// Notes
/// -----
/// With s = r = 0 this is convex-optimisation learning, `rate` being its d. The
/// law pairs each sample of the input with the first sample of the error that it
/// reaches. The last samples of the input reach nothing within the run: there
/// s, r and rate alone decide, and if all are zero the input stays as it was.
///
/// References
/// ----------
/// [haas2016], Eq. (5) to (12); [barton2010], Eq. (3.13) to (3.15).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import NormOptimalIlc, discretize, second_order
/// >>> axis = discretize(second_order(157.0, 0.5), 0.002)
/// >>> law = NormOptimalIlc(axis, 400, rate=3.0)
/// >>> law.update(np.zeros(400), np.ones(400)).shape
/// (400,)
#[pyclass(name = "NormOptimalIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyNormOptimalIlc {
    weights: Weights,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    law: Mutex<NormOptimal>,
}

#[pymethods]
impl PyNormOptimalIlc {
    #[new]
    #[pyo3(signature = (model, n_samples, q=1.0, s=0.0, r=0.0, rate=0.0))]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        n_samples: usize,
        q: f64,
        s: f64,
        r: f64,
        rate: f64,
    ) -> PyResult<Self> {
        let model = read_model("model", model)?;
        let weights = Weights { q, s, r, rate };
        let law = detached(py, || NormOptimal::new(&model, n_samples, weights)).or_raise()?;
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        Ok(Self { weights, n_samples, n_inputs, n_outputs, law: Mutex::new(law) })
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
        let u = self.read("u", u, self.n_inputs)?;
        let e = self.read("e", e, self.n_outputs)?;
        let result = detached(py, || next(&mut *held(&self.law), &u, &e)).or_raise()?;
        give_signal(py, result, u.n_channels, u.is_flat)
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        held(&self.law).reset();
    }

    fn __repr__(&self) -> String {
        let Weights { q, s, r, rate } = self.weights;
        format!("NormOptimalIlc(n_samples={}, q={q}, s={s}, r={r}, rate={rate})", self.n_samples)
    }
}

impl PyNormOptimalIlc {
    /// Returns the samples of a run.
    pub(super) fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Makes the law anew.
    pub(super) fn own(&self) -> Result<Box<dyn Law>, LearningError> {
        let law = held(&self.law);
        let Structure::Optimal { model, weights } = law.structure() else {
            return Err(LearningError::Empty { what: "model" });
        };
        Ok(Box::new(NormOptimal::new(model, self.n_samples, weights)?))
    }

    fn read(&self, name: &str, signal: &Bound<'_, PyAny>, n_channels: usize) -> PyResult<Signal> {
        let signal = Signal::read(name, signal)?;
        if (signal.n_samples, signal.n_channels) == (self.n_samples, n_channels) {
            return Ok(signal);
        }
        Err(misfit(name, &signal.shape(), &format!("({}, {n_channels})", self.n_samples)))
    }
}
