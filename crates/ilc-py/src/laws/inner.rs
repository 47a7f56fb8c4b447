//! Any law as the inside of another one: a native class or a user's own, called alike.

use std::sync::Mutex;

use ilc_rt::learning::gate::Gate;
use ilc_rt::learning::ladder::Ladder;
use ilc_rt::learning::law::through_jacobian::ThroughJacobian;
use ilc_rt::learning::{Law, LearningError};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use super::{held, next};
use crate::argument::{Signal, give_signal};
use crate::detached::detached;
use crate::error::OrRaise;

/// An object with `update(u, e, disturbance)` and the shapes in which it is to see its signals.
#[derive(Debug)]
pub(super) struct InnerLaw {
    law: Py<PyAny>,
    name: String,
    /// Channels, and whether there is no channel axis.
    u_shape: (usize, bool),
    e_shape: (usize, bool),
    disturbance: Option<Py<PyAny>>,
    /// What the object raised, to be raised again with its own class.
    raised: Option<PyErr>,
}

impl InnerLaw {
    pub(super) fn new(law: &Bound<'_, PyAny>) -> PyResult<Self> {
        let name = law.get_type().name()?.to_string();
        if !law.getattr("update").is_ok_and(|update| update.is_callable()) {
            return Err(PyTypeError::new_err(format!(
                "law is a {name}; an object with update(u, e, disturbance=None) is needed"
            )));
        }
        Ok(Self {
            law: law.clone().unbind(),
            name,
            u_shape: (1, true),
            e_shape: (1, true),
            disturbance: None,
            raised: None,
        })
    }

    fn prepare(&mut self, u: &Signal, e: &Signal, disturbance: Option<Py<PyAny>>) {
        self.prepare_shapes((u.n_channels, u.is_flat), (e.n_channels, e.is_flat), disturbance);
    }

    /// Says in which shapes the object is to see its signals, where the error is not as it came.
    pub(super) fn prepare_shapes(
        &mut self,
        u_shape: (usize, bool),
        e_shape: (usize, bool),
        disturbance: Option<Py<PyAny>>,
    ) {
        (self.u_shape, self.e_shape) = (u_shape, e_shape);
        self.disturbance = disturbance;
        self.raised = None;
    }

    /// Takes what the object raised in the last update.
    pub(super) fn take_raised(&mut self) -> Option<PyErr> {
        self.raised.take()
    }

    /// Returns an input in the shape in which `u` came last.
    pub(super) fn give<'py>(&self, py: Python<'py>, u: Vec<f64>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, u, self.u_shape.0, self.u_shape.1)
    }

    fn ask(&self, py: Python<'_>, input: &[f64], error: &[f64]) -> PyResult<Vec<f64>> {
        const WHAT: &str = "the input returned by update";
        let u = self.give(py, input.to_vec())?;
        let e = give_signal(py, error.to_vec(), self.e_shape.0, self.e_shape.1)?;
        let disturbance =
            self.disturbance.as_ref().map_or_else(|| py.None(), |given| given.clone_ref(py));
        let next = self.law.bind(py).call_method1("update", (u, e, disturbance))?;
        let next = Signal::read(WHAT, &next)?
            .with_channels(WHAT, self.u_shape.0)?
            .with_samples(WHAT, input.len() / self.u_shape.0)?;
        Ok(next.values)
    }
}

impl Law for InnerLaw {
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
                self.raised = Some(raised);
                Err(LearningError::User { law: self.name.clone(), reason })
            }
        }
    }

    fn on_rollback(&mut self) {
        // A law that has no `taken_back` does not care.
        let _ = Python::attach(|py| self.law.bind(py).call_method0("taken_back").map(drop));
    }

    fn reset(&mut self) {
        // A law may keep nothing and have no `reset`; one that fails is as good as none.
        let _ = Python::attach(|py| self.law.bind(py).call_method0("reset").map(drop));
    }

    fn describe(&self) -> String {
        let shown = Python::attach(|py| self.law.bind(py).repr().map(|text| text.to_string()));
        serde_json::json!({ "law": self.name, "repr": shown.unwrap_or_default() }).to_string()
    }
}

/// A law round another one.
pub(super) trait Around: Law {
    fn inner(&self) -> &InnerLaw;
    fn inner_mut(&mut self) -> &mut InnerLaw;

    /// Says how many channels the error of the coming update has.
    fn set_channels(&mut self, n_channels: usize) {
        let _ = n_channels;
    }
}

impl Around for Gate<InnerLaw> {
    fn set_channels(&mut self, n_channels: usize) {
        Self::set_channels(self, n_channels);
    }
    fn inner(&self) -> &InnerLaw {
        self.law()
    }
    fn inner_mut(&mut self) -> &mut InnerLaw {
        self.law_mut()
    }
}

impl Around for Ladder<InnerLaw> {
    fn inner(&self) -> &InnerLaw {
        self.law()
    }
    fn inner_mut(&mut self) -> &mut InnerLaw {
        self.law_mut()
    }
}

impl Around for ThroughJacobian<InnerLaw> {
    fn inner(&self) -> &InnerLaw {
        self.law()
    }
    fn inner_mut(&mut self) -> &mut InnerLaw {
        self.law_mut()
    }
}

/// Runs one update of a law round another one.
pub(super) fn update_around<'py, W: Around>(
    py: Python<'py>,
    law: &Mutex<W>,
    u: &Bound<'py, PyAny>,
    e: &Bound<'py, PyAny>,
    disturbance: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let u = Signal::read("u", u)?;
    let e = Signal::read("e", e)?.with_samples("e", u.n_samples)?;
    let disturbance = disturbance.map(|given| given.clone().unbind());
    let (result, raised) = look(py, law, |law| {
        law.inner_mut().prepare(&u, &e, disturbance);
        law.set_channels(e.n_channels);
        let result = next(law, &u, &e);
        (result, law.inner_mut().take_raised())
    });
    match raised {
        Some(raised) => Err(raised),
        None => give_signal(py, result.or_raise()?, u.n_channels, u.is_flat),
    }
}

/// Locks the law and uses it, detached: who holds it may be waiting for the interpreter.
pub(super) fn look<W: Around, T: Send>(
    py: Python<'_>,
    law: &Mutex<W>,
    look: impl FnOnce(&mut W) -> T + Send,
) -> T {
    detached(py, || look(&mut *held(law)))
}

/// Returns how the law inside shows itself.
pub(super) fn shown<W: Around>(py: Python<'_>, law: &Mutex<W>) -> PyResult<String> {
    let inside = look(py, law, |law| Python::attach(|py| law.inner().law.clone_ref(py)));
    Ok(inside.bind(py).repr()?.to_string())
}
