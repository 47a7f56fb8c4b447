//! `PdIlc`.

use ilc_rt::learning::law::pd::{Pd, PdGains};
use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::any_size::AnySize;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::signal::{kind, read_filter};
use crate::whole;

/// Proportional-derivative learning with a low-pass filter.
///
/// ``u'[n] = Q (u[n] + kp e[n + lead] + kd (e[n + lead] - e[n + lead - 1]))``
///
/// Parameters
/// ----------
/// kp : float
///     Proportional gain.
/// kd : float
///     Gain of the error's difference from sample to sample.
/// q_filter : ButterworthFilter, GaussianFilter, SwitchedFilter, FirFilter, array or None
///     Filter Q, applied without lag unless it is causal; an array holds the taps
///     of a symmetric one.
/// lead : int
///     How many samples ahead the error is taken: 1 for an axis without delay,
///     1 more for each sample of delay.
///
/// Raises
/// ------
/// LearningError
///     If a gain is not finite.
/// SignalError, TypeError
///     If `q_filter` is none.
///
/// Notes
/// -----
/// Each channel learns by itself. Beyond the end of the run the error is held
/// at its last value.
///
/// References
/// ----------
/// [haas2016], Eq. (4); [dimarco2016], Eq. (3.2).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import PdIlc
/// >>> PdIlc(kp=1.0, kd=0.0).update(np.zeros(3), np.array([1.0, 2.0, 4.0]))
/// array([2., 4., 4.])
#[pyclass(name = "PdIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyPdIlc {
    made: Made,
    gains: PdGains,
    q_filter: QFilter,
    law: AnySize<Pd>,
}

impl PyPdIlc {
    /// Makes the law anew, for runs of the given size.
    pub(super) fn own(
        &self,
        n_samples: usize,
        n_channels: usize,
    ) -> Result<Box<dyn Law>, LearningError> {
        Ok(Box::new(Pd::new(self.gains, n_samples, n_channels, self.q_filter.clone())?))
    }
}

#[pymethods]
impl PyPdIlc {
    #[new]
    #[pyo3(signature = (kp, kd, q_filter=None, lead=1))]
    fn new(
        kp: f64,
        kd: f64,
        q_filter: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::lead)] lead: usize,
    ) -> PyResult<Self> {
        let made = made!(kp, kd, q_filter, lead);
        let gains = PdGains { kp, kd, lead_samples: lead };
        // Made once for nothing, so that a wrong gain shows here and not after the first run.
        Pd::new(gains, 1, 1, QFilter::None).or_raise()?;
        Ok(Self { made, gains, q_filter: read_filter("q_filter", q_filter)?, law: AnySize::new() })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Return the input of the next run.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
    ///     Input of the run.
    /// e : ndarray of float64, same shape as `u`
    ///     Error of the run, reference minus measurement, on the grid of `u`.
    /// disturbance : object
    ///     Accepted from whoever calls every law alike; this one has no use for it.
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
    /// SignalError
    ///     If the run is too short for the filter.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let _ = disturbance;
        self.law.update(py, u, e, |n_samples, n_channels| {
            Pd::new(self.gains, n_samples, n_channels, self.q_filter.clone())
        })
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        self.law.reset();
    }

    fn __repr__(&self) -> String {
        let PdGains { kp, kd, lead_samples: lead } = self.gains;
        let filter = kind(&self.q_filter);
        format!("PdIlc(kp={kp}, kd={kd}, q_filter={filter}, lead={lead})")
    }
}
