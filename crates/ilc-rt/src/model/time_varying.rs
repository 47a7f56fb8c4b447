//! Linear time-varying (LTV) models, e.g. linearised along a motion.

use nalgebra::DVector;

use super::{ModelError, StateSpace};

/// A linear time-varying model over the samples of one run.
///
/// `x[k+1] = A[k] x[k] + B[k] u[k]`, `y[k] = C[k] x[k] + D[k] u[k]`
///
/// # Shapes
/// - one model per sample, all of the same sizes and sample time
/// # Units
/// - sample time in seconds; inputs and outputs in the units of the axis (SI)
#[derive(Debug, Clone, PartialEq)]
pub struct TimeVarying {
    samples: Vec<StateSpace>,
}

impl TimeVarying {
    /// Creates a model from one discrete model per sample.
    ///
    /// # Errors
    /// - [`ModelError::Length`] for an empty list.
    /// - [`ModelError::Continuous`] if one is continuous.
    /// - [`ModelError::AtSample`] if one has a different size or sample time than the first.
    pub fn new(samples: Vec<StateSpace>) -> Result<Self, ModelError> {
        let Some(first) = samples.first() else {
            return Err(ModelError::Length {
                what: "samples",
                found: 0,
                allowed: "one model for each sample of the run is needed".to_owned(),
            });
        };
        let dt_s = first.sampled("a time-varying model")?;
        for (sample, model) in samples.iter().enumerate() {
            let found = model.sampled("a time-varying model")?;
            if found.to_bits() != dt_s.to_bits() {
                let source = ModelError::TimeMismatch {
                    action: "string together",
                    first: format!("{dt_s} s"),
                    second: format!("{found} s"),
                };
                return Err(ModelError::AtSample { sample, source: Box::new(source) });
            }
            let pairs = [
                ("a", first.a().shape(), model.a().shape()),
                ("b", first.b().shape(), model.b().shape()),
                ("c", first.c().shape(), model.c().shape()),
                ("d", first.d().shape(), model.d().shape()),
            ];
            for (matrix, (rows, cols), (found_rows, found_cols)) in pairs {
                if (rows, cols) != (found_rows, found_cols) {
                    let source = ModelError::Shape { matrix, rows, cols, found_rows, found_cols };
                    return Err(ModelError::AtSample { sample, source: Box::new(source) });
                }
            }
        }
        Ok(Self { samples })
    }

    /// Returns the model at one sample.
    ///
    /// # Panics
    /// If `k` is beyond the end of the run.
    pub fn at(&self, k: usize) -> &StateSpace {
        &self.samples[k]
    }

    /// Returns the models of all samples.
    pub fn samples(&self) -> &[StateSpace] {
        &self.samples
    }

    /// Returns the number of samples of the run.
    pub fn n_samples(&self) -> usize {
        self.samples.len()
    }

    /// Returns the number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.samples[0].n_inputs()
    }

    /// Returns the number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.samples[0].n_outputs()
    }

    /// Returns the number of states.
    pub fn n_states(&self) -> usize {
        self.samples[0].n_states()
    }

    /// Returns the sample time in seconds.
    pub fn dt_s(&self) -> Option<f64> {
        self.samples[0].dt_s()
    }

    /// Returns the output for an input and an initial state.
    ///
    /// # Shapes
    /// - `input`: `n_samples` x `n_inputs`, time first; `x0`: `n_states` (zero if `None`); the
    ///   result: `n_samples` x `n_outputs`, time first
    /// # Errors
    /// - [`ModelError::Length`] if `input` or `x0` does not match.
    /// - [`ModelError::Overflow`] if the output overflows.
    pub fn simulate(&self, input: &[f64], x0: Option<&[f64]>) -> Result<Vec<f64>, ModelError> {
        let (n, m) = (self.n_states(), self.n_inputs());
        let (n_samples, found) = (self.n_samples(), input.len());
        if found != n_samples * m {
            let allowed = format!("{n_samples} samples of {m} channels are needed");
            return Err(ModelError::Length { what: "input", found, allowed });
        }
        let mut x = DVector::zeros(n);
        if let Some(x0) = x0 {
            if x0.len() != n {
                let allowed = format!("one value for each of the {n} states is needed");
                return Err(ModelError::Length { what: "x0", found: x0.len(), allowed });
            }
            x.copy_from_slice(x0);
        }
        let mut output = Vec::with_capacity(n_samples * self.n_outputs());
        for (k, model) in self.samples.iter().enumerate() {
            crate::interrupt::point();
            let u = DVector::from_column_slice(&input[k * m..(k + 1) * m]);
            output.extend_from_slice((model.c() * &x + model.d() * &u).as_slice());
            x = model.a() * &x + model.b() * &u;
        }
        if output.iter().all(|value| value.is_finite()) {
            Ok(output)
        } else {
            Err(ModelError::Overflow { what: "the simulated output" })
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn gain(value: f64, dt_s: f64) -> StateSpace {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        StateSpace::discrete(one(0.5), one(1.0), one(value), one(0.0), dt_s).unwrap()
    }

    #[test]
    fn each_sample_has_its_own_matrices() {
        let model =
            TimeVarying::new(vec![gain(1.0, 1.0), gain(2.0, 1.0), gain(10.0, 1.0)]).unwrap();
        // x = 0, 1, 0.5.
        assert_eq!(model.simulate(&[1.0, 0.0, 0.0], None).unwrap(), [0.0, 2.0, 5.0]);
        assert_eq!(model.simulate(&[0.0; 3], Some(&[4.0])).unwrap(), [4.0, 4.0, 10.0]);
    }

    #[test]
    fn each_misfit_is_named() {
        let case = |samples| TimeVarying::new(samples).unwrap_err().to_string();
        assert!(case(Vec::new()).contains("0 values"));
        assert!(case(vec![gain(1.0, 1.0), gain(1.0, 2.0)]).contains("at sample 1: "));
        let wide = StateSpace::static_gain(DMatrix::zeros(1, 2), Some(1.0)).unwrap();
        assert!(case(vec![gain(1.0, 1.0), wide]).contains("at sample 1: matrix a"));
        let model = TimeVarying::new(vec![gain(1.0, 1.0); 2]).unwrap();
        assert!(model.simulate(&[0.0; 3], None).is_err());
        assert!(model.simulate(&[0.0; 2], Some(&[0.0; 2])).is_err());
    }
}
