//! `repeatability`, `Repeatability`.

use ilc_rt::learning;
use pyo3::prelude::*;

use crate::argument::{Runs, give_signal};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};

/// What several runs with the same input have in common.
#[pyclass(name = "Repeatability", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyRepeatability {
    made: Made,
    found: learning::Repeatability,
    n_channels: usize,
    is_flat: bool,
}

#[pymethods]
impl PyRepeatability {
    /// Pickled and copied as the call that made it, which is made again.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Mean error of the runs, sample by sample.
    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.found.mean.clone(), self.n_channels, self.is_flat)
    }

    /// Standard deviation from run to run, sample by sample.
    #[getter]
    fn spread<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.found.spread.clone(), self.n_channels, self.is_flat)
    }

    /// Root mean square of the mean error: what learning can take away.
    #[getter]
    fn mean_rms(&self) -> f64 {
        self.found.mean_rms
    }

    /// Root mean square of the standard deviation: what it cannot.
    #[getter]
    fn spread_rms(&self) -> f64 {
        self.found.spread_rms
    }

    /// `spread_rms` over `mean_rms`; well below 1 where learning applies.
    #[getter]
    fn ratio(&self) -> f64 {
        self.found.ratio
    }

    /// Share of the mean square of one run's error that repeats, 0 to 1.
    #[getter]
    fn learnable(&self) -> f64 {
        self.found.learnable
    }

    /// Smallest root mean square of any run.
    #[getter]
    fn least_rms(&self) -> f64 {
        self.found.least_rms
    }

    /// Largest root mean square of any run.
    #[getter]
    fn largest_rms(&self) -> f64 {
        self.found.largest_rms
    }

    fn __repr__(&self) -> String {
        let learning::Repeatability { mean_rms, spread_rms, ratio, learnable, .. } = &self.found;
        format!(
            "Repeatability(mean_rms={mean_rms:e}, spread_rms={spread_rms:e}, ratio={ratio:.3}, learnable={learnable:.3})"
        )
    }
}

/// Compare the errors of runs with the same input.
///
/// ``learnable = (ms(m) - ms(s)/n) / (ms(m) - ms(s)/n + ms(s))``, m the mean and s the
/// standard deviation over n runs
///
/// Parameters
/// ----------
/// errors : ndarray of float64, shape (n_runs, n_samples) or (n_runs, n_samples, n_channels)
///     Errors of at least two runs.
///
/// Returns
/// -------
/// Repeatability
///     What repeats and what does not: whether learning is worth while.
///
/// Raises
/// ------
/// LearningError
///     If there are fewer than two runs.
/// ValueError, TypeError
///     If `errors` has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [filter-based], Section 6.1.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import repeatability
/// >>> repeatability(np.array([[1.0, 1.0], [3.0, -1.0]])).mean
/// array([2., 0.])
#[pyfunction]
pub(super) fn repeatability(
    py: Python<'_>,
    errors: &Bound<'_, PyAny>,
) -> PyResult<PyRepeatability> {
    let made = made!("repeatability": errors);
    let runs = Runs::read("errors", errors)?;
    let Runs { count, n_samples, n_channels, is_flat, .. } = runs;
    let found =
        detached(py, || learning::repeatability(&runs.values, count, n_samples, n_channels))
            .or_raise()?;
    Ok(PyRepeatability { made, found, n_channels, is_flat })
}
