//! `FirFilter`, `fir`.

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::signal::FirFilter;
use numpy::IntoPyArray;
use numpy::ndarray::Array1;
use pyo3::prelude::*;

use super::filtered;
use crate::argument::read_vector;
use crate::error::OrRaise;
use crate::whole;

/// Symmetric smoother of finite length, without lag.
///
/// ``y[k] = sum_i h[i] x[k + i - r]``, ``h[i] = h[2 r - i]``
///
/// Parameters
/// ----------
/// taps : ndarray of float64, shape (2 r + 1,)
///     Taps h, the same from either end.
/// repeats : int
///     How many passes the filter does in one: the taps are convolved with
///     themselves.
///
/// Raises
/// ------
/// SignalError
///     If the taps are an even number, or not symmetric.
/// ValueError, TypeError
///     If `taps` has the wrong shape, dtype or a number that is not finite.
///
/// Notes
/// -----
/// Beyond its ends the signal is held.
///
/// References
/// ----------
/// [dimarco2016], Eq. (3.2), for which the filter of the example serves.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import signal
/// >>> signal.FirFilter(np.array([-1, 4, 10, 4, -1]) / 16, repeats=6).taps.shape
/// (25,)
#[pyclass(name = "FirFilter", module = "ilc_rt.signal", frozen)]
#[derive(Debug)]
pub(crate) struct PyFirFilter {
    pub(super) filter: FirFilter,
}

#[pymethods]
impl PyFirFilter {
    #[new]
    #[pyo3(signature = (taps, repeats=1))]
    fn new(
        taps: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::repeats)] repeats: usize,
    ) -> PyResult<Self> {
        let once = FirFilter::new(&read_vector("taps", taps)?).or_raise()?;
        Ok(Self { filter: once.repeated(repeats).or_raise()? })
    }

    /// Pickled and copied as its taps.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let parts = (slf.get().taps(py),).into_pyobject(py)?.into_any();
        Ok((slf.get_type().into_any(), parts))
    }

    /// Taps, shape (n_taps,).
    #[getter]
    fn taps<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        Array1::from(self.filter.taps().to_vec()).into_pyarray(py).into_any()
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
    /// ValueError, TypeError
    ///     If `x` has the wrong shape, dtype or a number that is not finite.
    fn zero_phase<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        filtered(py, &QFilter::Fir(self.filter.clone()), x)
    }

    fn __repr__(&self) -> String {
        format!("FirFilter({} taps)", self.filter.taps().len())
    }
}

/// Return a symmetric smoother of finite length.
///
/// Parameters
/// ----------
/// taps : ndarray of float64, shape (2 r + 1,)
///     Taps, the same from either end.
/// repeats : int
///     How many passes the filter does in one.
///
/// Returns
/// -------
/// FirFilter
///     Filter, to be applied or given to a law as `q_filter`.
///
/// Raises
/// ------
/// SignalError
///     If the taps are an even number, or not symmetric.
/// ValueError, TypeError
///     If `taps` has the wrong shape, dtype or a number that is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt import signal
/// >>> signal.fir([0.25, 0.5, 0.25])
/// FirFilter(3 taps)
#[pyfunction]
#[pyo3(signature = (taps, repeats=1))]
pub(super) fn fir(
    taps: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::repeats)] repeats: usize,
) -> PyResult<PyFirFilter> {
    PyFirFilter::new(taps, repeats)
}
