//! Filters for Python: one class, `Filter`, behind the typed ones of `ilc_rt.signal`.

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::signal::{
    self, FirFilter, GaussianFilter, Section, Segment, SwitchRule, SwitchedFilter,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::answer::{Array, ByName, by_name, give_signal, give_vector};
use crate::argument::{Layout, Signal, read_vector};
use crate::arguments::Arguments;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::exceptions;
use crate::made::reduce_kind;
use crate::whole::{each, whole};

/// A filter of any kind, to be applied or passed to a law (Q-filter).
#[pyclass(name = "Filter", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyFilter {
    kind: String,
    arguments: Py<PyDict>,
    filter: QFilter,
}

#[pymethods]
impl PyFilter {
    #[new]
    fn new(kind: String, arguments: Arguments<'_, '_>) -> PyResult<Self> {
        let kept = arguments.kept()?;
        let a = Arguments::new(&kept);
        let filter = match kind.as_str() {
            "butterworth" => {
                let (order, cutoff_hz) = (a.whole("order")?, a.number("cutoff_hz")?);
                let kind = if a.flag("causal")? { QFilter::Causal } else { QFilter::ZeroPhase };
                kind(signal::butterworth(order, cutoff_hz, a.number("dt_s")?).or_raise()?)
            }
            "gaussian" => QFilter::Gaussian(
                GaussianFilter::new(a.number("bandwidth_hz")?, a.number("dt_s")?).or_raise()?,
            ),
            "fir" => {
                let once = FirFilter::new(&a.vector("taps")?).or_raise()?;
                QFilter::Fir(once.repeated(a.whole("repeats")?).or_raise()?)
            }
            "switched" => QFilter::Switched(switched(a)?),
            "from_signal" => QFilter::Switched(from_signal(a)?),
            _ => {
                let line = format!(
                    "kind = '{kind}'; butterworth, gaussian, fir, switched or from_signal is needed"
                );
                return Err(PyValueError::new_err(line));
            }
        };
        Ok(Self { kind, arguments: kept.unbind(), filter })
    }

    /// Return the zero-phase filtered signal.
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
    ///     If the signal is too short for the filter.
    /// ValueError, TypeError
    ///     If `x` has the wrong shape, dtype or a number that is not finite.
    fn zero_phase<'py>(&self, x: &Bound<'py, PyAny>) -> Array<'py> {
        filtered(&without_lag(&self.filter), x)
    }

    /// Return the causally filtered signal, from rest; recursive filters only.
    fn _forward<'py>(&self, x: &Bound<'py, PyAny>) -> Array<'py> {
        filtered(&QFilter::Causal(self.sections()?.to_vec()), x)
    }

    /// Sections b0 b1 b2 1 a1 a2 of a recursive filter.
    fn _sos<'py>(&self, py: Python<'py>) -> Array<'py> {
        let row = |&Section { b, a }: &Section| [b[0], b[1], b[2], 1.0, a[0], a[1]];
        give_signal(py, self.sections()?.iter().flat_map(row).collect(), 6, false)
    }

    /// Parameters of the filter by name, in addition to its arguments.
    fn _figures<'py>(&self, py: Python<'py>) -> ByName<'py> {
        let figures = self.arguments.bind(py).copy()?;
        let others = match &self.filter {
            QFilter::Gaussian(filter) => by_name!(py, sigma_samples: filter.sigma_samples()),
            QFilter::Fir(filter) => by_name!(py, taps: give_vector(py, filter.taps().to_vec())),
            QFilter::Switched(filter) => by_name!(py,
                cutoffs_hz: filter.segments().iter().map(|part| part.cutoff_hz).collect::<Vec<_>>(),
                starts: filter.segments().iter().map(|part| part.start).collect::<Vec<_>>(),
                order: filter.order(),
                blend: filter.blend(),
            ),
            _ => return Ok(figures),
        };
        figures.update(others.as_mapping())?;
        Ok(figures)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let this = slf.get();
        let class = slf.get_type().name()?.to_string();
        let class = if this.kind == "from_signal" { class + ".from_signal" } else { class };
        Arguments::new(this.arguments.bind(slf.py())).call(&class)
    }

    fn __eq__(slf: &Bound<'_, Self>, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            slf.get().filter == other.get().filter && slf.get_type().is(other.get_type())
        })
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        PyString::new(py, &self.filter.describe()).hash()
    }

    /// Pickled and copied as it was made.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let this = slf.get();
        reduce_kind(slf.as_any(), "Filter", &this.kind, &this.arguments)
    }
}

impl PyFilter {
    fn sections(&self) -> PyResult<&[Section]> {
        match &self.filter {
            QFilter::ZeroPhase(sections) | QFilter::Causal(sections) => Ok(sections),
            _ => Err(PyTypeError::new_err("this filter is not recursive: it has no sections")),
        }
    }
}

fn switched(a: Arguments<'_, '_>) -> PyResult<SwitchedFilter> {
    let cutoffs_hz = a.vector("cutoffs_hz")?;
    let starts = a.get("starts")?;
    let starts = each("starts", &starts, "a sequence of samples", |start| whole("starts", start))?;
    let (n_cutoffs, n_starts) = (cutoffs_hz.len(), starts.len());
    if n_cutoffs != n_starts {
        let line = format!("{n_cutoffs} cutoffs_hz for {n_starts} starts; as many are needed");
        return Err(exceptions::SignalError::new_err(line));
    }
    let segments = starts.into_iter().zip(cutoffs_hz);
    let segments: Vec<_> =
        segments.map(|(start, cutoff_hz)| Segment { start, cutoff_hz }).collect();
    SwitchedFilter::new(a.whole("order")?, &segments, a.whole("blend")?, a.number("dt_s")?)
        .or_raise()
}

fn from_signal(a: Arguments<'_, '_>) -> PyResult<SwitchedFilter> {
    let (reference, dt_s) = (a.signal("reference")?, a.number("dt_s")?);
    let usual =
        SwitchRule::new(a.number("low_hz")?, a.number("high_hz")?, a.number("threshold_hz")?);
    let rule = SwitchRule {
        order: a.whole("order")?,
        window_s: a.maybe_number("window_s")?.unwrap_or(usual.window_s),
        margin_s: a.maybe_number("margin_s")?.unwrap_or(usual.margin_s),
        blend_s: a.maybe_number("blend_s")?.unwrap_or(usual.blend_s),
        ..usual
    };
    detached(a.py(), || rule.design(&reference.values, reference.n_channels, dt_s)).or_raise()
}

/// Reads a filter, an array of taps, or no filter.
fn read_filter(name: &str, object: Option<&Bound<'_, PyAny>>) -> PyResult<QFilter> {
    let Some(object) = object else { return Ok(QFilter::None) };
    if let Ok(filter) = object.cast::<PyFilter>() {
        return Ok(filter.get().filter.clone());
    }
    // Anything with a length may be taps; anything else is refused as a filter, not as an array.
    if object.len().is_err() || object.is_instance_of::<PyString>() {
        let kind = object.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "{name} is a {kind}; a filter of ilc_rt.signal, an array of taps or None is needed"
        )));
    }
    Ok(QFilter::Fir(FirFilter::new(&read_vector(name, object)?).or_raise()?))
}

/// Reads such a filter from an argument.
pub(crate) fn given_filter(a: Arguments<'_, '_>, name: &str) -> PyResult<QFilter> {
    read_filter(name, a.given(name)?.as_ref())
}

fn without_lag(filter: &QFilter) -> QFilter {
    match filter {
        QFilter::Causal(sections) => QFilter::ZeroPhase(sections.clone()),
        filter => filter.clone(),
    }
}

fn filtered<'py>(filter: &QFilter, x: &Bound<'py, PyAny>) -> Array<'py> {
    let py = x.py();
    let Signal { mut values, layout } = Signal::read("x", x)?;
    let Layout { n_samples, n_channels, is_flat } = layout;
    detached(py, || filter.for_samples(n_samples)?.apply(&mut values, n_channels)).or_raise()?;
    give_signal(py, values, n_channels, is_flat)
}

#[pyfunction]
pub(crate) fn zero_phase<'py>(filter: &Bound<'py, PyAny>, x: &Bound<'py, PyAny>) -> Array<'py> {
    filtered(&without_lag(&read_filter("filter", Some(filter))?), x)
}

#[pyfunction]
pub(crate) fn instantaneous_frequency<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    let (x, dt_s) = (a.vector("x")?, a.number("dt_s")?);
    let found = detached(a.py(), || signal::instantaneous_frequency(&x, dt_s)).or_raise()?;
    Ok(give_vector(a.py(), found))
}
