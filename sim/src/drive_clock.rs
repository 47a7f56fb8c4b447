//! The drives' clock in real time: locked to SYNC like a real drive's, free without it.
//!
//! A real drive samples in hardware and locks its control loop to SYNC; a SYNC that is handled a little
//! late by a busy computer does not move the moment of sampling. So, while SYNCs come, each one stands
//! for exactly one cycle, whenever it is handled. A computer that stalls stalls controller and plant
//! alike: a few cycles left out by the controller are left out by the plant too, and it is the
//! controller that counts them. Without SYNC the wall clock rules, and the drives miss their commands.

use std::time::Duration;

/// Cycles without SYNC after which the clock runs by itself.
const LOST_AFTER: u32 = 15;

/// The clock; it is told the wall time and gives steps to take.
#[derive(Debug)]
pub(crate) struct DriveClock {
    cycle: Duration,
    step: Duration,
    /// Wall time up to which steps have been given.
    reached: Duration,
    last_sync: Option<Duration>,
}

impl DriveClock {
    /// `step` must divide `cycle`.
    pub(crate) fn new(cycle: Duration, step: Duration) -> Self {
        Self { cycle, step, reached: Duration::ZERO, last_sync: None }
    }

    /// Steps to take before the nodes sample for a SYNC handled at `now`.
    pub(crate) fn at_sync(&mut self, now: Duration) -> u32 {
        if self.last_sync.replace(now).is_none() {
            return self.catch_up(now);
        }
        self.reached = now;
        whole(self.cycle, self.step)
    }

    /// Steps to take at `now` when no SYNC has come: none while locked.
    pub(crate) fn idle(&mut self, now: Duration) -> u32 {
        if let Some(last) = self.last_sync {
            if now.saturating_sub(last) < self.cycle * LOST_AFTER {
                return 0;
            }
            self.last_sync = None;
        }
        self.catch_up(now)
    }

    fn catch_up(&mut self, now: Duration) -> u32 {
        let n_steps = whole(now.saturating_sub(self.reached), self.step);
        self.reached += self.step * n_steps;
        n_steps
    }
}

/// How many times `part` fits into `span`.
fn whole(span: Duration, part: Duration) -> u32 {
    u32::try_from(span.as_nanos() / part.as_nanos().max(1)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: Duration = Duration::from_millis(2);
    const STEP: Duration = Duration::from_micros(250);
    const STEPS: u32 = 8;

    /// A clock that has seen a SYNC at every cycle up to and including number `n`.
    fn locked(n: u32) -> DriveClock {
        let mut clock = DriveClock::new(CYCLE, STEP);
        clock.at_sync(Duration::ZERO);
        for k in 1..=n {
            assert_eq!(clock.at_sync(CYCLE * k), STEPS);
        }
        clock
    }

    #[test]
    fn without_sync_the_wall_clock_rules() {
        let mut clock = DriveClock::new(CYCLE, STEP);
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
        let mut clock = locked(10);
        assert_eq!(clock.idle(CYCLE * 13), 0);
        assert_eq!(clock.at_sync(CYCLE * 14), STEPS);
    }

    #[test]
    fn when_sync_stays_away_time_goes_on() {
        let mut clock = locked(10);
        let lost = 10 + LOST_AFTER;
        assert_eq!(clock.idle(CYCLE * (lost - 1)), 0);
        assert_eq!(clock.idle(CYCLE * (lost + 1)), (LOST_AFTER + 1) * STEPS);
        assert_eq!(clock.idle(CYCLE * (lost + 2)), STEPS);
        assert_eq!(clock.at_sync(CYCLE * (lost + 3)), STEPS);
    }
}
