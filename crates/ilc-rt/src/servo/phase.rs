//! Phases of the motion.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use serde::{Deserialize, Serialize};

use crate::interpolate::{ControlledStop, PointToPoint};

/// The phase of the cell, with its state.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "one of them, in the loop's own memory")]
pub(super) enum Phase {
    /// Drives are enabled, holding their position.
    Enabling { ticks: u32 },
    /// Axes move to the start.
    Returning(PointToPoint),
    /// Axes rest at the start.
    Settling { ticks_left: u32 },
    /// A run is in progress.
    Running { sample: u32 },
    /// Axes are being stopped early.
    Stopping { stop: ControlledStop, rest_ticks: u32 },
    /// Drives are being disabled.
    Disabling { ticks: u32 },
    /// Drives are disabled, or lost.
    Stopped,
}

/// The name of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PhaseName {
    /// Drives are enabled, holding their position.
    Enabling,
    /// Axes move to the start.
    Returning,
    /// Axes rest at the start.
    Settling,
    /// Axes rest at the start until the run is released.
    Waiting,
    /// A run is in progress.
    Running,
    /// A run is held on its path.
    Paused,
    /// Axes are being stopped early.
    Stopping,
    /// Drives are being disabled.
    Disabling,
    /// Drives are disabled, or lost.
    Stopped,
}

impl Phase {
    /// Returns the next sample of the run in progress.
    pub(super) fn sample(&self) -> Option<u32> {
        match self {
            Self::Running { sample } => Some(*sample),
            _ => None,
        }
    }

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
