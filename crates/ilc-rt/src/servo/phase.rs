//! Phases of the motion.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use crate::interpolate::{ControlledStop, PointToPoint};

/// The phase of the cell, with what it needs to go on.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "one of them, in the loop's own memory")]
pub(super) enum Phase {
    /// Drives are switched on, holding their position.
    Enabling { ticks: u32 },
    /// Axes go to the start.
    Returning(PointToPoint),
    /// Axes rest at the start.
    Settling { ticks_left: u32 },
    /// A run is on.
    Running { sample: u32 },
    /// Axes are brought to rest ahead of time.
    Stopping { stop: ControlledStop, rest_ticks: u32 },
    /// Drives are switched off.
    Disabling { ticks: u32 },
    /// Drives are off, or lost.
    Stopped,
}

/// The name of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseName {
    /// Drives are switched on, holding their position.
    Enabling,
    /// Axes go to the start.
    Returning,
    /// Axes rest at the start.
    Settling,
    /// A run is on.
    Running,
    /// Axes are brought to rest ahead of time.
    Stopping,
    /// Drives are switched off.
    Disabling,
    /// Drives are off, or lost.
    Stopped,
}

impl Phase {
    pub(super) fn name(&self) -> PhaseName {
        match self {
            Self::Enabling { .. } => PhaseName::Enabling,
            Self::Returning(_) => PhaseName::Returning,
            Self::Settling { .. } => PhaseName::Settling,
            Self::Running { .. } => PhaseName::Running,
            Self::Stopping { .. } => PhaseName::Stopping,
            Self::Disabling { .. } => PhaseName::Disabling,
            Self::Stopped => PhaseName::Stopped,
        }
    }
}
