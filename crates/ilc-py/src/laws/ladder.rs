//! `Ladder`.

use std::sync::Mutex;

use ilc_rt::learning::Law;
use ilc_rt::learning::ladder::{Ladder, LadderRule};
use pyo3::prelude::*;

use super::inner::{InnerLaw, look, shown, update_around};
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::whole;

/// Learn from the mean error of several runs with the same input.
///
/// ``u' = u + g (law(u, mean(e)) - u)`` after `repeats` runs, ``u' = u`` between
///
/// Parameters
/// ----------
/// law : object
///     Any law: one of this package, or an object with
///     ``update(u, e, disturbance)``.
/// repeats : int
///     Runs with the same input before each step.
/// slow : float
///     Ratio of the error to that before the last step above which it decays too
///     slowly.
/// increase : float
///     By what factor the gain g is then raised; 1 to leave it alone.
/// lowest : float
///     Lowest gain.
/// highest : float
///     Highest gain.
///
/// Raises
/// ------
/// LearningError
///     If `repeats` is 0 or a ratio is out of range.
/// TypeError
///     If `law` is no law.
///
/// Notes
/// -----
/// What does not repeat falls with the root of `repeats`. The gain is 1 at first;
/// it is halved when the repeatable error grew over a step, raised when it
/// decayed too slowly, and left alone where the error is less than twice the
/// noise that is left in the mean. Runs with another input begin a new mean.
///
/// References
/// ----------
/// [filter-based], Section 6.2; the rule for the gain is ours.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import Ladder, PdIlc
/// >>> law = Ladder(PdIlc(kp=1.0, kd=0.0), repeats=2)
/// >>> law.update(np.zeros(2), np.array([0.0, 1.0]))
/// array([0., 0.])
/// >>> law.update(np.zeros(2), np.array([0.0, 3.0]))
/// array([2., 2.])
#[pyclass(name = "Ladder", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyLadder {
    made: Made,
    rule: LadderRule,
    /// The law inside.
    #[pyo3(get)]
    law: Py<PyAny>,
    ladder: Mutex<Ladder<InnerLaw>>,
}

impl PyLadder {
    /// Returns the law inside.
    pub(super) fn inside<'py>(&self, py: Python<'py>) -> &Bound<'py, PyAny> {
        self.law.bind(py)
    }
}

#[pymethods]
impl PyLadder {
    #[new]
    #[pyo3(signature = (law, repeats, slow=0.8, increase=1.25, lowest=0.0625, highest=1.5))]
    fn new(
        law: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::repeats)] repeats: usize,
        slow: f64,
        increase: f64,
        lowest: f64,
        highest: f64,
    ) -> PyResult<Self> {
        let made = made!(law, repeats, slow, increase, lowest, highest);
        let rule = LadderRule { repeats, slow, increase, lowest, highest };
        let ladder = Ladder::new(InnerLaw::new(law)?, rule).or_raise()?;
        Ok(Self { made, rule, law: law.clone().unbind(), ladder: Mutex::new(ladder) })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Gain of the next step.
    #[getter]
    fn gain(&self, py: Python<'_>) -> f64 {
        look(py, &self.ladder, |ladder| ladder.gain())
    }

    /// Runs in the mean that the next step will use.
    #[getter]
    fn runs(&self, py: Python<'_>) -> usize {
        look(py, &self.ladder, |ladder| ladder.runs())
    }

    /// Root mean square of the repeatable error at the last step; None before.
    #[getter]
    fn repeatable_rms(&self, py: Python<'_>) -> Option<f64> {
        look(py, &self.ladder, |ladder| ladder.figure())
    }

    /// Root mean square of the noise left in the mean at the last step.
    #[getter]
    fn noise_rms(&self, py: Python<'_>) -> f64 {
        look(py, &self.ladder, |ladder| ladder.noise())
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
        update_around(py, &self.ladder, u, e, disturbance)
    }

    /// Tell the law that the input it made last is taken back.
    ///
    /// For whoever runs the law and restores an earlier input because the error
    /// grew: the gain is halved and the mean begins anew.
    fn taken_back(&self, py: Python<'_>) {
        look(py, &self.ladder, Law::on_rollback);
    }

    /// Forget every run and the gain; the law inside too.
    fn reset(&self, py: Python<'_>) {
        look(py, &self.ladder, Law::reset);
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("Ladder({}, repeats={})", shown(py, &self.ladder)?, self.rule.repeats))
    }
}
