//! The loop on the clock's absolute grid.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::{Cycle, TickStatus};
use crate::rt::flight::PLACES_MAX;
use crate::rt::{Clock, Interruptions, Latency, Nanos, Stamps};

/// Timing of the loop.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// Wake-up latency: from a tick's time on the grid to its start.
    pub wake_late: Latency,
    /// Execution time of a tick.
    pub execution: Latency,
    /// Stages of the recorded ticks.
    pub stages: StageTimes,
}

/// Times of the stages of all ticks, as the flight recorder stamped them.
#[derive(Clone, Debug, Default)]
pub struct StageTimes {
    /// Taking the messages that had arrived.
    pub receive: Latency,
    /// Computing the commands.
    pub control: Latency,
    /// Passing the commands and SYNC to the bus.
    pub send: Latency,
    /// From the exchange to the answer of each axis, then of the tool.
    pub answers: [Latency; PLACES_MAX],
    /// Interruptions of the thread.
    pub interruptions: Interruptions,
}

impl StageTimes {
    /// Adds the stages of a tick.
    pub fn record(&mut self, stamps: &Stamps) {
        self.receive.record(stamps.received.since(stamps.woke));
        let computing = stamps.controlled.since(stamps.received);
        self.control.record(computing.plus(stamps.ended.since(stamps.sent)));
        self.send.record(stamps.sent.since(stamps.controlled));
        for (latency, span_ns) in self.answers.iter_mut().zip(stamps.answer_ns) {
            if span_ns > 0 {
                latency.record(Nanos(u64::from(span_ns)));
            }
        }
        self.interruptions = self.interruptions.plus(stamps.interruptions);
    }
}

/// Ticks until the axes are at rest and the drives disabled.
///
/// A tick that begins at least a whole cycle late skips the cycles it missed, so that the loop
/// keeps its phase and never sends two commands at once. As many as
/// [`ServoSpec::catch_up_cycles_max`](super::ServoSpec::catch_up_cycles_max) are made up for in its place, at once.
///
/// # Real Time
/// Hot: call it in its own thread, prepared by [`crate::rt::thread::enter`].
pub fn run_on_clock(cycle: &mut Cycle, clock: &dyn Clock, timing: &mut Timing) {
    run_until(cycle, clock, timing, Nanos(u64::MAX));
}

/// Same, but for no longer than until `end`: the axes are then as they are.
///
/// # Real Time
/// Hot.
pub fn run_until(cycle: &mut Cycle, clock: &dyn Clock, timing: &mut Timing, end: Nanos) {
    let period = cycle.period();
    let mut due = clock.now().plus(period);
    // Missed cycles that were counted when they were missed, and are still to be made up for.
    let mut owed = 0;
    cycle.start();
    while due < end {
        clock.sleep_until(due);
        let began = clock.now();
        let late = began.since(due);
        timing.wake_late.record(late);
        let missed = late.0 / period.0.max(1);
        let skipped = u32::try_from(missed.saturating_sub(owed)).unwrap_or(u32::MAX);
        cycle.begin(due, began, skipped);
        let status = cycle.tick(skipped);
        timing.execution.record(clock.now().since(began));
        if let Some(stamps) = cycle.end() {
            timing.stages.record(&stamps);
        }
        if status == TickStatus::Stopped {
            return;
        }
        let passed = if missed <= cycle.catch_up_cycles_max() { 0 } else { missed };
        owed = (missed - passed).saturating_sub(1);
        due = due.plus(Nanos(period.0 * (passed + 1)));
    }
}
