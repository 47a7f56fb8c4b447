//! `FlexibleIlc`.

use ilc_rt::learning::law::flexible::{Flexible, TableShape};
use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::recalled::{Recalled, Size};
use crate::error::OrRaise;
use crate::library::PyLibrary;
use crate::made::{Made, made};

/// Learning with a table of inputs over the disturbance (Flexible ILC).
///
/// ``u' = (1 - t) L(u_a, e_a) + t L(u_b, e_b)``
///
/// with L the core law, a the last run under the tabulated disturbance nearest to
/// the coming one, b that under the nearest one beyond it, and t how far the
/// coming one lies from a to b.
///
/// Parameters
/// ----------
/// library : Library or None
///     Where runs of earlier campaigns are; those that fit are read once, at the
///     first update, as `RelevanceIlc` does.
/// core : law
///     What a run proposes for the next one; a `NormOptimalIlc` with s = r = 0
///     inverts the model, as the source does.
/// tolerance : float
///     Distance up to which two disturbances are the same entry of the table.
/// cell : str or None
///     Only runs of the cell of this name.
///
/// Raises
/// ------
/// LearningError
///     If the tolerance is negative or not finite.
/// TypeError
///     If core is no law.
///
/// Notes
/// -----
/// The disturbance given to `update` is the coming run's, as with `RelevanceIlc`.
/// Beyond the table the nearest entry holds. The law uses two runs only and does
/// not ask how well they went: it is here to compare with.
///
/// References
/// ----------
/// [hoelzle2012], as described in [dimarco2016], Sec. 3.2.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import FlexibleIlc, PdIlc
/// >>> law = FlexibleIlc(None, PdIlc(kp=1.0, kd=0.0))
/// >>> law.remember(np.zeros(2), np.full(2, 1.0), disturbance=10.0)
/// >>> law.remember(np.zeros(2), np.full(2, 3.0), disturbance=20.0)
/// >>> law.update(np.zeros(2), np.zeros(2), disturbance=15.0)
/// array([2., 2.])
#[pyclass(name = "FlexibleIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyFlexibleIlc {
    made: Made,
    tolerance: f64,
    recalled: Recalled<Flexible>,
}

#[pymethods]
impl PyFlexibleIlc {
    #[new]
    #[pyo3(signature = (library, core, tolerance=0.0, *, cell=None))]
    fn new(
        library: Option<&Bound<'_, PyLibrary>>,
        core: &Bound<'_, PyAny>,
        tolerance: f64,
        cell: Option<String>,
    ) -> PyResult<Self> {
        let made = made!(library, core, tolerance, cell);
        if !(tolerance.is_finite() && tolerance >= 0.0) {
            let (what, allowed) = ("tolerance", "a tolerance must be finite and not negative");
            return Err(LearningError::Parameter { what, value: tolerance, allowed }).or_raise();
        }
        Ok(Self { made, tolerance, recalled: Recalled::new(library, core, cell)? })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Return the input of the next run.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n_samples,) or (n_samples, n_inputs)
    ///     Input of the run that is over.
    /// e : ndarray of float64, shape (n_samples,) or (n_samples, n_outputs)
    ///     Error of that run, reference minus measurement, on the grid of `u`.
    /// disturbance : float or array_like of float64, shape (n_disturbances,)
    ///     Disturbance of the coming run; None: as it was.
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
    /// LearningError
    ///     If the number of disturbances changes, or the core law fails.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.recalled.update(py, u, e, disturbance, |core, size| self.make(core, size))
    }

    /// Announce a run before it begins: the first one, or one not learned from.
    ///
    /// Parameters
    /// ----------
    /// disturbance : float or array_like of float64, shape (n_disturbances,)
    ///     Disturbance of the run about to begin.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If it holds no number, or one that is not finite.
    fn expect(&self, disturbance: &Bound<'_, PyAny>) -> PyResult<()> {
        self.recalled.expect(disturbance)
    }

    /// Enter a run that was made elsewhere into the table.
    ///
    /// Parameters
    /// ----------
    /// u, e : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
    ///     Its input and error.
    /// disturbance : float or array_like of float64, shape (n_disturbances,)
    ///     The disturbance it was made under; None if none is measured.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     As `update` does.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn remember(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        e: &Bound<'_, PyAny>,
        disturbance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.recalled.remember(py, u, e, disturbance, |core, size| self.make(core, size))
    }

    /// Forget the table; the library is read again at the next update.
    fn reset(&self, py: Python<'_>) {
        self.recalled.reset(py);
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.recalled.with(py, |law| law.len()).unwrap_or(0)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let core = self.recalled.core_repr(py)?;
        Ok(format!("FlexibleIlc(core={core}, tolerance={})", self.tolerance))
    }
}

impl PyFlexibleIlc {
    fn make(&self, core: Box<dyn Law>, size: Size) -> PyResult<Flexible> {
        let Size { n_samples, n_inputs, n_outputs, n_disturbances, .. } = size;
        let tolerance = self.tolerance;
        let shape = TableShape { n_samples, n_inputs, n_outputs, n_disturbances, tolerance };
        Flexible::new(core, shape).or_raise()
    }
}
