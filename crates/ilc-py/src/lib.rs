//! Python bindings of `ilc-rt`: conversion, shape checks and error mapping only.
//!
//! One file per family of Python names, each with its `register`; `argument` checks input,
//! `exceptions` and `error` define the exceptions, and `detached` releases the interpreter.
//!
//! Family: `laws` and `python_law` call each other: an inner law may be written in Python.
//!
//! Family: `arguments`, `model` and `model_argument` read each other's arguments.
//!
//! Family: `experiment` and `identify` read each other's arguments.

#![expect(clippy::doc_markdown, reason = "documentation here is Python's, in numpydoc style")]

mod analysis;
mod argument;
mod arguments;
mod campaign;
mod cell;
mod contour;
mod control;
mod detached;
mod error;
mod exceptions;
mod experiment;
mod guard;
mod identify;
mod kinematics;
mod laws;
mod library;
mod made;
mod model;
mod model_argument;
mod python_law;
mod signal;
mod time_varying;
mod trajectory;
mod transport;
mod weights;
mod whole;

use pyo3::prelude::*;

/// The compiled part of `ilc_rt`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    exceptions::register(module)?;
    model::register(module)?;
    time_varying::register(module)?;
    identify::register(module)?;
    signal::register(module)?;
    kinematics::register(module)?;
    contour::register(module)?;
    control::register(module)?;
    trajectory::register(module)?;
    transport::register(module)?;
    laws::register(module)?;
    weights::register(module)?;
    analysis::register(module)?;
    cell::register(module)?;
    library::register(module)?;
    campaign::register(module)?;
    experiment::register(module)?;
    made::register(module)?;
    Ok(())
}
