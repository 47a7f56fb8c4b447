//! Release of the interpreter (GIL) during long work.

use std::cell::RefCell;
use std::rc::Rc;

use ilc_rt::interrupt;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::error::{OrRaise, Raised};

/// Runs `work` while other Python threads run: for everything that may take more than 100 us. It is not
/// interrupted, as it may change what others keep.
pub(crate) fn detached<T: Send, F: Send + FnOnce() -> T>(py: Python<'_>, work: F) -> T {
    py.detach(|| interrupt::shielded(work))
}

/// Runs `work` as [`interruptible`] does, and raises its error.
pub(crate) fn computed<T: Send, E: Send>(
    py: Python<'_>,
    work: impl Send + FnOnce() -> Result<T, E>,
) -> PyResult<T>
where
    Raised: From<E>,
{
    interruptible(py, work)?.or_raise()
}

/// Runs `work` as [`detached`] does, until a signal handler raises: for work that may take seconds, and that owns
/// what it changes.
///
/// # Errors
/// - The exception that a signal handler raised, `KeyboardInterrupt` for Ctrl-C.
#[expect(
    clippy::redundant_closure_for_method_calls,
    reason = "the method itself is not general enough in its lifetime"
)]
pub(crate) fn interruptible<T: Send, F: Send + FnOnce() -> T>(
    py: Python<'_>,
    work: F,
) -> PyResult<T> {
    py.detach(|| {
        let raised = Rc::new(RefCell::new(None));
        let slot = Rc::clone(&raised);
        let is_cancelled = move || match Python::attach(|py| py.check_signals()) {
            Ok(()) => false,
            Err(error) => {
                *slot.borrow_mut() = Some(error);
                true
            }
        };
        interrupt::scope(is_cancelled, work).ok_or_else(|| {
            raised.take().unwrap_or_else(|| PyKeyboardInterrupt::new_err("interrupted"))
        })
    })
}
