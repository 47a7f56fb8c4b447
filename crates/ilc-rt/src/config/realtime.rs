//! `[realtime]`: punctuality of the loop.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// `[realtime]`: the share of its period that a cycle may use.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Realtime {
    /// Share of its period after which a cycle is late: the flight recorder keeps it, and tells who was late.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub late_share: f64,
}

impl Default for Realtime {
    fn default() -> Self {
        Self { late_share: 0.9 }
    }
}
