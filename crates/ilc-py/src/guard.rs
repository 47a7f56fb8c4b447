//! Borrow guard of values that Python objects own and change.
//!
//! Waits for other threads with the interpreter released, as the holder of the guard may be waiting
//! for it, and refuses a deadlock: a law inside a gate that uses the gate during its own update.

use std::ops::{Deref, DerefMut};
use std::ptr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;

thread_local! {
    /// Its address is unique among the running threads.
    static THREAD: u8 = const { 0 };
}

fn this_thread() -> usize {
    THREAD.with(|mark| ptr::from_ref(mark).addr())
}

/// A value that one thread uses at a time.
#[derive(Debug)]
pub(crate) struct Guarded<T> {
    value: Mutex<T>,
    /// The thread that uses the value; 0 while none does.
    user: AtomicUsize,
}

impl<T> Guarded<T> {
    /// Wraps a value.
    pub(crate) fn new(value: T) -> Self {
        Self { value: Mutex::new(value), user: AtomicUsize::new(0) }
    }

    /// Borrows the value. If its last user panicked half-way, the value is still usable, as each
    /// update starts from scratch.
    ///
    /// # Errors
    /// - `RuntimeError` if this thread already uses it.
    pub(crate) fn borrow(&self, py: Python<'_>) -> PyResult<Borrowed<'_, T>> {
        if self.user.load(Ordering::Relaxed) == this_thread() {
            return Err(PyRuntimeError::new_err(
                "the law or controller is in the middle of an update, which called it again",
            ));
        }
        let value = self.value.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner);
        self.user.store(this_thread(), Ordering::Relaxed);
        Ok(Borrowed { value, user: &self.user })
    }
}

/// The value while it is borrowed.
pub(crate) struct Borrowed<'a, T> {
    value: MutexGuard<'a, T>,
    user: &'a AtomicUsize,
}

impl<T> Drop for Borrowed<'_, T> {
    fn drop(&mut self) {
        self.user.store(0, Ordering::Relaxed);
    }
}

impl<T> Deref for Borrowed<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Borrowed<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}
