//! `Law`: the native Python class behind every learning law.
//!
//! The typed classes of `ilc_rt.laws` derive from it. A kind of law is a small function that
//! builds it from its arguments, and a line of `BUILDERS` in the same file; this file has the exchange of signals with
//! NumPy, the size of the runs, pickling, and the access to the law for analysis and campaign.

mod apart;
mod around;
mod bounded;
mod exchange;
mod figure;
mod kinds;
mod optimal;
pub(crate) mod recalled;
mod research;

use std::sync::Arc;

use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::{Law, LearningError};
use pyo3::exceptions::{PyAttributeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answer::{Array, ByName};
use crate::argument::{Channels, Layout, read_disturbance};
use crate::arguments::Arguments;
use crate::detached::interruptible;
use crate::error::OrRaise;
use crate::guard::{Borrowed, Guarded};
use crate::made::reduce_kind;
use crate::python_law::{Frame, PythonLaw};
use crate::signal::given_filter;
use crate::whole::whole;
pub(crate) use apart::{apart, is_python, samples_of};
use exchange::{Copies, Given, Signals};
pub(crate) use figure::Readable;

/// A function that builds a law from its arguments.
type Build = fn(&Call<'_, '_>) -> PyResult<Built>;

/// A name of a law and its builder.
type Builder = (&'static str, Build);

/// The kinds of law with their builders, a list in each file.
const BUILDERS: [&[Builder]; 6] = [
    kinds::BUILDERS,
    optimal::BUILDERS,
    bounded::BUILDERS,
    around::BUILDERS,
    recalled::BUILDERS,
    research::BUILDERS,
];

/// The size of a run, from its signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Size {
    n_samples: usize,
    channels: Channels,
    n_disturbances: usize,
}

impl Size {
    const ONE: Self =
        Self { n_samples: 1, channels: Channels { n_inputs: 1, n_outputs: 1 }, n_disturbances: 0 };
}

/// Sizes of runs that a law accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fits {
    /// One size.
    Fixed(usize, Channels),
    /// Any size with the channels of the error equal to those of the input. The law is rebuilt for
    /// each new size, which cannot be compared with earlier ones.
    Alike,
    /// Any number of samples with these channels, likewise.
    Channels(Channels),
    /// Any, likewise.
    Any,
    /// Any size at first, and then that size until the law is reset.
    First,
}

/// One call of a builder.
struct Call<'a, 'py> {
    arguments: Arguments<'a, 'py>,
    /// Size of the coming runs; `None` before the first one, when a law that accepts any size is
    /// built for a single sample: its arguments are checked, and its figures can be read.
    size: Option<Size>,
    /// The frame of an inner law that is used in place; `None` if the whole is built separately.
    live: Option<&'a Arc<Frame>>,
}

impl<'py> Call<'_, 'py> {
    fn py(&self) -> Python<'py> {
        self.arguments.py()
    }

    /// Returns the size of the runs, or the smallest one before the first.
    fn size(&self) -> Size {
        self.size.unwrap_or(Size::ONE)
    }

    /// Returns the Q-filter of a law; a single sample is too short for any.
    fn filter(&self, name: &str) -> PyResult<QFilter> {
        let filter = given_filter(self.arguments, name)?;
        Ok(if self.size.is_some() { filter } else { QFilter::None })
    }

    /// Returns the inner law: the object itself, or an exclusive copy.
    fn inner(&self, name: &str, channels: Channels) -> PyResult<Box<dyn Law>> {
        let object = self.arguments.get(name)?;
        if let Some(frame) = self.live {
            return Ok(Box::new(PythonLaw::new(name, &object, channels, Arc::clone(frame))?));
        }
        let Size { n_samples, n_disturbances, .. } = self.size();
        apart(name, &object, n_samples, channels, n_disturbances)
    }

    /// Builds a law while other Python threads run.
    fn built<L: Readable + 'static>(
        &self,
        fits: Fits,
        build: impl FnOnce() -> Result<L, LearningError> + Send,
    ) -> PyResult<Built> {
        Built::of(fits, interruptible(self.py(), build)?)
    }
}

/// A law and the runs it accepts.
struct Built {
    law: Box<dyn Readable>,
    fits: Fits,
}

impl Built {
    /// Returns a new law, or raises its refusal.
    fn of(fits: Fits, law: Result<impl Readable + 'static, LearningError>) -> PyResult<Self> {
        Ok(Self { law: Box::new(law.or_raise()?), fits })
    }
}

/// A learning law of the controller, of any kind.
///
/// `ilc_rt.laws` has a typed class for each kind, which documents its equation and parameters.
#[pyclass(name = "Law", module = "ilc_rt._native", subclass, frozen)]
pub(crate) struct PyLaw {
    kind: &'static str,
    build: Build,
    arguments: Py<PyDict>,
    fits: Fits,
    frame: Arc<Frame>,
    state: Guarded<State>,
}

struct State {
    law: Box<dyn Readable>,
    /// Size that the law was built for; `None` before the first run.
    size: Option<Size>,
    /// Disturbances set before the first run.
    announced: Vec<Vec<f64>>,
    copies: Copies,
}

#[pymethods]
impl PyLaw {
    #[new]
    fn new(kind: &str, arguments: Arguments<'_, '_>) -> PyResult<Self> {
        let mut builders = BUILDERS.into_iter().flatten().copied();
        let Some((kind, build)) = builders.find(|(name, _)| *name == kind) else {
            let kinds: Vec<&str> = BUILDERS.into_iter().flatten().map(|(name, _)| *name).collect();
            let line = format!("kind = '{kind}'; one of {} is needed", kinds.join(", "));
            return Err(PyValueError::new_err(line));
        };
        let kept = arguments.kept()?;
        let frame = Arc::new(Frame::default());
        let call = Call { arguments: Arguments::new(&kept), size: None, live: Some(&frame) };
        let Built { law, fits } = build(&call)?;
        let size = match fits {
            Fits::Fixed(n_samples, channels) => {
                Some(Size { n_samples, channels, n_disturbances: 0 })
            }
            _ => None,
        };
        let state =
            Guarded::new(State { law, size, announced: Vec::new(), copies: Copies::default() });
        Ok(Self { kind, build, arguments: kept.unbind(), fits, frame, state })
    }

    /// Return the input of the next run.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n_samples,) or (n_samples, n_inputs)
    ///     Input of the run.
    /// e : ndarray of float64, shape (n_samples,) or (n_samples, n_outputs)
    ///     Error of the run, reference minus measurement, on the grid of `u`.
    /// disturbance : float, array_like of float64 or None, shape (n_disturbances,)
    ///     Measured disturbance of the coming run, e.g. a temperature; only
    ///     `RelevanceIlc` and `FlexibleIlc` use it, and any law inside another one
    ///     gets it as it is.
    /// out : ndarray of float64 or None, shape of `u`
    ///     Array for the next input, in C order, instead of a new one: `u` itself, or one that shares no
    ///     memory with `u` and `e`. No other thread may use it meanwhile. If the law raises an
    ///     exception, its values are undefined, or those of `u` if it is `u`.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, same shape as `u`
    ///     Input of the next run: `out` itself if it is given.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If an array has the wrong shape, dtype or a number that is not finite.
    /// LearningError, SignalError
    ///     If the run does not suit the law, e.g. it is too short for its filter.
    ///
    /// Notes
    /// -----
    /// An update that takes long releases the interpreter and works on copies of `u` and `e`, whose
    /// memory the law keeps: above 8192 numbers in both, with bounds always, and in norm-optimal
    /// learning without them above 262144.
    #[pyo3(signature = (u, e, disturbance=None, *, out=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> Array<'py> {
        let mut state = self.state.borrow(py)?;
        let in_place_max = state.law.in_place_max();
        let signals = Signals::read(u, e, out, &mut state.copies, in_place_max)?;
        let (u, e) = (signals.input.layout, signals.error.layout);
        let told = if state.law.n_disturbances().is_some() {
            disturbance.map(|given| read_disturbance("disturbance", given)).transpose()?
        } else {
            None
        };
        self.fit(py, &mut state, u, e, told.as_deref())?;
        if let Some(told) = &told {
            state.law.set_disturbance(told);
        }
        let has_inner = state.law.has_inner();
        if has_inner {
            let handed_on = disturbance.map(|given| given.clone().unbind());
            let handed_on = handed_on.filter(|_| told.is_none());
            self.frame.prepare(u.is_flat, handed_on);
        }
        let State { law, copies, .. } = &mut *state;
        let learned = signals.exchange(py, law.as_mut(), copies, has_inner)?;
        drop(state);
        learned.or_else(|error| match self.frame.take_raised() {
            Some(raised) => Err(raised),
            None => Err(error).or_raise(),
        })
    }

    /// Announce a run before it begins: the first one, or one that is not learned from.
    ///
    /// Its measured disturbance is a number or an array of shape (n_disturbances,). `update` announces the
    /// coming run itself if it is given one.
    fn expect(&self, py: Python<'_>, disturbance: &Bound<'_, PyAny>) -> PyResult<()> {
        let values = read_disturbance("disturbance", disturbance)?;
        let mut state = self.state.borrow(py)?;
        if state.size.is_some() {
            state.law.set_disturbance(&values);
        } else {
            state.announced.push(values);
        }
        Ok(())
    }

    /// Notify the law of a rollback: its last input is not used, since the error grew with it.
    fn taken_back(&self, py: Python<'_>) -> PyResult<()> {
        self.state.borrow(py)?.law.on_rollback();
        Ok(())
    }

    /// Forget everything learned from earlier runs; a law with a library reads it again.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        let mut state = self.state.borrow(py)?;
        state.law.reset();
        state.announced.clear();
        if self.fits == Fits::First && state.size.take().is_some() {
            state.law = self.build(py, None)?.law;
        }
        Ok(())
    }

    /// Parameters of the law by name, as they were given.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> ByName<'py> {
        self.arguments.bind(py).copy()
    }

    /// Figure of the law of this name, for the properties of the typed classes.
    fn _figure<'py>(&self, py: Python<'py>, name: &str) -> Array<'py> {
        let state = self.state.borrow(py)?;
        let found = state.law.figure(name);
        let n_inputs = state.size.unwrap_or(Size::ONE).channels.n_inputs;
        drop(state);
        let missing = || PyAttributeError::new_err(format!("this law has no {name}"));
        found.ok_or_else(missing)?.give(py, n_inputs, self.frame.is_flat())
    }

    /// Add an earlier run, or one made elsewhere, to the memory.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn _remember(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        e: &Bound<'_, PyAny>,
        disturbance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (u, e) = (Given::read("u", u)?, Given::read("e", e)?);
        let told = read_told("disturbance", disturbance)?;
        let mut state = self.state.borrow(py)?;
        self.fit(py, &mut state, u.layout, e.layout, Some(&told))?;
        let is_kept = state.law.recall(u.values()?, e.values()?, &told).or_raise()?;
        is_kept.then_some(()).ok_or_else(no_memory)
    }

    /// Return numbers and weights of the runs used under a disturbance.
    fn _relevant(
        &self,
        py: Python<'_>,
        disturbance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Vec<usize>, Vec<f64>)> {
        let told = read_told("disturbance", disturbance)?;
        let mut state = self.state.borrow(py)?;
        if state.size.is_none() {
            return Ok((Vec::new(), Vec::new()));
        }
        let law = state.law.relevance().ok_or_else(no_memory)?;
        Ok(law.relevant(&told).or_raise()?.into_iter().unzip())
    }

    /// Forget all but some of the remembered runs, and return the numbers of the remaining ones.
    fn _trim(
        &self,
        py: Python<'_>,
        keep: &Bound<'_, PyAny>,
        disturbances: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<usize>> {
        let keep = whole("keep", keep)?;
        let told = read_told("disturbances", disturbances)?;
        let mut state = self.state.borrow(py)?;
        if state.size.is_none() {
            return Ok(Vec::new());
        }
        state.law.relevance().ok_or_else(no_memory)?.trim(keep, &told).or_raise()
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let this = slf.get();
        let class = slf.get_type().name()?.to_string();
        let made_by =
            optimal::METHODS.contains(&this.kind).then(|| format!("{class}.{}", this.kind));
        let arguments = this.arguments.bind(slf.py()).copy()?;
        // Its runs are not part of its identity: a campaign resumes with another library.
        let _ = arguments.del_item("library");
        Arguments::new(&arguments).call(&made_by.unwrap_or(class))
    }

    /// Pickled and copied as created, without anything learned since.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        let this = slf.get();
        reduce_kind(slf.as_any(), "Law", this.kind, &this.arguments)
    }
}

impl PyLaw {
    fn build(&self, py: Python<'_>, size: Option<Size>) -> PyResult<Built> {
        let arguments = Arguments::new(self.arguments.bind(py));
        (self.build)(&Call { arguments, size, live: Some(&self.frame) })
    }

    /// Refuses a run that the law does not accept, and builds the law for a new size.
    fn fit(
        &self,
        py: Python<'_>,
        state: &mut Borrowed<'_, State>,
        u: Layout,
        e: Layout,
        disturbance: Option<&[f64]>,
    ) -> PyResult<()> {
        let channels = Channels { n_inputs: u.n_channels, n_outputs: e.n_channels };
        match (self.fits, state.size) {
            (Fits::Fixed(..) | Fits::First, Some(size)) => {
                u.require_exactly("u", size.n_samples, size.channels.n_inputs)?;
                return e.require_exactly("e", size.n_samples, size.channels.n_outputs);
            }
            (Fits::Channels(needed), _) => {
                u.require_channels("u", needed.n_inputs)?;
                e.require_samples("e", u.n_samples)?;
                e.require_channels("e", needed.n_outputs)?;
            }
            (Fits::Alike, _) => {
                e.require_samples("e", u.n_samples)?;
                e.require_channels("e", u.n_channels)?;
            }
            (Fits::Any, _) | (_, None) => e.require_samples("e", u.n_samples)?,
        }
        let told = disturbance.or(state.announced.last().map(Vec::as_slice));
        let n_disturbances = told.map_or(0, <[f64]>::len);
        let size = Size { n_samples: u.n_samples, channels, n_disturbances };
        let kept = if self.fits == Fits::First { size } else { Size { n_disturbances: 0, ..size } };
        if state.size == Some(kept) {
            return Ok(());
        }
        self.frame.prepare(u.is_flat, None);
        let mut law = self.build(py, Some(size))?.law;
        for disturbance in std::mem::take(&mut state.announced) {
            law.set_disturbance(&disturbance);
        }
        (state.law, state.size) = (law, Some(kept));
        Ok(())
    }

    /// Reads from the law.
    pub(crate) fn look<T>(
        &self,
        py: Python<'_>,
        look: impl FnOnce(&mut dyn Readable) -> T,
    ) -> PyResult<T> {
        Ok(look(self.state.borrow(py)?.law.as_mut()))
    }
}

/// Reads disturbances; `None` is an empty one.
fn read_told(name: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    given.map_or_else(|| Ok(Vec::new()), |given| read_disturbance(name, given))
}

fn no_memory() -> PyErr {
    PyAttributeError::new_err("this law has no memory of runs")
}
