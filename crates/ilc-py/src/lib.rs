//! Python bindings of `ilc-rt`: conversion, shape checks and error mapping only.
//!
//! One file per family of Python names, each with its `register`; `argument` checks what comes in,
//! `exceptions` and `error` say what is raised, and `detached` lets the interpreter go.

#![expect(clippy::doc_markdown, reason = "documentation here is Python's, in numpydoc style")]

mod analysis;
mod analyze;
mod argument;
mod campaign;
mod cell;
mod detached;
mod error;
mod exceptions;
mod laws;
mod library;
mod model;
mod model_argument;
mod python_law;
mod signal;
mod tuning;

use pyo3::prelude::*;

/// The compiled part of `ilc_rt`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    exceptions::register(module)?;
    model::register(module)?;
    signal::register(module)?;
    laws::register(module)?;
    analysis::register(module)?;
    analyze::register(module)?;
    tuning::register(module)?;
    cell::register(module)?;
    library::register(module)?;
    campaign::register(module)?;
    Ok(())
}
