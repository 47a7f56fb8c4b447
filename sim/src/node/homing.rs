//! Homing: the search for a switch, its edge and an index pulse, method by method.

use super::switches::Seen;

/// The methods of 0x6098 that are simulated; 0 takes the position as it is.
pub(super) const METHODS: [i64; 9] = [0, 1, 2, 17, 18, 33, 34, 35, 37];

/// A direction of the drive, and the limit switch at its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Down,
    Up,
}

impl Way {
    fn back(self) -> Self {
        match self {
            Self::Down => Self::Up,
            Self::Up => Self::Down,
        }
    }

    fn sign(self) -> f64 {
        match self {
            Self::Down => -1.0,
            Self::Up => 1.0,
        }
    }

    fn is_at_end(self, seen: &Seen) -> bool {
        match self {
            Self::Down => seen.is_at_min,
            Self::Up => seen.is_at_max,
        }
    }
}

/// Phase of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Not started since the mode was entered.
    Idle,
    /// Broken off by halt, by the end of bit 4 or of operation.
    Interrupted,
    ToSwitch {
        way: Way,
        then_index: bool,
    },
    OffSwitch {
        way: Way,
        then_index: bool,
    },
    ToIndex {
        way: Way,
    },
    /// Found, and slowing down.
    Settling {
        home_m: Option<f64>,
    },
    Done,
    Failed,
}

/// Order of a homing to the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Order {
    /// Nothing.
    None,
    /// Move in a direction of the drive until told otherwise, quickly or at the speed for edges.
    Move { sign: f64, is_quick: bool },
    /// Come to rest.
    Rest,
    /// It is over; the place becomes home, unless the position stays as it is.
    Done { home_m: Option<f64> },
}

/// The homing of a drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homing {
    phase: Phase,
}

impl Default for Homing {
    fn default() -> Self {
        Self { phase: Phase::Idle }
    }
}

impl Homing {
    /// Starts a method.
    pub(super) fn start(&mut self, method: i64, seen: &Seen) {
        let search = |way, then_index| Phase::ToSwitch { way, then_index };
        self.phase = match method {
            0 => Phase::Settling { home_m: None },
            1 => search(Way::Down, true),
            2 => search(Way::Up, true),
            17 => search(Way::Down, false),
            18 => search(Way::Up, false),
            33 => Phase::ToIndex { way: Way::Down },
            34 => Phase::ToIndex { way: Way::Up },
            35 | 37 => Phase::Settling { home_m: Some(seen.position_m) },
            _ => Phase::Failed,
        };
    }

    /// Breaks off what is under way.
    pub(super) fn interrupt(&mut self) {
        if self.is_under_way() {
            self.phase = Phase::Interrupted;
        }
    }

    /// Returns whether the axis is being homed.
    pub(super) fn is_under_way(&self) -> bool {
        !matches!(self.phase, Phase::Idle | Phase::Interrupted | Phase::Done | Phase::Failed)
    }

    /// Returns whether home was found since the mode was entered.
    pub(super) fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// Returns whether home could not be found.
    pub(super) fn has_failed(&self) -> bool {
        self.phase == Phase::Failed
    }

    /// Looks at switches and pulses once more and returns the order for the next step.
    pub(super) fn step(&mut self, seen: &Seen, is_at_rest: bool) -> Order {
        match self.phase {
            Phase::Idle | Phase::Done => return Order::None,
            Phase::ToSwitch { way, then_index } if way.is_at_end(seen) => {
                self.phase = Phase::OffSwitch { way: way.back(), then_index };
            }
            Phase::OffSwitch { way, then_index } if !way.back().is_at_end(seen) => {
                self.phase = if then_index {
                    Phase::ToIndex { way }
                } else {
                    Phase::Settling { home_m: Some(seen.position_m) }
                };
            }
            Phase::ToIndex { way } => {
                if let Some(home_m) = seen.index_m {
                    self.phase = Phase::Settling { home_m: Some(home_m) };
                } else if way.is_at_end(seen) {
                    self.phase = Phase::Failed;
                }
            }
            Phase::Settling { home_m } if is_at_rest => {
                self.phase = Phase::Done;
                return Order::Done { home_m };
            }
            Phase::ToSwitch { .. }
            | Phase::OffSwitch { .. }
            | Phase::Settling { .. }
            | Phase::Interrupted
            | Phase::Failed => {}
        }
        match self.phase {
            Phase::ToSwitch { way, .. } => Order::Move { sign: way.sign(), is_quick: true },
            Phase::OffSwitch { way, .. } | Phase::ToIndex { way } => {
                Order::Move { sign: way.sign(), is_quick: false }
            }
            _ => Order::Rest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Seen = Seen { position_m: 0.0, is_at_min: false, is_at_max: false, index_m: None };

    #[test]
    fn an_index_that_lies_beyond_the_switch_is_a_failure() {
        let mut homing = Homing::default();
        homing.start(33, &FREE);
        let down = Order::Move { sign: -1.0, is_quick: false };
        assert_eq!(homing.step(&FREE, false), down);
        assert_eq!(homing.step(&Seen { is_at_min: true, ..FREE }, false), Order::Rest);
        assert!(homing.has_failed());
    }

    #[test]
    fn an_axis_on_its_switch_leaves_it_first() {
        let mut homing = Homing::default();
        homing.start(1, &FREE);
        let on = Seen { is_at_min: true, ..FREE };
        let creep = Order::Move { sign: 1.0, is_quick: false };
        assert_eq!(homing.step(&on, true), creep);
        // A pulse under the switch does not count.
        assert_eq!(homing.step(&Seen { index_m: Some(-0.1), ..on }, false), creep);
        assert_eq!(homing.step(&FREE, false), creep);
        let pulse = Seen { index_m: Some(0.02), ..FREE };
        assert_eq!(homing.step(&pulse, false), Order::Rest);
        assert_eq!(homing.step(&FREE, true), Order::Done { home_m: Some(0.02) });
        assert!(homing.is_done());
    }
}
