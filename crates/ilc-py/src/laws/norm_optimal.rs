//! `NormOptimalIlc`.

use std::sync::Mutex;

use ilc_rt::learning::Law;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal};
use ilc_rt::learning::weights::Weight;
use pyo3::prelude::*;

use super::weight::{give_weight, read_weight};
use super::{held, next};
use crate::argument::{Signal, give_signal, misfit};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::model_argument::read_any_model;

/// Norm-optimal learning, exact and in linear time.
///
/// Minimises ``sum z'qz + u's u + v'rv + rate^2 |v[k] - v[k-1]|^2`` with z the
/// predicted error, u the next input and v its change.
///
/// Parameters
/// ----------
/// model : StateSpace, TimeVarying or compatible
///     Sampled model from the learned input to the measurement, delays of the
///     bus included.
/// n_samples : int
///     Samples of a run.
/// q : float or array_like, shape (n,), (n_outputs, n_outputs) or (n, n_outputs, n_outputs)
///     Weight of the predicted error, each sample by its own.
/// s : float or array_like, shape (n,), (n_inputs, n_inputs) or (n, n_inputs, n_inputs)
///     Weight of the next input.
/// r : float or array_like, shape as `s`
///     Weight of the change of the input.
/// rate : float
///     Weight of the change from one sample to the next; enters squared.
///
/// Raises
/// ------
/// LearningError
///     If a weight is not positive semidefinite, or s, r and rate are zero and the
///     model does not determine the input or has an unstable inverse.
/// ModelError, TypeError
///     If the model is continuous, varies over another number of samples, or is no
///     model.
/// ValueError, TypeError
///     If a weight has the wrong shape, dtype or a number that is not finite.
///
/// Notes
/// -----
/// With s = r = 0 this is convex-optimisation learning, `rate` being its d. The
/// law pairs each sample of the input with the first sample of the error that it
/// reaches. The last samples of the input reach nothing within the run: there
/// s, r and rate alone decide, and if all are zero the input stays as it was.
/// An update takes time and memory in proportion to n_samples.
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
/// >>> half = np.where(np.arange(400) < 200, 1.0, 0.0)
/// >>> NormOptimalIlc(axis, 400, q=half, r=0.01)
/// NormOptimalIlc(n_samples=400, q=(400,), s=0, r=0.01, rate=0)
#[pyclass(name = "NormOptimalIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyNormOptimalIlc {
    cost: Cost,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    law: Mutex<NormOptimal>,
}

#[pymethods]
impl PyNormOptimalIlc {
    #[new]
    #[pyo3(signature = (model, n_samples, q=None, s=None, r=None, rate=0.0),
           text_signature = "(model, n_samples, q=1.0, s=0.0, r=0.0, rate=0.0)")]
    #[expect(clippy::too_many_arguments, reason = "a keyword each, as Python has it")]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        n_samples: usize,
        q: Option<&Bound<'_, PyAny>>,
        s: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        rate: f64,
    ) -> PyResult<Self> {
        let model = read_any_model("model", model)?;
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        let weight = |name: &str, given: Option<&Bound<'_, PyAny>>, default: f64, n_channels| {
            given.map_or(Ok(Weight::Scalar(default)), |given| {
                read_weight(name, given, n_samples, n_channels)
            })
        };
        let cost = Cost {
            q: weight("q", q, 1.0, n_outputs)?,
            s: weight("s", s, 0.0, n_inputs)?,
            r: weight("r", r, 0.0, n_inputs)?,
            rate,
        };
        let law = detached(py, || NormOptimal::new(model.plant(), n_samples, cost.clone()));
        Ok(Self { cost, n_samples, n_inputs, n_outputs, law: Mutex::new(law.or_raise()?) })
    }

    /// Samples of a run.
    #[getter]
    fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Weight of the predicted error, as it was given.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_weight(py, &self.cost.q)
    }

    /// Weight of the next input, as it was given.
    #[getter]
    fn s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_weight(py, &self.cost.s)
    }

    /// Weight of the change of the input, as it was given.
    #[getter]
    fn r<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_weight(py, &self.cost.r)
    }

    /// Weight of the change from one sample to the next; enters squared.
    #[getter]
    fn rate(&self) -> f64 {
        self.cost.rate
    }

    /// How well the weights determine the input, 0 to 1.
    ///
    /// Below about 1e-12 noise decides on part of the input.
    #[getter]
    fn conditioning(&self) -> f64 {
        held(&self.law).conditioning()
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
        let told = |weight: &Weight| match weight {
            Weight::Scalar(value) => value.to_string(),
            Weight::PerSample(values) => format!("({},)", values.len()),
            Weight::Block(block) => format!("{:?}", block.shape()),
            Weight::Blocks(blocks) => {
                let p = blocks.first().map_or(0, |block| block.nrows());
                format!("({}, {p}, {p})", blocks.len())
            }
        };
        let Cost { q, s, r, rate } = &self.cost;
        let (q, s, r) = (told(q), told(s), told(r));
        format!("NormOptimalIlc(n_samples={}, q={q}, s={s}, r={r}, rate={rate})", self.n_samples)
    }
}

impl PyNormOptimalIlc {
    fn read(&self, name: &str, signal: &Bound<'_, PyAny>, n_channels: usize) -> PyResult<Signal> {
        let signal = Signal::read(name, signal)?;
        if (signal.n_samples, signal.n_channels) == (self.n_samples, n_channels) {
            return Ok(signal);
        }
        Err(misfit(name, &signal.shape(), &format!("({}, {n_channels})", self.n_samples)))
    }
}
