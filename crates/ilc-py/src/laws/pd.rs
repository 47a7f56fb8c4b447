//! `PdIlc`.

use std::sync::Mutex;

use ilc_rt::learning::law::pd::{Pd, PdGains, QFilter};
use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::{held, next};
use crate::argument::{Signal, give_signal};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::signal::PyButterworthFilter;

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
/// q_filter : ButterworthFilter or None
///     Filter Q, applied without lag unless it is causal.
/// lead : int
///     How many samples ahead the error is taken: 1 for an axis without delay,
///     1 more for each sample of delay.
///
/// Raises
/// ------
/// LearningError
///     If a gain is not finite.
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
    gains: PdGains,
    q_filter: QFilter,
    /// The law for the size of run seen last.
    law: Mutex<Option<(usize, usize, Pd)>>,
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
        q_filter: Option<&Bound<'_, PyButterworthFilter>>,
        lead: usize,
    ) -> PyResult<Self> {
        let gains = PdGains { kp, kd, lead };
        // Made once for nothing, so that a wrong gain shows here and not after the first run.
        Pd::new(gains, 1, 1, QFilter::None).or_raise()?;
        let q_filter = q_filter.map_or(QFilter::None, |filter| filter.get().q_filter());
        Ok(Self { gains, q_filter, law: Mutex::new(None) })
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
        let u = Signal::read("u", u)?;
        let e = Signal::read("e", e)?
            .with_samples("e", u.n_samples)?
            .with_channels("e", u.n_channels)?;
        let (n_samples, n_channels) = (u.n_samples, u.n_channels);
        let next = detached(py, || {
            let mut kept = held(&self.law);
            match &mut *kept {
                Some((n, m, law)) if (*n, *m) == (n_samples, n_channels) => next(law, &u, &e),
                _ => {
                    let mut law =
                        Pd::new(self.gains, n_samples, n_channels, self.q_filter.clone())?;
                    let result = next(&mut law, &u, &e);
                    *kept = Some((n_samples, n_channels, law));
                    result
                }
            }
        });
        give_signal(py, next.or_raise()?, u.n_channels, u.is_flat)
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        if let Some((_, _, law)) = &mut *held(&self.law) {
            law.reset();
        }
    }

    fn __repr__(&self) -> String {
        let PdGains { kp, kd, lead } = self.gains;
        let filtered = match &self.q_filter {
            QFilter::None => "None",
            QFilter::ZeroPhase(_) => "zero-phase",
            QFilter::Causal(_) => "causal",
        };
        format!("PdIlc(kp={kp}, kd={kd}, q_filter={filtered}, lead={lead})")
    }
}
