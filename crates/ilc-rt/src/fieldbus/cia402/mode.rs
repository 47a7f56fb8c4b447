//! Modes of operation that the controller commands.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]
#![allow(clippy::disallowed_methods, reason = "what the derived schema calls is cold")]

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::objects;

/// A cyclic synchronous mode of operation: the input of a drive, and the entry point of the learned
/// input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[repr(i8)]
pub enum Mode {
    /// Cyclic synchronous position: the drive closes the position loop (series learning, input in m).
    Csp = 8,
    /// Cyclic synchronous velocity: the position loop is here (parallel learning, input in m/s).
    Csv = 9,
    /// Cyclic synchronous torque: the whole cascade is here (parallel learning, input in N or N m).
    Cst = 10,
}

/// The quantity that a learned input is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum InputKind {
    /// The set point, in m or rad.
    Position,
    /// The velocity command, in m/s or rad/s.
    Velocity,
    /// The torque command, in N or N m.
    Torque,
}

impl InputKind {
    /// Returns the name in a cell description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Torque => "torque",
        }
    }
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 3] = [Self::Csp, Self::Csv, Self::Cst];

    /// Returns the mode's name in a cell description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Csp => "csp",
            Self::Csv => "csv",
            Self::Cst => "cst",
        }
    }

    /// Returns the inputs that a drive in this mode adds a learned one to, the default first.
    pub const fn inputs(self) -> &'static [InputKind] {
        match self {
            Self::Csp => &[InputKind::Position, InputKind::Velocity, InputKind::Torque],
            Self::Csv => &[InputKind::Velocity, InputKind::Torque],
            Self::Cst => &[InputKind::Torque],
        }
    }

    /// Returns the quantity of the target: the first input.
    pub const fn targeted(self) -> InputKind {
        self.inputs()[0]
    }

    /// Returns whether the target is a torque, so that the drive closes no loop.
    pub fn targets_torque(self) -> bool {
        self.targeted() == InputKind::Torque
    }

    /// Returns whether the target is a position, so that the drive closes both loops.
    pub fn targets_position(self) -> bool {
        self.targeted() == InputKind::Position
    }

    /// Returns the objects of a command, of 16, 32 and 16 bits. A drive in torque mode gets its
    /// demanded position as well, which it does not follow.
    pub const fn command_objects(self) -> [u16; 3] {
        match self {
            Self::Csp => [objects::CONTROLWORD, objects::TARGET_POSITION, objects::TORQUE_OFFSET],
            Self::Csv => [objects::CONTROLWORD, objects::TARGET_VELOCITY, objects::TORQUE_OFFSET],
            Self::Cst => [objects::CONTROLWORD, objects::TARGET_POSITION, objects::TARGET_TORQUE],
        }
    }

    /// Returns the object of the target, and its length in bits.
    pub const fn target(self) -> (u16, u8) {
        match self {
            Self::Csp => (objects::TARGET_POSITION, 32),
            Self::Csv => (objects::TARGET_VELOCITY, 32),
            Self::Cst => (objects::TARGET_TORQUE, 16),
        }
    }

    /// Returns the value of objects 0x6060 and 0x6061.
    pub const fn code(self) -> i8 {
        self as i8
    }

    /// Returns the mode of a value of 0x6060 or 0x6061, if supported.
    pub fn from_code(code: i8) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| mode.code() == code)
    }

    /// Returns the mode's bit in object 0x6502.
    pub const fn supported_bit(self) -> u32 {
        1 << (self.code() - 1)
    }
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Csp => "cyclic synchronous position (8)",
            Self::Csv => "cyclic synchronous velocity (9)",
            Self::Cst => "cyclic synchronous torque (10)",
        })
    }
}
