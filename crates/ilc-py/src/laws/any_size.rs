//! A law that is made anew for each size of run, so that Python need not say it beforehand.

use std::sync::Mutex;

use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::exchange::{Given, exchange};
use super::held;
use crate::argument::Layout;

/// The law for the size of run seen last: samples, channels, law.
#[derive(Debug)]
pub(super) struct AnySize<L>(Mutex<Option<(usize, usize, L)>>);

impl<L: Law> AnySize<L> {
    pub(super) fn new() -> Self {
        Self(Mutex::new(None))
    }

    /// Runs one update, with a law that `make` makes of samples and channels if need be.
    pub(super) fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        make: impl FnOnce(usize, usize) -> Result<L, LearningError> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let u = Given::read("u", u)?;
        let e = Given::read("e", e)?.like("e", &u)?;
        let Layout { n_samples, n_channels, .. } = u.layout();
        exchange(py, &u, &e, |u, e, next| {
            let mut kept = held(&self.0);
            if let Some((n, m, law)) = &mut *kept
                && (*n, *m) == (n_samples, n_channels)
            {
                return law.update(u, e, next);
            }
            let mut law = make(n_samples, n_channels)?;
            let result = law.update(u, e, next);
            *kept = Some((n_samples, n_channels, law));
            result
        })
    }

    /// Returns what `look` sees in the law, or `None` before the first update.
    pub(super) fn look<T>(&self, look: impl FnOnce(&L) -> T) -> Option<T> {
        held(&self.0).as_ref().map(|(_, _, law)| look(law))
    }

    pub(super) fn reset(&self) {
        if let Some((_, _, law)) = &mut *held(&self.0) {
            law.reset();
        }
    }
}
