//! Cancellation of long computations, as by Ctrl-C in Python: they reach a [`point`] every few milliseconds, and
//! end there if their caller does not wait any longer.
//!
//! The modules that compute call [`point`], which does nothing unless the caller has opened a [`scope`]; the Python
//! bindings do. Cancelling unwinds the stack, so that no function on the way needs an error for it: only work that
//! owns what it changes may run in a scope.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

/// Interval at which the caller is asked.
const ASK_EVERY: Duration = Duration::from_millis(50);
/// The clock is read at every point, unless they follow each other more quickly than this; then at one of so many.
const QUICK: Duration = Duration::from_micros(50);
const ONE_OF: u32 = 64;

thread_local! {
    static CALLER: RefCell<Option<Caller>> = const { RefCell::new(None) };
}

/// A caller that may cancel.
struct Caller {
    asked: Instant,
    /// The last reading of the clock, which takes as long as a sample of a simulation.
    read: Instant,
    /// Points that are passed before the next reading.
    passed: u32,
    is_cancelled: Box<dyn FnMut() -> bool>,
}

impl Caller {
    /// Returns true at a point that is due.
    fn is_due(&mut self) -> bool {
        if self.passed > 0 {
            self.passed -= 1;
            return false;
        }
        let now = Instant::now();
        self.passed = if now.duration_since(self.read) < QUICK { ONE_OF - 1 } else { 0 };
        self.read = now;
        now.duration_since(self.asked) >= ASK_EVERY
    }
}

/// Payload of the unwinding; no other panic is caught.
struct Cancelled;

/// Restores the caller of before, also when unwinding.
struct Restore(Option<Caller>);

impl Drop for Restore {
    fn drop(&mut self) {
        CALLER.set(self.0.take());
    }
}

/// Runs `work`; `None` if it reached a [`point`] at which `is_cancelled` returned true.
pub fn scope<T>(
    is_cancelled: impl FnMut() -> bool + 'static,
    work: impl FnOnce() -> T,
) -> Option<T> {
    let now = Instant::now();
    let is_cancelled = Box::new(is_cancelled);
    let caller = Caller { asked: now, read: now, passed: 0, is_cancelled };
    let restore = Restore(CALLER.replace(Some(caller)));
    let ended = catch_unwind(AssertUnwindSafe(work));
    drop(restore);
    match ended {
        Ok(value) => Some(value),
        Err(payload) if payload.is::<Cancelled>() => None,
        Err(panic) => resume_unwind(panic),
    }
}

/// Runs `work` to its end, also inside a scope: for work on what others keep.
pub fn shielded<T>(work: impl FnOnce() -> T) -> T {
    let _restore = Restore(CALLER.take());
    work()
}

/// Ends the work of the enclosing scope if its caller has cancelled it.
pub fn point() {
    // The caller runs code of its own when asked, which may open another scope.
    let is_due = CALLER.with_borrow_mut(|caller| caller.as_mut().is_some_and(Caller::is_due));
    if !is_due {
        return;
    }
    let Some(mut caller) = CALLER.take() else { return };
    let is_cancelled = (caller.is_cancelled)();
    caller.asked = Instant::now();
    CALLER.set(Some(caller));
    if is_cancelled {
        resume_unwind(Box::new(Cancelled));
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::rc::Rc;

    use super::*;

    fn endless() {
        loop {
            point();
            std::hint::spin_loop();
        }
    }

    #[test]
    fn endless_work_ends_when_its_caller_says_so() {
        let times = Rc::new(Cell::new(0));
        let asked = Rc::clone(&times);
        let count = move || {
            asked.set(asked.get() + 1);
            asked.get() == 2
        };
        assert_eq!(scope(count, endless), None);
        assert_eq!(times.get(), 2);
        assert_eq!(scope(|| false, || 7), Some(7));
    }

    #[test]
    fn an_inner_scope_ends_alone_and_shielded_work_does_not_end() {
        let mut is_outer_done = false;
        let ended = scope(
            || false,
            || {
                assert_eq!(scope(|| true, endless), None);
                is_outer_done = true;
            },
        );
        assert!(ended.is_some() && is_outer_done);
        let begin = Instant::now();
        let ended = scope(
            || true,
            || {
                shielded(|| {
                    while begin.elapsed() < 2 * ASK_EVERY {
                        point();
                    }
                    "whole"
                })
            },
        );
        assert_eq!(ended, Some("whole"));
    }

    #[test]
    fn the_clock_is_read_seldom_between_quick_points_and_always_between_slow_ones() {
        let now = Instant::now();
        let mut caller =
            Caller { asked: now, read: now, passed: 0, is_cancelled: Box::new(|| true) };
        // As if the last reading had just been made, and long ago.
        caller.read = Instant::now() + ASK_EVERY;
        assert!(!caller.is_due());
        assert_eq!(caller.passed, ONE_OF - 1);
        caller.asked = now.checked_sub(ASK_EVERY).unwrap();
        for _ in 1..ONE_OF {
            assert!(!caller.is_due());
        }
        caller.read = now.checked_sub(ASK_EVERY).unwrap();
        assert!(caller.is_due());
        assert_eq!(caller.passed, 0);
    }

    #[test]
    fn another_panic_passes() {
        let panic = catch_unwind(|| scope(|| false, || resume_unwind(Box::new("other"))));
        assert!(panic.unwrap_err().is::<&str>());
        // The scope has been closed.
        point();
    }
}
