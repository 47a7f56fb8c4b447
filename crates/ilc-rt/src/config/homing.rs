//! `[axis.homing]`: the way in which an axis knows its position after power-on.
//!
//! Bring-up writes what the drive needs for it; `campaign` and the verbs carry a homing out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// Homing methods of CiA 402 that can be configured: a limit switch with and without the index
/// pulse, the index pulse alone, and the present position.
pub const HOMING_METHODS: [i8; 8] = [1, 2, 17, 18, 33, 34, 35, 37];

/// Way in which an axis gets its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HomingKind {
    /// The position that the drive shows after power-on is used as it is.
    #[default]
    None,
    /// The drive has an absolute encoder, whose zero is at `offset_m`.
    Absolute,
    /// The drive searches its home by `method`; without it the axis does not move.
    Drive,
}

/// `[axis.homing]`: reference of the position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Homing {
    /// `none`: the position shown by the drive is used as it is. `absolute`: an absolute encoder with
    /// an offset. `drive`: the drive searches its home by `method`.
    pub kind: HomingKind,
    /// Position of the axis at which the drive shows 0; after a homing with a home offset of 0 (object
    /// 0x607C), the position of the home. Not with `none`.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub offset_m: f64,
    /// Homing method of the drive (object 0x6098): 1, 2 (negative, positive limit switch and index
    /// pulse), 17, 18 (negative, positive limit switch), 33, 34 (next index pulse in negative, positive
    /// direction of the drive), 35 or 37 (the present position).
    pub method: Option<i8>,
    /// Speed of the search for the switch (object 0x6099:01); for methods 1, 2, 17 and 18.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub speed_switch_m_s: Option<f64>,
    /// Speed of the search for the index pulse or the edge of the switch (object 0x6099:02); for all
    /// methods but 35 and 37.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub speed_zero_m_s: Option<f64>,
    /// Acceleration of the homing (object 0x609A); the axis' limit by default.
    #[schemars(range(min = 0.0001, max = 1e4))]
    pub acceleration_m_s2: Option<f64>,
    /// Time allowed for the homing; after it the axis is stopped.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub timeout_s: f64,
    /// Turn of the axis: those with a lower number are homed before it, those with the same number
    /// together with it.
    #[schemars(range(min = 1, max = 12))]
    pub order: u8,
}

impl Default for Homing {
    fn default() -> Self {
        Self {
            kind: HomingKind::None,
            offset_m: 0.0,
            method: None,
            speed_switch_m_s: None,
            speed_zero_m_s: None,
            acceleration_m_s2: None,
            timeout_s: 60.0,
            order: 1,
        }
    }
}

/// A homing that the drive carries out, complete.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveHoming {
    /// Homing method, one of [`HOMING_METHODS`].
    pub method: i8,
    /// Speed of the search for the switch; 0 if the method has none.
    pub speed_switch_m_s: f64,
    /// Speed of the search for the zero; 0 if the method has none.
    pub speed_zero_m_s: f64,
    /// Acceleration.
    pub acceleration_m_s2: f64,
    /// Time allowed.
    pub timeout_s: f64,
    /// Turn of the axis.
    pub order: u8,
}

impl Homing {
    /// Returns true if the method searches a switch.
    pub(super) fn searches_switch(method: i8) -> bool {
        matches!(method, 1 | 2 | 17 | 18)
    }

    /// Returns true if the method moves the axis.
    pub(crate) fn moves(method: i8) -> bool {
        !matches!(method, 35 | 37)
    }

    /// Returns the homing that the drive carries out, in an axis with this acceleration limit; `None`
    /// if it carries out none.
    pub fn by_drive(&self, acceleration_max_m_s2: f64) -> Option<DriveHoming> {
        let method = self.method.filter(|_| self.kind == HomingKind::Drive)?;
        Some(DriveHoming {
            method,
            speed_switch_m_s: self.speed_switch_m_s.unwrap_or(0.0),
            speed_zero_m_s: self.speed_zero_m_s.unwrap_or(0.0),
            acceleration_m_s2: self.acceleration_m_s2.unwrap_or(acceleration_max_m_s2),
            timeout_s: self.timeout_s,
            order: self.order,
        })
    }
}
