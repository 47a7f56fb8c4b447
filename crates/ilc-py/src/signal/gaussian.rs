//! `GaussianFilter`, `gaussian`.

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::signal::GaussianFilter;
use pyo3::prelude::*;

use super::filtered;
use crate::error::OrRaise;
use crate::made::{Made, made};

/// Gaussian low-pass filter, without lag or overshoot.
///
/// ``w[i] = exp(-(i T / sigma)^2 / 2) / sum``, ``sigma = sqrt(ln 2) / (2 pi f)``
///
/// Parameters
/// ----------
/// bandwidth_hz : float
///     Frequency f in Hz at which the gain is 1/sqrt(2).
/// dt_s : float
///     Sample time T in seconds.
///
/// Raises
/// ------
/// SignalError
///     If bandwidth or sample time cannot be designed for.
///
/// Notes
/// -----
/// Beyond its ends the signal is mirrored between two samples. The bell is cut
/// off where 99.99 % of its area are inside.
///
/// References
/// ----------
/// [barton2010], H.3.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import signal
/// >>> float(signal.GaussianFilter(15.0, 0.002).zero_phase(np.ones(100))[3].round(12))
/// 1.0
#[pyclass(name = "GaussianFilter", module = "ilc_rt.signal", frozen)]
#[derive(Debug)]
pub(crate) struct PyGaussianFilter {
    made: Made,
    pub(super) filter: GaussianFilter,
}

#[pymethods]
impl PyGaussianFilter {
    #[new]
    fn new(bandwidth_hz: f64, dt_s: f64) -> PyResult<Self> {
        let made = made!(bandwidth_hz, dt_s);
        Ok(Self { made, filter: GaussianFilter::new(bandwidth_hz, dt_s).or_raise()? })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Bandwidth in Hz.
    #[getter]
    fn bandwidth_hz(&self) -> f64 {
        self.filter.bandwidth_hz()
    }

    /// Sample time in seconds.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.filter.dt_s()
    }

    /// Standard deviation of the bell in samples.
    #[getter]
    fn sigma_samples(&self) -> f64 {
        self.filter.sigma_samples()
    }

    /// Return the signal filtered.
    ///
    /// Parameters
    /// ----------
    /// x : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
    ///     Signal.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, same shape
    ///     Filtered signal.
    ///
    /// Raises
    /// ------
    /// SignalError
    ///     If the signal is shorter than half the bell.
    /// ValueError, TypeError
    ///     If `x` has the wrong shape, dtype or a number that is not finite.
    fn zero_phase<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        filtered(py, &QFilter::Gaussian(self.filter), x)
    }

    fn __repr__(&self) -> String {
        format!("GaussianFilter(bandwidth_hz={}, dt_s={})", self.bandwidth_hz(), self.dt_s())
    }
}

/// Return a Gaussian low-pass filter.
///
/// Parameters
/// ----------
/// bandwidth_hz : float
///     Frequency in Hz at which the gain is 1/sqrt(2).
/// dt_s : float
///     Sample time in seconds.
///
/// Returns
/// -------
/// GaussianFilter
///     Filter, to be applied or given to a law as `q_filter`.
///
/// Raises
/// ------
/// SignalError
///     If bandwidth or sample time cannot be designed for.
///
/// Examples
/// --------
/// >>> from ilc_rt import signal
/// >>> signal.gaussian(15.0, 0.002)
/// GaussianFilter(bandwidth_hz=15, dt_s=0.002)
#[pyfunction]
pub(super) fn gaussian(bandwidth_hz: f64, dt_s: f64) -> PyResult<PyGaussianFilter> {
    PyGaussianFilter::new(bandwidth_hz, dt_s)
}
