//! The loop on the clock's absolute grid.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::{Cycle, TickStatus};
use crate::rt::{Latency, MonotonicClock, Nanos};

/// Timing of the loop.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// From a tick's place on the grid to its beginning.
    pub wake_late: Latency,
    /// From a tick's beginning to its end.
    pub execution: Latency,
}

/// Ticks until the axes are at rest and the drives off.
///
/// A tick that begins a whole cycle late or more skips the cycles it missed, so that the loop keeps
/// its phase and never sends two commands at once.
///
/// # Real Time
/// Hot: call it in a thread of its own, made ready with [`crate::rt::thread::enter`].
pub fn run_on_clock(cycle: &mut Cycle, clock: &MonotonicClock, timing: &mut Timing) {
    let period = cycle.period();
    let mut due = clock.now().plus(period);
    loop {
        clock.sleep_until(due);
        let began = clock.now();
        let late = began.since(due);
        timing.wake_late.record(late);
        let missed = late.0 / period.0.max(1);
        let status = cycle.tick(u32::try_from(missed).unwrap_or(u32::MAX));
        timing.execution.record(clock.now().since(began));
        if status == TickStatus::Stopped {
            return;
        }
        due = due.plus(Nanos(period.0 * (missed + 1)));
    }
}
