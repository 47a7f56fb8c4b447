//! A campaign inside this process: `run_events`.

use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use ilc_rt::campaign::{self, CampaignError, Disturbance, Options};
use ilc_rt::cli::{IdentifyOptions, described, parse};
use ilc_rt::fieldbus::transport;
use ilc_rt::learning::Law;
use ilc_rt::record::Event;
use pyo3::exceptions::{PyBaseException, PyValueError};
use pyo3::prelude::*;

use crate::argument::{Channels, read_disturbance};
use crate::cell::PyCell;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::python_law::{Frame, PythonLaw};

/// Capacity of events towards Python; a full queue makes the campaign wait.
const EVENTS: usize = 64;
/// Interval at which a waiting `next` checks for signals.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Signal number with which a dropped stream stops its axes.
const SIGTERM: i32 = 15;

/// Events of a campaign that runs inside this process, one JSON object each.
#[pyclass(name = "EventStream", module = "ilc_rt._native", frozen)]
pub(crate) struct EventStream {
    events: Mutex<Receiver<String>>,
    thread: Mutex<Option<JoinHandle<Result<(), CampaignError>>>>,
    stop: Arc<AtomicI32>,
    /// Frame of a law written in Python.
    frame: Arc<Frame>,
}

#[pymethods]
impl EventStream {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<String>> {
        loop {
            let event = detached(py, || {
                self.events.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK_EVERY)
            });
            match event {
                Ok(event) => return Ok(Some(event)),
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => return self.finish(py).map(|()| None),
            }
        }
    }

    /// Return the exception that the law raised, with its traceback, or None.
    fn raised(&self, py: Python<'_>) -> Option<Py<PyBaseException>> {
        self.frame.take_raised().map(|raised| raised.into_value(py))
    }

    /// Stop the axes; events continue until they are at rest.
    ///
    /// - signal : int: Number of the signal that requested it.
    #[pyo3(signature = (signal=SIGTERM))]
    fn stop(&self, signal: i32) {
        self.stop.store(signal, Ordering::Relaxed);
    }
}

impl EventStream {
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        match thread.map(|thread| detached(py, || thread.join())) {
            Some(Ok(ended)) => ended.or_raise(),
            Some(Err(_)) => Err(PyValueError::new_err("the campaign's thread died")),
            None => Ok(()),
        }
    }
}

impl Drop for EventStream {
    fn drop(&mut self) {
        self.stop.store(SIGTERM, Ordering::Relaxed);
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread {
            // The campaign must not wait for a reader of its events, nor for the interpreter.
            Python::attach(|py| {
                detached(py, || {
                    let events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
                    while events.recv().is_ok() {}
                    let _ = thread.join();
                });
            });
        }
    }
}

/// Run a campaign inside this process and return its events.
///
/// With ``loopback:`` the simulated drives are in this process too.
///
/// - cell : Cell: The cell.
/// - arguments : list of str: Options, as words of ``ilc-rt run`` or ``ilc-rt identify``; see
///   `described_options`.
/// - verb : {"run", "identify"}: Run the program and learn, or excite an axis once.
/// - law : object or None: A law with ``update(u, e, disturbance=None)`` instead of the cell's.
/// - disturbance : callable or None: Called with the number of each run before it begins; returns
///   its disturbance, a number or an array of shape (n_disturbances,).
///
/// Returns EventStream: An iterator of JSON texts.
/// Raises ValueError if an option cannot be used; from the iterator, before anything moves, if
///     something else cannot.
#[pyfunction(signature = (cell, arguments, verb="run", law=None, disturbance=None))]
pub(crate) fn run_events(
    cell: &Bound<'_, PyCell>,
    arguments: Vec<String>,
    verb: &str,
    law: Option<&Bound<'_, PyAny>>,
    disturbance: Option<Py<PyAny>>,
) -> PyResult<EventStream> {
    let cell = cell.get().cell.clone();
    let mut work = Work::parse(verb, &arguments)?;
    if let (Work::Run(options), Some(ask)) = (&mut work, disturbance) {
        options.disturbance = measured(ask);
    }
    let session = match &mut work {
        Work::Run(options) => &mut options.session,
        Work::Identify(options) => &mut options.session,
    };
    let address = session.bus.clone().unwrap_or_else(|| cell.bus.address.clone());
    if transport::scheme_of(&address).is_some_and(|scheme| scheme.in_process) {
        session.telemetry = false;
        if !session.lockstep {
            return Err(PyValueError::new_err(format!(
                "bus = {address} runs in lock-step only, as its drives have no clock of their own"
            )));
        }
    }
    let stop = Arc::clone(&session.stop);
    let frame = Arc::new(Frame::default());
    let n_axes = cell.n_axes();
    let channels = Channels { n_inputs: n_axes, n_outputs: n_axes };
    let law =
        law.map(|law| PythonLaw::new("law", law, channels, Arc::clone(&frame))).transpose()?;
    let (sender, events) = sync_channel(EVENTS);
    let thread = std::thread::Builder::new().name("ilc-campaign".to_owned()).spawn(move || {
        let mut cell = cell;
        cell.bus.address = address;
        let bus = ilc_sim::bus::open(&cell)?;
        let mut send = |event: &Event| {
            if let Ok(text) = serde_json::to_string(event) {
                let _ = sender.send(text);
            }
        };
        match work {
            Work::Run(options) => {
                let law = law.map(|law| -> Box<dyn Law> { Box::new(law) });
                campaign::run(&cell, &options, bus, law, &mut send)
            }
            Work::Identify(IdentifyOptions { experiment, session }) => {
                let experiment = experiment.experiment(&cell, None)?;
                campaign::identify(&cell, &experiment, &session, bus, &mut send)
            }
        }
        .map(drop)
    })?;
    Ok(EventStream { events: Mutex::new(events), thread: Mutex::new(Some(thread)), stop, frame })
}

/// Operations of the campaign's thread.
enum Work {
    Run(Options),
    Identify(IdentifyOptions),
}

impl Work {
    fn parse(verb: &str, arguments: &[String]) -> PyResult<Self> {
        let parsed = match verb {
            "run" => parse(arguments).map(Self::Run),
            "identify" => parse(arguments).map(Self::Identify),
            _ => Err(no_verb(verb)),
        };
        parsed.map_err(PyValueError::new_err)
    }
}

/// Check options, the words of ``ilc-rt run`` or ``ilc-rt identify`` after the verb.
///
/// Raises ValueError with the name of the option, its value and the allowed values.
#[pyfunction]
pub(crate) fn check_options(verb: &str, arguments: Vec<String>) -> PyResult<()> {
    Work::parse(verb, &arguments).map(drop)
}

/// Describe the options of ``ilc-rt run`` or ``ilc-rt identify``.
///
/// Returns a JSON list: name, flags, help, kind, default, choices, placeholder.
#[pyfunction]
pub(crate) fn described_options(verb: &str) -> PyResult<String> {
    let options = match verb {
        "run" => described::<Options>(),
        "identify" => described::<IdentifyOptions>(),
        _ => return Err(PyValueError::new_err(no_verb(verb))),
    };
    serde_json::to_string(&options).map_err(|error| PyValueError::new_err(error.to_string()))
}

fn no_verb(verb: &str) -> String {
    format!("verb = '{verb}': 'run' or 'identify' is allowed")
}

/// Returns a source of disturbances that calls a Python function.
fn measured(ask: Py<PyAny>) -> Disturbance {
    Disturbance::measured(move |run| {
        Python::attach(|py| {
            let told = ask.call1(py, (run,))?;
            read_disturbance("disturbance", told.bind(py))
        })
        .map_err(|error: PyErr| error.to_string().replace('\n', " "))
    })
}
