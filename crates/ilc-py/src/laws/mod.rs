//! Learning laws for Python, one a file; what they share is here.

mod norm_optimal;
mod pd;

use std::sync::{Mutex, MutexGuard, PoisonError};

use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};

use ilc_rt::learning::{Law, LearningError};
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use crate::argument::Signal;
use crate::error::OrRaise;

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

/// Makes a law of its own out of one that comes with the controller, for runs of the given size;
/// `None` for any other object.
pub(crate) fn own_law(
    object: &Bound<'_, PyAny>,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Option<Box<dyn Law>>> {
    if let Ok(law) = object.cast::<pd::PyPdIlc>() {
        return law.get().own(n_samples, n_channels).or_raise().map(Some);
    }
    match object.cast::<norm_optimal::PyNormOptimalIlc>() {
        Ok(law) => law.get().own().or_raise().map(Some),
        Err(_) => Ok(None),
    }
}

/// Returns the number of samples that a law was made for, if it says so.
pub(crate) fn samples_of(object: &Bound<'_, PyAny>) -> Option<usize> {
    let law = object.cast::<norm_optimal::PyNormOptimalIlc>().ok()?;
    Some(law.get().n_samples())
}

/// Makes the optimal law of the given weights.
pub(crate) fn optimal(
    model: &StateSpace,
    n_samples: usize,
    weights: Weights,
) -> Result<Box<dyn Law>, LearningError> {
    Ok(Box::new(NormOptimal::new(model, n_samples, weights)?))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<pd::PyPdIlc>()?;
    module.add_class::<norm_optimal::PyNormOptimalIlc>()
}
