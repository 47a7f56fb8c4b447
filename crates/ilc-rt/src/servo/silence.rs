//! Detection of silence: each PDO of each node is monitored, and named when it is missing.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::mode;
use super::pending::Part;
use super::phase::Phase;
use super::spec::Pace;
use crate::fieldbus::network::AnswerPart;

/// Largest age in cycles of a position from which a velocity is computed in a valid run.
const OLD_CYCLES: u64 = 2;
/// Length of the PDO of the tool.
const TOOL_BYTES: u8 = 8;

impl Cycle {
    /// Returns the first part that has been silent for too long, each one once; during a stop, rather one
    /// that explains it.
    pub(super) fn find_silence(&mut self) -> Option<StopReason> {
        // Paced by answers, the wait is already over: one unanswered SYNC is silence.
        let max = match self.spec.pace {
            Pace::Answers(_) => 0,
            Pace::Clock => u64::from(self.spec.silent_cycles_max),
        };
        let mut found = None;
        for axis in 0..self.n_axes() {
            for part in [Part::Status(axis), Part::DriveMotion(axis)] {
                let silence = self.pending.silence(part);
                if silence <= max || self.pending.is_given_up(part) {
                    continue;
                }
                let silent = self.silent_part(axis, part, silence);
                if found.is_none() || self.better_reason(silent).is_some() {
                    found = Some(silent);
                }
                self.pending.give_up(part);
                if part == Part::Status(axis) {
                    // Its state is unknown, so it can only be commanded to stop.
                    self.drives[axis].lost = true;
                }
            }
        }
        let silence = self.pending.silence(Part::Tool);
        if let Some(tool) = self.spec.tool
            && silence > max
            && !self.pending.is_given_up(Part::Tool)
        {
            self.pending.give_up(Part::Tool);
            let reason = match self.tool_unreadable {
                Some(n_bytes) => StopReason::WrongLength {
                    node: tool.node.get(),
                    pdo: 1,
                    n_bytes,
                    needed: TOOL_BYTES,
                },
                None => StopReason::SilentTool { cycles: saturate(silence) },
            };
            found = found.or(Some(reason));
        }
        found
    }

    /// Returns the reason for the silence of a part of an axis, as far as it is known.
    fn silent_part(&self, axis: usize, part: Part, silence: u64) -> StopReason {
        let (pdo, other) = match part {
            Part::DriveMotion(_) => (AnswerPart::Motion, Part::Status(axis)),
            Part::Status(_) | Part::Tool => (AnswerPart::Status, Part::DriveMotion(axis)),
        };
        if let Some(reason) = self.wrong_length(axis, pdo) {
            return reason;
        }
        // Both fall silent together if the node does; a cycle of difference is chance.
        if !self.pending.is_sent(other) || 2 * self.pending.silence(other) > silence {
            return self.silent_axis(axis, silence);
        }
        let pdo = if pdo == AnswerPart::Status { 1 } else { 2 };
        StopReason::SilentPdo { axis, pdo, cycles: saturate(silence) }
    }

    pub(super) fn silent_axis(&self, axis: usize, silence: u64) -> StopReason {
        let unreadable = self.wrong_length(axis, AnswerPart::Status);
        unreadable.unwrap_or(StopReason::SilentAxis { axis, cycles: saturate(silence) })
    }

    /// Returns the reason for a part of an answer that came, but could not be read.
    fn wrong_length(&self, axis: usize, part: AnswerPart) -> Option<StopReason> {
        let n_bytes = self.drives[axis].unreadable[part.index()]?;
        let node = self.spec.axes[axis].node.get();
        let pdo = if part == AnswerPart::Status { 1 } else { 2 };
        Some(StopReason::WrongLength {
            node,
            pdo,
            n_bytes,
            needed: self.network.part_bytes(axis, part),
        })
    }

    /// Records if this cycle of a run is commanded on a stale position.
    pub(super) fn watch_age(&mut self) {
        if !matches!(self.phase, Phase::Running { .. }) {
            return;
        }
        let is_old = (0..self.n_axes()).any(|axis| {
            mode::of(self.spec.axes[axis].mode).closes_position_loop()
                && self.pending.lag(Part::Status(axis)) > OLD_CYCLES
        });
        if is_old {
            self.pending.spoil_next();
        }
    }
}

pub(super) fn saturate(cycles: u64) -> u32 {
    u32::try_from(cycles).unwrap_or(u32::MAX)
}
