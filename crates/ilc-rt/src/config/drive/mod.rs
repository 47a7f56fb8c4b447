//! `[axis.drive]`: the drive of an axis, where it differs from what bring-up expects of any drive.
//!
//! Everything here is optional: without it a drive is brought up as `docs/drives.md` says.

mod object_name;
mod pdo;
mod start_up;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;
pub use object_name::ObjectName;
pub use pdo::DrivePdo;
pub use start_up::StartUp;

/// `[axis.drive]`: identity, settings and process data of the drive.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Drive {
    /// Vendor (object 0x1018:01) that the drive must have; not checked by default.
    pub vendor: Option<u32>,
    /// Product code (object 0x1018:02) that the drive must have; not checked by default.
    pub product: Option<u32>,
    /// Revision (object 0x1018:03) that the drive must have; not checked by default.
    pub revision: Option<u32>,
    /// Serial number (object 0x1018:04) that the drive must have; not checked by default.
    pub serial: Option<u32>,
    /// Objects that bring-up leaves as they are, e.g. `["0x6072", "0x607D"]`: only those on which no
    /// stop depends.
    pub keep: Vec<ObjectName>,
    /// Home offset (object 0x607C) in units of the drive. By default the drive must have 0, or gets it
    /// if it is homed by `kind = "drive"`.
    pub home_offset: Option<i32>,
    /// Polarity (object 0x607E): 0, or 192 for a drive that reverses positions and velocities itself;
    /// the sign of the axis is `reversed`.
    pub polarity: u8,
    /// Encoder increments and motor revolutions (object 0x608F). If one of the three ratios is given,
    /// those that the drive has are given too and written; `counts_per_m` is then in units of the drive.
    #[schemars(inner(range(min = 1)))]
    pub encoder_resolution: Option<[u32; 2]>,
    /// Motor and shaft revolutions (object 0x6091).
    #[schemars(inner(range(min = 1)))]
    pub gear_ratio: Option<[u32; 2]>,
    /// Feed in units of the drive, and shaft revolutions (object 0x6092).
    #[schemars(inner(range(min = 1)))]
    pub feed_constant: Option<[u32; 2]>,
    /// Unit of positions that the drive states (object 0x60A8) for a count of the cell description.
    pub position_unit: Option<u32>,
    /// Unit of velocities that the drive states (object 0x60A9) for a count per second.
    pub velocity_unit: Option<u32>,
    /// Following error window (object 0x6065) in units of the drive; `following_error_max_m` by default.
    #[schemars(range(min = 1))]
    pub following_error_window: Option<u32>,
    /// Time that the following error may exceed the window (object 0x6066); 10 ms by default.
    #[schemars(range(min = 0, max = 60_000))]
    pub following_error_time_ms: Option<u16>,
    /// Reaction to a quick stop (object 0x605A); 2 or 6 by default. Not 0, which coasts.
    pub quick_stop_option: Option<i16>,
    /// Reaction to a fault (object 0x605E); 2 or 1 by default. Not 0, which coasts.
    pub fault_reaction_option: Option<i16>,
    /// Reaction to a loss of the connection (object 0x6007); 1 or 3 by default. Neither 0, which
    /// continues, nor 2, which coasts.
    pub connection_loss_option: Option<i16>,
    /// `[axis.drive.pdo]`: process data of every cycle.
    pub pdo: DrivePdo,
    /// `[[axis.drive.start_up]]`: objects written at bring-up, in this order.
    pub start_up: Vec<StartUp>,
}

impl Drive {
    /// Returns true if the cell description states the ratios of the mechanics.
    pub fn states_ratios(&self) -> bool {
        self.encoder_resolution.is_some()
            || self.gear_ratio.is_some()
            || self.feed_constant.is_some()
    }

    /// Returns true if bring-up leaves an object, or the whole record it belongs to, as it is.
    pub fn keeps(&self, index: u16, sub: u8) -> bool {
        self.keep.iter().any(|kept| kept.covers(index, sub))
    }
}
