//! A learning law written in Python, as the supervisor's own.

use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use crate::argument::{Signal, give_signal};

/// Any object with `update(u, e, disturbance=None)`.
pub(crate) struct PythonLaw {
    law: Py<PyAny>,
    name: String,
    n_axes: usize,
}

impl PythonLaw {
    /// Takes the object; its class names it in the library.
    pub(crate) fn new(law: &Bound<'_, PyAny>, n_axes: usize) -> PyResult<Self> {
        law.getattr("update")?;
        let name = law.get_type().name()?.to_string();
        Ok(Self { law: law.clone().unbind(), name, n_axes })
    }

    fn ask(&self, py: Python<'_>, input: &[f64], error: &[f64]) -> PyResult<Vec<f64>> {
        let u = give_signal(py, input.to_vec(), self.n_axes, false)?;
        let e = give_signal(py, error.to_vec(), self.n_axes, false)?;
        let next = self.law.bind(py).call_method1("update", (u, e, py.None()))?;
        let n_samples = input.len() / self.n_axes.max(1);
        let next = Signal::read("the input returned by update", &next)?
            .with_channels("the input returned by update", self.n_axes)?
            .with_samples("the input returned by update", n_samples)?;
        Ok(next.values)
    }
}

impl Law for PythonLaw {
    fn update(
        &mut self,
        input: &[f64],
        error: &[f64],
        next: &mut [f64],
    ) -> Result<(), LearningError> {
        let learned = Python::attach(|py| {
            self.ask(py, input, error).map_err(|raised| LearningError::User {
                law: self.name.clone(),
                reason: raised.to_string().replace('\n', " "),
            })
        })?;
        next.copy_from_slice(&learned);
        Ok(())
    }

    fn reset(&mut self) {
        // A law may keep nothing and have no `reset`; one that fails is as good as none.
        let _ = Python::attach(|py| self.law.bind(py).call_method0("reset").map(drop));
    }

    fn describe(&self) -> String {
        let shown = Python::attach(|py| self.law.bind(py).repr().map(|text| text.to_string()));
        // The address in a default repr differs from process to process and would prevent resuming.
        let shown = shown.ok().filter(|text| !text.contains(" at 0x"));
        serde_json::json!({ "law": self.name, "repr": shown }).to_string()
    }
}
