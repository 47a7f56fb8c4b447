//! Frequency-dependent weights of the input: it is filtered before it is weighted.

use super::dynamic::check_filter;
use super::{Dynamic, ErrorFilter, Weight};
use crate::learning::{LearningError, Result};
use crate::model::StateSpace;

/// A weight of the filtered input, or of its filtered change.
///
/// `sum_k |w_k|^2_weight`, `w = F u` with `F` causal and stable, from rest at the start of the run.
///
/// With a high-pass, e.g., high frequencies cost more than low ones.
///
/// # Source
/// - \[gupta1980\]: cost functionals with filters of state and input.
#[derive(Debug, Clone, PartialEq)]
pub struct FilteredInput {
    filter: StateSpace,
    weight: Weight,
}

impl FilteredInput {
    /// Creates a weight of a filter's outputs.
    ///
    /// # Shapes
    /// - `filter`: one input per input of the plant; `weight`: of its outputs
    /// # Errors
    /// - as [`Dynamic::new`].
    pub fn new(filter: StateSpace, weight: Weight) -> Result<Self> {
        check_filter(&filter)?;
        Ok(Self { filter, weight })
    }

    /// Refuses a weight that does not match the run, or a filter that does not match the plant's inputs.
    ///
    /// # Errors
    /// - [`LearningError::Weight`], naming it `what`.
    pub fn check(&self, what: &'static str, n_samples: usize, n_inputs: usize) -> Result {
        if self.filter.n_inputs() != n_inputs {
            let taken = self.filter.n_inputs();
            let reason =
                format!("its filter takes {taken} signals; {n_inputs} are needed, the inputs");
            return Err(LearningError::Weight { what, sample: 0, reason });
        }
        self.weight.check(what, n_samples, self.n_filtered())
    }

    /// Returns the filter.
    pub fn filter(&self) -> &StateSpace {
        &self.filter
    }

    /// Returns the weight of the filter's outputs.
    pub fn weight(&self) -> &Weight {
        &self.weight
    }

    /// Returns the number of filtered channels.
    pub fn n_filtered(&self) -> usize {
        self.filter.n_outputs()
    }

    /// Returns the filter with its memory, for whole runs.
    ///
    /// # Errors
    /// - none, as the filter is checked.
    pub fn run_filter(&self) -> Result<ErrorFilter> {
        Ok(Dynamic::new(self.filter.clone())?.error_filter())
    }
}
