//! Norm-optimal ILC with dynamic (frequency-dependent) weights of error, input and its change.

mod augmented;
#[cfg(test)]
mod oracle;
mod parameters;

pub use augmented::InputWeights;
pub use parameters::{DynamicParameters, PassParameters};

use augmented::{Augmented, InputFilter};

use crate::learning::error::{check, check_length};
use crate::learning::law::norm_optimal::{Cost, NormOptimal, Plant};
use crate::learning::weights::{Dynamic, ErrorFilter};
use crate::learning::{Law, LearningError, Result};

/// Norm-optimal ILC with dynamic weights, exact and in linear time.
///
/// `J = sum_k |w[k]|^2_q + |z[k]|^2_plain + |u'[k]|^2_s + |v[k]|^2_r + rate^2 |v[k] - v[k-1]|^2`, with
/// `w = F (G z)`, and with [`InputWeights`] also `sum_k |(F_u u')[k]|^2 + |(F_v v)[k]|^2`, each with its weight.
///
/// Since `w = F G e - F G P v`, this is norm-optimal ILC from the filtered error, for the model in
/// series with the filter: the total delay of plant and filter is paired there. Since
/// `F_u u' = F_u u + F_u v`, weights of the filtered input are weights of further outputs, `F_u` and `F_v`,
/// whose errors are `-F_u u` and 0.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs` of the plant;
///   `q` of the cost weights the outputs of the filter
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples)` time and memory.
/// # Source
/// - \[barton2010\], Eq. (J.10) to (J.23): the error; \[gupta1980\]: filters of the input; \[vanharen2024\]:
///   weights of norm-optimal ILC designed in the frequency domain.
#[derive(Debug)]
pub struct DynamicNormOptimal {
    inner: NormOptimal,
    filter: ErrorFilter,
    filtered: Vec<f64>,
    /// Weights of the filtered input or its change, if there are any.
    inputs: Option<InputFilter>,
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
        Self::with_inputs(model, n_samples, (dynamic, &InputWeights::default()), cost)
    }

    /// Creates the law with dynamic weights of the input and its change as well.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a weight that does not match the plant's inputs or the run.
    /// - otherwise as [`DynamicNormOptimal::new`].
    pub fn with_inputs<'a>(
        model: impl Into<Plant<'a>>,
        n_samples: usize,
        (dynamic, inputs): (&Dynamic, &InputWeights),
        cost: impl Into<Cost>,
    ) -> Result<Self> {
        let (plant, cost) = (model.into(), cost.into());
        if n_samples == 0 {
            return Err(LearningError::Empty { what: "n_samples" });
        }
        plant.check(n_samples)?;
        let augmented = Augmented { plant, dynamic, inputs };
        let cost = Cost { q: augmented.weight(n_samples, &cost.q)?, ..cost };
        let inner = augmented.law(n_samples, cost)?;
        let filter = dynamic.error_filter();
        let filtered = vec![0.0; n_samples * filter.n_outputs()];
        let inputs = inputs.filter(n_samples, filter.n_outputs())?;
        Ok(Self { inner, filter, filtered, inputs, n_samples })
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
        let Some(inputs) = &mut self.inputs else {
            return self.inner.update(input, &self.filtered, next);
        };
        check("input", input, self.n_samples, inputs.n_inputs())?;
        let augmented = inputs.run(input, &self.filtered);
        self.inner.update(input, augmented, next)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        check_length("to_error", to_error, self.n_samples, self.filter.n_inputs())?;
        let to_filtered = match &mut self.inputs {
            None => &mut self.filtered,
            Some(inputs) => inputs.augmented_mut(),
        };
        if !self.inner.apply_adjoint(dual, to_input, to_filtered)? {
            return Ok(false);
        }
        if let Some(inputs) = &mut self.inputs {
            inputs.run_transposed(to_input, &mut self.filtered);
        }
        self.filter.run_transposed(&self.filtered, to_error);
        Ok(true)
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        let inputs = self.inputs.as_ref().map_or_else(String::new, |inputs| {
            let (input, change) = inputs.n_filtered();
            format!(r#""filtered_inputs":{input},"filtered_changes":{change},"#)
        });
        format!(
            r#"{{"law":"dynamic_norm_optimal","n_outputs":{},{inputs}"filtered":{}}}"#,
            self.filter.n_inputs(),
            self.inner.describe()
        )
    }
}
