//! `ConstrainedIlc`.

use ilc_rt::learning::law::constrained::{Bound as Limits, Bounds, Constrained, Limit, Status};
use ilc_rt::learning::law::norm_optimal::Cost;
use ilc_rt::learning::weights::Weight;
use ilc_rt::learning::{Law, LearningError};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::fixed_size::FixedSize;
use super::weight::read_weight;
use crate::argument::{Signal, misfit, read_numbers};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::model_argument::read_model;
use crate::whole;

/// Norm-optimal learning within bounds, in linear time.
///
/// Minimises ``sum z'qz + u's u + v'rv + rate^2 |v[k] - v[k-1]|^2`` with z the
/// predicted error, u the next input and v its change, over all inputs for which
/// every bound holds.
///
/// Each bound is a pair (least, largest). A side is a number, an array of shape
/// (n_samples,), (n_samples, n_channels) or (1, n_channels), or None; infinite
/// where there is no bound.
///
/// Parameters
/// ----------
/// model : StateSpace or compatible
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
/// u_bounds : tuple, optional
///     Bounds of the next input, in its unit.
/// v_bounds : tuple, optional
///     Bounds of its change from this run to the next, in its unit.
/// step_bounds : tuple, optional
///     Bounds of its change from sample to sample, in its unit.
/// reference : array_like, shape (n_samples,) or (n_samples, n_inputs), optional
///     Set-points r of the program, in the unit of the input.
/// position_bounds : tuple, optional
///     Bounds of the corrected set-point r + u.
/// velocity_bounds : tuple, optional
///     Bounds of its first difference over the sample time, per second.
/// acceleration_bounds : tuple, optional
///     Bounds of its second difference over the squared sample time, per second
///     squared.
/// output_bounds : tuple, optional
///     Bounds of the predicted output r - z, in its unit.
/// output_reference : array_like, shape (n_samples,) or (n_samples, n_outputs), optional
///     The reference of the outputs, if it is not `reference`.
///
/// Raises
/// ------
/// LearningError
///     If bounds contradict each other, with their names and the sample; if a
///     weight is not positive semidefinite, or s, r and rate are zero and the model
///     does not determine the input.
/// ModelError
///     If the model is continuous.
/// ValueError, TypeError
///     If an argument has the wrong shape, dtype or a number that is not allowed.
///
/// Notes
/// -----
/// Before the run the input is 0 and the set-point stands at its first value: the
/// first step is the input itself, and the first accelerations start from rest.
/// Where a run begins otherwise, make the bounds of those samples infinite. Output
/// samples before the first effect of the input are as they are.
///
/// The next input exceeds no bound by more than 1e-9 of its size. If no such input
/// is found, `update` returns the input of the run and `status` says why. A
/// primal-dual interior point does the search, its linear systems being solved by
/// a Riccati recursion; it starts from the last solution.
///
/// References
/// ----------
/// [haas2016], section 4; [mehrotra1992]; [rao1998].
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import ConstrainedIlc, discretize, second_order
/// >>> axis = discretize(second_order(157.0, 0.5), 0.002)
/// >>> law = ConstrainedIlc(axis, 400, rate=3.0, u_bounds=(-0.01, 0.01))
/// >>> e = 0.05 * np.sin(0.05 * np.arange(400))
/// >>> u = law.update(np.zeros(400), e)
/// >>> law.status, round(float(u.max()), 6)
/// ('solved', 0.01)
#[pyclass(name = "ConstrainedIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyConstrainedIlc {
    made: Made,
    law: FixedSize<Constrained>,
}

impl PyConstrainedIlc {
    /// Makes the law without its bounds, as which analysis sees it.
    pub(super) fn unbounded(&self) -> Result<Box<dyn Law>, LearningError> {
        Ok(Box::new(self.law.look(Constrained::unbounded)?))
    }
}

#[pymethods]
impl PyConstrainedIlc {
    #[new]
    #[pyo3(signature = (model, n_samples, q=None, s=None, r=None, rate=0.0, *, u_bounds=None,
                        v_bounds=None, step_bounds=None, reference=None, position_bounds=None,
                        velocity_bounds=None, acceleration_bounds=None, output_bounds=None,
                        output_reference=None),
           text_signature = "(model, n_samples, q=1.0, s=0.0, r=0.0, rate=0.0, *, u_bounds=None, \
                             v_bounds=None, step_bounds=None, reference=None, position_bounds=None, \
                             velocity_bounds=None, acceleration_bounds=None, output_bounds=None, \
                             output_reference=None)")]
    #[expect(clippy::too_many_arguments, reason = "a keyword each, as Python has it")]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::n_samples)] n_samples: usize,
        q: Option<&Bound<'_, PyAny>>,
        s: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        rate: f64,
        u_bounds: Option<&Bound<'_, PyAny>>,
        v_bounds: Option<&Bound<'_, PyAny>>,
        step_bounds: Option<&Bound<'_, PyAny>>,
        reference: Option<&Bound<'_, PyAny>>,
        position_bounds: Option<&Bound<'_, PyAny>>,
        velocity_bounds: Option<&Bound<'_, PyAny>>,
        acceleration_bounds: Option<&Bound<'_, PyAny>>,
        output_bounds: Option<&Bound<'_, PyAny>>,
        output_reference: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let made = made!(
            model,
            n_samples,
            q,
            s,
            r,
            rate,
            u_bounds,
            v_bounds,
            step_bounds,
            reference,
            position_bounds,
            velocity_bounds,
            acceleration_bounds,
            output_bounds,
            output_reference
        );
        let model = read_model("model", model)?;
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
        let limits = |name: &str, given: Option<&Bound<'_, PyAny>>, n_channels| {
            given.map(|given| read_limits(name, given, n_samples, n_channels)).transpose()
        };
        let signal = |name: &str, given: Option<&Bound<'_, PyAny>>, n_channels| {
            let read = |given: &Bound<'_, PyAny>| {
                Signal::read(name, given)?
                    .with_samples(name, n_samples)?
                    .with_channels(name, n_channels)
                    .map(|signal| signal.values)
            };
            given.map(read).transpose()
        };
        // Bounds of the output alone may come with the reference of the outputs as `reference`.
        let is_setpoint = n_inputs == n_outputs
            || [position_bounds, velocity_bounds, acceleration_bounds].iter().any(Option::is_some);
        let (width, target) = if is_setpoint { (n_inputs, None) } else { (n_outputs, reference) };
        let given_reference = signal("reference", reference, width)?;
        let bounds = Bounds {
            input: limits("u_bounds", u_bounds, n_inputs)?,
            change: limits("v_bounds", v_bounds, n_inputs)?,
            step: limits("step_bounds", step_bounds, n_inputs)?,
            position: limits("position_bounds", position_bounds, n_inputs)?,
            velocity: limits("velocity_bounds", velocity_bounds, n_inputs)?,
            acceleration: limits("acceleration_bounds", acceleration_bounds, n_inputs)?,
            output: limits("output_bounds", output_bounds, n_outputs)?,
            output_reference: signal("output_reference", output_reference.or(target), n_outputs)?,
            reference: given_reference.filter(|_| is_setpoint),
        };
        let law = detached(py, || Constrained::new(&model, n_samples, cost, bounds)).or_raise()?;
        Ok(Self { made, law: FixedSize::new(law, &model, n_samples) })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Samples of a run.
    #[getter]
    pub(super) fn n_samples(&self) -> usize {
        self.law.n_samples()
    }

    /// How the last update ended: untried, solved, infeasible or max_iterations.
    #[getter]
    fn status(&self) -> &'static str {
        match self.law.look(Constrained::status) {
            Status::Untried => "untried",
            Status::Solved => "solved",
            Status::Infeasible(_) => "infeasible",
            Status::MaxIterations => "max_iterations",
        }
    }

    /// The status as a sentence, with names and samples of bounds that cannot be honoured.
    #[getter]
    fn message(&self) -> String {
        match self.law.look(Constrained::status) {
            Status::Untried => "there was no update yet".to_owned(),
            Status::Solved => "the input is optimal within the bounds".to_owned(),
            Status::Infeasible(error) => error.to_string(),
            Status::MaxIterations => {
                "no optimum was found: the bounds most likely contradict each other".to_owned()
            }
        }
    }

    /// Iterations of the last update; 0 if no bound was reached.
    #[getter]
    fn iterations(&self) -> usize {
        self.law.look(Constrained::iterations)
    }

    /// By how much the cost may exceed the least one, as a part of it.
    #[getter]
    fn gap(&self) -> f64 {
        self.law.look(Constrained::gap)
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
    ///     Input of the next run; `u` itself unless `status` is solved.
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

    /// Forget the last solution: the next search starts afresh.
    fn reset(&self) {
        self.law.reset();
    }

    fn __repr__(&self) -> String {
        format!("ConstrainedIlc({})", self.law.look(Constrained::describe))
    }
}

/// Reads a pair of sides.
fn read_limits(
    name: &str,
    object: &Bound<'_, PyAny>,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Limits> {
    if !(object.is_instance_of::<PyTuple>() || object.is_instance_of::<PyList>()) {
        let kind = object.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "{name} is a {kind}; a pair (least, largest) is needed"
        )));
    }
    let length = object.len()?;
    if length != 2 {
        return Err(PyValueError::new_err(format!(
            "{name} has {length} sides; a pair (least, largest) is needed"
        )));
    }
    let side = |place: usize, none: f64| -> PyResult<Limit> {
        let given = object.get_item(place)?;
        if given.is_none() {
            return Ok(Limit::Scalar(none));
        }
        let name = format!("{name}[{place}]");
        let (values, shape) = read_numbers(&name, &given)?;
        if let Some(index) = values.iter().position(|value| value.is_nan()) {
            return Err(PyValueError::new_err(format!(
                "{name} holds NaN as its value {index}; a number or infinity is needed"
            )));
        }
        let (n, m) = (n_samples, n_channels);
        match shape[..] {
            [] => Ok(Limit::Scalar(values[0])),
            [length] if length == n => Ok(Limit::PerSample(values)),
            [rows, cols] if (rows, cols) == (n, m) => Ok(Limit::Full(values)),
            [1, cols] if cols == m => Ok(Limit::PerChannel(values)),
            _ => Err(misfit(&name, &shape, &format!("(), ({n},), ({n}, {m}) or (1, {m})"))),
        }
    };
    Ok(Limits { lower: side(0, f64::NEG_INFINITY)?, upper: side(1, f64::INFINITY)? })
}
