//! `[recording]`: recordings of every session.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// `[recording]`: every tick of every session in a file, for viewers and for `ilc-rt replay`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Recording {
    /// Folder for the recordings, which is made if it is missing; nothing is recorded if it is not given. `--record`
    /// replaces it.
    pub folder: Option<PathBuf>,
    /// Recordings of this cell that stay in the folder, the newest; older ones are deleted when a session begins.
    #[schemars(range(min = 1, max = 100_000))]
    pub keep: u32,
    /// Largest size of them together, in megabytes: the oldest are deleted, and a recording ends that is larger by
    /// itself. Unlimited if not given.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub keep_mb: Option<u32>,
}

impl Default for Recording {
    fn default() -> Self {
        Self { folder: None, keep: 20, keep_mb: None }
    }
}
