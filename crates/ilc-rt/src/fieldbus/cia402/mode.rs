//! Modes of operation that the controller commands.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// A cyclic synchronous mode of operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum Mode {
    /// Cyclic synchronous position: a position target every SYNC.
    Csp = 8,
    /// Cyclic synchronous velocity: a velocity target every SYNC.
    Csv = 9,
}

impl Mode {
    /// The value of objects 0x6060 and 0x6061.
    pub const fn code(self) -> i8 {
        self as i8
    }

    /// The mode of a value of 0x6060 or 0x6061, if it is one of these.
    pub const fn from_code(code: i8) -> Option<Self> {
        match code {
            8 => Some(Self::Csp),
            9 => Some(Self::Csv),
            _ => None,
        }
    }

    /// The mode's bit in object 0x6502.
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
