//! Homing of one drive, cycle by cycle: statusword in, controlword out. For `homing` only.

use crate::fieldbus::cia402::{Controlword, State, Statusword, next_command};

/// Bit 4 of the controlword in homing mode: home is searched while it is set.
const GO: u16 = 1 << 4;
/// Cycles after the start whose words may be older than it.
const GRACE: u32 = 3;

/// Longest times of a homing, in cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Patience {
    /// Without an answer.
    pub(super) silent: u32,
    /// Without an answer of a drive that is being stopped: it is lost.
    pub(super) lost: u32,
    /// From power off to operation enabled.
    pub(super) enabling: u32,
    /// From the start to a sign that the drive is at it.
    pub(super) starting: u32,
    /// Whole homing.
    pub(super) search: u32,
    /// At about the same position: it is at rest.
    pub(super) rest: u32,
    /// Largest way in that time, in counts.
    pub(super) rest_counts: u32,
    /// From a quick stop to power off.
    pub(super) stopping: u32,
}

/// Reason that home was not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Failure {
    /// The drive reports a homing error.
    Error(Statusword),
    /// It was not found in time.
    TimedOut,
    /// The drive does not begin.
    NotStarted,
    /// The drive is in fault.
    Fault,
    /// The drive cannot be switched on, or lost its power.
    NoPower(Statusword),
    /// No answers.
    Silent,
    /// The drive stays on.
    StaysOn(Statusword),
    /// Broken off.
    BrokenOff,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Enabling,
    Ready,
    Starting,
    Searching,
    /// Home was found, and the axis comes to rest.
    Resting,
    /// Power goes off.
    Leaving,
    /// Quick stop, then power off.
    Stopping,
    Off,
}

/// Homing of a drive.
#[derive(Clone, Debug)]
pub(super) struct Seeker {
    phase: Phase,
    controlword: u16,
    /// Cycles in this phase, and in the search as a whole.
    cycles: u32,
    searched: u32,
    silent: u32,
    /// The drive has shown that it is at it, or had no home before.
    is_under_way: bool,
    /// Bit 4 was lowered and raised once more.
    is_asked_again: bool,
    /// The method moves the axis.
    moves: bool,
    /// Last position.
    counts: Option<i32>,
    /// A position, and the cycles since the axis was farther from it than at rest.
    anchor: Option<i32>,
    still: u32,
    failure: Option<Failure>,
    patience: Patience,
}

impl Seeker {
    pub(super) fn new(moves: bool, patience: Patience) -> Self {
        Self {
            phase: Phase::Enabling,
            controlword: Controlword::DISABLE_VOLTAGE.0,
            cycles: 0,
            searched: 0,
            silent: 0,
            is_under_way: false,
            is_asked_again: false,
            moves,
            counts: None,
            anchor: None,
            still: 0,
            failure: None,
            patience,
        }
    }

    /// Returns the command of the next cycle.
    pub(super) fn command(&self) -> Controlword {
        Controlword(self.controlword)
    }

    /// Returns whether the drive is off, or given up.
    pub(super) fn is_over(&self) -> bool {
        self.phase == Phase::Off
    }

    /// Returns the reason that home was not found.
    pub(super) fn failure(&self) -> Option<Failure> {
        self.failure
    }

    /// Returns the last position, in counts.
    pub(super) fn counts(&self) -> Option<i32> {
        self.counts
    }

    /// Brings the axis to rest and switches it off, as home is not to be found any more.
    pub(super) fn break_off(&mut self) {
        if !matches!(self.phase, Phase::Resting | Phase::Stopping | Phase::Leaving | Phase::Off) {
            self.fail(Failure::BrokenOff);
        }
    }

    fn fail(&mut self, failure: Failure) {
        self.failure = self.failure.or(Some(failure));
        self.enter(Phase::Stopping, Controlword::QUICK_STOP);
        self.still = 0;
    }

    fn enter(&mut self, phase: Phase, command: Controlword) {
        self.phase = phase;
        self.controlword = command.0;
        self.cycles = 0;
    }

    /// Takes the answer of a cycle, if there is one.
    pub(super) fn step(&mut self, answer: Option<(Statusword, Option<i32>)>) {
        self.cycles = self.cycles.saturating_add(1);
        let Some((word, counts)) = answer else {
            self.silent += 1;
            match self.phase {
                Phase::Off => {}
                Phase::Stopping | Phase::Leaving if self.silent > self.patience.lost => {
                    self.failure = self.failure.or(Some(Failure::Silent));
                    self.phase = Phase::Off;
                }
                Phase::Stopping | Phase::Leaving => self.give_up(Failure::Silent),
                _ if self.silent > self.patience.silent => self.fail(Failure::Silent),
                _ => {}
            }
            return;
        };
        self.silent = 0;
        self.watch(counts);
        match self.phase {
            Phase::Enabling => self.enable(word),
            Phase::Ready => {
                // If the drive has no home yet, this search finds it, even if no answer shows it under way.
                self.is_under_way = !word.has(Statusword::HOMING_ATTAINED);
                self.enter(Phase::Starting, Controlword(Controlword::ENABLE_OPERATION.0 | GO));
            }
            Phase::Starting | Phase::Searching => self.search(word),
            Phase::Resting => match word.state() {
                Some(State::Fault | State::FaultReactionActive) => self.fail(Failure::Fault),
                Some(State::OperationEnabled) if !self.is_at_rest() => {}
                _ => self.enter(Phase::Leaving, Controlword::SHUTDOWN),
            },
            Phase::Leaving => {
                self.controlword = Controlword::DISABLE_VOLTAGE.0;
                self.switch_off(word);
            }
            Phase::Stopping => {
                if self.is_at_rest() {
                    self.controlword = Controlword::DISABLE_VOLTAGE.0;
                }
                self.switch_off(word);
            }
            Phase::Off => {}
        }
    }

    fn watch(&mut self, counts: Option<i32>) {
        let Some(counts) = counts else { return };
        let is_near = |anchor: i32| anchor.abs_diff(counts) <= self.patience.rest_counts;
        if self.anchor.is_some_and(is_near) {
            self.still = self.still.saturating_add(1);
        } else {
            (self.anchor, self.still) = (Some(counts), 0);
        }
        self.counts = Some(counts);
    }

    /// Returns whether the axis is at rest, or has had the time to come to it.
    fn is_at_rest(&self) -> bool {
        self.still >= self.patience.rest || self.cycles > self.patience.stopping / 2
    }

    fn enable(&mut self, word: Statusword) {
        match word.state() {
            Some(State::Fault | State::FaultReactionActive) => self.fail(Failure::Fault),
            Some(State::OperationEnabled) => {
                self.enter(Phase::Ready, Controlword::ENABLE_OPERATION);
            }
            _ if self.cycles > self.patience.enabling => self.fail(Failure::NoPower(word)),
            state => self.controlword = state.map_or(Controlword::DISABLE_VOLTAGE, next_command).0,
        }
    }

    fn search(&mut self, word: Statusword) {
        self.searched = self.searched.saturating_add(1);
        let is_attained = word.has(Statusword::HOMING_ATTAINED);
        let has_failed = word.has(Statusword::HOMING_ERROR);
        self.is_under_way |= !is_attained && !has_failed;
        match word.state() {
            Some(State::OperationEnabled) => {}
            Some(State::Fault | State::FaultReactionActive) => return self.fail(Failure::Fault),
            _ => return self.fail(Failure::NoPower(word)),
        }
        if self.searched > self.patience.search {
            return self.fail(Failure::TimedOut);
        }
        let is_there = is_attained && word.has(Statusword::TARGET_REACHED);
        if self.phase == Phase::Searching {
            if has_failed {
                self.fail(Failure::Error(word));
            } else if is_there {
                self.rest();
            }
            return;
        }
        if self.cycles <= GRACE {
            return;
        }
        if self.is_under_way || has_failed {
            self.phase = Phase::Searching;
        } else if self.cycles > self.patience.starting {
            // A drive may set its position so quickly that it never shows it; and a search that began at its index
            // may end between two words, where answers come late.
            if !self.moves && is_there {
                self.rest();
            } else if !self.is_asked_again {
                self.is_asked_again = true;
                self.enter(Phase::Ready, Controlword::ENABLE_OPERATION);
            } else {
                self.fail(Failure::NotStarted);
            }
        }
    }

    /// Waits for the rest, with the command that found the home.
    fn rest(&mut self) {
        self.enter(Phase::Resting, Controlword(self.controlword));
        self.still = 0;
    }

    fn switch_off(&mut self, word: Statusword) {
        let is_off = matches!(
            word.state(),
            Some(
                State::NotReadyToSwitchOn
                    | State::SwitchOnDisabled
                    | State::ReadyToSwitchOn
                    | State::Fault
            )
        );
        // Ready to switch on is left as well: power off is the last command.
        if is_off && self.controlword == Controlword::DISABLE_VOLTAGE.0 {
            self.phase = Phase::Off;
        } else if is_off {
            self.controlword = Controlword::DISABLE_VOLTAGE.0;
        } else {
            self.give_up(Failure::StaysOn(word));
        }
    }

    /// Ends after the time of a stop.
    fn give_up(&mut self, failure: Failure) {
        if self.cycles > self.patience.stopping {
            self.failure = self.failure.or(Some(failure));
            self.phase = Phase::Off;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Patience = Patience {
        silent: 2,
        lost: 20,
        enabling: 5,
        starting: 10,
        search: 50,
        rest: 2,
        rest_counts: 0,
        stopping: 20,
    };
    const ENABLED: u16 = 0x0237;
    const OFF: u16 = 0x0250;

    fn say(seeker: &mut Seeker, word: u16) -> u16 {
        seeker.step(Some((Statusword(word), Some(7))));
        seeker.command().0
    }

    /// A drive that is switched on, and told to search.
    fn started(moves: bool) -> Seeker {
        started_from(ENABLED | 0x1400, moves)
    }

    fn started_from(ready: u16, moves: bool) -> Seeker {
        let mut seeker = Seeker::new(moves, PATIENCE);
        assert_eq!(say(&mut seeker, OFF), 0x06);
        assert_eq!(say(&mut seeker, 0x0231), 0x07);
        assert_eq!(say(&mut seeker, 0x0233), 0x0F);
        assert_eq!(say(&mut seeker, ready), 0x0F, "bit 4 has to rise");
        assert_eq!(say(&mut seeker, ready), 0x1F);
        seeker
    }

    #[test]
    fn home_of_an_earlier_homing_is_not_taken_for_this_one() {
        let mut seeker = started(true);
        for _ in 0..5 {
            assert_eq!(say(&mut seeker, ENABLED | 0x1400), 0x1F);
        }
        say(&mut seeker, ENABLED);
        assert_eq!(say(&mut seeker, ENABLED | 0x1000), 0x1F, "found, but not at rest");
        assert_eq!(say(&mut seeker, ENABLED | 0x1400), 0x1F, "told to be at rest");
        seeker.step(Some((Statusword(ENABLED | 0x1400), Some(9))));
        assert_eq!(seeker.command().0, 0x1F, "still moving");
        seeker.step(Some((Statusword(ENABLED | 0x1400), Some(9))));
        seeker.step(Some((Statusword(ENABLED | 0x1400), Some(9))));
        assert_eq!(seeker.command().0, 0x06);
        assert_eq!(say(&mut seeker, 0x0231), 0x00);
        say(&mut seeker, OFF);
        assert!(seeker.is_over());
        assert_eq!(seeker.failure(), None);
    }

    #[test]
    fn a_drive_that_never_begins_is_asked_once_more_unless_nothing_moves() {
        for (moves, failure) in [(true, Some(Failure::NotStarted)), (false, None)] {
            let mut seeker = started(moves);
            while say(&mut seeker, ENABLED | 0x1400) == 0x1F {}
            if moves {
                assert_eq!(
                    (seeker.command().0, seeker.failure()),
                    (0x0F, None),
                    "bit 4 has to rise"
                );
                assert_eq!(say(&mut seeker, ENABLED | 0x1400), 0x1F);
                while say(&mut seeker, ENABLED | 0x1400) == 0x1F {}
            }
            assert_eq!(seeker.failure(), failure);
        }
    }

    #[test]
    fn a_first_home_counts_though_its_search_ended_between_two_words() {
        let mut seeker = started_from(ENABLED, true);
        while say(&mut seeker, ENABLED | 0x1400) == 0x1F {}
        assert_eq!((seeker.command().0, seeker.failure()), (0x06, None));
    }

    #[test]
    fn an_error_a_fault_and_silence_stop_quickly() {
        let mut seeker = started(true);
        for _ in 0..4 {
            say(&mut seeker, ENABLED);
        }
        assert_eq!(say(&mut seeker, ENABLED | 0x2000), 0x02);
        assert!(matches!(seeker.failure(), Some(Failure::Error(_))));
        // Voltage goes off at rest only.
        seeker.step(Some((Statusword(0x0217), Some(8))));
        assert_eq!(seeker.command().0, 0x02);
        seeker.step(Some((Statusword(0x0217), Some(8))));
        seeker.step(Some((Statusword(0x0217), Some(8))));
        assert_eq!(seeker.command().0, 0x00);
        let mut seeker = started(true);
        say(&mut seeker, 0x0218);
        assert_eq!(seeker.failure(), Some(Failure::Fault));
        let mut seeker = started(true);
        for _ in 0..100 {
            seeker.step(None);
        }
        assert!(seeker.is_over());
        assert_eq!(seeker.failure(), Some(Failure::Silent));
    }
}
