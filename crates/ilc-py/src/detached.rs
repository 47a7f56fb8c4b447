//! Release of the interpreter (GIL) during long work.

use pyo3::marker::Ungil;
use pyo3::prelude::*;

/// Runs `work` while other Python threads run: for everything that may take more than 100 us.
pub(crate) fn detached<T: Ungil, F: Ungil + FnOnce() -> T>(py: Python<'_>, work: F) -> T {
    py.detach(work)
}
