//! An allocator that counts, for tests that promise not to allocate.
//!
//! A test makes it its own with
//! `#[global_allocator] static ALLOCATOR: Counting = Counting;`, and compares counts.

#![expect(unsafe_code, reason = "a global allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::thread::LocalKey;

thread_local! {
    // Per thread, because the test harness allocates on its own threads meanwhile.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static DEALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting the requests of each thread.
#[derive(Clone, Copy, Debug)]
pub struct Counting;

/// Allocations of this thread so far; a reallocation is one.
pub fn allocations() -> u64 {
    ALLOCATIONS.get()
}

/// Deallocations of this thread so far; a reallocation is one.
pub fn deallocations() -> u64 {
    DEALLOCATIONS.get()
}

fn count(what: &'static LocalKey<Cell<u64>>) {
    // Gone when a thread ends; what is allocated then is nobody's to count.
    let _ = what.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call is handed to the system allocator unchanged; counting touches no memory but
// thread-local cells that need no set-up.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(&ALLOCATIONS);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(&DEALLOCATIONS);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(&ALLOCATIONS);
        count(&DEALLOCATIONS);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}
