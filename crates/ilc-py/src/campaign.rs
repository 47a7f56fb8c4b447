//! A campaign inside this process: `run_events`.

use std::path::PathBuf;
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use ilc_rt::config::{Cell, LawName, Measure};
use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::transport::{self, loopback::InProcess};
use ilc_rt::learning::Law;
use ilc_rt::record::Event;
use ilc_rt::supervisor::{self, Disturbance, Options, SupervisorError};
use ilc_sim::machine::{ClockMode, Machine};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::read_disturbance;
use crate::cell::PyCell;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::experiment::read_experiment;
use crate::python_law::{Channels, Frame, PythonLaw};
use crate::whole;

/// Frames that may wait for the loop on the bus inside the process.
const LOOPBACK_FRAMES: usize = 1024;
/// Events that may wait for Python; the campaign waits when they are not taken.
const EVENTS: usize = 64;
/// How often a waiting `next` looks for signals.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Signal number with which a dropped stream stops its axes.
const SIGTERM: i32 = 15;

/// Events of a campaign that runs inside this process, one JSON object each.
#[pyclass(name = "EventStream", module = "ilc_rt._native", frozen)]
struct EventStream {
    events: Mutex<Receiver<String>>,
    thread: Mutex<Option<JoinHandle<Result<(), SupervisorError>>>>,
    stop: Arc<AtomicI32>,
    /// Of the law that is written in Python.
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

    /// Bring the axes to rest; the events go on until they are.
    ///
    /// Parameters
    /// ----------
    /// signal : int
    ///     Number of the signal that asked for it.
    #[pyo3(signature = (signal=SIGTERM))]
    fn stop(&self, signal: i32) {
        self.stop.store(signal, Ordering::Relaxed);
    }
}

impl EventStream {
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        match thread.map(|thread| detached(py, || thread.join())) {
            Some(Ok(ended)) => ended.or_raise().map_err(|error| {
                if let Some(raised) = self.frame.take_raised() {
                    error.set_cause(py, Some(raised));
                }
                error
            }),
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
            // The campaign must not wait for somebody to take its events, nor for the interpreter.
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
/// Parameters
/// ----------
/// cell : Cell
///     The cell.
/// iterations : int
///     Runs in all; the first one is without learning.
/// library : str or os.PathLike
///     Where the runs are kept.
/// bus : str or None
///     Bus address instead of the cell's.
/// measure : str or None
///     ``encoder`` or ``tcp`` instead of the cell's.
/// lockstep : bool
///     Whether the drives' answers set the pace instead of the clock.
/// resume : bool
///     Whether to go on with the newest campaign of the same kind.
/// law : object or None
///     A law with ``update(u, e, disturbance=None)`` instead of the cell's.
/// learning : bool
///     Whether to learn at all; if not, every run is like the first.
/// experiment : object or None
///     What to excite instead of running the program, as ``Experiment``.
/// disturbance : callable or None
///     Called with the number of each run before it begins; returns its
///     disturbance, a number or an array of shape (n_disturbances,).
/// simulated : bool
///     Whether the drives are simulated on this computer, so that a stall of it
///     stalls them as well and is forgiven for longer.
///
/// Returns
/// -------
/// EventStream
///     An iterator of JSON texts.
///
/// Raises
/// ------
/// ValueError
///     From the iterator, before anything moves, if something cannot be used.
#[pyfunction]
#[pyo3(signature = (cell, iterations, library, bus=None, measure=None, lockstep=true, resume=false, law=None,
    learning=true, experiment=None, disturbance=None, simulated=false))]
#[expect(
    clippy::too_many_arguments,
    clippy::fn_params_excessive_bools,
    reason = "keyword arguments in Python"
)]
fn run_events(
    cell: &Bound<'_, PyCell>,
    #[pyo3(from_py_with = whole::iterations)] iterations: u32,
    library: PathBuf,
    bus: Option<String>,
    measure: Option<&str>,
    lockstep: bool,
    resume: bool,
    law: Option<&Bound<'_, PyAny>>,
    learning: bool,
    experiment: Option<&Bound<'_, PyAny>>,
    disturbance: Option<Py<PyAny>>,
    simulated: bool,
) -> PyResult<EventStream> {
    let mut cell: Cell = cell.get().cell.clone();
    if let Some(address) = bus {
        cell.bus.address = address;
    }
    if !learning {
        cell.learning.law = LawName::None;
    }
    let experiment = experiment.map(|object| read_experiment(object, &cell)).transpose()?;
    let measure = match measure {
        None => None,
        Some("encoder") => Some(Measure::Encoder),
        Some("tcp") => Some(Measure::Tcp),
        Some(other) => {
            let line = format!("measure = {other:?}: \"encoder\" or \"tcp\" is allowed");
            return Err(PyValueError::new_err(line));
        }
    };
    let frame = Arc::new(Frame::default());
    let n_axes = cell.n_axes();
    let channels = Channels { n_inputs: n_axes, n_outputs: n_axes };
    let law =
        law.map(|law| PythonLaw::new("law", law, channels, Arc::clone(&frame))).transpose()?;
    let stop = Arc::new(AtomicI32::new(0));
    let loopback = cell.bus.address.starts_with("loopback:");
    let options = Options {
        iterations,
        measure,
        lockstep,
        simulated,
        resume,
        library,
        disturbance: disturbance.map_or_else(Disturbance::default, ask),
        telemetry: !loopback,
        stop: Arc::clone(&stop),
    };
    if loopback && !lockstep {
        return Err(PyValueError::new_err(
            "bus = loopback: runs in lock-step only, as its drives have no clock of their own",
        ));
    }
    let (sender, events) = sync_channel(EVENTS);
    let thread = std::thread::Builder::new().name("ilc-campaign".to_owned()).spawn(move || {
        let bus = open(&cell)?;
        let law = law.map(|law| -> Box<dyn Law> { Box::new(law) });
        let mut send = |event: &Event| {
            if let Ok(text) = serde_json::to_string(event) {
                let _ = sender.send(text);
            }
        };
        match experiment {
            None => supervisor::run(&cell, &options, bus, law, &mut send),
            Some(experiment) => supervisor::identify(&cell, &experiment, &options, bus, &mut send),
        }
        .map(drop)
    })?;
    Ok(EventStream { events: Mutex::new(events), thread: Mutex::new(Some(thread)), stop, frame })
}

/// Asks a Python function for the disturbance of each run.
fn ask(measure: Py<PyAny>) -> Disturbance {
    Disturbance::measured(move |run| {
        Python::attach(|py| {
            let told = measure.call1(py, (run,))?;
            read_disturbance("disturbance", told.bind(py))
        })
        .map_err(|error: PyErr| error.to_string().replace('\n', " "))
    })
}

fn open(cell: &Cell) -> Result<Box<dyn Bus>, SupervisorError> {
    let file = cell.file.display().to_string();
    if !cell.bus.address.starts_with("loopback:") {
        let place = format!("{file}: [bus] address");
        return transport::open(&cell.bus.address)
            .map_err(|source| SupervisorError::Bus { place, source });
    }
    match Machine::from_cell(cell, ClockMode::LockStep) {
        Ok(machine) => Ok(Box::new(InProcess::new(machine, LOOPBACK_FRAMES))),
        Err(error) => Err(SupervisorError::Simulation { file, reason: error.to_string() }),
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<EventStream>()?;
    module.add_function(wrap_pyfunction!(run_events, module)?)
}
