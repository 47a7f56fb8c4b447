//! A counting allocator, for tests of code that must not allocate.
//!
//! A test installs it with `#[global_allocator] static ALLOCATOR: Counting = Counting;`, and
//! compares counts.

#![expect(unsafe_code, reason = "a global allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::thread::LocalKey;

thread_local! {
    // Per thread, because the test harness allocates on its own threads meanwhile.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static DEALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static LIVE_BYTES: Cell<i64> = const { Cell::new(0) };
}

/// The system allocator, with a count of each thread's requests.
#[derive(Clone, Copy, Debug)]
pub struct Counting;

/// Returns the allocations of this thread so far; a reallocation counts as one.
pub fn allocations() -> u64 {
    ALLOCATIONS.get()
}

/// Returns the deallocations of this thread so far; a reallocation counts as one.
pub fn deallocations() -> u64 {
    DEALLOCATIONS.get()
}

/// Returns the bytes that this thread has allocated and not freed; what other threads freed counts as well.
pub fn live_bytes() -> i64 {
    LIVE_BYTES.get()
}

fn add_bytes(size: usize, sign: i64) {
    let size = i64::try_from(size).unwrap_or(i64::MAX);
    let _ = LIVE_BYTES.try_with(|bytes| bytes.set(bytes.get().wrapping_add(sign * size)));
}

fn count(what: &'static LocalKey<Cell<u64>>) {
    // The counter is gone while a thread ends; allocations of that phase are not counted.
    let _ = what.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call is forwarded to the system allocator unchanged; counting touches only
// thread-local cells that need no initialisation.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(&ALLOCATIONS);
        add_bytes(layout.size(), 1);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(&DEALLOCATIONS);
        add_bytes(layout.size(), -1);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(&ALLOCATIONS);
        count(&DEALLOCATIONS);
        add_bytes(layout.size(), -1);
        add_bytes(size, 1);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}
