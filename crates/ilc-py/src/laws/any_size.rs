//! A law that is made anew for each size of run, so that Python need not say it beforehand.

use std::sync::Mutex;

use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use super::{held, next};
use crate::argument::{Signal, give_signal};
use crate::detached::detached;
use crate::error::OrRaise;

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
        let u = Signal::read("u", u)?;
        let e = Signal::read("e", e)?
            .with_samples("e", u.n_samples)?
            .with_channels("e", u.n_channels)?;
        let (n_samples, n_channels) = (u.n_samples, u.n_channels);
        let result = detached(py, || {
            let mut kept = held(&self.0);
            match &mut *kept {
                Some((n, m, law)) if (*n, *m) == (n_samples, n_channels) => next(law, &u, &e),
                _ => {
                    let mut law = make(n_samples, n_channels)?;
                    let result = next(&mut law, &u, &e);
                    *kept = Some((n_samples, n_channels, law));
                    result
                }
            }
        });
        give_signal(py, result.or_raise()?, n_channels, u.is_flat)
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
