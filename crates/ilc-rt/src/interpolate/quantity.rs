//! The quantities of an axis that limits are set on, and the units that they are stated in.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A quantity that a limit is set on.
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
    /// The unit of the quantity, for an axis that is measured in `unit`.
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
    /// The unit as it is written.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Rad => "rad",
        }
    }

    /// The unit of a distance along a path of several axes: radians where all of them are rotary.
    pub fn along(units: &[Self]) -> Self {
        if !units.is_empty() && units.iter().all(|unit| *unit == Self::Rad) {
            Self::Rad
        } else {
            Self::M
        }
    }
}
