//! The rows of a recording: the state of the loop at the end of a tick.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::tap::{AxisRow, LoopRecord, LoopRow, Tap};
use crate::rt::Nanos;

impl Cycle {
    /// Records this tick: the loop, then each axis.
    pub(super) fn record(&self, tap: &mut Tap) {
        let now = tap.now();
        if !tap.has_room(self.n_axes()) {
            return;
        }
        tap.record(LoopRecord::Loop(self.row(now)));
        for axis in 0..self.n_axes() {
            tap.record(LoopRecord::Axis(self.axis_row(axis)));
        }
    }

    fn row(&self, (tick, at, missed, lost): (u64, Nanos, u32, u64)) -> LoopRow {
        LoopRow {
            tick,
            at,
            missed,
            asked: self.mail.asked,
            orders: self.mail.seen,
            table: self.table.number,
            phase: self.phase_name(),
            run: self.run,
            sample: self.phase.sample(),
            overruns: self.run_overruns,
            scaled: self.run_scaled,
            scale: self.feed.scale(),
            tool_m: [self.tool_m[0], self.tool_m[1]],
            inputs: self.input_bits,
            stopping: self.stopping,
            lost,
        }
    }

    fn axis_row(&self, axis: usize) -> AxisRow {
        let drive = &self.drives[axis];
        let answered_m = self.pending.answered_reference_m(axis);
        AxisRow {
            reference_m: self.reference.position_m[axis],
            reference_m_s: self.reference.velocity_m_s[axis],
            correction: self.input.value()[axis],
            position_m: drive.encoder_m,
            velocity_m_s: drive.encoder_m_s,
            error_m: answered_m.map_or(0.0, |reference_m| reference_m - drive.encoder_m),
            following_error_m: drive.following_error_m,
            command: self.commanded[0][axis],
            sent: drive.sent,
            statusword: drive.statusword,
            drive_counts_s: drive.velocity_counts_s,
            torque: drive.torque,
        }
    }
}
