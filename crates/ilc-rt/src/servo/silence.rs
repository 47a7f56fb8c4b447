//! Detection of silence: each PDO of each node is monitored, and named when it is missing.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::mailbox::StopReason;
use super::mode;
use super::pending::Part;
use super::phase::Phase;
use super::spec::Pace;

/// Largest age in cycles of a position from which a velocity is computed in a valid run.
const OLD_CYCLES: u64 = 2;

impl Cycle {
    /// Returns the first part that has been silent for too long, each one once.
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
                found = found.or(Some(self.silent_part(axis, part, silence)));
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
                Some(n_bytes) => StopReason::WrongLength { node: tool.node.get(), pdo: 1, n_bytes },
                None => StopReason::SilentTool { cycles: saturate(silence) },
            };
            found = found.or(Some(reason));
        }
        found
    }

    /// Returns the reason for the silence of a part of an axis, as far as it is known.
    fn silent_part(&self, axis: usize, part: Part, silence: u64) -> StopReason {
        let (pdo, other) = match part {
            Part::DriveMotion(_) => (2, Part::Status(axis)),
            Part::Status(_) | Part::Tool => (1, Part::DriveMotion(axis)),
        };
        if let Some(n_bytes) = self.drives[axis].unreadable[usize::from(pdo - 1)] {
            let node = self.spec.axes[axis].node.get();
            return StopReason::WrongLength { node, pdo, n_bytes };
        }
        // Both fall silent together if the node does; a cycle of difference is chance.
        if 2 * self.pending.silence(other) > silence {
            return self.silent_axis(axis, silence);
        }
        StopReason::SilentPdo { axis, pdo, cycles: saturate(silence) }
    }

    pub(super) fn silent_axis(&self, axis: usize, silence: u64) -> StopReason {
        match self.drives[axis].unreadable[0] {
            Some(n_bytes) => {
                StopReason::WrongLength { node: self.spec.axes[axis].node.get(), pdo: 1, n_bytes }
            }
            None => StopReason::SilentAxis { axis, cycles: saturate(silence) },
        }
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
