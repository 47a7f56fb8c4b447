//! `[[input]]`: a digital input of a drive, and its part in the running of the cell.
//!
//! `design` turns them into what the loop watches; `campaign` names them in its sentences.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axis::Axis;
use crate::schema::field_order;

pub use crate::servo::INPUTS_MAX;

/// Bit of object 0x60FD of the negative limit switch of a drive.
const NEGATIVE_LIMIT_SWITCH: u8 = 0;
/// Bit of object 0x60FD of the positive limit switch of a drive.
const POSITIVE_LIMIT_SWITCH: u8 = 1;

/// Level at which an input is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// The bit is 1.
    #[default]
    High,
    /// The bit is 0: a contact that opens, so that a broken wire is noticed.
    Low,
}

/// Part of an input in the running of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InputUse {
    /// A guard, on while it is closed: an open one stops all axes, or refuses the start.
    Guard,
    /// A button: a press starts the run that waits, with `--start input`.
    Start,
    /// A button, on while it is pressed: all axes come to rest and the program ends.
    Stop,
    /// A limit switch of the axis, on while it is reached: motion towards it stops.
    Limit,
}

impl InputUse {
    /// Returns its name in a cell description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Guard => "guard",
            Self::Start => "start",
            Self::Stop => "stop",
            Self::Limit => "limit",
        }
    }
}

/// Direction of motion of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Towards lower positions.
    Negative,
    /// Towards higher positions.
    Positive,
}

impl Direction {
    /// Returns -1 or 1.
    pub const fn sign(self) -> f64 {
        match self {
            Self::Negative => -1.0,
            Self::Positive => 1.0,
        }
    }

    /// Returns its name in a cell description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Negative => "negative",
            Self::Positive => "positive",
        }
    }
}

/// `[[input]]`: a digital input of a drive (object 0x60FD), which the drive then sends in every cycle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Input {
    /// Name, such as `"front door"`: 1 to 64 characters without control characters, no leading or trailing
    /// spaces; unique.
    pub name: String,
    /// Axis whose drive the input is wired to.
    pub axis: String,
    /// Bit of object 0x60FD: 0 negative limit switch, 1 positive limit switch, 2 home switch, 3 interlock,
    /// 16 to 31 those of the manufacturer.
    #[schemars(range(min = 0, max = 31))]
    pub bit: u8,
    /// Level at which it is on: `high` or `low`. On means a closed guard, a pressed button, a limit switch that
    /// is reached.
    #[serde(default)]
    pub active: Level,
    /// `guard`: an open guard stops all axes, or refuses the start. `start`: a press starts the run that waits,
    /// with `--start input`. `stop`: a press brings all axes to rest and ends the program. `limit`: motion of the
    /// axis towards the switch stops, motion away from it is allowed.
    #[serde(rename = "use")]
    pub purpose: InputUse,
    /// Direction of the axis that a limit switch ends: `negative` or `positive`. By default that of bits 0 and 1,
    /// which on a `reversed` axis is the other one; only for `use = "limit"`.
    pub direction: Option<Direction>,
    /// Cycles in a row after which a closed guard, and a start button that is released or pressed, is taken for
    /// steady. Open guards, stop buttons and limit switches count at once.
    #[serde(default = "default_debounce_cycles")]
    #[schemars(range(min = 1, max = 1000))]
    pub debounce_cycles: u32,
}

fn default_debounce_cycles() -> u32 {
    5
}

impl Input {
    /// Returns the direction that a limit switch ends, in the coordinates of its axis; `None` if neither key nor
    /// bit tells.
    pub fn direction_of(&self, axis: &Axis) -> Option<Direction> {
        self.direction.or(match (self.bit, axis.reversed) {
            (NEGATIVE_LIMIT_SWITCH, false) | (POSITIVE_LIMIT_SWITCH, true) => {
                Some(Direction::Negative)
            }
            (NEGATIVE_LIMIT_SWITCH, true) | (POSITIVE_LIMIT_SWITCH, false) => {
                Some(Direction::Positive)
            }
            _ => None,
        })
    }

    /// Returns true if it is on in a value of object 0x60FD.
    pub fn is_on(&self, word: u32) -> bool {
        (word >> self.bit & 1 == 1) == (self.active == Level::High)
    }
}
