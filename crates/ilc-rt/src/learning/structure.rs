//! What a law says of itself to whoever analyses it.

use crate::learning::law::norm_optimal::Weights;
use crate::learning::law::pd::PdGains;
use crate::model::StateSpace;

/// What is known of a law beyond its update.
#[derive(Debug, Clone, PartialEq)]
pub enum Structure<'a> {
    /// Nothing: analysis tries whether it is linear.
    Unknown,
    /// Proportional-derivative learning with a filter or without.
    Pd(PdGains),
    /// Each update minimises a quadratic cost with this model. Whatever the weights, learning then
    /// converges if the model is right.
    Optimal {
        /// What the law believes of the axes.
        model: &'a StateSpace,
        /// The weights of the cost.
        weights: Weights,
    },
}
