//! `ButterworthFilter`, `butterworth`.

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::signal::{self, Section, SosFilter};
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;

use super::filtered;
use crate::argument::{Signal, give_signal};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::whole;

/// Butterworth low-pass filter.
///
/// Parameters
/// ----------
/// order : int
///     1 to 12.
/// cutoff_hz : float
///     Frequency in Hz at which one pass has a gain of 1/sqrt(2).
/// dt_s : float
///     Sample time in seconds.
/// causal : bool
///     Whether a learning law applies it forward only, with lag; otherwise it
///     is applied forward and backward, without.
///
/// Raises
/// ------
/// SignalError
///     If order, cut-off or sample time cannot be designed for.
///
/// Examples
/// --------
/// >>> from ilc_rt import signal
/// >>> signal.ButterworthFilter(2, 50.0, 0.002).sos.shape
/// (1, 6)
#[pyclass(name = "ButterworthFilter", module = "ilc_rt.signal", frozen)]
#[derive(Debug)]
pub(crate) struct PyButterworthFilter {
    made: Made,
    /// Order of the filter.
    #[pyo3(get)]
    order: usize,
    /// Cut-off of one pass in Hz.
    #[pyo3(get)]
    cutoff_hz: f64,
    /// Sample time in seconds.
    #[pyo3(get)]
    dt_s: f64,
    /// Whether a learning law applies it forward only.
    #[pyo3(get)]
    causal: bool,
    sections: Vec<Section>,
}

impl PyButterworthFilter {
    /// Returns the filter as a law takes it.
    pub(crate) fn q_filter(&self) -> QFilter {
        let sections = self.sections.clone();
        if self.causal { QFilter::Causal(sections) } else { QFilter::ZeroPhase(sections) }
    }
}

#[pymethods]
impl PyButterworthFilter {
    #[new]
    #[pyo3(signature = (order, cutoff_hz, dt_s, causal=false))]
    fn new(
        #[pyo3(from_py_with = whole::order)] order: usize,
        cutoff_hz: f64,
        dt_s: f64,
        causal: bool,
    ) -> PyResult<Self> {
        let made = made!(order, cutoff_hz, dt_s, causal);
        let sections = signal::butterworth(order, cutoff_hz, dt_s).or_raise()?;
        Ok(Self { made, order, cutoff_hz, dt_s, causal, sections })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Second-order sections, shape (n_sections, 6): b0 b1 b2 1 a1 a2.
    #[getter]
    fn sos<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let rows: Vec<[f64; 6]> = self
            .sections
            .iter()
            .map(|Section { b, a }| [b[0], b[1], b[2], 1.0, a[0], a[1]])
            .collect();
        Array2::from_shape_fn((rows.len(), 6), |(row, col)| rows[row][col])
            .into_pyarray(py)
            .into_any()
    }

    /// Return the signal filtered forward only, from rest.
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
    fn filter<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut x = Signal::read("x", x)?;
        detached(py, || {
            for channel in 0..x.n_channels {
                let mut filter = SosFilter::new(self.sections.clone());
                for value in x.values.iter_mut().skip(channel).step_by(x.n_channels) {
                    *value = filter.step(*value);
                }
            }
        });
        give_signal(py, x.values, x.n_channels, x.is_flat)
    }

    /// Return the signal filtered forward and backward, without lag.
    ///
    /// Parameters
    /// ----------
    /// x : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
    ///     Signal.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, same shape
    ///     Filtered signal; the gain is 1/2 at the cut-off.
    ///
    /// Raises
    /// ------
    /// SignalError
    ///     If the signal is too short to be extended at its ends.
    /// ValueError, TypeError
    ///     If `x` has the wrong shape, dtype or a number that is not finite.
    fn zero_phase<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        filtered(py, &QFilter::ZeroPhase(self.sections.clone()), x)
    }

    fn __repr__(&self) -> String {
        let Self { order, cutoff_hz, dt_s, causal, .. } = self;
        let causal = if *causal { "True" } else { "False" };
        format!(
            "ButterworthFilter(order={order}, cutoff_hz={cutoff_hz}, dt_s={dt_s}, causal={causal})"
        )
    }
}

/// Return a Butterworth low-pass filter.
///
/// Parameters
/// ----------
/// order : int
///     1 to 12.
/// cutoff_hz : float
///     Frequency in Hz at which one pass has a gain of 1/sqrt(2).
/// dt_s : float
///     Sample time in seconds.
/// causal : bool
///     Whether a learning law applies it forward only, with lag.
///
/// Returns
/// -------
/// ButterworthFilter
///     Filter, to be applied or given to a law as `q_filter`.
///
/// Raises
/// ------
/// SignalError
///     If order, cut-off or sample time cannot be designed for.
///
/// Examples
/// --------
/// >>> from ilc_rt import signal
/// >>> signal.butterworth(2, 50.0, 0.002)
/// ButterworthFilter(order=2, cutoff_hz=50, dt_s=0.002, causal=False)
#[pyfunction]
#[pyo3(signature = (order, cutoff_hz, dt_s, causal=false))]
pub(super) fn butterworth(
    #[pyo3(from_py_with = whole::order)] order: usize,
    cutoff_hz: f64,
    dt_s: f64,
    causal: bool,
) -> PyResult<PyButterworthFilter> {
    PyButterworthFilter::new(order, cutoff_hz, dt_s, causal)
}
