//! `[learning.dynamic]`: weights of the cost and the filters of error, input and change.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{DynamicNormOptimal, InputWeights};
use crate::learning::law::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff,
};
use crate::learning::law::norm_optimal::Weights;
use crate::learning::weights::{Dynamic, FilteredInput, Pass, Weight, band};
use crate::learning::{Law, Result};
use crate::schema::{Violation, field_order};

/// `[learning.dynamic]`: weights of the low-passed error, of the unfiltered error and of the input, filtered
/// and not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct DynamicParameters {
    /// Weight of the low-passed next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the unfiltered next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub plain: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Weight of the rate of the change of input.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rate: f64,
    /// Order of the causal Butterworth low-pass of each axis' error.
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency.
    pub cutoff_hz: f64,
    /// Weight of the filtered next input: a high-pass keeps high frequencies small.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<PassParameters>,
    /// Weight of the filtered change of input: a high-pass slows learning at high frequencies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<PassParameters>,
}

impl Default for DynamicParameters {
    fn default() -> Self {
        Self {
            q: 1.0,
            plain: 0.0,
            s: 0.0,
            r: 0.0,
            rate: 0.0,
            order: 1,
            cutoff_hz: 10.0,
            input: None,
            change: None,
        }
    }
}

/// `[learning.dynamic.input]` and `[learning.dynamic.change]`: a weight of what a causal Butterworth filter
/// passes, the same for every axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PassParameters {
    /// Weight of the filtered signal.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub weight: f64,
    /// Frequencies that the filter passes and the weight counts: above or below the cut-off.
    pub pass: Pass,
    /// Order of the Butterworth filter.
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the filter, 0.001 to 0.95 of the Nyquist frequency.
    pub cutoff_hz: f64,
}

impl Default for PassParameters {
    fn default() -> Self {
        Self { weight: 1.0, pass: Pass::High, order: 2, cutoff_hz: 20.0 }
    }
}

impl PassParameters {
    fn filtered(&self, context: &LawContext) -> Result<FilteredInput> {
        let dt_s = context.cell.cycle_s;
        let filter = band(self.pass, (self.order, self.cutoff_hz), dt_s, context.n_axes())?;
        FilteredInput::new(filter, Weight::Scalar(self.weight))
    }
}

impl LawParameters for DynamicParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_cutoff("[learning.dynamic] cutoff_hz", Some(self.cutoff_hz), cell)?;
        let cutoff_hz = |part: &Option<PassParameters>| part.map(|part| part.cutoff_hz);
        check_cutoff("[learning.dynamic.input] cutoff_hz", cutoff_hz(&self.input), cell)?;
        check_cutoff("[learning.dynamic.change] cutoff_hz", cutoff_hz(&self.change), cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let (dt_s, n_axes) = (context.cell.cycle_s, context.n_axes());
        let mut weight =
            Dynamic::new(band(Pass::Low, (self.order, self.cutoff_hz), dt_s, n_axes)?)?;
        if self.plain > 0.0 {
            weight = weight.with_plain(Weight::Scalar(self.plain));
        }
        let filtered = |part: Option<PassParameters>| part.map(|part| part.filtered(context));
        let inputs = InputWeights {
            input: filtered(self.input).transpose()?,
            change: filtered(self.change).transpose()?,
        };
        let weights = Weights { q: self.q, s: self.s, r: self.r, rate: self.rate };
        let all = (&weight, &inputs);
        Ok(Box::new(DynamicNormOptimal::with_inputs(
            context.model,
            context.n_samples(),
            all,
            weights,
        )?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example {
                is_parallel: false,
                learning: "law = \"dynamic\"\n[learning.dynamic]\nplain = 0.2\nrate = 6.0\n\
                           order = 2\ncutoff_hz = 12.0",
                error_left: 0.1,
            },
            Example {
                is_parallel: false,
                learning: "law = \"dynamic\"\n[learning.dynamic]\nq = 0.0\nplain = 1.0\nrate = 1.0\n\
                           input = { weight = 2.0, cutoff_hz = 30.0 }\n\
                           change = { weight = 5.0, cutoff_hz = 15.0 }",
                error_left: 0.1,
            },
        ]
    }
}
