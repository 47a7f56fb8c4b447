//! `ErrorFeedforwardIlc`.

use ilc_rt::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::any_size::AnySize;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::signal::{kind, read_filter};
use crate::whole;

/// Feed-forward learned from the filtered error.
///
/// ``u'[k] = clamp(u[k] + gain (Q e)[k + lead])``
///
/// Parameters
/// ----------
/// gain : float
///     Learning gain, input units per error unit.
/// filter : ButterworthFilter, GaussianFilter, SwitchedFilter, FirFilter, array or None
///     Filter Q of the error; an array holds the taps of a symmetric one.
/// lead : int
///     How many samples ahead the error is taken: 1 for an axis without delay,
///     1 more for each sample of delay.
/// limit : float or None
///     Largest magnitude of the learned feed-forward.
///
/// Raises
/// ------
/// LearningError
///     If the gain is not finite, or the limit not positive.
/// SignalError, TypeError
///     If `filter` is none.
///
/// Notes
/// -----
/// For the parallel structure: `u` is added to the controller's output. Each
/// channel learns by itself. Beyond the end of the run the error is held.
///
/// References
/// ----------
/// [filter-based], Eq. (2), with the lead of Eq. (9).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import ErrorFeedforwardIlc
/// >>> ErrorFeedforwardIlc(0.5, limit=1.5).update(np.zeros(3), np.array([1.0, 2.0, 4.0]))
/// array([1. , 1.5, 1.5])
#[pyclass(name = "ErrorFeedforwardIlc", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyErrorFeedforwardIlc {
    made: Made,
    rule: Feedforward,
    filter: QFilter,
    law: AnySize<ErrorFeedforward>,
}

impl PyErrorFeedforwardIlc {
    /// Makes the law anew, for runs of the given size.
    pub(super) fn own(
        &self,
        n_samples: usize,
        n_channels: usize,
    ) -> Result<Box<dyn Law>, LearningError> {
        let filter = self.filter.clone();
        Ok(Box::new(ErrorFeedforward::new(self.rule, n_samples, n_channels, filter)?))
    }
}

#[pymethods]
impl PyErrorFeedforwardIlc {
    #[new]
    #[pyo3(signature = (gain, filter=None, lead=1, limit=None))]
    fn new(
        gain: f64,
        filter: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::lead)] lead: usize,
        limit: Option<f64>,
    ) -> PyResult<Self> {
        let made = made!(gain, filter, lead, limit);
        let rule = Feedforward {
            gain_per_s: gain,
            lead_samples: lead,
            input_max: limit.unwrap_or(f64::INFINITY),
        };
        // Made once for nothing, so that a wrong gain shows here and not after the first run.
        ErrorFeedforward::new(rule, 1, 1, QFilter::None).or_raise()?;
        Ok(Self { made, rule, filter: read_filter("filter", filter)?, law: AnySize::new() })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Values of the last input that stand at the limit.
    #[getter]
    fn n_limited(&self) -> usize {
        self.law.look(ErrorFeedforward::n_limited).unwrap_or(0)
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
            ErrorFeedforward::new(self.rule, n_samples, n_channels, self.filter.clone())
        })
    }

    /// Forget what earlier runs taught: nothing, for this law.
    fn reset(&self) {
        self.law.reset();
    }

    fn __repr__(&self) -> String {
        let Feedforward { gain_per_s: gain, lead_samples: lead, input_max: limit } = self.rule;
        let limit = if limit.is_finite() { limit.to_string() } else { "None".to_owned() };
        format!(
            "ErrorFeedforwardIlc(gain={gain}, filter={}, lead={lead}, limit={limit})",
            kind(&self.filter)
        )
    }
}
