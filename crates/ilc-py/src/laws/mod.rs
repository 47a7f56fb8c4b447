//! Learning laws for Python, one a file; what they share is here.

mod constrained;
mod norm_optimal;
mod pd;
mod weight;

use std::sync::{Mutex, MutexGuard, PoisonError};

use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use crate::argument::Signal;

/// Runs one update and returns the next input.
fn next(law: &mut dyn Law, u: &Signal, e: &Signal) -> Result<Vec<f64>, LearningError> {
    let mut next = vec![0.0; u.values.len()];
    law.update(&u.values, &e.values, &mut next)?;
    Ok(next)
}

/// Locks a law. One that panicked half-way starts each update from scratch and can go on.
fn held<T>(law: &Mutex<T>) -> MutexGuard<'_, T> {
    law.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<pd::PyPdIlc>()?;
    module.add_class::<constrained::PyConstrainedIlc>()?;
    module.add_class::<norm_optimal::PyNormOptimalIlc>()
}
