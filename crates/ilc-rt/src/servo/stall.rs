//! Stalls of the computer: lateness of the loop itself, and pauses for stalled nodes.
//!
//! Simulated drives share the computer with the loop, and their time advances by SYNC. If they stop
//! answering they are stalled like everything else, so the loop may pause: it sends nothing, no set
//! point is skipped, and the motion pauses in the plant as in the loop. A real drive keeps moving;
//! there [`ServoSpec::hold_cycles_max`](super::ServoSpec::hold_cycles_max) is 0.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// Unanswered cycles after which the loop pauses: more than an answer is ever late.
pub(super) const HOLD_AFTER: u64 = 5;
/// Cycles for which a stall is remembered as the cause of a drive's report.
const BLAMED_FOR: u32 = 25;

/// Stalls of the loop itself.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stall {
    /// Consecutive cycles missed so far.
    streak: u32,
    /// The last streak, and the cycles since it ended.
    last: u32,
    since: u32,
    held: u32,
}

impl Stall {
    /// Records the cycles missed before a tick.
    pub(super) fn note(&mut self, missed: u32) {
        if missed > 0 {
            self.streak = self.streak.saturating_add(missed);
            (self.last, self.since) = (self.streak, 0);
        } else {
            self.streak = 0;
            self.since = self.since.saturating_add(1);
        }
    }

    /// Consecutive cycles missed so far.
    pub(super) fn streak(&self) -> u32 {
        self.streak
    }

    /// Returns the cycles of the stall that explains a drive's report of missing commands, if there
    /// was one.
    pub(super) fn blamed(&self) -> Option<u32> {
        (self.last > 1 && self.since <= BLAMED_FOR).then_some(self.last)
    }

    /// Returns true to hold still in this tick, while nodes do not answer and the stall is
    /// tolerated.
    pub(super) fn holds(&mut self, nodes_wait: bool, max: u32) -> bool {
        if !nodes_wait {
            self.held = 0;
            return false;
        }
        if self.held >= max {
            return false;
        }
        self.held += 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_is_blamed_for_what_follows_at_once_and_no_longer() {
        let mut stall = Stall::default();
        stall.note(0);
        assert_eq!(stall.blamed(), None);
        stall.note(30);
        stall.note(4);
        assert_eq!((stall.streak(), stall.blamed()), (34, Some(34)));
        stall.note(0);
        assert_eq!((stall.streak(), stall.blamed()), (0, Some(34)));
        for _ in 0..BLAMED_FOR {
            stall.note(0);
        }
        assert_eq!(stall.blamed(), None);
    }

    #[test]
    fn holding_ends_with_the_answers_or_with_patience() {
        let mut stall = Stall::default();
        assert!(!stall.holds(true, 0), "real drives are never waited for");
        assert!(stall.holds(true, 2) && stall.holds(true, 2));
        assert!(!stall.holds(true, 2), "patience is over until they answer");
        assert!(!stall.holds(false, 2));
        assert!(stall.holds(true, 2));
    }
}
