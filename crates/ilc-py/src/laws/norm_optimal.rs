//! `NormOptimalIlc`.

use std::sync::Mutex;

use ilc_rt::learning::law::dynamic::DynamicNormOptimal;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal};
use ilc_rt::learning::weights::{Dynamic, Weight};
use ilc_rt::learning::{Law, LearningError};
use ilc_rt::model::StateSpace;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::{held, next};
use crate::argument::{Signal, give_signal, misfit};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::model_argument::read_model;
use crate::weights::{Given, Task, read_contour, read_matrices};

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
/// q : float or ndarray of shape (n_samples,), (p, p) or (n_samples, p, p)
///     Weight of the predicted error of p outputs; `ilc_rt.weights` makes such.
/// s : float or ndarray, as `q` for the inputs
///     Weight of the next input.
/// r : float or ndarray, as `s`
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
    told: String,
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    law: Mutex<Solver>,
}

/// The law with or without a filter in front.
#[derive(Debug)]
enum Solver {
    Plain(NormOptimal),
    Dynamic(DynamicNormOptimal),
}

impl Solver {
    fn law(&mut self) -> &mut dyn Law {
        match self {
            Self::Plain(law) => law,
            Self::Dynamic(law) => law,
        }
    }
}

/// What a builder leaves to be said about the input.
struct Effort<'a, 'py> {
    s: &'a Given<'py>,
    r: &'a Given<'py>,
    rate: f64,
}

impl Effort<'_, '_> {
    fn cost(&self, q: Weight) -> PyResult<Cost> {
        Ok(Cost { q, s: self.s.weight("s")?, r: self.r.weight("r")?, rate: self.rate })
    }
}

#[pymethods]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
#[expect(clippy::needless_pass_by_value, reason = "arguments from Python are owned")]
impl PyNormOptimalIlc {
    #[new]
    #[pyo3(
        signature = (
            model, n_samples, q=Given::Number(1.0), s=Given::Number(0.0), r=Given::Number(0.0),
            rate=0.0
        ),
        text_signature = "(model, n_samples, q=1.0, s=0.0, r=0.0, rate=0.0)"
    )]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        n_samples: usize,
        q: Given<'_>,
        s: Given<'_>,
        r: Given<'_>,
        rate: f64,
    ) -> PyResult<Self> {
        let model = read_model("model", model)?;
        let cost = Effort { s: &s, r: &r, rate }.cost(q.weight("q")?)?;
        Self::plain(py, &model, n_samples, cost)
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
    #[pyo3(
        signature = (
            model, reference, q=Given::Number(1.0), contour=Given::Number(1.0),
            along=Given::Number(0.0), s=Given::Number(0.0), r=Given::Number(0.0), rate=0.0,
            axes=None
        ),
        text_signature = "(model, reference, q=1.0, contour=1.0, along=0.0, s=0.0, r=0.0, \
                          rate=0.0, axes=None)"
    )]
    fn contour(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        reference: &Bound<'_, PyAny>,
        q: Given<'_>,
        contour: Given<'_>,
        along: Given<'_>,
        s: Given<'_>,
        r: Given<'_>,
        rate: f64,
        axes: Option<Vec<usize>>,
    ) -> PyResult<Self> {
        let model = read_model("model", model)?;
        let (q, n_samples, p) = read_contour(py, reference, (&q, &contour, &along), axes)?;
        if p != model.n_outputs() {
            let rule = format!("(n_samples, {}), one column an output,", model.n_outputs());
            return Err(misfit("reference", &[n_samples, p], &rule));
        }
        Self::plain(py, &model, n_samples, Effort { s: &s, r: &r, rate }.cost(q)?)
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
    #[pyo3(
        signature = (
            models, n_samples, tracking=Given::Number(1.0), own=Given::Number(1.0),
            centre=Given::Number(0.0), sigma=Given::Number(1.0), weight=Given::Number(1.0),
            s=Given::Number(0.0), r=Given::Number(0.0), rate=0.0, leaders=None, pairs=None,
            axes=None
        ),
        text_signature = "(models, n_samples, tracking=1.0, own=1.0, centre=0.0, sigma=1.0, \
                          weight=1.0, s=0.0, r=0.0, rate=0.0, leaders=None, pairs=None, axes=None)"
    )]
    fn formation(
        py: Python<'_>,
        models: Vec<Bound<'_, PyAny>>,
        n_samples: usize,
        tracking: Given<'_>,
        own: Given<'_>,
        centre: Given<'_>,
        sigma: Given<'_>,
        weight: Given<'_>,
        s: Given<'_>,
        r: Given<'_>,
        rate: f64,
        leaders: Option<Vec<usize>>,
        pairs: Option<Vec<(usize, usize)>>,
        axes: Option<Vec<usize>>,
    ) -> PyResult<Self> {
        let agents = models
            .iter()
            .enumerate()
            .map(|(i, model)| read_model(&format!("models[{i}]"), model))
            .collect::<PyResult<Vec<_>>>()?;
        let Some((first, others)) = agents.split_first() else {
            return Err(PyValueError::new_err("models is empty; at least one agent is needed"));
        };
        let mut all = first.clone();
        for (i, agent) in others.iter().enumerate() {
            if agent.n_outputs() != first.n_outputs() {
                return Err(PyValueError::new_err(format!(
                    "models[{}] has {} outputs; {} are needed, as models[0] has",
                    i + 1,
                    agent.n_outputs(),
                    first.n_outputs()
                )));
            }
            all = all.append(agent).or_raise()?;
        }
        let task = Task {
            tracking: &tracking,
            own: &own,
            centre: &centre,
            sigma: &sigma,
            weight: &weight,
            leaders,
            pairs,
            axes,
        };
        let q = task.read(py, n_samples, agents.len(), first.n_outputs())?;
        Self::plain(py, &all, n_samples, Effort { s: &s, r: &r, rate }.cost(q)?)
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
    #[pyo3(
        signature = (
            model, n_samples, filter, q=Given::Number(1.0), plain=None, coupling=None,
            s=Given::Number(0.0), r=Given::Number(0.0), rate=0.0
        ),
        text_signature = "(model, n_samples, filter, q=1.0, plain=None, coupling=None, s=0.0, \
                          r=0.0, rate=0.0)"
    )]
    fn dynamic(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        n_samples: usize,
        filter: &Bound<'_, PyAny>,
        q: Given<'_>,
        plain: Option<Given<'_>>,
        coupling: Option<&Bound<'_, PyAny>>,
        s: Given<'_>,
        r: Given<'_>,
        rate: f64,
    ) -> PyResult<Self> {
        let model = read_model("model", model)?;
        let mut dynamic = Dynamic::new(read_model("filter", filter)?).or_raise()?;
        if let Some(coupling) = coupling {
            let matrices = read_matrices("coupling", coupling)?;
            dynamic = dynamic.with_coupling(matrices).or_raise()?;
        }
        if let Some(plain) = plain {
            dynamic = dynamic.with_plain(plain.weight("plain")?);
        }
        let cost = Effort { s: &s, r: &r, rate }.cost(q.weight("q")?)?;
        Self::make(py, &model, n_samples, cost, |model, cost| {
            DynamicNormOptimal::new(model, n_samples, &dynamic, cost).map(Solver::Dynamic)
        })
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
        let result = detached(py, || next(held(&self.law).law(), &u, &e)).or_raise()?;
        give_signal(py, result, u.n_channels, u.is_flat)
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        held(&self.law).law().reset();
    }

    fn __repr__(&self) -> String {
        format!("NormOptimalIlc(n_samples={}, {})", self.n_samples, self.told)
    }
}

impl PyNormOptimalIlc {
    fn plain(py: Python<'_>, model: &StateSpace, n_samples: usize, cost: Cost) -> PyResult<Self> {
        Self::make(py, model, n_samples, cost, |model, cost| {
            NormOptimal::new(model, n_samples, cost).map(Solver::Plain)
        })
    }

    fn make(
        py: Python<'_>,
        model: &StateSpace,
        n_samples: usize,
        cost: Cost,
        solver: impl FnOnce(&StateSpace, Cost) -> Result<Solver, LearningError> + Send,
    ) -> PyResult<Self> {
        let told = |weight: &Weight| match weight {
            Weight::Scalar(value) => value.to_string(),
            _ => "...".to_owned(),
        };
        let Cost { q, s, r, rate } = &cost;
        let told = format!("q={}, s={}, r={}, rate={rate}", told(q), told(s), told(r));
        let law = Mutex::new(detached(py, || solver(model, cost)).or_raise()?);
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        Ok(Self { told, n_samples, n_inputs, n_outputs, law })
    }

    fn read(&self, name: &str, signal: &Bound<'_, PyAny>, n_channels: usize) -> PyResult<Signal> {
        let signal = Signal::read(name, signal)?;
        if (signal.n_samples, signal.n_channels) == (self.n_samples, n_channels) {
            return Ok(signal);
        }
        Err(misfit(name, &signal.shape(), &format!("({}, {n_channels})", self.n_samples)))
    }
}
