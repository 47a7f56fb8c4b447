//! `SwitchedFilter`.

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::signal::{Segment, SwitchRule, SwitchedFilter};
use pyo3::prelude::*;

use super::filtered;
use crate::argument::Signal;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::whole;

/// Zero-phase low-pass with another cut-off on each segment.
///
/// ``y[k] = sum_i w_i[k] (Q_i x)[k]``, the weights going over along half a cosine
///
/// Parameters
/// ----------
/// cutoffs_hz : list of float
///     Cut-off of one pass on each segment, in Hz.
/// starts : list of int
///     First sample of each segment, 0 for the first one.
/// dt_s : float
///     Sample time in seconds.
/// order : int
///     Order of one pass, 1 to 12.
/// blend : int
///     Samples within which it goes over from one segment to the next, half of
///     them before the start of the later one.
///
/// Raises
/// ------
/// SignalError
///     If a cut-off or the order cannot be designed for, the segments are not in
///     order, or there are not as many starts as cut-offs.
///
/// References
/// ----------
/// [filter-based], Eq. (12); the cross-fade is ours.
///
/// Examples
/// --------
/// >>> from ilc_rt import signal
/// >>> signal.SwitchedFilter([10.0, 50.0, 10.0], [0, 300, 600], 0.002, blend=50).starts
/// [0, 300, 600]
#[pyclass(name = "SwitchedFilter", module = "ilc_rt.signal", frozen)]
#[derive(Debug)]
pub(crate) struct PySwitchedFilter {
    pub(super) filter: SwitchedFilter,
}

#[pymethods]
impl PySwitchedFilter {
    #[new]
    #[pyo3(signature = (cutoffs_hz, starts, dt_s, order=2, blend=0))]
    fn new(
        cutoffs_hz: Vec<f64>,
        #[pyo3(from_py_with = whole::list::starts)] starts: Vec<usize>,
        dt_s: f64,
        #[pyo3(from_py_with = whole::order)] order: usize,
        #[pyo3(from_py_with = whole::blend)] blend: usize,
    ) -> PyResult<Self> {
        if cutoffs_hz.len() != starts.len() {
            return Err(crate::exceptions::SignalError::new_err(format!(
                "{} cutoffs_hz for {} starts; as many are needed",
                cutoffs_hz.len(),
                starts.len()
            )));
        }
        let segments: Vec<Segment> = starts
            .into_iter()
            .zip(cutoffs_hz)
            .map(|(start, cutoff_hz)| Segment { start, cutoff_hz })
            .collect();
        Ok(Self { filter: SwitchedFilter::new(order, &segments, blend, dt_s).or_raise()? })
    }

    /// Pickled and copied as its segments.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let filter = &this.filter;
        let parts =
            (this.cutoffs_hz(), this.starts(), filter.dt_s(), filter.order(), filter.blend());
        Ok((slf.get_type().into_any(), parts.into_pyobject(py)?.into_any()))
    }

    /// Design the filter for a motion by its instantaneous frequency.
    ///
    /// Parameters
    /// ----------
    /// reference : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
    ///     The motion; a velocity shows the fast stretches better than a position.
    /// dt_s : float
    ///     Sample time in seconds.
    /// low_hz : float
    ///     Cut-off in Hz where the motion is slow.
    /// high_hz : float
    ///     Cut-off in Hz where it is fast.
    /// threshold_hz : float
    ///     Instantaneous frequency of the motion in Hz above which it is fast.
    /// order : int
    ///     Order of one pass.
    /// window_s : float or None
    ///     Span over which the frequency is averaged, weighted by the squared
    ///     amplitude; one period of the threshold unless given.
    /// margin_s : float or None
    ///     How long before and after a fast stretch the filter is open; one period
    ///     of the lower cut-off unless given.
    /// blend_s : float or None
    ///     Time within which it goes over; one period of the lower cut-off unless
    ///     given.
    ///
    /// Returns
    /// -------
    /// SwitchedFilter
    ///     Filter for runs of as many samples; open wherever any channel is fast.
    ///
    /// Raises
    /// ------
    /// SignalError
    ///     If a frequency or time is out of range.
    /// ValueError, TypeError
    ///     If `reference` has the wrong shape, dtype or a number that is not finite.
    ///
    /// References
    /// ----------
    /// [filter-based], Section 5.
    #[staticmethod]
    #[pyo3(signature = (reference, dt_s, low_hz, high_hz, threshold_hz, order=2, window_s=None, margin_s=None, blend_s=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python, each with its unit")]
    fn from_signal(
        py: Python<'_>,
        reference: &Bound<'_, PyAny>,
        dt_s: f64,
        low_hz: f64,
        high_hz: f64,
        threshold_hz: f64,
        #[pyo3(from_py_with = whole::order)] order: usize,
        window_s: Option<f64>,
        margin_s: Option<f64>,
        blend_s: Option<f64>,
    ) -> PyResult<Self> {
        let reference = Signal::read("reference", reference)?;
        let usual = SwitchRule::new(low_hz, high_hz, threshold_hz);
        let rule = SwitchRule {
            order,
            window_s: window_s.unwrap_or(usual.window_s),
            margin_s: margin_s.unwrap_or(usual.margin_s),
            blend_s: blend_s.unwrap_or(usual.blend_s),
            ..usual
        };
        let design = || rule.design(&reference.values, reference.n_channels, dt_s);
        Ok(Self { filter: detached(py, design).or_raise()? })
    }

    /// Cut-off of one pass on each segment in Hz.
    #[getter]
    fn cutoffs_hz(&self) -> Vec<f64> {
        self.filter.segments().iter().map(|segment| segment.cutoff_hz).collect()
    }

    /// First sample of each segment.
    #[getter]
    fn starts(&self) -> Vec<usize> {
        self.filter.segments().iter().map(|segment| segment.start).collect()
    }

    /// Order of one pass.
    #[getter]
    fn order(&self) -> usize {
        self.filter.order()
    }

    /// Samples within which it goes over from one segment to the next.
    #[getter]
    fn blend(&self) -> usize {
        self.filter.blend()
    }

    /// Sample time in seconds.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.filter.dt_s()
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
    ///     If the signal is too short, or ends before a segment starts.
    /// ValueError, TypeError
    ///     If `x` has the wrong shape, dtype or a number that is not finite.
    fn zero_phase<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        filtered(py, &QFilter::Switched(self.filter.clone()), x)
    }

    fn __repr__(&self) -> String {
        format!(
            "SwitchedFilter(cutoffs_hz={:?}, starts={:?}, dt_s={}, order={}, blend={})",
            self.cutoffs_hz(),
            self.starts(),
            self.dt_s(),
            self.order(),
            self.blend()
        )
    }
}
