//! `Gate`.

use std::sync::Mutex;

use ilc_rt::learning::gate::{Gate, GateRule, GateState, Measure};
use ilc_rt::learning::{Law, Standing};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::inner::{InnerLaw, look, shown, update_around};
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::whole;

/// Stop any law when the error is good enough, or before it diverges.
///
/// Parameters
/// ----------
/// law : object
///     Any law: one of this package, or an object with
///     ``update(u, e, disturbance)``.
/// tolerance : float or None
///     Error up to which the input is kept as it is; None to learn for ever.
/// measure : {"rms", "max"}
///     What a run is judged by: the root of the mean over the samples of the squared
///     length of the error, all channels taken together, as a cell description and
///     `tracking_rms_m` have it; or the largest magnitude of any channel.
/// resume : float
///     By what factor the error must leave the tolerance before learning resumes.
/// growth : float
///     By what factor the error may exceed the best one so far; infinite to let
///     it grow.
/// patience : int
///     For how many runs in a row it may do so. Then the input of the best run
///     comes back.
///
/// Raises
/// ------
/// LearningError
///     If the tolerance is negative, a ratio below 1 or the patience 0.
/// ValueError, TypeError
///     If `measure` is none of the two, or `law` is no law.
///
/// Notes
/// -----
/// `state` is "learning", "holding" (inside the tolerance) or "rolled_back" (to
/// the best input). Learning resumes from "holding" when the error exceeds
/// `resume` times the tolerance, and from "rolled_back" when for `patience` runs
/// in a row the error exceeds `growth` times what the same input once gave.
///
/// References
/// ----------
/// [filter-based], Section 4 (Fig. 19) and Section 6.3.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import Gate, PdIlc
/// >>> law = Gate(PdIlc(kp=1.0, kd=0.0), tolerance=0.1)
/// >>> law.update(np.zeros(2), np.full(2, 0.05))
/// array([0., 0.])
/// >>> law.state
/// 'holding'
#[pyclass(name = "Gate", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyGate {
    made: Made,
    rule: GateRule,
    /// The law inside.
    #[pyo3(get)]
    law: Py<PyAny>,
    gate: Mutex<Gate<InnerLaw>>,
}

impl PyGate {
    /// Returns what the gate decided after the last update, and why.
    pub(super) fn standing(&self, py: Python<'_>) -> (Standing, Option<String>) {
        look(py, &self.gate, |gate| (gate.standing(), gate.status()))
    }

    /// Returns the law inside.
    pub(super) fn inside<'py>(&self, py: Python<'py>) -> &Bound<'py, PyAny> {
        self.law.bind(py)
    }
}

#[pymethods]
impl PyGate {
    #[new]
    #[pyo3(signature = (law, tolerance=None, measure="rms", resume=1.5, growth=1.5, patience=2))]
    fn new(
        law: &Bound<'_, PyAny>,
        tolerance: Option<f64>,
        measure: &str,
        resume: f64,
        growth: f64,
        #[pyo3(from_py_with = whole::patience)] patience: usize,
    ) -> PyResult<Self> {
        let made = made!(law, tolerance, measure, resume, growth, patience);
        let measure = match measure {
            "rms" => Measure::Rms { n_channels: 1 },
            "max" => Measure::Max,
            other => {
                return Err(PyValueError::new_err(format!(
                    "measure = '{other}'; 'rms' or 'max' is needed"
                )));
            }
        };
        let tolerance = tolerance.unwrap_or(0.0);
        let rule = GateRule { measure, tolerance, resume, growth, patience };
        let gate = Gate::new(InnerLaw::new(law)?, rule).or_raise()?;
        Ok(Self { made, rule, law: law.clone().unbind(), gate: Mutex::new(gate) })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// What the gate is doing: "learning", "holding" or "rolled_back".
    #[getter]
    fn state(&self, py: Python<'_>) -> &'static str {
        match look(py, &self.gate, |gate| gate.state()) {
            GateState::Learning => "learning",
            GateState::Holding => "holding",
            GateState::RolledBack => "rolled_back",
        }
    }

    /// Error of the best run since learning began or resumed; None before the first.
    #[getter]
    fn best_error(&self, py: Python<'_>) -> Option<f64> {
        look(py, &self.gate, |gate| gate.best_figure())
    }

    /// Input of the best run, in the shape of `u`; None before the first.
    #[getter]
    fn best_input<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let given = look(py, &self.gate, |gate| {
            let input = gate.best_figure().map(|_| gate.best_input().to_vec());
            input.map(|input| Python::attach(|py| gate.law().give(py, input).map(Bound::unbind)))
        });
        given.transpose().map(|input| input.map(|input| input.into_bound(py)))
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
    ///     Handed on to the law inside.
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
    /// Exception
    ///     Whatever the law inside raises.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        update_around(py, &self.gate, u, e, disturbance)
    }

    /// Tell the law that the input it made last is taken back.
    ///
    /// For whoever runs the law and restores an earlier input because the error
    /// grew; handed on to the law inside.
    fn taken_back(&self, py: Python<'_>) {
        look(py, &self.gate, Law::on_rollback);
    }

    /// Forget every run; the law inside too.
    fn reset(&self, py: Python<'_>) {
        look(py, &self.gate, Law::reset);
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let GateRule { measure, tolerance, resume, growth, patience } = self.rule;
        let measure = measure.as_str();
        Ok(format!(
            "Gate({}, tolerance={tolerance}, measure='{measure}', resume={resume}, growth={growth}, patience={patience})",
            shown(py, &self.gate)?
        ))
    }
}
