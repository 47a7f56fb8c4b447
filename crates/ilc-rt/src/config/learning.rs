//! `[learning]`: which law learns, from what, how far it may go, and what goes round it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

use super::law::{
    AdjointSection, ConstrainedSection, ErrorFeedforwardSection, ModelInverseSection, PdSection,
};
use super::norm_optimal::NormOptimalSection;

/// Growth of the RMS error over the best run at which the best input is restored, if nothing is said.
const ROLLBACK_RATIO: f64 = 1.5;

/// `[learning]`: which law learns, from what, and how far it may go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Learning {
    /// The law.
    pub law: LawName,
    /// The measurement whose error is learned from.
    pub measure: Measure,
    /// Largest learned input of a csp axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub input_max_m: f64,
    /// Largest learned input of a csv axis.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub input_max_m_s: f64,
    /// Growth of the RMS error over the best run at which the best input is restored; not with a gate.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub rollback_ratio: Option<f64>,
    /// Whether a law may start of which the analysis says that it will not converge.
    pub allow_divergent: bool,
    /// `[learning.norm_optimal]`
    pub norm_optimal: NormOptimalSection,
    /// `[learning.pd]`
    pub pd: PdSection,
    /// `[learning.constrained]`
    pub constrained: ConstrainedSection,
    /// `[learning.adjoint]`
    pub adjoint: AdjointSection,
    /// `[learning.model_inverse]`
    pub model_inverse: ModelInverseSection,
    /// `[learning.error_feedforward]`
    pub error_feedforward: ErrorFeedforwardSection,
    /// `[learning.ladder]`
    pub ladder: Option<LadderSection>,
    /// `[learning.gate]`
    pub gate: Option<GateSection>,
}

impl Default for Learning {
    fn default() -> Self {
        Self {
            law: LawName::NormOptimal,
            measure: Measure::Tcp,
            input_max_m: 0.005,
            input_max_m_s: 0.05,
            rollback_ratio: None,
            allow_divergent: false,
            norm_optimal: NormOptimalSection::default(),
            pd: PdSection::default(),
            constrained: ConstrainedSection::default(),
            adjoint: AdjointSection::default(),
            model_inverse: ModelInverseSection::default(),
            error_feedforward: ErrorFeedforwardSection::default(),
            ladder: None,
            gate: None,
        }
    }
}

impl Learning {
    /// Returns the growth of the RMS error over the best run at which the supervisor restores the best
    /// input, if no gate decides instead.
    pub fn rollback(&self) -> f64 {
        self.rollback_ratio.unwrap_or(ROLLBACK_RATIO)
    }

    /// Returns law and parameters as text that is the same if and only if they are: what a campaign
    /// that goes on must have in common with the one before.
    pub fn law_text(&self) -> String {
        let section: &dyn std::fmt::Debug = match self.law {
            LawName::NormOptimal => &self.norm_optimal,
            LawName::Pd => &self.pd,
            LawName::Constrained => &self.constrained,
            LawName::Adjoint => &self.adjoint,
            LawName::ModelInverse => &self.model_inverse,
            LawName::ErrorFeedforward => &self.error_feedforward,
            LawName::None => &(),
        };
        format!("{:?}", (self.law, section, self.ladder, self.gate))
    }
}

/// Which law learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LawName {
    /// Norm-optimal; with `rate` it is CO-ILC.
    NormOptimal,
    /// Proportional-derivative with zero-phase low-pass.
    Pd,
    /// Norm-optimal within bounds.
    Constrained,
    /// Gradient: the error run backward through the model.
    Adjoint,
    /// The inverse of the model.
    ModelInverse,
    /// Feed-forward from the filtered error, for axes whose position loop is in the controller.
    ErrorFeedforward,
    /// No learning: every run is like the first.
    None,
}

impl LawName {
    /// Returns the name as a cell description has it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::NormOptimal => "norm_optimal",
            Self::Pd => "pd",
            Self::Constrained => "constrained",
            Self::Adjoint => "adjoint",
            Self::ModelInverse => "model_inverse",
            Self::ErrorFeedforward => "error_feedforward",
            Self::None => "none",
        }
    }
}

/// Which measurement is learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The encoder in each drive.
    Encoder,
    /// The tool centre point.
    Tcp,
}

/// `[learning.ladder]`: several runs with the same input before each step of learning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct LadderSection {
    /// Runs with the same input before each step.
    #[schemars(range(min = 1, max = 1000))]
    pub repeats: usize,
    /// Ratio of the error to that before the last step above which it decays too slowly.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub slow: f64,
    /// By what factor the gain is then raised; 1 to leave it alone.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub increase: f64,
    /// Lowest gain.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub lowest: f64,
    /// Highest gain.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub highest: f64,
}

impl Default for LadderSection {
    fn default() -> Self {
        Self { repeats: 2, slow: 0.8, increase: 1.25, lowest: 0.0625, highest: 1.5 }
    }
}

/// By what figure of a run's error a gate judges it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GateMeasure {
    /// Root of the mean over the samples of the squared length of the error: `tracking_rms_m`.
    Rms,
    /// Largest magnitude of any sample of any axis: `tracking_inf_m`.
    Max,
}

/// `[learning.gate]`: when the law is to learn, to rest, or to go back to what was best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct GateSection {
    /// Error up to which the input is kept as it is; 0 to learn for ever.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tolerance_m: f64,
    /// What a run is judged by.
    pub measure: GateMeasure,
    /// By what factor the error must leave the tolerance before learning resumes.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub resume: f64,
    /// By what factor the error may exceed the best one so far.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub growth: f64,
    /// For how many runs in a row it may do so; with a ladder, for how many of its steps.
    #[schemars(range(min = 1, max = 100))]
    pub patience: usize,
}

impl Default for GateSection {
    fn default() -> Self {
        Self { tolerance_m: 0.0, measure: GateMeasure::Rms, resume: 1.5, growth: 1.5, patience: 2 }
    }
}
