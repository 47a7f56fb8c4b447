//! `[learning.norm_optimal]`: the weights of the quadratic cost, across the path and along the run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// `[learning.norm_optimal]`: weights of the quadratic cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct NormOptimalSection {
    /// Weight of the next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Weight d of the rate of the change of input (Haas eq. 7).
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rate: f64,
    /// `[learning.norm_optimal.contour]`: what the error across the path weighs beyond `q`.
    pub contour: Option<ContourSection>,
    /// `[[learning.norm_optimal.phase]]`, in the order of time: other weights for part of the run.
    #[serde(rename = "phase")]
    pub phases: Vec<PhaseSection>,
    /// Bandwidth with which the weights go over from one phase to the next.
    pub smoothing_hz: f64,
}

impl Default for NormOptimalSection {
    fn default() -> Self {
        Self {
            q: 1.0,
            s: 0.0,
            r: 0.0,
            rate: 3.0,
            contour: None,
            phases: Vec::new(),
            smoothing_hz: 10.0,
        }
    }
}

/// `[learning.norm_optimal.contour]`: `Q = q I + weight (I - t t') + along t t'`, t the direction of
/// the program's path at each sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ContourSection {
    /// Weight of the error across the path.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub weight: f64,
    /// Weight of the error along the path.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub along: f64,
    /// Names of the two or three axes that make the path; all axes of the cell if none is named.
    pub axes: Vec<String>,
}

impl Default for ContourSection {
    fn default() -> Self {
        Self { weight: 1.0, along: 0.0, axes: Vec::new() }
    }
}

/// `[[learning.norm_optimal.phase]]`: weights that hold for part of the run; what is not named here
/// stays as it is outside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PhaseSection {
    /// Begin, from the start of the run.
    #[schemars(range(min = 0.0, max = 100000.0))]
    pub from_s: f64,
    /// End, from the start of the run.
    #[schemars(range(min = 0.0, max = 100000.0))]
    pub to_s: f64,
    /// Weight of the next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: Option<f64>,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: Option<f64>,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: Option<f64>,
    /// Weight of the error across the path.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub contour: Option<f64>,
}
