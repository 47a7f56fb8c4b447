//! The tables of the laws that have a few numbers each: `[learning.pd]`, `[learning.constrained]`,
//! `[learning.adjoint]`, `[learning.model_inverse]`, `[learning.error_feedforward]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// `[learning.pd]`: gains and the zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PdSection {
    /// Proportional gain.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub kp: f64,
    /// Derivative gain, per sample difference.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub kd: f64,
    /// Lead of the error over the input.
    #[schemars(range(min = 0, max = 1000))]
    pub lead_samples: usize,
    /// Order of the low-pass.
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass.
    pub cutoff_hz: f64,
}

impl Default for PdSection {
    fn default() -> Self {
        Self { kp: 0.5, kd: 0.0, lead_samples: 1, order: 2, cutoff_hz: 10.0 }
    }
}

/// `[learning.constrained]`: the weights of norm-optimal learning and its bounds.
///
/// The input is bounded by `input_max_m` and `input_max_m_s` of `[learning]`, the corrected set point
/// of a csp axis by the position limits of its axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ConstrainedSection {
    /// Weight of the next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Weight d of the rate of the change of input.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rate: f64,
    /// Largest change of the input of a csp axis from run to run.
    #[schemars(range(min = 1e-12, max = 1.0))]
    pub change_max_m: Option<f64>,
    /// The same of a csv axis.
    #[schemars(range(min = 1e-12, max = 10.0))]
    pub change_max_m_s: Option<f64>,
    /// Largest change of the input of a csp axis from sample to sample.
    #[schemars(range(min = 1e-12, max = 1.0))]
    pub step_max_m: Option<f64>,
    /// The same of a csv axis.
    #[schemars(range(min = 1e-12, max = 10.0))]
    pub step_max_m_s: Option<f64>,
    /// Largest speed of the corrected set point of csp axes; each axis' own limit if not given.
    #[schemars(range(min = 1e-6))]
    pub velocity_max_m_s: Option<f64>,
    /// Largest acceleration of it; each axis' own limit if not given.
    #[schemars(range(min = 0.0001))]
    pub acceleration_max_m_s2: Option<f64>,
}

impl Default for ConstrainedSection {
    fn default() -> Self {
        Self {
            q: 1.0,
            s: 0.0,
            r: 0.0,
            rate: 3.0,
            change_max_m: None,
            change_max_m_s: None,
            step_max_m: None,
            step_max_m_s: None,
            velocity_max_m_s: None,
            acceleration_max_m_s2: None,
        }
    }
}

/// `[learning.adjoint]`: the gain, and a low-pass if one is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct AdjointSection {
    /// Step alpha; half the largest one that converges if not given.
    #[schemars(range(min = 1e-12, max = 1e12))]
    pub gain: Option<f64>,
    /// Order of the zero-phase Butterworth low-pass.
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass; none if not given.
    pub cutoff_hz: Option<f64>,
}

impl Default for AdjointSection {
    fn default() -> Self {
        Self { gain: None, order: 2, cutoff_hz: None }
    }
}

/// `[learning.model_inverse]`: gain and zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ModelInverseSection {
    /// Share of the predicted error that one update takes away.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 2.0))]
    pub gain: f64,
    /// Order of the low-pass.
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass.
    pub cutoff_hz: f64,
}

impl Default for ModelInverseSection {
    fn default() -> Self {
        Self { gain: 0.5, order: 2, cutoff_hz: 10.0 }
    }
}

/// `[learning.error_feedforward]`: gain, lead, and the zero-phase Butterworth low-pass of the error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ErrorFeedforwardSection {
    /// Learned speed per error.
    #[schemars(range(min = 1e-6, max = 10000.0))]
    pub gain_per_s: f64,
    /// Lead of the error over the input.
    #[schemars(range(min = 0, max = 1000))]
    pub lead_samples: usize,
    /// Order of the low-pass.
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass.
    pub cutoff_hz: f64,
}

impl Default for ErrorFeedforwardSection {
    fn default() -> Self {
        Self { gain_per_s: 10.0, lead_samples: 1, order: 2, cutoff_hz: 5.0 }
    }
}
