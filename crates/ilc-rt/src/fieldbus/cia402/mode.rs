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
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 2] = [Self::Csp, Self::Csv];

    /// Returns the mode's name in a cell description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Csp => "csp",
            Self::Csv => "csv",
        }
    }

    /// Returns the objects of a command, of 16, 32 and 16 bits.
    pub const fn command_objects(self) -> [u16; 3] {
        let target = match self {
            Self::Csp => objects::TARGET_POSITION,
            Self::Csv => objects::TARGET_VELOCITY,
        };
        [objects::CONTROLWORD, target, objects::TORQUE_OFFSET]
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
        })
    }
}
