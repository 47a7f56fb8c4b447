//! Learning laws for Python, one a file; what they share is here.

mod adjoint;
mod any_size;
mod constrained;
mod error_feedforward;
mod exchange;
mod flexible;
mod gate;
mod inner;
mod ladder;
mod model_inverse;
mod norm_optimal;
mod pd;
mod recalled;
mod relevance;
mod relevance_weights;
mod repeatability;
mod solver;
pub(crate) mod weight;

use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};

use ilc_rt::learning::{Law, LearningError};
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use crate::argument::{Signal, misfit};
use crate::error::OrRaise;
use crate::held::held;

/// Runs one update and returns the next input.
fn next(law: &mut dyn Law, u: &Signal, e: &Signal) -> Result<Vec<f64>, LearningError> {
    let mut next = vec![0.0; u.values.len()];
    law.update(&u.values, &e.values, &mut next)?;
    Ok(next)
}

/// Reads a signal of a law that was made for one size of run.
fn fixed_size(
    name: &str,
    signal: &Bound<'_, PyAny>,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Signal> {
    let signal = Signal::read(name, signal)?;
    if (signal.n_samples, signal.n_channels) == (n_samples, n_channels) {
        return Ok(signal);
    }
    Err(misfit(name, &signal.shape(), &format!("({n_samples}, {n_channels})")))
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
    module.add_class::<error_feedforward::PyErrorFeedforwardIlc>()?;
    module.add_class::<adjoint::PyAdjointIlc>()?;
    module.add_class::<model_inverse::PyModelInverseIlc>()?;
    module.add_class::<gate::PyGate>()?;
    module.add_class::<ladder::PyLadder>()?;
    module.add_class::<repeatability::PyRepeatability>()?;
    module.add_function(wrap_pyfunction!(repeatability::repeatability, module)?)?;
    module.add_class::<norm_optimal::PyNormOptimalIlc>()?;
    module.add_class::<constrained::PyConstrainedIlc>()?;
    module.add_class::<relevance_weights::PyRelevanceWeights>()?;
    module.add_class::<relevance::PyRelevanceIlc>()?;
    module.add_class::<flexible::PyFlexibleIlc>()
}
