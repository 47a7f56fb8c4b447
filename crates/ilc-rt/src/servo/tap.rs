//! The tap of a recording: what a tick read, and what it made of it, in records of a fixed size.
//!
//! A tick is a function of the loop's state, of the missed cycles before it, of what it reads of the mailbox (a
//! table, orders, a signal to stop) and of the messages that the bus has. The first are recorded here, the frames in
//! [`TappedBus`](crate::fieldbus::transport::TappedBus), so that a replay feeds the same ones into the same loop. What
//! the tick made of them is recorded as well, for a person who reads it and for the comparison.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::Arc;

use rtrb::Producer;

use super::inputs::InputBits;
use super::mailbox::StopReason;
use super::orders::OrdersSeen;
use super::phase::PhaseName;
use crate::fieldbus::cia402::CommandRpdo1;
use crate::fieldbus::transport::TapCount;
use crate::rt::{Clock, Nanos, Stamps};

/// The loop in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopRow {
    /// Number of the tick since the loop began.
    pub tick: u64,
    /// Time since the epoch at which it began; without a clock the tick on the grid.
    pub at: Nanos,
    /// Cycles that were skipped before it.
    pub missed: u32,
    /// Signal that requested a stop, or 0.
    pub asked: i32,
    /// Orders as read.
    pub orders: OrdersSeen,
    /// Number of the input table in use.
    pub table: u32,
    /// Phase at its end.
    pub phase: PhaseName,
    /// Run, the next one between two runs.
    pub run: u32,
    /// Sample that a run has reached: the next one to come.
    pub sample: Option<u32>,
    /// Cycles of this run that began late.
    pub overruns: u32,
    /// Cycles of this run at another feed than 100 %.
    pub scaled: u32,
    /// Scale of the time along the path, 0 to 1.
    pub scale: f64,
    /// Tool centre point, m.
    pub tool_m: [f64; 2],
    /// Digital inputs.
    pub inputs: InputBits,
    /// Reason of the stop that is in progress or was made.
    pub stopping: Option<StopReason>,
    /// Records lost so far, as their ring was full.
    pub lost: u64,
}

/// One axis in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisRow {
    /// Set point without the learned input, m.
    pub reference_m: f64,
    /// Its velocity, m/s.
    pub reference_m_s: f64,
    /// Learned input as applied, in its unit.
    pub correction: f64,
    /// Newest measured position, m.
    pub position_m: f64,
    /// Velocity derived from it, m/s.
    pub velocity_m_s: f64,
    /// Set point of the exchange that this position answers, minus the position, m.
    pub error_m: f64,
    /// Following error, m: reported by the drive, or computed.
    pub following_error_m: f64,
    /// Command: m, m/s or N by the mode.
    pub command: f64,
    /// The same as sent to the drive.
    pub sent: CommandRpdo1,
    /// Statusword.
    pub statusword: u16,
    /// Velocity that the drive reports, counts/s.
    pub drive_counts_s: Option<i32>,
    /// Torque that the drive reports, thousandths of the rated one.
    pub torque: Option<i16>,
}

/// A record of the tap. A tick gives a row of the loop, then a row of each axis, then its stamps if there is a
/// flight recorder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoopRecord {
    /// The loop in a tick.
    Loop(LoopRow),
    /// The next axis of this tick.
    Axis(AxisRow),
    /// Stamps of the tick.
    Stamps(Stamps),
}

/// The tap of a loop: a ring that never blocks. What it has no room for is lost, and counted.
pub struct Tap {
    records: Producer<LoopRecord>,
    count: Arc<TapCount>,
    clock: Option<Arc<dyn Clock>>,
    period: Nanos,
    tick: u64,
    missed: u32,
    at: Nanos,
}

impl std::fmt::Debug for Tap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tap").field("tick", &self.tick).finish_non_exhaustive()
    }
}

impl Tap {
    /// Creates the tap of a loop of a cycle, with a clock for its times or, without one, times on the grid. Cold.
    pub fn new(
        records: Producer<LoopRecord>,
        count: Arc<TapCount>,
        clock: Option<Arc<dyn Clock>>,
        period: Nanos,
    ) -> Self {
        Self { records, count, clock, period, tick: 0, missed: 0, at: Nanos(0) }
    }

    /// Begins a tick.
    pub(super) fn begin(&mut self, missed: u32) {
        self.missed = missed;
        self.at = match &self.clock {
            Some(clock) => clock.since_epoch(),
            None => Nanos(self.period.0.saturating_mul(self.tick)),
        };
    }

    /// Records the stamps of the last tick.
    pub(super) fn stamps(&mut self, stamps: &Stamps) {
        if self.records.push(LoopRecord::Stamps(*stamps)).is_err() {
            self.count.lose(1);
        }
    }

    /// Ends a tick of so many axes; returns whether there is room for its rows, all of them or none.
    pub(super) fn has_room(&mut self, n_axes: usize) -> bool {
        self.tick += 1;
        self.count.set_tick(self.tick);
        let has_room = self.records.slots() > n_axes;
        if !has_room {
            self.count.lose(1);
        }
        has_room
    }

    /// Records a row, for which there is room.
    pub(super) fn record(&mut self, record: LoopRecord) {
        let _ = self.records.push(record);
    }

    /// Returns number and time of the tick, the cycles missed before it, and the records lost so far.
    pub(super) fn now(&self) -> (u64, Nanos, u32, u64) {
        (self.tick, self.at, self.missed, self.count.lost())
    }
}
