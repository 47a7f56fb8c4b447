//! Learning laws for Python, one a file; what they share is here.

mod norm_optimal;
mod pd;
mod solver;
pub(crate) mod weight;

use ilc_rt::learning::{Law, LearningError};
use pyo3::prelude::*;

use crate::argument::Signal;
use crate::held::held;

/// Runs one update and returns the next input.
fn next(law: &mut dyn Law, u: &Signal, e: &Signal) -> Result<Vec<f64>, LearningError> {
    let mut next = vec![0.0; u.values.len()];
    law.update(&u.values, &e.values, &mut next)?;
    Ok(next)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<pd::PyPdIlc>()?;
    module.add_class::<norm_optimal::PyNormOptimalIlc>()
}
