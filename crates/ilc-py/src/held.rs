//! The one way to lock what a Python object keeps.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a law or a controller. One that panicked half-way starts each update from scratch and can go
/// on.
pub(crate) fn held<T>(kept: &Mutex<T>) -> MutexGuard<'_, T> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}
