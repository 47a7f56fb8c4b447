//! Puts each answer with the SYNC that asked for it, also when it comes a cycle or two late.
//!
//! A node sends each of its PDOs once for every SYNC and in order, so that the n-th one belongs to the
//! n-th SYNC. That holds for sure whenever every SYNC has been answered. While one is not, it is not
//! known whether its answer is late or lost, and what comes meanwhile is held back: once all are there
//! they were late, and belong where they stand; if as many stay behind for a while as answers flow, so
//! many were lost, and each answer belongs to the SYNC before it came. What cannot be told apart, or
//! comes without having been asked for, makes its samples missing.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::mailbox::Sample;
use crate::interpolate::MAX_AXES;

/// Cycles that may wait for their answers.
const DEPTH: usize = 64;
/// Age at which a cycle is given out although an answer is missing.
const PATIENCE: u64 = 40;
/// Ticks with an answer that a PDO must lag before the difference counts as lost.
const LAG_TICKS: u32 = 8;
/// Most parts of an answer: two PDOs a drive, and the tool.
const PARTS_MAX: usize = 2 * MAX_AXES + 1;

/// A PDO that is expected after every SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// State and position of an axis.
    Status(usize),
    /// What else the drive of an axis sends.
    Extra(usize),
    /// The tool.
    Tool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    sample: Sample,
    /// Position that each axis was commanded to, m.
    commanded_m: [f64; MAX_AXES],
    last_of_run: bool,
    /// SYNCs sent when each part came; 0 if it has not.
    came: [u64; PARTS_MAX],
    /// Whether something in this cycle makes its measurement worthless.
    spoiled: bool,
}

/// How far one part is.
#[derive(Clone, Copy, Debug, Default)]
struct Lag {
    answers: u64,
    /// SYNCs whose answers are known for sure.
    settled: u64,
    /// Ticks with an answer since then, and the smallest lag in them.
    ticks: u32,
    least: u64,
    /// SYNCs since the last answer.
    silent: u64,
    came: bool,
    given_up: bool,
}

/// The cycles under way.
#[derive(Clone, Debug)]
pub(super) struct Slots {
    ring: [Slot; DEPTH],
    lags: [Lag; PARTS_MAX],
    n_axes: usize,
    n_parts: usize,
    sent: u64,
    given: u64,
    spoil_next: bool,
}

impl Slots {
    #[expect(clippy::large_stack_arrays, reason = "made once, before the loop starts")]
    pub(super) fn new(n_axes: usize, has_tool: bool) -> Self {
        let n_axes = n_axes.min(MAX_AXES);
        Self {
            ring: [Slot::default(); DEPTH],
            lags: [Lag::default(); PARTS_MAX],
            n_axes,
            n_parts: 2 * n_axes + usize::from(has_tool),
            sent: 0,
            given: 0,
            spoil_next: false,
        }
    }

    /// Notes what goes out with the next SYNC: the sample, and the position that each axis is
    /// commanded to, m. Its measurement fields hold the newest ones known, which stand in should an
    /// answer never come.
    pub(super) fn send(
        &mut self,
        mut sample: Sample,
        commanded_m: [f64; MAX_AXES],
        last_of_run: bool,
    ) {
        sample.sync = self.sent;
        let spoiled = std::mem::take(&mut self.spoil_next);
        self.ring[index(self.sent)] =
            Slot { sample, commanded_m, last_of_run, came: [0; PARTS_MAX], spoiled };
        self.sent += 1;
        for lag in &mut self.lags[..self.n_parts] {
            lag.silent += 1;
        }
    }

    /// Makes the cycle that is sent next worthless: it was commanded on what is too old.
    pub(super) fn spoil_next(&mut self) {
        self.spoil_next = true;
    }

    /// Notes an answer: the position of an axis, or the coordinates of the tool.
    pub(super) fn answer(&mut self, part: Part, value: [f64; 2]) {
        let Some(number) = self.number(part) else { return };
        let lag = &mut self.lags[number];
        if lag.answers >= self.sent {
            // Nothing asked for it: of two answers to one SYNC nobody knows which is the right one.
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
            let slot = &mut self.ring[index(sync)];
            slot.came[number] = self.sent;
            write(&mut slot.sample, part, value);
        }
    }

    /// Position that an axis had been commanded to at the SYNC that its newest answer belongs to, m.
    pub(super) fn answered_command_m(&self, axis: usize) -> Option<f64> {
        let number = self.number(Part::Status(axis))?;
        let sync = self.lags[number].answers.checked_sub(1)?;
        Some(self.ring[index(sync)].commanded_m[axis])
    }

    /// SYNCs that a part has not answered.
    pub(super) fn lag(&self, part: Part) -> u64 {
        self.number(part).map_or(0, |number| self.sent - self.lags[number].answers)
    }

    /// SYNCs sent since a part last came.
    pub(super) fn silence(&self, part: Part) -> u64 {
        self.number(part).map_or(0, |number| self.lags[number].silent)
    }

    /// Whether a part that is not given up has stayed away for the last `n_cycles` SYNCs.
    pub(super) fn waits(&self, n_cycles: u64) -> bool {
        self.lags[..self.n_parts].iter().any(|lag| !lag.given_up && lag.silent >= n_cycles)
    }

    /// Whether a part is no longer waited for.
    pub(super) fn is_given_up(&self, part: Part) -> bool {
        self.number(part).is_some_and(|number| self.lags[number].given_up)
    }

    /// No longer waits for a part that is silent: the stop that follows needs many ticks.
    pub(super) fn give_up(&mut self, part: Part) {
        if let Some(number) = self.number(part) {
            self.lags[number].given_up = true;
        }
    }

    /// Whether every part that is not given up has answered every SYNC.
    pub(super) fn all_answered(&self) -> bool {
        self.lags[..self.n_parts].iter().all(|lag| lag.given_up || lag.answers == self.sent)
    }

    /// Once a tick, after receiving: finds out what has been late and what is lost.
    pub(super) fn watch_lag(&mut self) {
        for number in 0..self.n_parts {
            let lag = &mut self.lags[number];
            let came = std::mem::take(&mut lag.came);
            let behind = self.sent - lag.answers;
            if behind == 0 {
                (lag.settled, lag.ticks) = (self.sent, 0);
                continue;
            }
            // While nothing comes it may all be on its way yet.
            if !came {
                continue;
            }
            lag.least = if lag.ticks == 0 { behind } else { lag.least.min(behind) };
            lag.ticks += 1;
            if lag.ticks >= LAG_TICKS {
                let lost = lag.least;
                self.skip(number, lost);
            }
        }
    }

    /// Takes it that `lost` answers of a part will never come, and puts those that came since with the
    /// SYNCs before them.
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
            let slot = &mut self.ring[index(own)];
            slot.came[number] = came;
            write(&mut slot.sample, part, value);
        }
        if !clear {
            // Two came at once, so that it is not known which SYNC each belongs to.
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

    /// The next cycle that is complete, or too old to wait for; and whether it ends its run.
    pub(super) fn take(&mut self) -> Option<(Sample, bool)> {
        if self.given == self.sent {
            return None;
        }
        let slot = &mut self.ring[index(self.given)];
        let complete = self.lags[..self.n_parts]
            .iter()
            .zip(&slot.came)
            .all(|(lag, came)| *came > 0 && self.given < lag.settled);
        // What is settled and has not come never will.
        let hopeless = self.lags[..self.n_parts].iter().all(|lag| self.given < lag.settled);
        if !complete && !hopeless && self.sent - self.given <= PATIENCE {
            return None;
        }
        slot.sample.missing = !complete || slot.spoiled;
        self.given += 1;
        Some((slot.sample, slot.last_of_run))
    }

    fn number(&self, part: Part) -> Option<usize> {
        let number = match part {
            Part::Status(axis) => 2 * axis,
            Part::Extra(axis) => 2 * axis + 1,
            Part::Tool => 2 * self.n_axes,
        };
        (number < self.n_parts).then_some(number)
    }

    fn part(&self, number: usize) -> Part {
        match (number / 2, number % 2) {
            (axis, _) if axis >= self.n_axes => Part::Tool,
            (axis, 0) => Part::Status(axis),
            (axis, _) => Part::Extra(axis),
        }
    }
}

fn write(sample: &mut Sample, part: Part, value: [f64; 2]) {
    match part {
        Part::Status(axis) => sample.encoder_m[axis] = value[0],
        Part::Extra(_) => {}
        Part::Tool => sample.tool_m[..2].copy_from_slice(&value),
    }
}

fn read(sample: &Sample, part: Part) -> [f64; 2] {
    match part {
        Part::Status(axis) => [sample.encoder_m[axis], 0.0],
        Part::Extra(_) => [0.0; 2],
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
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Both PDOs of an axis.
    fn answer(slots: &mut Slots, axis: usize, value: f64) {
        slots.answer(Part::Status(axis), [value, 0.0]);
        slots.answer(Part::Extra(axis), [0.0; 2]);
    }

    #[test]
    fn a_late_answer_lands_in_its_own_cycle() {
        let mut slots = Slots::new(2, false);
        slots.send(Sample::default(), [0.0; MAX_AXES], false);
        answer(&mut slots, 0, 10.0);
        slots.watch_lag();
        assert!(slots.take().is_none(), "node 1 has not answered");
        slots.send(Sample::default(), [0.0; MAX_AXES], true);
        answer(&mut slots, 1, 20.0);
        answer(&mut slots, 1, 21.0);
        answer(&mut slots, 0, 11.0);
        slots.watch_lag();
        let (first, last) = slots.take().unwrap();
        assert_eq!((first.encoder_m[0], first.encoder_m[1], last), (10.0, 20.0, false));
        let (second, last) = slots.take().unwrap();
        assert_eq!((second.encoder_m[0], second.encoder_m[1], last), (11.0, 21.0, true));
        assert!(slots.all_answered());
    }

    /// Lets `n` cycles pass; `deliver` says which answers of PDO 1 come in the tick after each SYNC.
    fn pass(n: u64, mut deliver: impl FnMut(u64, &mut Vec<u64>)) -> Vec<Sample> {
        let mut slots = Slots::new(1, false);
        let mut out = Vec::new();
        let mut coming = Vec::new();
        for sync in 0..n {
            slots.send(Sample::default(), [0.0; MAX_AXES], false);
            deliver(sync, &mut coming);
            for of in coming.drain(..) {
                slots.answer(Part::Status(0), [of as f64, 0.0]);
            }
            slots.answer(Part::Extra(0), [0.0; 2]);
            slots.watch_lag();
            while let Some((sample, _)) = slots.take() {
                out.push(sample);
            }
        }
        out
    }

    /// Cycles whose measurement is missing; no other may be wrong.
    fn missing(samples: &[Sample]) -> BTreeSet<u64> {
        for sample in samples.iter().filter(|sample| !sample.missing) {
            assert_eq!(sample.encoder_m[0], sample.sync as f64, "in the wrong cycle");
        }
        samples.iter().filter(|sample| sample.missing).map(|sample| sample.sync).collect()
    }

    #[test]
    fn lost_answers_are_missing_and_shift_nothing() {
        for n_lost in [1, 2, 10, 19] {
            let out = pass(200, |sync, coming| {
                if !(50..50 + n_lost).contains(&sync) {
                    coming.push(sync);
                }
            });
            assert_eq!(missing(&out), (50..50 + n_lost).collect(), "{n_lost}");
            assert!(out.len() > 190);
        }
    }

    #[test]
    fn late_answers_are_not_missing() {
        for n_late in [1, 2, 10, 19] {
            let out = pass(200, |sync, coming| {
                if !(50..50 + n_late).contains(&sync) {
                    coming.extend((50..50 + n_late).filter(|_| sync == 50 + n_late));
                    coming.push(sync);
                }
            });
            assert_eq!(missing(&out), BTreeSet::new(), "{n_late}");
        }
    }

    #[test]
    fn a_doubled_answer_makes_its_cycle_missing() {
        let out = pass(100, |sync, coming| {
            coming.push(sync);
            if sync == 50 {
                coming.push(sync);
            }
        });
        assert_eq!(missing(&out), BTreeSet::from([50]));
    }

    #[test]
    fn whatever_comes_and_does_not_nothing_is_put_in_the_wrong_cycle_for_long() {
        let mut state = 7_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        // Losses far enough from each other to be told apart.
        let lost: BTreeSet<u64> = (1..40).map(|n| n * 50 + random() % 20).collect();
        let out = pass(2100, |sync, coming| {
            if !lost.contains(&sync) {
                coming.push(sync);
            }
        });
        assert_eq!(missing(&out), lost);
        // Losses at random, close to each other: missing at least, and never believed to be right.
        let out = pass(5000, |sync, coming| {
            if random() % 12 > 0 {
                coming.push(sync);
            }
        });
        assert!(missing(&out).len() > 300);
    }

    #[test]
    fn a_late_position_belongs_to_the_command_that_it_answers() {
        let mut slots = Slots::new(1, false);
        assert_eq!(slots.answered_command_m(0), None);
        for n in 0..4 {
            slots.send(Sample::default(), [f64::from(n); MAX_AXES], false);
        }
        answer(&mut slots, 0, 0.0);
        assert_eq!(slots.answered_command_m(0), Some(0.0));
        for n in 1..4 {
            answer(&mut slots, 0, f64::from(n));
            assert_eq!(slots.answered_command_m(0), Some(f64::from(n)));
        }
    }

    #[test]
    fn one_pdo_of_two_is_not_enough() {
        let mut slots = Slots::new(1, true);
        for _ in 0..60 {
            slots.send(
                Sample { encoder_m: [7.0; MAX_AXES], ..Default::default() },
                [0.0; MAX_AXES],
                false,
            );
            slots.answer(Part::Extra(0), [0.0; 2]);
            slots.answer(Part::Tool, [1.0, 2.0]);
            slots.watch_lag();
        }
        assert_eq!((slots.lag(Part::Status(0)), slots.silence(Part::Status(0))), (60, 60));
        assert_eq!((slots.lag(Part::Extra(0)), slots.lag(Part::Tool)), (0, 0));
        let (sample, _) = slots.take().unwrap();
        assert!(sample.missing && (sample.encoder_m[0] - 7.0).abs() < 1e-15);
        assert_eq!(sample.tool_m[..2], [1.0, 2.0]);
    }
}
