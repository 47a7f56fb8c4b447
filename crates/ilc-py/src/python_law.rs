//! The adapter of laws that are Python objects: in a campaign, inside another law, or under
//! analysis.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ilc_rt::learning::{Law, LearningError, Purpose, Standing};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::answer::{give_signal, give_vector};
use crate::argument::{Channels, Signal};
use crate::laws::PyLaw;
use crate::whole::shown;

/// Data exchanged between a Python object and its caller, besides the signals.
#[derive(Debug, Default)]
pub(crate) struct Frame {
    /// True if the signals have no channel axis.
    is_flat: AtomicBool,
    /// Disturbance of the coming run, passed on unchanged.
    disturbance: Mutex<Option<Py<PyAny>>>,
    /// The last exception raised by the object, with its traceback.
    raised: Mutex<Option<PyErr>>,
}

impl Frame {
    /// Sets the data passed on by the next update.
    pub(crate) fn prepare(&self, is_flat: bool, disturbance: Option<Py<PyAny>>) {
        self.is_flat.store(is_flat, Ordering::Relaxed);
        *self.disturbance.lock().unwrap_or_else(PoisonError::into_inner) = disturbance;
        *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns true if the signals of the last update had no channel axis.
    pub(crate) fn is_flat(&self) -> bool {
        self.is_flat.load(Ordering::Relaxed)
    }

    /// Takes the exception raised by the object since [`Frame::prepare`].
    pub(crate) fn take_raised(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Any object with `update(u, e, disturbance=None)`, native or written in Python.
///
/// A run from which nothing is learned, and the first one, are announced by its method
/// `expect(disturbance)`, a rollback by `taken_back()`; both are optional.
#[derive(Debug)]
pub(crate) struct PythonLaw {
    law: Py<PyAny>,
    /// Name of the class, which is the law's name in the library.
    name: String,
    channels: Channels,
    frame: Arc<Frame>,
    /// Disturbance of the coming run, not yet passed to the object.
    next_disturbance: Option<Vec<f64>>,
}

impl PythonLaw {
    /// Wraps an object, named `argument` in errors.
    ///
    /// # Errors
    /// - `TypeError` if it has no method `update`.
    pub(crate) fn new(
        argument: &str,
        law: &Bound<'_, PyAny>,
        channels: Channels,
        frame: Arc<Frame>,
    ) -> PyResult<Self> {
        let name = law.get_type().name()?.to_string();
        if !law.getattr_opt("update")?.is_some_and(|update| update.is_callable()) {
            let text = shown(law);
            return Err(PyTypeError::new_err(format!(
                "{argument} = {text} is a {name}; an object with update(u, e, disturbance=None) is needed"
            )));
        }
        let law = law.clone().unbind();
        Ok(Self { law, name, channels, frame, next_disturbance: None })
    }

    fn ask(&mut self, py: Python<'_>, input: &[f64], error: &[f64]) -> PyResult<Vec<f64>> {
        const WHAT: &str = "the input returned by update";
        let Channels { n_inputs, n_outputs } = self.channels;
        let is_flat = self.frame.is_flat();
        let given = self.frame.disturbance.lock().unwrap_or_else(PoisonError::into_inner).take();
        let announced = self.next_disturbance.take();
        let disturbance = if let Some(given) = given {
            if let Some(announced) = announced {
                self.announce(py, announced);
            }
            Some(given.into_bound(py))
        } else {
            announced.map(|values| give_vector(py, values))
        };
        let u = give_signal(py, input.to_vec(), n_inputs, is_flat && n_inputs == 1)?;
        let e = give_signal(py, error.to_vec(), n_outputs, is_flat && n_outputs == 1)?;
        let next = self.law.bind(py).call_method1("update", (u, e, disturbance))?;
        let next = Signal::read(WHAT, &next)?
            .with_channels(WHAT, n_inputs)?
            .with_samples(WHAT, input.len() / n_inputs.max(1))?;
        Ok(next.values)
    }

    /// Passes the disturbance of a run that the object does not learn from.
    fn announce(&self, py: Python<'_>, disturbance: Vec<f64>) {
        // A law without `expect` ignores it; a failure shows in the update.
        let _ = self.law.bind(py).call_method1("expect", (give_vector(py, disturbance),));
    }

    /// Calls an optional method of the object; a failure has no effect.
    fn call_if_there(&self, method: &str) {
        let _ = Python::attach(|py| self.law.bind(py).call_method0(method).map(drop));
    }

    /// Queries the native law behind the object, if there is one.
    fn ask_native<T>(&self, ask: impl FnOnce(&dyn Law) -> T) -> Option<T> {
        Python::attach(|py| {
            let native = self.law.bind(py).cast::<PyLaw>().ok()?;
            native.get().look(py, |law| ask(law)).ok()
        })
    }
}

impl Law for PythonLaw {
    fn update(
        &mut self,
        input: &[f64],
        error: &[f64],
        next: &mut [f64],
    ) -> Result<(), LearningError> {
        match Python::attach(|py| self.ask(py, input, error)) {
            Ok(learned) => {
                next.copy_from_slice(&learned);
                Ok(())
            }
            Err(raised) => {
                let reason = raised.to_string().replace('\n', " ");
                let slot = &self.frame.raised;
                *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
                Err(LearningError::User { law: self.name.clone(), reason })
            }
        }
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        if let Some(passed) = self.next_disturbance.replace(disturbance.to_vec()) {
            Python::attach(|py| self.announce(py, passed));
        }
    }

    fn on_rollback(&mut self) {
        self.call_if_there("taken_back");
    }

    fn handles_rollback(&self) -> bool {
        self.ask_native(|law| law.handles_rollback()).unwrap_or(false)
    }

    fn status(&self) -> Option<String> {
        self.ask_native(|law| law.status()).flatten()
    }

    fn standing(&self) -> Standing {
        self.ask_native(|law| law.standing()).unwrap_or(Standing::Learns)
    }

    fn purpose(&self) -> Purpose {
        self.ask_native(|law| law.purpose()).unwrap_or_default()
    }

    fn measures(&self) -> bool {
        self.ask_native(|law| law.measures()).unwrap_or(false)
    }

    fn reset(&mut self) {
        self.next_disturbance = None;
        self.call_if_there("reset");
    }

    fn describe(&self) -> String {
        let shown = Python::attach(|py| self.law.bind(py).repr().map(|text| text.to_string()));
        // The address in a default repr differs between processes and would prevent resuming.
        let shown = shown.ok().filter(|text| !text.contains(" at 0x"));
        serde_json::json!({ "law": self.name, "repr": shown }).to_string()
    }

    fn earlier_description(&self) -> Option<String> {
        let shown = Python::attach(|py| {
            let earlier = py.import("ilc_rt.laws.earlier").and_then(|m| m.getattr("shown")).ok()?;
            earlier.call1((self.law.bind(py),)).ok()?.extract::<Option<String>>().ok()?
        })?;
        Some(serde_json::json!({ "law": self.name, "repr": shown }).to_string())
    }
}
