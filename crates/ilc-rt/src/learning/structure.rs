//! Structure of a law, for its analysis: the laws state it, `analysis` reads it.

use crate::learning::Law;
use crate::learning::law::norm_optimal::Weights;
use crate::learning::law::pd::PdGains;
use crate::model::StateSpace;

/// Structure of a law beyond its update.
#[derive(Debug, Clone, PartialEq)]
pub enum Structure<'a> {
    /// Nothing: analysis tries whether it is linear.
    Unknown,
    /// Proportional-derivative learning with a filter or without.
    Pd(PdGains),
    /// Each update minimises a quadratic cost with this model. Whatever the weights, learning then
    /// converges if the model is right.
    Optimal {
        /// Nominal model of the axes.
        model: &'a StateSpace,
        /// The weights of the cost; `None` if they change along the run or tie channels together.
        weights: Option<Weights>,
    },
}

/// Linear law that analysis uses in place of one that is not linear itself.
#[expect(missing_debug_implementations, reason = "laws need not have one")]
pub enum Surrogate<'a> {
    /// The law itself.
    Itself,
    /// The law inside one that only says when to learn, or from which runs.
    Inside(&'a mut (dyn Law + 'a)),
    /// The law as it is as long as none of its bounds is reached.
    Unbounded(Box<dyn Law>),
}

/// The low-pass of a law, and the law without it.
#[expect(missing_debug_implementations, reason = "laws need not have one")]
pub struct LowPass {
    /// Highest frequency that one pass of the filter lets through with `1 / sqrt 2` or more.
    pub cutoff_hz: f64,
    /// The same law without filter and without bounds.
    pub unfiltered: Box<dyn Law>,
}
