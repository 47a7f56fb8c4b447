//! Trial loop of a group of plants, which are simulated side by side and learn one after the other.

use std::sync::atomic::{AtomicBool, Ordering};

use super::lanes::{Abreast, LANES, Signals, silence};
use super::{BatchError, Laws, Task, figures};
use crate::interrupt;
use crate::learning::{Law, LearningError};
use crate::model::{ModelError, StateSpace};
use crate::signal::{SignalError, WhiteNoise};

/// Largest error whose square sums still are numbers.
const LARGEST: f64 = 1e140;

/// A plant's index and the places of its figures, which are infinite before.
#[derive(Debug)]
pub(super) struct Case<'a> {
    pub(super) plant: usize,
    pub(super) rms: &'a mut [f64],
    pub(super) inf: &'a mut [f64],
    pub(super) errors: &'a mut [f64],
    pub(super) inputs: &'a mut [f64],
}

/// Workspace of a thread.
#[derive(Debug)]
pub(super) struct Bench {
    inputs: Signals,
    nexts: Signals,
    outputs: Signals,
    error: Vec<f64>,
    squares: Vec<f64>,
}

impl Bench {
    pub(super) fn new(task: &Task) -> Self {
        let (n_inputs, n_outputs) = task.channels();
        Self {
            inputs: silence(task.n_samples, n_inputs),
            nexts: silence(task.n_samples, n_inputs),
            outputs: silence(task.n_samples, n_outputs),
            error: vec![0.0; task.n_samples * n_outputs],
            squares: vec![0.0; task.n_samples],
        }
    }

    /// Makes all runs of a group of at most eight plants of the same shape; ends early if `is_over`.
    pub(super) fn learn(
        &mut self,
        task: &Task,
        laws: &Laws,
        group: &mut [Case],
        is_over: &AtomicBool,
    ) -> Result<(), BatchError> {
        let plants: Vec<&StateSpace> = group.iter().map(|case| &task.plants[case.plant]).collect();
        let mut abreast = Abreast::new(&plants);
        for input in &mut self.inputs {
            input.fill(0.0);
            input[..task.initial_input.len()].copy_from_slice(task.initial_input);
        }
        let mut learners = group.iter().map(|case| laws.take(case.plant)).collect::<Vec<_>>();
        for law in learners.iter_mut().flatten() {
            law.reset();
            if let Some(told) = task.disturbance.first() {
                law.set_disturbance(told);
            }
        }
        let mut learning = [true; LANES];
        for trial in 0..task.trials {
            if is_over.load(Ordering::Relaxed) || !learning[..group.len()].contains(&true) {
                break;
            }
            abreast.simulate(&self.inputs, &mut self.outputs);
            for (lane, case) in group.iter_mut().enumerate() {
                interrupt::point();
                if !learning[lane] {
                    continue;
                }
                learning[lane] = self.measure(task, trial, lane, case)
                    && self.update(task, trial, lane, case.plant, learners[lane].as_deref_mut())?;
                if !learning[lane] {
                    self.inputs[lane].fill(0.0);
                }
            }
        }
        for (case, law) in group.iter().zip(learners) {
            if let Some(law) = law {
                laws.put(case.plant, law);
            }
        }
        Ok(())
    }

    /// Writes error and figures of a run; returns false if they are not finite.
    fn measure(&mut self, task: &Task, trial: usize, lane: usize, case: &mut Case) -> bool {
        let Self { inputs, outputs, error, squares, .. } = self;
        let (n_inputs, n_outputs) = task.channels();
        let output = &mut outputs[lane][..error.len()];
        match task.output_disturbance {
            // As NumPy, which adds a 0 and so has no negative one.
            [] => output.iter_mut().for_each(|y| *y += 0.0),
            [all] => output.iter_mut().zip(all).for_each(|(y, added)| *y += added),
            each => output.iter_mut().zip(&each[trial]).for_each(|(y, added)| *y += added),
        }
        if task.noise_std > 0.0 {
            let run = u32::try_from(trial).unwrap_or(u32::MAX);
            let mut noise = WhiteNoise::new(task.seeds[case.plant], &[run, 0]);
            for y in output.iter_mut() {
                *y += task.noise_std * noise.draw();
            }
        }
        for ((error, reference), y) in error.iter_mut().zip(task.reference).zip(output) {
            *error = reference - *y;
        }
        let largest = figures::largest(error);
        if largest > LARGEST {
            return false;
        }
        case.inf[trial] = largest;
        case.rms[trial] = figures::rms(error, n_outputs, squares);
        let input = &inputs[lane][..task.n_samples * n_inputs];
        for (signal, kept) in [(&error[..], &mut *case.errors), (input, &mut *case.inputs)] {
            // The last places are those of the last run.
            let after = (task.trials - 1 - trial) * signal.len();
            if let Some(end) = kept.len().checked_sub(after).filter(|end| *end > 0) {
                kept[end - signal.len()..end].copy_from_slice(signal);
            }
        }
        true
    }

    /// Computes the input of the run after this one, if there is one; returns false if it overflows.
    fn update(
        &mut self,
        task: &Task,
        trial: usize,
        lane: usize,
        plant: usize,
        law: Option<&mut (dyn Law + 'static)>,
    ) -> Result<bool, BatchError> {
        let Some(law) = law.filter(|_| trial + 1 < task.trials) else { return Ok(true) };
        if let Some(told) = task.disturbance.get(trial + 1) {
            law.set_disturbance(told);
        }
        let n_values = task.initial_input.len();
        let (input, next) = (&mut self.inputs[lane], &mut self.nexts[lane]);
        match law.update(&input[..n_values], &self.error, &mut next[..n_values]) {
            Ok(()) => {
                std::mem::swap(input, next);
                Ok(true)
            }
            Err(
                LearningError::NotFinite { .. }
                | LearningError::Signal(SignalError::Overflow { .. })
                | LearningError::Model(ModelError::Overflow { .. }),
            ) => Ok(false),
            Err(error) => Err(BatchError::Law { plant, trial, error }),
        }
    }
}
