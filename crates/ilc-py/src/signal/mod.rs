//! Filters for Python, one a file, and what takes any of them.

mod butterworth;
mod fir;
mod frequency;
mod gaussian;
mod switched;

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::signal::FirFilter;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::argument::{Signal, give_signal, read_vector};
use crate::detached::detached;
use crate::error::OrRaise;

/// Reads a filter of any kind, or the taps of a symmetric one, as a law takes it.
pub(crate) fn read_filter(name: &str, object: Option<&Bound<'_, PyAny>>) -> PyResult<QFilter> {
    let Some(object) = object else { return Ok(QFilter::None) };
    if let Ok(filter) = object.cast::<butterworth::PyButterworthFilter>() {
        return Ok(filter.get().q_filter());
    }
    if let Ok(filter) = object.cast::<gaussian::PyGaussianFilter>() {
        return Ok(QFilter::Gaussian(filter.get().filter));
    }
    if let Ok(filter) = object.cast::<switched::PySwitchedFilter>() {
        return Ok(QFilter::Switched(filter.get().filter.clone()));
    }
    if let Ok(filter) = object.cast::<fir::PyFirFilter>() {
        return Ok(QFilter::Fir(filter.get().filter.clone()));
    }
    // Anything with a length may be taps; what is none is named as a filter, not as an array.
    if object.len().is_err() || object.is_instance_of::<pyo3::types::PyString>() {
        let kind = object.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "{name} is a {kind}; a filter of ilc_rt.signal, an array of taps or None is needed"
        )));
    }
    Ok(QFilter::Fir(FirFilter::new(&read_vector(name, object)?).or_raise()?))
}

/// Returns how a law shows its filter.
pub(crate) fn kind(filter: &QFilter) -> &'static str {
    match filter {
        QFilter::None => "None",
        QFilter::ZeroPhase(_) => "zero-phase",
        QFilter::Causal(_) => "causal",
        QFilter::Gaussian(_) => "Gaussian",
        QFilter::Switched(_) => "switched",
        QFilter::Fir(_) => "FIR",
    }
}

/// Filters a signal from Python.
fn filtered<'py>(
    py: Python<'py>,
    filter: &QFilter,
    x: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut x = Signal::read("x", x)?;
    detached(py, || filter.for_samples(x.n_samples)?.apply(&mut x.values, x.n_channels))
        .or_raise()?;
    give_signal(py, x.values, x.n_channels, x.is_flat)
}

/// Return a signal filtered without lag.
///
/// Parameters
/// ----------
/// filter : ButterworthFilter, GaussianFilter, SwitchedFilter, FirFilter or array
///     Filter; an array holds the taps of a symmetric one. A Butterworth filter
///     is applied forward and backward, also one that laws apply forward only.
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
///     If the signal is too short for the filter.
/// ValueError, TypeError
///     If `x` has the wrong shape, dtype or a number that is not finite, or
///     `filter` is none.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import signal
/// >>> smooth = signal.zero_phase(signal.butterworth(2, 50.0, 0.002), np.ones(100))
/// >>> bool(np.allclose(smooth, 1.0))
/// True
#[pyfunction]
fn zero_phase<'py>(
    py: Python<'py>,
    filter: &Bound<'py, PyAny>,
    x: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let filter = match read_filter("filter", Some(filter))? {
        QFilter::Causal(sections) => QFilter::ZeroPhase(sections),
        filter => filter,
    };
    filtered(py, &filter, x)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<butterworth::PyButterworthFilter>()?;
    module.add_class::<gaussian::PyGaussianFilter>()?;
    module.add_class::<switched::PySwitchedFilter>()?;
    module.add_class::<fir::PyFirFilter>()?;
    module.add_function(wrap_pyfunction!(butterworth::butterworth, module)?)?;
    module.add_function(wrap_pyfunction!(gaussian::gaussian, module)?)?;
    module.add_function(wrap_pyfunction!(fir::fir, module)?)?;
    module.add_function(wrap_pyfunction!(frequency::instantaneous_frequency, module)?)?;
    module.add_function(wrap_pyfunction!(zero_phase, module)?)
}
