//! A learning law that is a Python object, as a campaign's own or as the core of another law.

use ilc_rt::learning::{Law, LearningError, Standing};
use pyo3::prelude::*;

use crate::argument::{Signal, give_signal};
use crate::laws;

/// Any object with `update(u, e, disturbance=None)`; told of a run from which nothing is learned, or
/// of the first one, by its method `expect(disturbance)` if it has one, and that its last input is
/// taken back by `taken_back()`.
pub(crate) struct PythonLaw {
    law: Py<PyAny>,
    name: String,
    n_inputs: usize,
    n_outputs: usize,
    is_flat: bool,
    /// Disturbance of the coming run that the object has not been told yet.
    coming: Option<Vec<f64>>,
}

impl PythonLaw {
    /// Takes the object; its class names it in the library.
    pub(crate) fn new(law: &Bound<'_, PyAny>, n_axes: usize) -> PyResult<Self> {
        Self::core(law, n_axes, n_axes, false)
    }

    /// Takes the object for signals of these shapes, without channel axis if `is_flat`.
    pub(crate) fn core(
        law: &Bound<'_, PyAny>,
        n_inputs: usize,
        n_outputs: usize,
        is_flat: bool,
    ) -> PyResult<Self> {
        law.getattr("update")?;
        let name = law.get_type().name()?.to_string();
        let law = law.clone().unbind();
        Ok(Self { law, name, n_inputs, n_outputs, is_flat, coming: None })
    }

    fn ask(
        &self,
        py: Python<'_>,
        input: &[f64],
        error: &[f64],
        coming: Option<Vec<f64>>,
    ) -> PyResult<Vec<f64>> {
        let u = give_signal(py, input.to_vec(), self.n_inputs, self.is_flat)?;
        let e = give_signal(py, error.to_vec(), self.n_outputs, self.is_flat)?;
        let coming = coming.map(|values| give_signal(py, values, 1, true)).transpose()?;
        let next = self.law.bind(py).call_method1("update", (u, e, coming))?;
        let n_samples = input.len() / self.n_inputs.max(1);
        let next = Signal::read("the input returned by update", &next)?
            .with_channels("the input returned by update", self.n_inputs)?
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
        let coming = self.coming.take();
        let learned = Python::attach(|py| {
            self.ask(py, input, error, coming).map_err(|raised| LearningError::User {
                law: self.name.clone(),
                reason: raised.to_string().replace('\n', " "),
            })
        })?;
        next.copy_from_slice(&learned);
        Ok(())
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        if let Some(passed) = self.coming.replace(disturbance.to_vec()) {
            // A law that has no `expect` does not care; one that fails shows it in the update.
            let _ = Python::attach(|py| -> PyResult<()> {
                let passed = give_signal(py, passed, 1, true)?;
                self.law.bind(py).call_method1("expect", (passed,)).map(drop)
            });
        }
    }

    fn on_rollback(&mut self) {
        // A law that has no `taken_back` does not care.
        let _ = Python::attach(|py| self.law.bind(py).call_method0("taken_back").map(drop));
    }

    fn handles_rollback(&self) -> bool {
        Python::attach(|py| laws::handles_rollback(self.law.bind(py)))
    }

    fn status(&self) -> Option<String> {
        Python::attach(|py| laws::standing(self.law.bind(py)).1)
    }

    fn standing(&self) -> Standing {
        Python::attach(|py| laws::standing(self.law.bind(py)).0)
    }

    fn reset(&mut self) {
        self.coming = None;
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
