//! The problem whose outputs are all filtered signals: those of the error, of the input and of its change.

use nalgebra::DMatrix;

use crate::learning::Result;
use crate::learning::law::norm_optimal::{Cost, NormOptimal, Plant};
use crate::learning::weights::{Dynamic, ErrorFilter, FilteredInput, Weight};
use crate::model::{ModelError, StateSpace, TimeVarying};

/// Weights of the filtered input and of its filtered change.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InputWeights {
    /// Weight of the filtered next input.
    pub input: Option<FilteredInput>,
    /// Weight of the filtered change of the input.
    pub change: Option<FilteredInput>,
}

impl InputWeights {
    fn each(&self) -> impl Iterator<Item = (&'static str, &FilteredInput)> {
        let input = self.input.as_ref().map(|one| ("input_weight", one));
        let change = self.change.as_ref().map(|one| ("change_weight", one));
        input.into_iter().chain(change)
    }

    /// Returns the filters of whole runs behind the `n_error` filtered signals of the error.
    pub(super) fn filter(&self, n_samples: usize, n_error: usize) -> Result<Option<InputFilter>> {
        let Some((_, first)) = self.each().next() else { return Ok(None) };
        let n_inputs = first.filter().n_inputs();
        let filter = self.input.as_ref().map(FilteredInput::run_filter).transpose()?;
        let n_filtered = filter.as_ref().map_or(0, ErrorFilter::n_outputs);
        let n_changes = self.change.as_ref().map_or(0, FilteredInput::n_filtered);
        Ok(Some(InputFilter {
            filter,
            n_inputs,
            n_error,
            n_changes,
            filtered: vec![0.0; n_samples * n_filtered],
            to_input: vec![0.0; n_samples * n_inputs],
            augmented: vec![0.0; n_samples * (n_error + n_filtered + n_changes)],
        }))
    }
}

/// A plant with all filters behind it.
pub(super) struct Augmented<'a> {
    pub(super) plant: Plant<'a>,
    pub(super) dynamic: &'a Dynamic,
    pub(super) inputs: &'a InputWeights,
}

impl Augmented<'_> {
    /// Returns the weight of all outputs, with `q` that of the filtered error.
    pub(super) fn weight(&self, n_samples: usize, q: &Weight) -> Result<Weight> {
        let n_inputs = self.plant.at(0).n_inputs();
        for (what, one) in self.inputs.each() {
            one.check(what, n_samples, n_inputs)?;
        }
        let error = self.dynamic.weight(n_samples, q)?;
        let n_error = self.dynamic.error_filter().n_outputs();
        let mut parts = vec![(&error, n_error)];
        parts.extend(self.inputs.each().map(|(_, one)| (one.weight(), one.n_filtered())));
        Ok(Weight::beside(&parts, n_samples))
    }

    /// Returns the law of all outputs.
    pub(super) fn law(&self, n_samples: usize, cost: Cost) -> Result<NormOptimal> {
        if self.dynamic.is_constant() && self.plant.invariant().is_some() {
            return NormOptimal::new(&self.at(0)?, n_samples, cost);
        }
        let samples = (0..n_samples).map(|k| self.at(k)).collect::<Result<_, _>>()?;
        NormOptimal::new(&TimeVarying::new(samples)?, n_samples, cost)
    }

    /// Returns the model of all outputs at sample `k`.
    fn at(&self, k: usize) -> Result<StateSpace> {
        let mut all = self.plant.at(k).series(&self.dynamic.at(k)?)?;
        for (_, one) in self.inputs.each() {
            all = side_by_side(&all, one.filter())?;
        }
        Ok(all)
    }
}

/// Returns both models with the same input, the outputs of the first one first.
fn side_by_side(first: &StateSpace, second: &StateSpace) -> Result<StateSpace, ModelError> {
    let n_inputs = first.n_inputs();
    let twice = DMatrix::from_fn(2 * n_inputs, n_inputs, |row, col| {
        f64::from(u8::from(row % n_inputs == col))
    });
    StateSpace::static_gain(twice, first.dt_s())?.series(&first.append(second)?)
}

/// The errors of all outputs: the filtered error, `-F_u u`, and 0 for the filtered change.
#[derive(Debug)]
pub(super) struct InputFilter {
    filter: Option<ErrorFilter>,
    n_inputs: usize,
    n_error: usize,
    n_changes: usize,
    filtered: Vec<f64>,
    to_input: Vec<f64>,
    augmented: Vec<f64>,
}

impl InputFilter {
    pub(super) fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Returns the numbers of filtered inputs and of filtered changes.
    pub(super) fn n_filtered(&self) -> (usize, usize) {
        (self.filter.as_ref().map_or(0, ErrorFilter::n_outputs), self.n_changes)
    }

    pub(super) fn augmented_mut(&mut self) -> &mut [f64] {
        &mut self.augmented
    }

    /// Returns the errors of all outputs; those of the filtered change stay 0.
    pub(super) fn run(&mut self, input: &[f64], error: &[f64]) -> &[f64] {
        let (n_filtered, n_changes) = self.n_filtered();
        if let Some(filter) = &mut self.filter {
            filter.run(input, &mut self.filtered);
        }
        let n_all = self.n_error + n_filtered + n_changes;
        for (k, all) in self.augmented.chunks_exact_mut(n_all).enumerate() {
            let (to_error, others) = all.split_at_mut(self.n_error);
            to_error.copy_from_slice(&error[k * self.n_error..(k + 1) * self.n_error]);
            let (to_input, to_change) = others.split_at_mut(n_filtered);
            let filtered = &self.filtered[k * n_filtered..(k + 1) * n_filtered];
            to_input.iter_mut().zip(filtered).for_each(|(to, value)| *to = -value);
            to_change.fill(0.0);
        }
        &self.augmented
    }

    /// Applies the adjoint of [`InputFilter::run`] to the augmented signal: overwrites `error`, and adds to `input`.
    pub(super) fn run_transposed(&mut self, input: &mut [f64], error: &mut [f64]) {
        let (n_filtered, n_changes) = self.n_filtered();
        let n_all = self.n_error + n_filtered + n_changes;
        for (k, all) in self.augmented.chunks_exact(n_all).enumerate() {
            let (of_error, others) = all.split_at(self.n_error);
            error[k * self.n_error..(k + 1) * self.n_error].copy_from_slice(of_error);
            self.filtered[k * n_filtered..(k + 1) * n_filtered]
                .copy_from_slice(&others[..n_filtered]);
        }
        if let Some(filter) = &mut self.filter {
            filter.run_transposed(&self.filtered, &mut self.to_input);
            input.iter_mut().zip(&self.to_input).for_each(|(to, value)| *to -= value);
        }
    }
}
