//! Structure of a law, for its analysis: the laws state it, `analysis` reads it.

use crate::learning::Law;
use crate::learning::law::norm_optimal::Weights;
use crate::learning::law::pd::PdGains;
use crate::model::StateSpace;

/// Structure of a law beyond its update.
#[derive(Debug, Clone, PartialEq)]
pub enum Structure<'a> {
    /// Unknown: the analysis tests for linearity.
    Unknown,
    /// PD-type ILC with or without filter.
    Pd(PdGains),
    /// Norm-optimal: each update minimises a quadratic cost with this model. For any weights,
    /// learning then converges if the model is exact.
    Optimal {
        /// Nominal model of the axes.
        model: &'a StateSpace,
        /// Weights of the cost; `None` if they vary along the run or couple channels.
        weights: Option<Weights>,
    },
}

/// Linear law that analysis uses in place of one that is not linear itself.
#[expect(missing_debug_implementations, reason = "laws need not have one")]
pub enum Surrogate<'a> {
    /// The law itself.
    Itself,
    /// The inner law of a wrapper that decides when to learn, or from which runs.
    Inside(&'a mut (dyn Law + 'a)),
    /// The law without its bounds.
    Unbounded(Box<dyn Law>),
    /// Gradient descent on the plant itself, whose gradient the law measures.
    Gradient {
        /// Its step; `None` for the best one of each iteration.
        gain: Option<f64>,
    },
}

/// The low-pass (Q-filter) of a law, and the law without it.
#[expect(missing_debug_implementations, reason = "laws need not have one")]
pub struct LowPass {
    /// Highest frequency with a gain of `1 / sqrt 2` or more in one pass of the filter.
    pub cutoff_hz: f64,
    /// The same law without filter and bounds.
    pub unfiltered: Box<dyn Law>,
}
