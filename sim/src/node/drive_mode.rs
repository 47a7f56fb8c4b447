//! Modes of operation of a simulated drive: its own profiles, homing, and the controller's cyclic modes.

use ilc_rt::fieldbus::cia402::Mode;

/// A mode of operation, objects 0x6060 and 0x6061.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveMode {
    /// Profile position.
    ProfilePosition,
    /// Profile velocity.
    ProfileVelocity,
    /// Homing.
    Homing,
    /// Cyclic synchronous, with targets from the controller at every SYNC.
    Cyclic(Mode),
}

impl DriveMode {
    /// Modes in which the drive generates its own targets (profile modes and homing).
    const OWN: [Self; 3] = [Self::ProfilePosition, Self::ProfileVelocity, Self::Homing];

    /// Returns all modes.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::OWN.into_iter().chain(Mode::ALL.into_iter().map(Self::Cyclic))
    }

    /// Returns the value of objects 0x6060 and 0x6061.
    pub const fn code(self) -> i8 {
        match self {
            Self::ProfilePosition => 1,
            Self::ProfileVelocity => 3,
            Self::Homing => 6,
            Self::Cyclic(mode) => mode.code(),
        }
    }

    /// Returns the mode of a value of 0x6060 or 0x6061; `None` for 0 and for others.
    pub fn from_code(code: i64) -> Option<Self> {
        Self::all().find(|mode| i64::from(mode.code()) == code)
    }

    /// Returns the value of object 0x6502.
    pub fn supported() -> u32 {
        Self::all().fold(0, |bits, mode| bits | 1 << (mode.code() - 1))
    }
}
