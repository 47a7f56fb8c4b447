//! Parameters and decision rule of the gate.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// Figure by which a run is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// RMS over time of the Euclidean norm of the error, all channels together: the figure that a
    /// controller reports for its runs.
    Rms {
        /// Channels of the error.
        n_channels: usize,
    },
    /// Largest magnitude of any sample of any channel.
    Max,
}

impl Measure {
    /// Returns the figure of a run's error.
    pub fn of(self, error: &[f64]) -> f64 {
        match self {
            Self::Rms { n_channels } => {
                let sum: f64 = error.iter().map(|e| e * e).sum();
                (sum * n_channels as f64 / error.len().max(1) as f64).sqrt()
            }
            Self::Max => error.iter().fold(0.0, |largest: f64, e| largest.max(e.abs())),
        }
    }

    /// Returns its name in records.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Rms { .. } => "rms",
            Self::Max => "max",
        }
    }
}

/// Figure of a run's error that a gate judges it by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GateMeasure {
    /// RMS over time of the Euclidean norm of the tracking error, as in the table of runs.
    Rms,
    /// Largest magnitude of any sample of any axis.
    Max,
}

/// `[learning.gate]`: stops learning at a tolerance, and rolls back to the best input when the
/// error grows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct GateParameters {
    /// Error up to which the input is kept unchanged; 0 to learn indefinitely.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tolerance_m: f64,
    /// Figure by which a run is judged.
    pub measure: GateMeasure,
    /// Factor on the tolerance above which learning resumes.
    #[schemars(range(min = 1.0, max = 1e3))]
    pub resume: f64,
    /// Factor by which the error may exceed the best one so far.
    #[schemars(range(min = 1.0, max = 1e3))]
    pub growth: f64,
    /// Consecutive runs, or steps of a ladder, in which it may do so before the best input is
    /// restored.
    #[schemars(range(min = 1, max = 100))]
    pub patience: usize,
}

impl Default for GateParameters {
    fn default() -> Self {
        Self { tolerance_m: 0.0, measure: GateMeasure::Rms, resume: 1.5, growth: 1.5, patience: 2 }
    }
}

impl GateParameters {
    /// Returns the rule for a cell of `n_axes` axes, whose ladder makes `runs_a_step` runs per
    /// step.
    pub fn rule(&self, n_axes: usize, runs_a_step: usize) -> GateRule {
        GateRule {
            measure: match self.measure {
                GateMeasure::Rms => Measure::Rms { n_channels: n_axes },
                GateMeasure::Max => Measure::Max,
            },
            tolerance: self.tolerance_m,
            resume: self.resume,
            growth: self.growth,
            // A step's error shows in all its runs; the ladder must have seen them to respond.
            patience: self.patience * runs_a_step,
        }
    }
}

/// Thresholds of a [`Gate`](super::Gate).
///
/// # Units
/// - `tolerance` in units of the error; the others are ratios and numbers of runs
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateRule {
    /// Figure by which a run is judged.
    pub measure: Measure,
    /// Figure up to which the error is good enough; 0 to learn indefinitely.
    pub tolerance: f64,
    /// Factor by which the error must leave the tolerance before learning resumes; 1 or more.
    pub resume: f64,
    /// Factor by which the error may exceed the best one so far; 1 or more, infinite to let it grow.
    pub growth: f64,
    /// Number of consecutive runs in which it may do so.
    pub patience: usize,
}

impl Default for GateRule {
    fn default() -> Self {
        Self {
            measure: Measure::Rms { n_channels: 1 },
            tolerance: 0.0,
            resume: 1.5,
            growth: 1.5,
            patience: 2,
        }
    }
}
