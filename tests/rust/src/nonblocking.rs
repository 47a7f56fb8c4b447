//! Code that may not block, under the sanitizer of LLVM for real-time code (`RealtimeSanitizer`).
//!
//! `make rtsan` builds the tests of the tick with it: inside [`nonblocking`] every allocation, lock,
//! sleep and system call that libc makes for us is an error with a stack trace. Without it the
//! function only calls.

#[cfg(rtsan)]
#[expect(unsafe_code, reason = "the sanitizer has a C interface")]
mod context {
    unsafe extern "C" {
        fn __rtsan_realtime_enter();
        fn __rtsan_realtime_exit();
    }

    /// A real-time context that ends when it is dropped.
    #[derive(Debug)]
    pub(super) struct Context;

    impl Context {
        pub(super) fn enter() -> Self {
            // SAFETY: it counts the contexts of this thread, and `drop` leaves this one.
            unsafe { __rtsan_realtime_enter() };
            Self
        }
    }

    impl Drop for Context {
        fn drop(&mut self) {
            // SAFETY: `enter` was called before, on this thread, by the same call of `nonblocking`.
            unsafe { __rtsan_realtime_exit() };
        }
    }
}

/// Calls a function that must neither allocate, lock, sleep nor wait.
pub fn nonblocking<T>(call: impl FnOnce() -> T) -> T {
    #[cfg(rtsan)]
    let _context = context::Context::enter();
    call()
}
