//! `NormOptimalIlc`.

use std::sync::Mutex;

use ilc_rt::learning::law::norm_optimal::Cost;
use ilc_rt::learning::weights::Weight;
use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::exchange::{Given, exchange};
use super::held;
use super::solver::{Effort, Filter, Solver, side_by_side};
use super::weight::give_weight;
use crate::argument::misfit;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::model_argument::{AnyModel, read_any_model};
use crate::weights::{Task, read_contour, read_weight};
use crate::whole;

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
    made: Made,
    model: AnyModel,
    filter: Option<Filter>,
    cost: Cost,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    law: Mutex<Solver>,
}

#[pymethods]
impl PyNormOptimalIlc {
    #[new]
    #[pyo3(signature = (model, n_samples, q=None, s=None, r=None, rate=0.0),
           text_signature = "(model, n_samples, q=1.0, s=0.0, r=0.0, rate=0.0)")]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
        q: Option<&Bound<'_, PyAny>>,
        s: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        rate: f64,
    ) -> PyResult<Self> {
        let made = made!(model, n_samples, q, s, r, rate);
        let model = read_any_model("model", model)?;
        let q = read_weight("q", q, 1.0, n_samples, model.n_outputs())?;
        Self::make(py, made, &model, n_samples, q, &Effort { s, r, rate }, None)
    }

    /// Return the law that learns the contour rather than each axis.
    ///
    /// Parameters
    /// ----------
    /// model : StateSpace or compatible
    ///     Sampled model from the learned input to the measurement.
    /// reference : ndarray of float64, shape (n_samples, n_outputs)
    ///     Reference of every output.
    /// q, contour, along : float or ndarray
    ///     Weights of every output, of the error across and along the path, as in
    ///     `ilc_rt.weights.contour`.
    /// s, r, rate : float or ndarray
    ///     Weights of the input, as for the law itself.
    /// axes : sequence of int, optional
    ///     Outputs that make the path; by default all.
    ///
    /// Returns
    /// -------
    /// NormOptimalIlc
    ///     Law for runs as long as the reference.
    ///
    /// Raises
    /// ------
    /// LearningError, ModelError, ValueError, TypeError
    ///     As `ilc_rt.weights.contour` and the law itself.
    ///
    /// References
    /// ----------
    /// [barton2010], Eq. (4.1) to (4.3), (5.8) to (5.11).
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from ilc_rt import NormOptimalIlc, discretize, second_order
    /// >>> axis = discretize(second_order(157.0, 0.5), 0.002)
    /// >>> line = np.outer(np.linspace(0.0, 0.1, 100), [1.0, 1.0])
    /// >>> law = NormOptimalIlc.contour(axis.append(axis), line, contour=30.0, r=0.01)
    /// >>> law.update(np.zeros((100, 2)), np.ones((100, 2))).shape
    /// (100, 2)
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "a keyword each, as Python has it")]
    #[pyo3(
        signature = (
            model, reference, q=None, contour=None,
            along=None, s=None, r=None, rate=0.0,
            axes=None
        ),
        text_signature = "(model, reference, q=1.0, contour=1.0, along=0.0, s=0.0, r=0.0, \
                          rate=0.0, axes=None)"
    )]
    fn contour(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        reference: &Bound<'_, PyAny>,
        q: Option<&Bound<'_, PyAny>>,
        contour: Option<&Bound<'_, PyAny>>,
        along: Option<&Bound<'_, PyAny>>,
        s: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        rate: f64,
        #[pyo3(from_py_with = whole::maybe_list::axes)] axes: Option<Vec<usize>>,
    ) -> PyResult<Self> {
        let made = made!("contour": model, reference, q, contour, along, s, r, rate, axes);
        let model = read_any_model("model", model)?;
        let (q, n_samples, p) = read_contour(py, reference, q, contour, along, axes)?;
        if p != model.n_outputs() {
            let rule = format!("(n_samples, {}), one column an output,", model.n_outputs());
            return Err(misfit("reference", &[n_samples, p], &rule));
        }
        Self::make(py, made, &model, n_samples, q, &Effort { s, r, rate }, None)
    }

    /// Return the law of several agents that keep a formation.
    ///
    /// Parameters
    /// ----------
    /// models : sequence of StateSpace or compatible
    ///     Sampled model of each agent, all with as many outputs.
    /// n_samples : int
    ///     Samples of a run.
    /// tracking, own, centre, sigma, weight : float or ndarray
    ///     Shares and weights, as in `ilc_rt.weights.formation`.
    /// s, r, rate : float or ndarray
    ///     Weights of the inputs of all agents, as for the law itself.
    /// leaders, pairs, axes : sequence, optional
    ///     As in `ilc_rt.weights.formation`.
    ///
    /// Returns
    /// -------
    /// NormOptimalIlc
    ///     Law of all agents' inputs and errors, one agent after the other.
    ///
    /// Raises
    /// ------
    /// LearningError, ModelError, ValueError, TypeError
    ///     As `ilc_rt.weights.formation` and the law itself.
    ///
    /// References
    /// ----------
    /// [barton2010], Eq. (6.1) to (6.11).
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from ilc_rt import NormOptimalIlc, discretize, second_order
    /// >>> axis = discretize(second_order(157.0, 0.5), 0.002)
    /// >>> law = NormOptimalIlc.formation([axis, axis], 100, tracking=0.5, r=0.01)
    /// >>> law.update(np.zeros((100, 2)), np.ones((100, 2))).shape
    /// (100, 2)
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "a keyword each, as Python has it")]
    #[pyo3(
        signature = (
            models, n_samples, tracking=None, own=None,
            centre=None, sigma=None, weight=None,
            s=None, r=None, rate=0.0, leaders=None, pairs=None,
            axes=None
        ),
        text_signature = "(models, n_samples, tracking=1.0, own=1.0, centre=0.0, sigma=1.0, \
                          weight=1.0, s=0.0, r=0.0, rate=0.0, leaders=None, pairs=None, axes=None)"
    )]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn formation(
        py: Python<'_>,
        models: Vec<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
        tracking: Option<&Bound<'_, PyAny>>,
        own: Option<&Bound<'_, PyAny>>,
        centre: Option<&Bound<'_, PyAny>>,
        sigma: Option<&Bound<'_, PyAny>>,
        weight: Option<&Bound<'_, PyAny>>,
        s: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        rate: f64,
        #[pyo3(from_py_with = whole::maybe_list::leaders)] leaders: Option<Vec<usize>>,
        #[pyo3(from_py_with = whole::maybe_pairs::pairs)] pairs: Option<Vec<(usize, usize)>>,
        #[pyo3(from_py_with = whole::maybe_list::axes)] axes: Option<Vec<usize>>,
    ) -> PyResult<Self> {
        let made = made!("formation": models, n_samples, tracking, own, centre, sigma, weight, s, r, rate, leaders, pairs, axes);
        let (model, n_outputs) = side_by_side(&models)?;
        let task = Task { tracking, own, centre, sigma, weight, leaders, pairs, axes };
        let q = task.read(py, n_samples, models.len(), n_outputs)?;
        let model = AnyModel::Invariant(model);
        Self::make(py, made, &model, n_samples, q, &Effort { s, r, rate }, None)
    }

    /// Return the law that weighs the error through a filter.
    ///
    /// ``sum |w|^2_q + |z|^2_plain + s |u'|^2 + r |v|^2 + ..``, ``w = F (G z)``
    ///
    /// Parameters
    /// ----------
    /// model : StateSpace or compatible
    ///     Sampled model from the learned input to the measurement.
    /// n_samples : int
    ///     Samples of a run.
    /// filter : StateSpace or compatible
    ///     Causal, stable filter F: an input for each output of the model, or for
    ///     each row of `coupling`.
    /// q : float or ndarray of shape (n_samples,), (f, f) or (n_samples, f, f)
    ///     Weight of what the filter gives.
    /// plain : float or ndarray, optional
    ///     Weight of the error itself besides; by default none.
    /// coupling : ndarray of float64, shape (n_samples, g, n_outputs), optional
    ///     G: what goes into the filter at each sample, as gains of a contour.
    /// s, r, rate : float or ndarray
    ///     Weights of the input, as for the law itself.
    ///
    /// Returns
    /// -------
    /// NormOptimalIlc
    ///     Law that filters each run's error before it learns from it.
    ///
    /// Raises
    /// ------
    /// LearningError
    ///     If the filter has a pole outside the unit circle, as one that runs
    ///     backwards has, or a weight does not fit.
    /// ModelError, ValueError, TypeError
    ///     If the filter does not fit the model, and as the law itself.
    ///
    /// References
    /// ----------
    /// [barton2010], Eq. (J.10) to (J.23).
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from ilc_rt import NormOptimalIlc, discretize, from_transfer_function, second_order
    /// >>> axis = discretize(second_order(157.0, 0.5), 0.002)
    /// >>> low_pass = from_transfer_function([0.33], [1.0, -0.67], 0.002)
    /// >>> law = NormOptimalIlc.dynamic(axis, 100, low_pass, r=0.01)
    /// >>> law.update(np.zeros(100), np.ones(100)).shape
    /// (100,)
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "a keyword each, as Python has it")]
    #[pyo3(
        signature = (
            model, n_samples, filter, q=None, plain=None, coupling=None,
            s=None, r=None, rate=0.0
        ),
        text_signature = "(model, n_samples, filter, q=1.0, plain=None, coupling=None, s=0.0, \
                          r=0.0, rate=0.0)"
    )]
    fn dynamic(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
        filter: &Bound<'_, PyAny>,
        q: Option<&Bound<'_, PyAny>>,
        plain: Option<&Bound<'_, PyAny>>,
        coupling: Option<&Bound<'_, PyAny>>,
        s: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        rate: f64,
    ) -> PyResult<Self> {
        let made = made!("dynamic": model, n_samples, filter, q, plain, coupling, s, r, rate);
        let model = read_any_model("model", model)?;
        let filter = Filter::read(filter, n_samples, coupling, plain)?;
        let q = read_weight("q", q, 1.0, n_samples, filter.n_outputs())?;
        Self::make(py, made, &model, n_samples, q, &Effort { s, r, rate }, Some(filter))
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Samples of a run.
    #[getter]
    pub(super) fn n_samples(&self) -> usize {
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
        let u = Given::read("u", u)?.of_size("u", self.n_samples, self.n_inputs)?;
        let e = Given::read("e", e)?.of_size("e", self.n_samples, self.n_outputs)?;
        exchange(py, &u, &e, |u, e, next| held(&self.law).law().update(u, e, next))
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        held(&self.law).law().reset();
    }

    fn __repr__(&self) -> String {
        let told = |weight: &Weight| match weight {
            Weight::Scalar(value) => value.to_string(),
            Weight::PerSample(values) => format!("({},)", values.len()),
            Weight::Block(block) => format!("{:?}", block.shape()),
            Weight::Blocks(blocks) => {
                let p = blocks.first().map_or(0, nalgebra::DMatrix::nrows);
                format!("({}, {p}, {p})", blocks.len())
            }
        };
        let Cost { q, s, r, rate } = &self.cost;
        let (q, s, r) = (told(q), told(s), told(r));
        format!("NormOptimalIlc(n_samples={}, q={q}, s={s}, r={r}, rate={rate})", self.n_samples)
    }
}

impl PyNormOptimalIlc {
    fn make(
        py: Python<'_>,
        made: Made,
        model: &AnyModel,
        n_samples: usize,
        q: Weight,
        effort: &Effort<'_, '_>,
        filter: Option<Filter>,
    ) -> PyResult<Self> {
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        let cost = effort.cost(q, n_samples, n_inputs)?;
        let solver = || Solver::new(model.plant(), n_samples, cost.clone(), filter.clone());
        let law = Mutex::new(detached(py, solver).or_raise()?);
        let model = model.clone();
        Ok(Self { made, model, filter, cost, n_samples, n_inputs, n_outputs, law })
    }

    /// Makes the law anew.
    pub(super) fn own(&self) -> Result<Box<dyn Law>, LearningError> {
        let Self { model, filter, cost, n_samples, .. } = self;
        let solver = Solver::new(model.plant(), *n_samples, cost.clone(), filter.clone())?;
        Ok(solver.into_law())
    }
}
