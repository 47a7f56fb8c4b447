//! The two sweeps for any number of states, inputs and outputs.

use super::factor::{Gains, StageGains};
use super::{Channels, Run, Sweep};

/// The solver for coupled axes.
///
/// # Real Time
/// Cold path. Allocates when it is made, never in [`Sweep::solve`]; each sample costs about
/// `2 n^2 + 4 n m + 2 n p` multiply-adds.
#[derive(Debug)]
pub struct General {
    gains: Gains,
    channels: Channels,
    /// One `kappa` per sample and input.
    kappa: Vec<f64>,
    state: Vec<f64>,
    work: Vec<f64>,
    input: Vec<f64>,
    error: Vec<f64>,
}

impl General {
    /// Makes the solver for the given channels.
    pub fn new(gains: Gains, channels: Channels) -> Self {
        let n_states = gains.n_states();
        let (m, p) = (channels.inputs.len(), channels.outputs.len());
        Self {
            kappa: vec![0.0; gains.n_samples() * m],
            state: vec![0.0; n_states],
            work: vec![0.0; n_states],
            input: vec![0.0; m],
            error: vec![0.0; p],
            gains,
            channels,
        }
    }
}

impl Sweep for General {
    fn solve(&mut self, run: &mut Run) {
        let Self { gains, channels, kappa, state, work, input, error } = self;
        let m = channels.inputs.len();
        let last = gains.n_samples().saturating_sub(1);
        let gather = |k: usize, input: &mut [f64]| {
            for (value, channel) in input.iter_mut().zip(&channels.inputs) {
                *value = run.input[k * run.n_inputs + channel];
            }
        };

        state.fill(0.0);
        let mut k = gains.n_samples();
        for set in (0..gains.n_stored()).rev() {
            let (count, at) = gains.set(set);
            for _ in 0..count {
                k -= 1;
                gather(k, input);
                for (i, value) in error.iter_mut().enumerate() {
                    // Past the end of the run the weight is zero: any finite value will do.
                    let sample = (k + channels.shifts[i]).min(last);
                    *value = run.error[sample * run.n_outputs + channels.outputs[i]];
                }
                backward(at, state, input, error, &mut kappa[k * m..(k + 1) * m], work);
                std::mem::swap(state, work);
            }
        }

        state.fill(0.0);
        for set in 0..gains.n_stored() {
            let (count, at) = gains.set(set);
            for _ in 0..count {
                let kappa = &kappa[k * m..(k + 1) * m];
                gather(k, input);
                for (i, channel) in channels.inputs.iter().enumerate() {
                    let back: f64 = (0..state.len()).map(|j| at.feedback[(i, j)] * state[j]).sum();
                    run.next[k * run.n_inputs + channel] = input[i] + (kappa[i] - back);
                }
                for (i, value) in work.iter_mut().enumerate() {
                    let kept: f64 =
                        (0..state.len()).map(|j| at.transition[(i, j)] * state[j]).sum();
                    *value = kept + (0..m).map(|j| at.b[(i, j)] * kappa[j]).sum::<f64>();
                }
                std::mem::swap(state, work);
                k += 1;
            }
        }
    }
}

/// Writes `kappa_k` and, into `earlier`, `p_k`, from `costate = p_{k+1}`.
fn backward(
    at: &StageGains,
    costate: &[f64],
    input: &[f64],
    error: &[f64],
    kappa: &mut [f64],
    earlier: &mut [f64],
) {
    for (i, value) in kappa.iter_mut().enumerate() {
        let cost: f64 = (0..costate.len()).map(|j| at.costate[(i, j)] * costate[j]).sum();
        let pull: f64 = (0..error.len()).map(|j| at.error[(i, j)] * error[j]).sum();
        let hold: f64 = (0..input.len()).map(|j| at.input[(i, j)] * input[j]).sum();
        *value = cost + pull - hold;
    }
    for (i, value) in earlier.iter_mut().enumerate() {
        let cost: f64 = (0..costate.len()).map(|j| at.transition[(j, i)] * costate[j]).sum();
        let pull: f64 = (0..error.len()).map(|j| at.from_error[(i, j)] * error[j]).sum();
        let hold: f64 = (0..input.len()).map(|j| at.from_input[(i, j)] * input[j]).sum();
        *value = cost + pull + hold;
    }
}
