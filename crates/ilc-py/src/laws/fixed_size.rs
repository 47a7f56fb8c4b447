//! A law that is made once, for runs of one size: what every such class of Python does alike.

use std::sync::Mutex;

use ilc_rt::learning::Law;
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use super::exchange::{Given, exchange};
use super::held;

/// The law, and the size of run that it was made for.
#[derive(Debug)]
pub(super) struct FixedSize<L> {
    n_samples: usize,
    n_inputs: usize,
    n_outputs: usize,
    law: Mutex<L>,
}

impl<L: Law> FixedSize<L> {
    /// Keeps a law that was made with a model for runs of `n_samples` samples.
    pub(super) fn new(law: L, model: &StateSpace, n_samples: usize) -> Self {
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        Self { n_samples, n_inputs, n_outputs, law: Mutex::new(law) }
    }

    pub(super) fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Runs one update.
    pub(super) fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let u = Given::read("u", u)?.of_size("u", self.n_samples, self.n_inputs)?;
        let e = Given::read("e", e)?.of_size("e", self.n_samples, self.n_outputs)?;
        exchange(py, &u, &e, |u, e, next| held(&self.law).update(u, e, next))
    }

    /// Returns what `look` sees in the law.
    pub(super) fn look<T>(&self, look: impl FnOnce(&L) -> T) -> T {
        look(&held(&self.law))
    }

    pub(super) fn reset(&self) {
        held(&self.law).reset();
    }
}
