//! Digital inputs: their parts, and one input over time, with its bounce. `interlock` acts on them in the loop.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// Largest number of inputs that the loop watches.
pub const INPUTS_MAX: usize = 16;

/// Part of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputRole {
    /// On while the guard is closed.
    Guard,
    /// On while the start button is pressed.
    Start,
    /// On while the stop button is pressed.
    Stop,
    /// On while the limit switch of its axis is reached, in the direction of the sign.
    Limit(f64),
}

/// One input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputSpec {
    /// Axis whose drive sends it.
    pub axis: usize,
    /// Its bits in the digital inputs of the drive.
    pub mask: u32,
    /// True if it is on while the bit is 1.
    pub is_high: bool,
    /// Its part.
    pub role: InputRole,
    /// Cycles in a row after which it is steady.
    pub debounce_cycles: u32,
}

/// The inputs as last read, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InputBits {
    /// Inputs that have been read.
    pub known: u16,
    /// Inputs that are on.
    pub on: u16,
}

/// One input over time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Input {
    /// Level as last read; `None` before.
    pub(super) is_on: Option<bool>,
    /// Cycles in a row with this level.
    cycles: u32,
    /// True once it was off for long enough, until it is on for long enough.
    armed: bool,
}

impl Input {
    /// Takes the level of a cycle, `None` if it is too old; returns true if the input went on and is steady.
    pub(super) fn see(&mut self, level: Option<bool>, debounce_cycles: u32) -> bool {
        let Some(level) = level else {
            // A press during the silence would be a guess.
            (self.cycles, self.armed) = (0, false);
            return false;
        };
        let is_same = self.is_on.replace(level) == Some(level);
        self.cycles = if is_same { self.cycles.saturating_add(1) } else { 1 };
        if self.cycles < debounce_cycles {
            return false;
        }
        let went_on = level && self.armed;
        self.armed = !level;
        went_on
    }

    /// Returns true if it has been on for long enough.
    pub(super) fn is_steadily_on(self, debounce_cycles: u32) -> bool {
        self.is_on == Some(true) && self.cycles >= debounce_cycles
    }
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

    /// Returns the cycles in which an input with these levels went on; `x` is a cycle without an answer.
    fn presses(levels: &str, debounce_cycles: u32) -> Vec<usize> {
        let mut input = Input::default();
        let level = |c| match c {
            '1' => Some(true),
            '0' => Some(false),
            _ => None,
        };
        let seen = levels.chars().map(|c| input.see(level(c), debounce_cycles));
        seen.enumerate().filter_map(|(cycle, went_on)| went_on.then_some(cycle)).collect()
    }

    #[test]
    fn a_press_is_an_edge_that_lasts() {
        assert_eq!(presses("000111000111", 3), [5, 11]);
        assert_eq!(presses("0011", 1), [2]);
        assert_eq!(presses("00011011011", 3), [0; 0], "too short");
    }

    #[test]
    fn a_button_held_down_at_the_start_is_no_press() {
        assert_eq!(presses("1111111", 3), [0; 0]);
        assert_eq!(presses("1111000111", 3), [9]);
    }

    #[test]
    fn bounce_counts_once() {
        assert_eq!(presses("0000101101111101111", 3), [11]);
        assert_eq!(presses("0000111110101011111", 3), [6], "of the release, neither");
    }

    #[test]
    fn silence_is_neither_a_press_nor_the_time_before_one() {
        assert_eq!(presses("000xxx111111", 3), [0; 0]);
        assert_eq!(presses("000xxx111000111", 3), [14]);
        assert_eq!(presses("0001x11", 3), [0; 0]);
    }

    #[test]
    fn a_guard_is_closed_when_it_has_been_for_a_while() {
        let mut input = Input::default();
        let mut closed = Vec::new();
        for level in [true, true, false, true, true, true] {
            input.see(Some(level), 3);
            closed.push(input.is_steadily_on(3));
        }
        assert_eq!(closed, [false, false, false, false, false, true]);
        input.see(None, 3);
        assert!(!input.is_steadily_on(3), "nothing is known any more");
    }
}
