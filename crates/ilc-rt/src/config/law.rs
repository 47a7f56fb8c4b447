//! The tables of the laws that have a few numbers each: `[learning.pd]`, `[learning.constrained]`,
//! `[learning.adjoint]`, `[learning.model_inverse]`, `[learning.error_feedforward]`.

use serde::Deserialize;

/// `[learning.pd]`: gains and the zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PdSection {
    /// Proportional gain.
    pub kp: f64,
    /// Derivative gain, per sample difference.
    pub kd: f64,
    /// Lead of the error over the input.
    pub lead_samples: usize,
    /// Order of the low-pass.
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
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConstrainedSection {
    /// Weight of the next error.
    pub q: f64,
    /// Weight of the next input.
    pub s: f64,
    /// Weight of the change of input.
    pub r: f64,
    /// Weight d of the rate of the change of input.
    pub rate: f64,
    /// Largest change of the input of a csp axis from run to run.
    pub change_max_m: Option<f64>,
    /// The same of a csv axis.
    pub change_max_m_s: Option<f64>,
    /// Largest change of the input of a csp axis from sample to sample.
    pub step_max_m: Option<f64>,
    /// The same of a csv axis.
    pub step_max_m_s: Option<f64>,
    /// Largest speed of the corrected set point of csp axes; each axis' own limit if not given.
    pub velocity_max_m_s: Option<f64>,
    /// Largest acceleration of it; each axis' own limit if not given.
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
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdjointSection {
    /// Step alpha; half the largest one that converges if not given.
    pub gain: Option<f64>,
    /// Order of the zero-phase Butterworth low-pass.
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
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelInverseSection {
    /// Share of the predicted error that one update takes away.
    pub gain: f64,
    /// Order of the low-pass.
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
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ErrorFeedforwardSection {
    /// Learned speed per error.
    pub gain_per_s: f64,
    /// Lead of the error over the input.
    pub lead_samples: usize,
    /// Order of the low-pass.
    pub order: usize,
    /// Cut-off of the low-pass.
    pub cutoff_hz: f64,
}

impl Default for ErrorFeedforwardSection {
    fn default() -> Self {
        Self { gain_per_s: 10.0, lead_samples: 1, order: 2, cutoff_hz: 5.0 }
    }
}
