//! `instantaneous_frequency`.

use ilc_rt::signal;
use pyo3::prelude::*;

use crate::argument::{give_signal, read_vector};
use crate::detached::detached;
use crate::error::OrRaise;

/// Return the frequency of a signal from sample to sample.
///
/// ``f[k] = wrap(arg a[k+1] - arg a[k]) / (2 pi T)``, a the analytic signal
///
/// Parameters
/// ----------
/// x : ndarray of float64, shape (n_samples,)
///     Signal that swings about zero.
/// dt_s : float
///     Sample time T in seconds.
///
/// Returns
/// -------
/// ndarray of float64, shape (n_samples - 1,)
///     Frequency in Hz. Where the amplitude is small it is noise and may be
///     negative.
///
/// Raises
/// ------
/// SignalError
///     If there are fewer than two samples or the sample time is not positive.
/// ValueError, TypeError
///     If `x` has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [filter-based], Section 5; [oppenheim2009], Ch. 12.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import signal
/// >>> x = np.sin(2 * np.pi * 8.0 * 0.002 * np.arange(500))
/// >>> float(signal.instantaneous_frequency(x, 0.002)[100].round(9))
/// 8.0
#[pyfunction]
pub(super) fn instantaneous_frequency<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    dt_s: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let x = read_vector("x", x)?;
    let found = detached(py, || signal::instantaneous_frequency(&x, dt_s)).or_raise()?;
    give_signal(py, found, 1, true)
}
