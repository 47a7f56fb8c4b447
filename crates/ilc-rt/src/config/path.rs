//! `[program] kind`: what kind of path the tool follows, and the numbers of each.

use crate::schema::field_order;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What kind of path it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathKind {
    /// Straight moves and arcs, `[[program.segment]]`.
    #[default]
    Points,
    /// A smooth curve through the points of `[[program.segment]]`.
    Spline,
    /// `[program.butterfly]`.
    Butterfly,
    /// `[program.spiral]`.
    Spiral,
    /// `[program.raster]`.
    Raster,
    /// The legs of `[[program.segment]]` with the oscillation of `[program.modulated]`.
    Modulated,
    /// A part program, `file`.
    Gcode,
    /// Set points, one row a servo cycle, `file`.
    Table,
}

/// `[program.butterfly]`: `r = scale (e^{cos t} - 2 cos 4t - sin⁵(t/12))`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ButterflySection {
    /// Size.
    pub scale_m: f64,
    /// Turns of t; 12 close the contour.
    pub turns: f64,
}

impl Default for ButterflySection {
    fn default() -> Self {
        Self { scale_m: 0.00185, turns: 1.0 }
    }
}

/// `[program.spiral]`: from its centre, anticlockwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct SpiralSection {
    /// Distance of the turns.
    pub pitch_m: f64,
    /// Turns.
    pub turns: f64,
}

/// `[program.raster]`: rows along the first axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct RasterSection {
    /// Length of a row.
    pub width_m: f64,
    /// Distance of the rows.
    pub pitch_m: f64,
    /// Number of rows.
    pub rows: usize,
    /// Whether the same way is gone back.
    #[serde(default)]
    pub there_and_back: bool,
}

/// `[program.modulated]`: an oscillation along the legs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ModulatedSection {
    /// Amplitude.
    pub amplitude_m: f64,
    /// Frequency.
    pub frequency_hz: f64,
}
