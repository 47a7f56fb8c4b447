//! `[learning.dynamic]`: weights of the cost and the filter of the error.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::DynamicNormOptimal;
use crate::learning::law::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff,
};
use crate::learning::law::norm_optimal::Weights;
use crate::learning::weights::{Dynamic, Weight};
use crate::learning::{Law, Result};
use crate::model::{StateSpace, from_transfer_function};
use crate::schema::{Violation, field_order};
use crate::signal::{Section, butterworth};

/// `[learning.dynamic]`: weights of the low-passed error, of the unfiltered error and of the input.
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
}

impl Default for DynamicParameters {
    fn default() -> Self {
        Self { q: 1.0, plain: 0.0, s: 0.0, r: 0.0, rate: 0.0, order: 1, cutoff_hz: 10.0 }
    }
}

impl LawParameters for DynamicParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_cutoff("[learning.dynamic] cutoff_hz", Some(self.cutoff_hz), cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let mut weight = Dynamic::new(self.filter(context)?)?;
        if self.plain > 0.0 {
            weight = weight.with_plain(Weight::Scalar(self.plain));
        }
        let weights = Weights { q: self.q, s: self.s, r: self.r, rate: self.rate };
        let n_samples = context.n_samples();
        Ok(Box::new(DynamicNormOptimal::new(context.model, n_samples, &weight, weights)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"dynamic\"\n[learning.dynamic]\nplain = 0.2\nrate = 6.0\n\
                       order = 2\ncutoff_hz = 12.0",
            error_left: 0.1,
        }]
    }
}

impl DynamicParameters {
    /// Returns the low-passes of all axes, block-diagonal.
    fn filter(&self, context: &LawContext) -> Result<StateSpace> {
        let dt_s = context.cell.cycle_s;
        let one = || StateSpace::static_gain(DMatrix::identity(1, 1), Some(dt_s));
        let mut axis = one()?;
        for Section { b, a } in butterworth(self.order, self.cutoff_hz, dt_s)? {
            axis = axis.series(&from_transfer_function(&b, &[1.0, a[0], a[1]], Some(dt_s))?)?;
        }
        let mut all = axis.clone();
        for _ in 1..context.n_axes() {
            all = all.append(&axis)?;
        }
        Ok(all)
    }
}
