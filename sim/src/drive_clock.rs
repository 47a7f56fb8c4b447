//! The drives' clock in real time: locked to SYNC like a real drive's, free-running without it.
//!
//! A real drive samples in hardware and locks its control loop to SYNC; a SYNC handled slightly
//! late by a busy computer does not shift its sampling. So, while SYNCs arrive, each one stands for
//! exactly one cycle, whenever it is handled. A stall of the computer stalls controller and plant
//! alike: cycles skipped by the controller are skipped by the plant too, and the controller counts
//! them.
//!
//! Controller and drives share a computer, and if one of them is stalled, the other must not count
//! it as lost. The silence between two SYNCs is therefore the time for which this process *watched*
//! a silent bus: a gap in which it did not run counts as one check. Once the drives have been in
//! lock for a while, a long silence first pauses the plant's time; then the clock runs freely with
//! the wall clock, from that moment on, and the drives miss their commands. Paused time is not
//! caught up.

use std::time::Duration;

/// Cycles without SYNC after which the clock runs freely, unless it has been in lock.
const LOOSE_CYCLES: u32 = 15;
/// Consecutive SYNCs, each within [`LOOSE_CYCLES`] of the previous one, after which the clock is in
/// lock.
const IN_STEP: u32 = 10;
/// Largest time that counts between two checks of the bus; a longer gap is a stall of this process.
const LOOK_MAX: Duration = Duration::from_millis(10);

/// The clock; it is given the wall time and returns steps to take.
#[derive(Debug)]
pub(crate) struct DriveClock {
    cycle: Duration,
    step: Duration,
    patience: Duration,
    looked: Duration,
    /// Elapsed time not yet returned as steps, while free-running.
    owed: Duration,
    /// Time of silence watched since the last SYNC; `None` while free-running.
    silence: Option<Duration>,
    n_in_step: u32,
}

impl DriveClock {
    /// Creates the clock. `step` must divide `cycle`; `patience` is the silence that ends a lock.
    pub(crate) fn new(cycle: Duration, step: Duration, patience: Duration) -> Self {
        Self {
            cycle,
            step,
            patience,
            looked: Duration::ZERO,
            owed: Duration::ZERO,
            silence: None,
            n_in_step: 0,
        }
    }

    /// Returns the steps to take before the nodes sample for a SYNC handled at `now`.
    pub(crate) fn at_sync(&mut self, now: Duration) -> u32 {
        let passed = self.look(now);
        let Some(silence) = self.silence.replace(Duration::ZERO) else {
            return self.take(passed);
        };
        let is_regular = silence + passed < self.loose();
        self.n_in_step = if is_regular { self.n_in_step.saturating_add(1) } else { 0 };
        self.owed = Duration::ZERO;
        count(self.cycle, self.step)
    }

    /// Returns the steps to take at `now` without a SYNC: none while locked.
    pub(crate) fn idle(&mut self, now: Duration) -> u32 {
        let passed = self.look(now);
        let Some(silence) = self.silence else { return self.take(passed) };
        let silence = silence + passed;
        let max = if self.n_in_step >= IN_STEP { self.patience } else { self.loose() };
        let is_lost = silence >= max;
        self.silence = (!is_lost).then_some(silence);
        if is_lost {
            self.n_in_step = 0;
        }
        0
    }

    fn loose(&self) -> Duration {
        (self.cycle * LOOSE_CYCLES).min(self.patience)
    }

    /// Returns the time since the last check during which this process was awake.
    fn look(&mut self, now: Duration) -> Duration {
        let passed = now.saturating_sub(self.looked).min(LOOK_MAX);
        self.looked = now;
        passed
    }

    fn take(&mut self, passed: Duration) -> u32 {
        self.owed += passed;
        let n_steps = count(self.owed, self.step);
        self.owed -= self.step * n_steps;
        n_steps
    }
}

/// Returns the number of times that `part` fits into `span`.
fn count(span: Duration, part: Duration) -> u32 {
    u32::try_from(span.as_nanos() / part.as_nanos().max(1)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: Duration = Duration::from_millis(2);
    const STEP: Duration = Duration::from_micros(250);
    const STEPS: u32 = 8;
    const PATIENCE: Duration = Duration::from_secs(1);

    fn clock() -> DriveClock {
        DriveClock::new(CYCLE, STEP, PATIENCE)
    }

    /// Returns a clock that has received a SYNC at every cycle up to and including number `n`.
    fn locked(n: u32) -> DriveClock {
        let mut clock = clock();
        clock.at_sync(Duration::ZERO);
        for k in 1..=n {
            assert_eq!(clock.at_sync(CYCLE * k), STEPS);
        }
        clock
    }

    /// Checks once a millisecond for a while, and returns the steps and the time at the end.
    fn watch(clock: &mut DriveClock, from: Duration, span: Duration) -> (u32, Duration) {
        let mut n_steps = 0;
        let mut now = from;
        while now < from + span {
            now += Duration::from_millis(1);
            n_steps += clock.idle(now);
        }
        (n_steps, now)
    }

    #[test]
    fn without_sync_the_wall_clock_rules() {
        let mut clock = clock();
        assert_eq!(clock.idle(Duration::from_micros(600)), 2);
        assert_eq!(clock.idle(Duration::from_micros(700)), 0);
        assert_eq!(clock.idle(Duration::from_millis(1)), 2);
    }

    #[test]
    fn a_sync_handled_late_still_stands_for_one_cycle() {
        let mut clock = locked(10);
        assert_eq!(clock.idle(CYCLE * 13), 0);
        for k in 11..=13_u32 {
            assert_eq!(clock.at_sync(CYCLE * 13 + Duration::from_micros(u64::from(k))), STEPS);
        }
        assert_eq!(clock.at_sync(CYCLE * 14), STEPS);
    }

    #[test]
    fn a_controller_that_stalls_stalls_the_plant() {
        for stall_ms in [20, 38, 100, 300, 900] {
            let mut clock = locked(20);
            let (n_steps, now) = watch(&mut clock, CYCLE * 20, Duration::from_millis(stall_ms));
            assert_eq!((n_steps, clock.at_sync(now + CYCLE)), (0, STEPS), "{stall_ms} ms");
        }
    }

    #[test]
    fn drives_that_stall_themselves_do_not_miss_what_lies_in_the_socket() {
        for stall_ms in [20, 38, 100, 300, 5000] {
            let mut clock = locked(20);
            let woken = CYCLE * 20 + Duration::from_millis(stall_ms);
            // The first frames are commands, followed by the first SYNC of many.
            assert_eq!(clock.idle(woken), 0, "{stall_ms} ms");
            assert_eq!(clock.idle(woken), 0, "{stall_ms} ms");
            assert_eq!(clock.at_sync(woken), STEPS, "{stall_ms} ms");
        }
    }

    #[test]
    fn when_sync_stays_away_for_good_time_goes_on_from_then() {
        let mut clock = locked(20);
        let (n_steps, now) = watch(&mut clock, CYCLE * 20, PATIENCE);
        assert_eq!(n_steps, 0, "what stood still is not made up for");
        let (n_steps, now) = watch(&mut clock, now, Duration::from_millis(40));
        assert_eq!(n_steps, 20 * STEPS);
        assert_eq!(clock.at_sync(now + CYCLE), STEPS);
    }

    #[test]
    fn syncs_sent_by_hand_leave_the_time_between_them_to_the_wall_clock() {
        let mut clock = clock();
        let mut now = Duration::ZERO;
        for _ in 0..5 {
            clock.at_sync(now);
            let (n_steps, later) = watch(&mut clock, now, Duration::from_millis(200));
            assert_eq!(n_steps, 170 * 4, "30 ms of 200 are waited for the next SYNC");
            now = later;
        }
    }

    #[test]
    fn a_stall_without_sync_is_not_run_through_at_once() {
        let mut clock = clock();
        assert_eq!(clock.idle(Duration::from_secs(5)), count(LOOK_MAX, STEP));
    }
}
