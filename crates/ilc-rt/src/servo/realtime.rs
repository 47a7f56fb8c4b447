//! The loop on the clock's absolute grid.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::{Cycle, TickStatus};
use crate::rt::{Latency, MonotonicClock, Nanos};

/// Timing of the loop.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// Wake-up latency: from a tick's time on the grid to its start.
    pub wake_late: Latency,
    /// Execution time of a tick.
    pub execution: Latency,
}

/// Ticks until the axes are at rest and the drives disabled.
///
/// A tick that begins at least a whole cycle late skips the cycles it missed, so that the loop
/// keeps its phase and never sends two commands at once.
///
/// # Real Time
/// Hot: call it in its own thread, prepared by [`crate::rt::thread::enter`].
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
