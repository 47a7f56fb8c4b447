//! Assigns each answer to its SYNC, also when it arrives a cycle or two late.
//!
//! A node sends each of its PDOs once for every SYNC and in order, so that the n-th one belongs to
//! the n-th SYNC. That is certain whenever every SYNC has been answered. While one is not, its
//! answer may be late or lost, and later ones are held back: once all have arrived they were late,
//! and keep their places; if the same number stays missing for a while although answers arrive,
//! those were lost, and each answer belongs to the SYNC before it. Ambiguous or unrequested answers
//! make their samples missing.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::mailbox::Sample;
use crate::interpolate::MAX_AXES;

/// Largest number of cycles that wait for their answers.
const DEPTH: usize = 64;
/// Age at which a cycle is passed on in spite of a missing answer.
const PATIENCE: u64 = 40;
/// Ticks with an answer that a PDO must lag before the difference counts as lost.
const LAG_TICKS: u32 = 8;
/// Largest number of parts of an answer: two PDOs per drive, and the tool.
const PARTS_MAX: usize = 2 * MAX_AXES + 1;

/// A PDO expected after every SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// State and position of an axis.
    Status(usize),
    /// Velocity and following error of an axis.
    DriveMotion(usize),
    /// The tool.
    Tool,
}

#[derive(Clone, Copy, Debug, Default)]
struct PendingCycle {
    sample: Sample,
    /// Commanded position of each axis, m.
    commanded_m: [f64; MAX_AXES],
    last_of_run: bool,
    /// SYNCs sent when each part arrived; 0 if it has not.
    came: [u64; PARTS_MAX],
    /// True if this cycle's measurement is invalid.
    spoiled: bool,
}

/// Progress of one part of the answers.
#[derive(Clone, Copy, Debug, Default)]
struct Lag {
    answers: u64,
    /// SYNCs whose answers are certain.
    settled: u64,
    /// Ticks with an answer since then, and the smallest lag in them.
    ticks: u32,
    min: u64,
    /// SYNCs since the last answer.
    silent: u64,
    came: bool,
    given_up: bool,
}

/// The cycles in transit.
#[derive(Clone, Debug)]
pub(super) struct PendingCycles {
    ring: [PendingCycle; DEPTH],
    lags: [Lag; PARTS_MAX],
    n_axes: usize,
    /// True for the parts that are sent.
    is_sent: [bool; PARTS_MAX],
    sent: u64,
    given: u64,
    spoil_next: bool,
}

impl PendingCycles {
    #[expect(clippy::large_stack_arrays, reason = "made once, before the loop starts")]
    pub(super) fn new(parts: &[[bool; 2]], has_tool: bool) -> Self {
        let n_axes = parts.len().min(MAX_AXES);
        let mut is_sent = [false; PARTS_MAX];
        for (room, parts) in is_sent.chunks_exact_mut(2).zip(parts) {
            room.copy_from_slice(parts);
        }
        is_sent[2 * n_axes] = has_tool;
        Self {
            ring: [PendingCycle::default(); DEPTH],
            lags: [Lag::default(); PARTS_MAX],
            n_axes,
            is_sent,
            sent: 0,
            given: 0,
            spoil_next: false,
        }
    }

    /// Records the data of the next SYNC: the sample, and the commanded position of each axis, m.
    /// Its measurement fields hold the newest known ones, which stand in should an answer never
    /// arrive.
    pub(super) fn send(
        &mut self,
        mut sample: Sample,
        commanded_m: [f64; MAX_AXES],
        last_of_run: bool,
    ) {
        sample.sync = self.sent;
        let spoiled = std::mem::take(&mut self.spoil_next);
        self.ring[index(self.sent)] =
            PendingCycle { sample, commanded_m, last_of_run, came: [0; PARTS_MAX], spoiled };
        self.sent += 1;
        for (lag, is_sent) in self.lags.iter_mut().zip(self.is_sent) {
            lag.silent += u64::from(is_sent);
        }
    }

    /// Invalidates the next cycle: it was commanded on stale measurements.
    pub(super) fn spoil_next(&mut self) {
        self.spoil_next = true;
    }

    /// Records an answer: the position of an axis, or the coordinates of the tool.
    pub(super) fn answer(&mut self, part: Part, value: [f64; 2]) {
        let Some(number) = self.number(part) else { return };
        let lag = &mut self.lags[number];
        if lag.answers >= self.sent {
            // Unrequested: of two answers to one SYNC the right one is unknown.
            if self.sent > self.given {
                self.ring[index(self.sent - 1)].spoiled = true;
            }
            return;
        }
        let sync = lag.answers;
        lag.answers += 1;
        lag.silent = 0;
        lag.came = true;
        if sync >= self.given {
            let cycle = &mut self.ring[index(sync)];
            cycle.came[number] = self.sent;
            write(&mut cycle.sample, part, value);
        }
    }

    /// Returns the last cycles that were sent, oldest first, including those that wait for answers.
    pub(super) fn last(&self, n_cycles: u64) -> impl Iterator<Item = Sample> + '_ {
        let first = self.sent.saturating_sub(n_cycles.min(DEPTH as u64));
        (first..self.sent).map(|sync| {
            let cycle = &self.ring[index(sync)];
            let missing =
                cycle.spoiled || self.expected().any(|(_, number)| cycle.came[number] == 0);
            Sample { missing, ..cycle.sample }
        })
    }

    /// Returns the position that an axis was commanded to at the SYNC of its newest answer, m.
    pub(super) fn answered_command_m(&self, axis: usize) -> Option<f64> {
        let number = self.number(Part::Status(axis))?;
        let sync = self.lags[number].answers.checked_sub(1)?;
        Some(self.ring[index(sync)].commanded_m[axis])
    }

    /// Returns the set point of an axis at the SYNC of its newest answer, m.
    pub(super) fn answered_reference_m(&self, axis: usize) -> Option<f64> {
        let number = self.number(Part::Status(axis))?;
        let sync = self.lags[number].answers.checked_sub(1)?;
        Some(self.ring[index(sync)].sample.reference_m[axis])
    }

    /// Returns the number of SYNCs that a part has not answered.
    pub(super) fn lag(&self, part: Part) -> u64 {
        self.number(part).map_or(0, |number| self.sent - self.lags[number].answers)
    }

    /// Returns whether a part is sent at all.
    pub(super) fn is_sent(&self, part: Part) -> bool {
        self.number(part).is_some()
    }

    /// Returns the SYNCs sent since a part last arrived.
    pub(super) fn silence(&self, part: Part) -> u64 {
        self.number(part).map_or(0, |number| self.lags[number].silent)
    }

    /// Returns true if a part that is not given up has been missing for the last `n_cycles` SYNCs.
    pub(super) fn waits(&self, n_cycles: u64) -> bool {
        self.expected().any(|(lag, _)| !lag.given_up && lag.silent >= n_cycles)
    }

    /// Returns whether a part is no longer waited for.
    pub(super) fn is_given_up(&self, part: Part) -> bool {
        self.number(part).is_some_and(|number| self.lags[number].given_up)
    }

    /// Stops waiting for a silent part: the stop that follows needs many ticks.
    pub(super) fn give_up(&mut self, part: Part) {
        if let Some(number) = self.number(part) {
            self.lags[number].given_up = true;
        }
    }

    /// Returns whether every part that is not given up has answered every SYNC.
    pub(super) fn all_answered(&self) -> bool {
        self.expected().all(|(lag, _)| lag.given_up || lag.answers == self.sent)
    }

    /// Returns the parts that are sent, with their numbers.
    fn expected(&self) -> impl Iterator<Item = (&Lag, usize)> {
        let numbered = self.lags.iter().zip(0..).zip(self.is_sent);
        numbered.filter_map(|(part, is_sent)| is_sent.then_some(part))
    }

    /// Decides, once per tick after receiving, which answers are late and which are lost.
    pub(super) fn watch_lag(&mut self) {
        for number in 0..PARTS_MAX {
            if !self.is_sent[number] {
                continue;
            }
            let lag = &mut self.lags[number];
            let came = std::mem::take(&mut lag.came);
            let behind = self.sent - lag.answers;
            if behind == 0 {
                (lag.settled, lag.ticks) = (self.sent, 0);
                continue;
            }
            // While nothing arrives all of it may still be in transit.
            if !came {
                continue;
            }
            lag.min = if lag.ticks == 0 { behind } else { lag.min.min(behind) };
            lag.ticks += 1;
            if lag.ticks >= LAG_TICKS {
                let lost = lag.min;
                self.skip(number, lost);
            }
        }
    }

    /// Assumes that `lost` answers of a part will never arrive, and assigns those that arrived
    /// since to the SYNCs before them.
    fn skip(&mut self, number: usize, lost: u64) {
        let (settled, answers) = (self.lags[number].settled, self.lags[number].answers);
        let part = self.part(number);
        let mut newer = self.sent;
        let mut clear = true;
        for sync in (settled.max(self.given)..answers).rev() {
            let came = std::mem::take(&mut self.ring[index(sync)].came[number]);
            if came == 0 {
                continue;
            }
            let own = came - 1;
            clear &= own < newer;
            newer = own;
            let value = read(&self.ring[index(sync)].sample, part);
            let cycle = &mut self.ring[index(own)];
            cycle.came[number] = came;
            write(&mut cycle.sample, part, value);
        }
        if !clear {
            // Two arrived at once, so their SYNCs are unknown.
            for sync in settled.max(self.given)..self.sent {
                self.ring[index(sync)].came[number] = 0;
            }
        }
        let lag = &mut self.lags[number];
        lag.answers += lost;
        lag.ticks = 0;
        if lag.answers == self.sent {
            lag.settled = self.sent;
        }
    }

    /// Returns the next cycle that is complete, or too old to wait for; and true if it ends its
    /// run.
    pub(super) fn take(&mut self) -> Option<(Sample, bool)> {
        if self.given == self.sent {
            return None;
        }
        let came = &self.ring[index(self.given)].came;
        // A settled cycle whose answer has not arrived never gets one.
        let hopeless = self.expected().all(|(lag, _)| self.given < lag.settled);
        let complete = hopeless && self.expected().all(|(_, number)| came[number] > 0);
        if !complete && !hopeless && self.sent - self.given <= PATIENCE {
            return None;
        }
        let cycle = &mut self.ring[index(self.given)];
        cycle.sample.missing = !complete || cycle.spoiled;
        self.given += 1;
        Some((cycle.sample, cycle.last_of_run))
    }

    fn number(&self, part: Part) -> Option<usize> {
        let number = match part {
            Part::Status(axis) => 2 * axis,
            Part::DriveMotion(axis) => 2 * axis + 1,
            Part::Tool => 2 * self.n_axes,
        };
        self.is_sent.get(number).is_some_and(|is_sent| *is_sent).then_some(number)
    }

    fn part(&self, number: usize) -> Part {
        match (number / 2, number % 2) {
            (axis, _) if axis >= self.n_axes => Part::Tool,
            (axis, 0) => Part::Status(axis),
            (axis, _) => Part::DriveMotion(axis),
        }
    }
}

fn write(sample: &mut Sample, part: Part, value: [f64; 2]) {
    match part {
        Part::Status(axis) => sample.encoder_m[axis] = value[0],
        Part::DriveMotion(_) => {}
        Part::Tool => sample.tool_m[..2].copy_from_slice(&value),
    }
}

fn read(sample: &Sample, part: Part) -> [f64; 2] {
    match part {
        Part::Status(axis) => [sample.encoder_m[axis], 0.0],
        Part::DriveMotion(_) => [0.0; 2],
        Part::Tool => [sample.tool_m[0], sample.tool_m[1]],
    }
}

#[expect(clippy::cast_possible_truncation, reason = "below DEPTH")]
fn index(sync: u64) -> usize {
    (sync % DEPTH as u64) as usize
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests;
