//! `[learning.relevance]`: core law, disturbances, and weights of the relevance.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::index::DISTURBANCES_MAX;
use super::{Relevance, RelevanceWeights, RunShape};
use crate::learning::Law;
use crate::learning::law::LawName;
use crate::learning::law::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_core, violation,
};
use crate::schema::{Violation, field_order};

/// `[learning.relevance]`: the core law, the disturbances of a run, and the weights of its relevance.
///
/// Each run counts by `1 / (sum of the weighted squares of its error, of the error's rate and of
/// the distance of its disturbance from the coming one + epsilon)`. The runs of this cell, program
/// and measurement in the library are added at the start, and give the input of the first run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct RelevanceParameters {
    /// The law that proposes an input after each run, with the parameters of its own table.
    pub core: LawName,
    /// Number of disturbances of a run, e.g. temperatures.
    #[schemars(range(min = 0, max = 7))]
    pub disturbances: usize,
    /// Weight of the squared error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub error: f64,
    /// Weight of the squared rate of the error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub error_rate: f64,
    /// Weight of the squared distance of the disturbances: one for all, or one per disturbance.
    #[schemars(inner(range(min = 0.0, max = 1e12)))]
    pub disturbance: Vec<f64>,
    /// Sum of the squares below which runs count as equally good.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub epsilon: f64,
    /// Time constant of the filter that computes the error's rate.
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub rate_filter_s: f64,
    /// Gain of the core law's correction.
    #[schemars(range(min = -1e3, max = 1e3))]
    pub error_gain: f64,
    /// Gain of the input.
    #[schemars(range(min = -1e3, max = 1e3))]
    pub input_gain: f64,
    /// Number of most relevant runs to use; all if not given.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub top: Option<usize>,
}

impl Default for RelevanceParameters {
    fn default() -> Self {
        let RelevanceWeights {
            error,
            error_rate,
            disturbance,
            epsilon,
            rate_filter_s,
            error_gain,
            input_gain,
        } = RelevanceWeights::default();
        Self {
            core: LawName::NormOptimal,
            disturbances: 1,
            error,
            error_rate,
            disturbance,
            epsilon,
            rate_filter_s,
            error_gain,
            input_gain,
            top: None,
        }
    }
}

impl LawParameters for RelevanceParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_core("[learning.relevance] core", self.core, cell)?;
        let n = self.disturbance.len();
        if n == 1 || (n == self.disturbances && n <= DISTURBANCES_MAX) {
            return Ok(());
        }
        let (key, value) = ("[learning.relevance] disturbance", format!("{:?}", self.disturbance));
        let allowed =
            format!("one weight, or one for each of disturbances = {}", self.disturbances);
        Err(violation(key, value, allowed))
    }

    fn core(&self) -> Option<LawName> {
        Some(self.core)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let shape = RunShape {
            n_samples: context.n_samples(),
            n_inputs: context.n_axes(),
            n_outputs: context.n_axes(),
            n_disturbances: self.disturbances,
            dt_s: context.cell.cycle_s,
        };
        let weights = RelevanceWeights {
            error: self.error,
            error_rate: self.error_rate,
            disturbance: self.disturbance.clone(),
            epsilon: self.epsilon,
            rate_filter_s: self.rate_filter_s,
            error_gain: self.error_gain,
            input_gain: self.input_gain,
        };
        let core = context.core(self.core)?;
        Ok(Box::new(Relevance::new(core, shape, weights, self.top)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"relevance\"\n[learning.relevance]\nerror = 1.0\nerror_rate = 0.0\n\
                       epsilon = 1e-9\n[learning.norm_optimal]\nrate = 6.0",
            error_left: 0.2,
        }]
    }
}
