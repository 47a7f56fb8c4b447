//! Learning laws for Python, one a file; what they share is here.

mod adjoint;
mod any_size;
mod constrained;
mod error_feedforward;
mod exchange;
mod fixed_size;
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
mod through_jacobian;
pub(crate) mod weight;

use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};

use ilc_rt::learning::{Law, LearningError, Standing};
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use crate::argument::Signal;
use crate::error::OrRaise;
use crate::held::held;

/// Runs one update and returns the next input.
fn next(law: &mut dyn Law, u: &Signal, e: &Signal) -> Result<Vec<f64>, LearningError> {
    let mut next = vec![0.0; u.values.len()];
    law.update(&u.values, &e.values, &mut next)?;
    Ok(next)
}

/// Makes a law of its own for analysis out of one that comes with the controller, for runs of the given
/// size: of a gate or a ladder the law inside, of a law with bounds the one without them. `None` for any
/// other object.
pub(crate) fn own_law(
    object: &Bound<'_, PyAny>,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Option<Box<dyn Law>>> {
    if let Ok(law) = object.cast::<pd::PyPdIlc>() {
        return law.get().own(n_samples, n_channels).or_raise().map(Some);
    }
    if let Ok(law) = object.cast::<error_feedforward::PyErrorFeedforwardIlc>() {
        return law.get().own(n_samples, n_channels).or_raise().map(Some);
    }
    if let Ok(law) = object.cast::<adjoint::PyAdjointIlc>() {
        return Ok(Some(law.get().own()));
    }
    if let Ok(law) = object.cast::<model_inverse::PyModelInverseIlc>() {
        return Ok(Some(law.get().own()));
    }
    if let Ok(law) = object.cast::<constrained::PyConstrainedIlc>() {
        return law.get().unbounded().or_raise().map(Some);
    }
    if let Ok(law) = object.cast::<norm_optimal::PyNormOptimalIlc>() {
        return law.get().own().or_raise().map(Some);
    }
    match inside(object) {
        Some(law) => own_law(&law, n_samples, n_channels),
        None => Ok(None),
    }
}

/// Returns the law inside a gate or a ladder.
fn inside<'py>(object: &Bound<'py, PyAny>) -> Option<Bound<'py, PyAny>> {
    let py = object.py();
    if let Ok(law) = object.cast::<gate::PyGate>() {
        return Some(law.get().inside(py).clone());
    }
    object.cast::<ladder::PyLadder>().ok().map(|law| law.get().inside(py).clone())
}

/// Returns whether a law goes back to its best input by itself: a gate does, also inside a ladder.
pub(crate) fn handles_rollback(object: &Bound<'_, PyAny>) -> bool {
    object.is_instance_of::<gate::PyGate>()
        || inside(object).is_some_and(|law| handles_rollback(&law))
}

/// Returns what a gate, also one inside a ladder, decided after the last update, and why.
pub(crate) fn standing(object: &Bound<'_, PyAny>) -> (Standing, Option<String>) {
    if let Ok(gate) = object.cast::<gate::PyGate>() {
        return gate.get().standing(object.py());
    }
    inside(object).map_or((Standing::Learns, None), |law| standing(&law))
}

/// Returns the number of samples that a law was made for, if it says so.
pub(crate) fn samples_of(object: &Bound<'_, PyAny>) -> Option<usize> {
    if let Ok(law) = object.cast::<adjoint::PyAdjointIlc>() {
        return Some(law.get().n_samples());
    }
    if let Ok(law) = object.cast::<model_inverse::PyModelInverseIlc>() {
        return Some(law.get().n_samples());
    }
    if let Ok(law) = object.cast::<constrained::PyConstrainedIlc>() {
        return Some(law.get().n_samples());
    }
    if let Ok(law) = object.cast::<norm_optimal::PyNormOptimalIlc>() {
        return Some(law.get().n_samples());
    }
    inside(object).and_then(|law| samples_of(&law))
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
    module.add_class::<through_jacobian::PyThroughJacobian>()?;
    module.add_class::<repeatability::PyRepeatability>()?;
    module.add_function(wrap_pyfunction!(repeatability::repeatability, module)?)?;
    module.add_class::<norm_optimal::PyNormOptimalIlc>()?;
    module.add_class::<constrained::PyConstrainedIlc>()?;
    module.add_class::<relevance_weights::PyRelevanceWeights>()?;
    module.add_class::<relevance::PyRelevanceIlc>()?;
    module.add_class::<flexible::PyFlexibleIlc>()
}
