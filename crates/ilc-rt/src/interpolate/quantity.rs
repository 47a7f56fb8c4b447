//! The limited quantities of an axis and their units.

#![allow(clippy::disallowed_methods, reason = "the calls of the derived schema are cold")]

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A quantity that a limit applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// First derivative of the position.
    Velocity,
    /// Second derivative.
    Acceleration,
    /// Third derivative.
    Jerk,
}

impl Quantity {
    /// Returns the unit of the quantity for an axis measured in `unit`.
    pub const fn unit(self, unit: AxisUnit) -> &'static str {
        match (self, unit) {
            (Self::Velocity, AxisUnit::M) => "m/s",
            (Self::Acceleration, AxisUnit::M) => "m/s^2",
            (Self::Jerk, AxisUnit::M) => "m/s^3",
            (Self::Velocity, AxisUnit::Rad) => "rad/s",
            (Self::Acceleration, AxisUnit::Rad) => "rad/s^2",
            (Self::Jerk, AxisUnit::Rad) => "rad/s^3",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
        })
    }
}

/// The unit of an axis's position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AxisUnit {
    /// Metres: a linear axis.
    #[default]
    M,
    /// Radians: a rotary axis.
    Rad,
}

impl AxisUnit {
    /// Returns the unit symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Rad => "rad",
        }
    }

    /// Returns the unit of a path length over several axes: radians if all of them are rotary.
    pub fn along(units: &[Self]) -> Self {
        if !units.is_empty() && units.iter().all(|unit| *unit == Self::Rad) {
            Self::Rad
        } else {
            Self::M
        }
    }
}
