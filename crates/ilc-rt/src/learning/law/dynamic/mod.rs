//! Norm-optimal ILC with a dynamic (frequency-dependent) weight of the error.

#[cfg(test)]
mod oracle;
mod parameters;

pub use parameters::DynamicParameters;

use crate::learning::error::{check, check_length};
use crate::learning::law::norm_optimal::{Cost, NormOptimal, Plant};
use crate::learning::weights::{Dynamic, ErrorFilter};
use crate::learning::{Law, LearningError, Result};
use crate::model::TimeVarying;

/// Norm-optimal ILC with a dynamic weight, exact and in linear time.
///
/// `J = sum_k |w[k]|^2_q + |z[k]|^2_plain + |u'[k]|^2_s + |v[k]|^2_r + rate^2 |v[k] - v[k-1]|^2`,
/// `w = F (G z)`
///
/// Since `w = F G e - F G P v`, this is norm-optimal ILC from the filtered error, for the model in
/// series with the filter: the total delay of plant and filter is paired there.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs` of the plant;
///   `q` of the cost weights the outputs of the filter
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples)` time and memory.
/// # Source
/// - \[barton2010\], Eq. (J.10) to (J.23).
#[derive(Debug)]
pub struct DynamicNormOptimal {
    inner: NormOptimal,
    filter: ErrorFilter,
    filtered: Vec<f64>,
    n_samples: usize,
}

impl DynamicNormOptimal {
    /// Creates the law: factorises the problem for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`LearningError::Model`] unless the filter matches the plant's outputs and sample time.
    /// - otherwise as [`NormOptimal::new`].
    pub fn new<'a>(
        model: impl Into<Plant<'a>>,
        n_samples: usize,
        dynamic: &Dynamic,
        cost: impl Into<Cost>,
    ) -> Result<Self> {
        let (plant, cost) = (model.into(), cost.into());
        if n_samples == 0 {
            return Err(LearningError::Empty { what: "n_samples" });
        }
        plant.check(n_samples)?;
        let cost = Cost { q: dynamic.weight(n_samples, &cost.q)?, ..cost };
        let behind = |k: usize| -> Result<_> { Ok(plant.at(k).series(&dynamic.at(k)?)?) };
        let inner = if dynamic.is_constant() && matches!(plant, Plant::Invariant(_)) {
            NormOptimal::new(&behind(0)?, n_samples, cost)?
        } else {
            let samples = (0..n_samples).map(behind).collect::<Result<_, _>>()?;
            NormOptimal::new(&TimeVarying::new(samples)?, n_samples, cost)?
        };
        let filter = dynamic.error_filter();
        let filtered = vec![0.0; n_samples * filter.n_outputs()];
        Ok(Self { inner, filter, filtered, n_samples })
    }

    /// Returns the law that learns from the filtered error.
    pub fn inner(&self) -> &NormOptimal {
        &self.inner
    }
}

impl Law for DynamicNormOptimal {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        check("error", error, self.n_samples, self.filter.n_inputs())?;
        self.filter.run(error, &mut self.filtered);
        self.inner.update(input, &self.filtered, next)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        check_length("to_error", to_error, self.n_samples, self.filter.n_inputs())?;
        if !self.inner.apply_adjoint(dual, to_input, &mut self.filtered)? {
            return Ok(false);
        }
        self.filter.run_transposed(&self.filtered, to_error);
        Ok(true)
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        format!(
            r#"{{"law":"dynamic_norm_optimal","n_outputs":{},"filtered":{}}}"#,
            self.filter.n_inputs(),
            self.inner.describe()
        )
    }
}
