//! The switches and the index pulses of an axis, simulated from its position.

use ilc_rt::config::Axis;

/// Distance of a limit switch from the limit, as a share of the travel.
const BEYOND_LIMITS: f64 = 0.05;

/// Places of the switches of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switches {
    /// The limit switch at the lower end of the axis is closed from here downwards.
    pub min_m: f64,
    /// The limit switch at the upper end of the axis is closed from here upwards.
    pub max_m: f64,
    /// The home switch is closed from here upwards.
    pub home_m: Option<f64>,
    /// Distance of the encoder's index pulses.
    pub index_pitch_m: f64,
    /// The drive counts against the axis: its negative limit switch is the one at the upper end.
    pub is_reversed: bool,
}

/// Bit of 0x60FD: the negative limit switch.
const AT_MIN: i64 = 1 << 0;
/// Bit of 0x60FD: the positive limit switch.
const AT_MAX: i64 = 1 << 1;
/// Bit of 0x60FD: the home switch.
const AT_HOME: i64 = 1 << 2;

/// State of the switches and of the encoder in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Position of the encoder.
    pub(super) position_m: f64,
    /// The drive's negative limit switch is closed.
    pub(super) is_at_min: bool,
    /// The drive's positive limit switch is closed.
    pub(super) is_at_max: bool,
    /// Place of the index pulse that was passed since the last step.
    pub(super) index_m: Option<f64>,
}

impl Switches {
    /// Returns the switches of an axis, by default beyond its limits.
    pub fn of(axis: &Axis) -> Self {
        let limits = &axis.limits;
        let simulation = &axis.simulation;
        let beyond_m = BEYOND_LIMITS * (limits.position_max_m - limits.position_min_m);
        Self {
            min_m: simulation.switch_min_m.unwrap_or(limits.position_min_m - beyond_m),
            max_m: simulation.switch_max_m.unwrap_or(limits.position_max_m + beyond_m),
            home_m: simulation.switch_home_m,
            index_pitch_m: simulation.index_pitch_m,
            is_reversed: axis.reversed,
        }
    }

    /// Returns whether the drive's negative and positive limit switches are closed.
    fn ends(&self, position_m: f64) -> [bool; 2] {
        let [low, high] = [position_m <= self.min_m, position_m >= self.max_m];
        if self.is_reversed { [high, low] } else { [low, high] }
    }

    /// Returns 1, or -1 if the drive's positive direction is the axis' negative one.
    pub(super) fn sign(&self) -> f64 {
        if self.is_reversed { -1.0 } else { 1.0 }
    }

    /// Returns what is seen at a position, after another one.
    pub(super) fn see(&self, before_m: f64, position_m: f64) -> Seen {
        let turn = |place_m: f64| (place_m / self.index_pitch_m).floor();
        let (from, to) = (turn(before_m), turn(position_m));
        let [is_at_min, is_at_max] = self.ends(position_m);
        Seen {
            position_m,
            is_at_min,
            is_at_max,
            index_m: (from < to || to < from).then(|| from.max(to) * self.index_pitch_m),
        }
    }

    /// Returns the bits of 0x60FD that the position sets.
    pub(super) fn bits(&self, position_m: f64) -> i64 {
        let bit = |is_closed, bit| if is_closed { bit } else { 0 };
        let [is_at_min, is_at_max] = self.ends(position_m);
        bit(is_at_min, AT_MIN)
            | bit(is_at_max, AT_MAX)
            | bit(self.home_m.is_some_and(|home_m| position_m >= home_m), AT_HOME)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SWITCHES: Switches = Switches {
        min_m: -0.02,
        max_m: 0.1,
        home_m: Some(0.05),
        index_pitch_m: 0.01,
        is_reversed: false,
    };

    #[test]
    fn pulses_are_seen_from_both_sides_at_the_same_place() {
        assert_eq!(SWITCHES.see(0.019, 0.021).index_m, Some(0.02));
        assert_eq!(SWITCHES.see(0.021, 0.019).index_m, Some(0.02));
        assert_eq!(SWITCHES.see(0.021, 0.022).index_m, None);
        assert_eq!(SWITCHES.see(-0.001, 0.001).index_m, Some(0.0));
    }

    #[test]
    fn switches_have_their_bits() {
        let bits = [-0.02, 0.0, 0.05, 0.1].map(|position_m| SWITCHES.bits(position_m));
        assert_eq!(bits, [0b001, 0b000, 0b100, 0b110]);
        // The drive's positive end is where the axis begins.
        let reversed = Switches { is_reversed: true, ..SWITCHES };
        let bits = [-0.02, 0.0, 0.05, 0.1].map(|position_m| reversed.bits(position_m));
        assert_eq!(bits, [0b010, 0b000, 0b100, 0b101]);
    }
}
