//! `[[axis.drive.start_up]]`: an object that bring-up writes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ObjectName;
use crate::fieldbus::bring_up::Kind;
use crate::schema::field_order;

/// `[[axis.drive.start_up]]`: an object and its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct StartUp {
    /// The object, e.g. `"0x2010:01"`. Not one that bring-up sets itself, unless `keep` names it.
    pub object: ObjectName,
    /// Its type: sign and size in bits.
    #[serde(rename = "type")]
    pub kind: Kind,
    /// The value.
    pub value: i64,
    /// Read the object first, write it only if it differs, and read it back; `false` for an object that
    /// cannot be read, or that acts when it is written.
    #[serde(default = "yes")]
    pub read_back: bool,
}

fn yes() -> bool {
    true
}
