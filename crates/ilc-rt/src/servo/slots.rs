//! Puts each answer with the SYNC that asked for it, also when it comes a cycle or two late.
//!
//! Every node answers every SYNC once and in order, so its n-th answer belongs to the n-th SYNC. An
//! answer that is merely late still lands in the right sample; one that is lost is noticed by the
//! node's lag never returning to zero.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::mailbox::Sample;
use crate::trajectory::MAX_AXES;

/// Cycles that may wait for their answers.
const DEPTH: usize = 64;
/// Age at which a cycle is given out although an answer is missing.
const PATIENCE: u64 = 40;
/// Cycles in a row that a node must lag before an answer counts as lost.
const LAG_WINDOW: u32 = 32;
/// Most nodes: the axes, and the tool.
pub(super) const NODES_MAX: usize = MAX_AXES + 1;

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    sample: Sample,
    last_of_run: bool,
    answered: [bool; NODES_MAX],
}

#[derive(Clone, Copy, Debug, Default)]
struct Lag {
    answers: u64,
    ticks: u32,
    least: u64,
    silent: u64,
}

/// The cycles under way.
#[derive(Clone, Debug)]
pub(super) struct Slots {
    ring: [Slot; DEPTH],
    lags: [Lag; NODES_MAX],
    given_up: [bool; NODES_MAX],
    n_nodes: usize,
    sent: u64,
    given: u64,
}

impl Slots {
    #[expect(clippy::large_stack_arrays, reason = "made once, before the loop starts")]
    pub(super) fn new(n_nodes: usize) -> Self {
        Self {
            ring: [Slot::default(); DEPTH],
            lags: [Lag::default(); NODES_MAX],
            given_up: [false; NODES_MAX],
            n_nodes: n_nodes.min(NODES_MAX),
            sent: 0,
            given: 0,
        }
    }

    /// Notes what goes out with the next SYNC. Its measurement fields hold the newest ones known,
    /// which stand in should an answer never come.
    pub(super) fn send(&mut self, mut sample: Sample, last_of_run: bool) {
        sample.sync = self.sent;
        self.ring[index(self.sent)] = Slot { sample, last_of_run, answered: [false; NODES_MAX] };
        self.sent += 1;
        for lag in &mut self.lags[..self.n_nodes] {
            lag.silent += 1;
        }
    }

    /// Notes an answer of `node`; `write` puts the measurement into the sample that it belongs to.
    pub(super) fn answer(&mut self, node: usize, write: impl FnOnce(&mut Sample)) {
        let Some(lag) = self.lags.get_mut(node) else { return };
        if lag.answers >= self.sent {
            return;
        }
        let sync = lag.answers;
        lag.answers += 1;
        lag.silent = 0;
        if sync >= self.given {
            let slot = &mut self.ring[index(sync)];
            slot.answered[node] = true;
            write(&mut slot.sample);
        }
    }

    /// SYNCs that `node` has not answered.
    fn lag(&self, node: usize) -> u64 {
        self.lags.get(node).map_or(0, |lag| self.sent - lag.answers)
    }

    /// SYNCs sent since `node` last answered any.
    pub(super) fn silence(&self, node: usize) -> u64 {
        self.lags.get(node).map_or(0, |lag| lag.silent)
    }

    /// Whether a node that is not given up has answered none of the last `n_cycles` SYNCs.
    pub(super) fn waits(&self, n_cycles: u64) -> bool {
        (0..self.n_nodes).any(|node| !self.given_up[node] && self.silence(node) >= n_cycles)
    }

    /// No longer waits for `node`, which is silent: the stop that follows needs many ticks.
    pub(super) fn give_up(&mut self, node: usize) {
        if let Some(given_up) = self.given_up.get_mut(node) {
            *given_up = true;
        }
    }

    /// Whether every node that is not given up has answered every SYNC.
    pub(super) fn all_answered(&self) -> bool {
        (0..self.n_nodes).all(|node| self.given_up[node] || self.lag(node) == 0)
    }

    /// Once a tick, after receiving: skips answers that are lost for good.
    pub(super) fn watch_lag(&mut self) {
        let sent = self.sent;
        for lag in &mut self.lags[..self.n_nodes] {
            let behind = sent - lag.answers;
            if behind == 0 {
                lag.ticks = 0;
                continue;
            }
            lag.least = if lag.ticks == 0 { behind } else { lag.least.min(behind) };
            lag.ticks += 1;
            if lag.ticks >= LAG_WINDOW {
                lag.answers += lag.least;
                lag.ticks = 0;
            }
        }
    }

    /// The next cycle that is complete, or too old to wait for; and whether it ends its run.
    pub(super) fn take(&mut self) -> Option<(Sample, bool)> {
        if self.given == self.sent {
            return None;
        }
        let slot = &mut self.ring[index(self.given)];
        let complete = slot.answered[..self.n_nodes].iter().all(|answered| *answered);
        if !complete && self.sent - self.given <= PATIENCE {
            return None;
        }
        slot.sample.missing = !complete;
        self.given += 1;
        Some((slot.sample, slot.last_of_run))
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
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    fn answer(slots: &mut Slots, node: usize, value: f64) {
        slots.answer(node, |sample| sample.encoder_m[node] = value);
    }

    #[test]
    fn a_late_answer_lands_in_its_own_cycle() {
        let mut slots = Slots::new(2);
        slots.send(Sample::default(), false);
        answer(&mut slots, 0, 10.0);
        assert!(slots.take().is_none(), "node 1 has not answered");
        slots.send(Sample::default(), true);
        answer(&mut slots, 1, 20.0);
        answer(&mut slots, 1, 21.0);
        answer(&mut slots, 0, 11.0);
        let (first, last) = slots.take().unwrap();
        assert_eq!((first.encoder_m[0], first.encoder_m[1], last), (10.0, 20.0, false));
        let (second, last) = slots.take().unwrap();
        assert_eq!((second.encoder_m[0], second.encoder_m[1], last), (11.0, 21.0, true));
        assert!(slots.all_answered());
    }

    #[test]
    fn a_lost_answer_is_missing_once_and_shifts_nothing_for_long() {
        let mut slots = Slots::new(1);
        let mut out = Vec::new();
        for sync in 0..200_u32 {
            slots.send(Sample::default(), false);
            if sync != 50 {
                answer(&mut slots, 0, f64::from(sync));
            }
            slots.watch_lag();
            while let Some((sample, _)) = slots.take() {
                out.push(sample);
            }
        }
        let wrong =
            out.iter().filter(|s| !s.missing && (s.encoder_m[0] - s.sync as f64).abs() > 0.5);
        // From the loss until the lag window has passed, answers are one cycle off; then all is well.
        assert!(wrong.count() <= LAG_WINDOW as usize);
        let end = out.last().unwrap();
        assert!((end.encoder_m[0] - end.sync as f64).abs() < 0.5 && !end.missing);
        assert!(out.iter().filter(|sample| sample.missing).count() >= 1);
    }

    #[test]
    fn silence_is_seen_and_old_cycles_are_given_out() {
        let mut slots = Slots::new(1);
        for _ in 0..60 {
            slots.send(Sample { encoder_m: [7.0; MAX_AXES], ..Default::default() }, false);
        }
        assert_eq!(slots.lag(0), 60);
        let (sample, _) = slots.take().unwrap();
        assert!(sample.missing && (sample.encoder_m[0] - 7.0).abs() < 1e-15);
    }
}
