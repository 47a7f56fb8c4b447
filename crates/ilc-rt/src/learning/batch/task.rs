//! Plants, reference and circumstances of the runs, and the figures they give.

use thiserror::Error;

use super::Laws;
use crate::learning::LearningError;
use crate::model::StateSpace;

/// Runs of many plants.
///
/// `y[j] = P(u[j]) + d[j] + n[j]`, `e[j] = r - y[j]`, `u[j+1] = law(u[j], e[j])`, from rest in every run.
///
/// # Shapes
/// - signals time first: `reference` has `n_samples` x `n_outputs`, `initial_input` `n_samples` x `n_inputs`
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// Discrete plants with as many inputs and outputs as each other.
    pub plants: &'a [StateSpace],
    /// Reference r of all plants.
    pub reference: &'a [f64],
    /// Input of the first run.
    pub initial_input: &'a [f64],
    /// Samples of a run.
    pub n_samples: usize,
    /// Runs of each plant.
    pub trials: usize,
    /// Disturbance d of the output: none, one for all runs, or one for each.
    pub output_disturbance: &'a [Vec<f64>],
    /// Measured disturbances for the laws: none, or those of each run.
    pub disturbance: &'a [Vec<f64>],
    /// Standard deviation of the white noise n.
    pub noise_std: f64,
    /// Seed of each plant's noise; its run `j` has the key `(j, 0)`. Not used without noise.
    pub seeds: &'a [u64],
    /// Number of last runs whose errors are kept, and whose inputs are.
    pub kept: [usize; 2],
}

/// Figures of all runs, plant by plant; infinite from the run on in which a plant's error is above 1e140 or not a
/// number, or its law overflows.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// RMS over time of the Euclidean norm of the error, `n_plants` x `trials`.
    pub rms: Vec<f64>,
    /// Largest absolute error, `n_plants` x `trials`.
    pub inf: Vec<f64>,
    /// Errors of the last runs, `n_plants` x `kept[0]` x `n_samples` x `n_outputs`.
    pub errors: Vec<f64>,
    /// Inputs of the last runs, `n_plants` x `kept[1]` x `n_samples` x `n_inputs`.
    pub inputs: Vec<f64>,
}

/// A refused task, or a law that refuses a run.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum BatchError {
    /// A list or signal of the wrong length.
    #[error("{what} has {found} entries; {needed} are needed")]
    Length {
        /// Its name.
        what: &'static str,
        /// Entries given.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// A plant that does not match the first.
    #[error("plant {plant} {reason}")]
    Plant {
        /// Its index.
        plant: usize,
        /// Its fault, and what is needed.
        reason: String,
    },
    /// A law that refuses a run for another reason than numbers that are too large.
    #[error("plant {plant}, trial {trial}: {error}")]
    Law {
        /// Index of the plant.
        plant: usize,
        /// Run that it learned from.
        trial: usize,
        /// Its reason.
        error: LearningError,
    },
}

impl Task<'_> {
    /// Returns the numbers of inputs and outputs.
    pub(super) fn channels(&self) -> (usize, usize) {
        self.plants.first().map_or((0, 0), |plant| (plant.n_inputs(), plant.n_outputs()))
    }

    /// Refuses what does not fit together.
    pub(super) fn check(&self, laws: &Laws) -> Result<(), BatchError> {
        let (n_inputs, n_outputs) = self.channels();
        for (number, plant) in self.plants.iter().enumerate() {
            let found = (plant.n_inputs(), plant.n_outputs());
            let reason = if plant.dt_s().is_none() {
                "is in continuous time: discretize it first".to_owned()
            } else if n_inputs * n_outputs == 0 {
                "has no input or no output".to_owned()
            } else if found != (n_inputs, n_outputs) {
                let needed = format!("{n_inputs} and {n_outputs} are needed, as plant 0 has");
                format!("has {} inputs and {} outputs; {needed}", found.0, found.1)
            } else {
                continue;
            };
            return Err(BatchError::Plant { plant: number, reason });
        }
        let (n_plants, n_values) = (self.plants.len(), self.n_samples * n_outputs);
        let optional = |found: usize, needed: usize| if found == 0 { 0 } else { needed };
        let seeds = if self.noise_std > 0.0 { n_plants } else { self.seeds.len() };
        let lists = self.output_disturbance.len();
        let mut lengths = vec![
            ("reference", self.reference.len(), n_values),
            ("initial_input", self.initial_input.len(), self.n_samples * n_inputs),
            ("seeds", self.seeds.len(), seeds),
            ("disturbance", self.disturbance.len(), optional(self.disturbance.len(), self.trials)),
            ("output_disturbance", lists, if lists <= 1 { lists } else { self.trials }),
            ("law", laws.len(), optional(laws.len(), n_plants)),
        ];
        let added = self.output_disturbance.iter();
        lengths.extend(added.map(|added| ("output_disturbance", added.len(), n_values)));
        match lengths.into_iter().find(|(_, found, needed)| found != needed) {
            Some((what, found, needed)) => Err(BatchError::Length { what, found, needed }),
            None => Ok(()),
        }
    }
}
