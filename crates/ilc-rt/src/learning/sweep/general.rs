//! The two sweeps for any number of states, inputs and outputs.

use super::factor::Gains;
use super::record::Sizes;
use super::{Channels, Run, Sweep, fixed};

/// The solver for coupled axes, and for time-varying gains.
///
/// # Real Time
/// Cold path. Allocates at creation, never in [`Sweep::solve`]; each sample costs about
/// `(n + m)(n + p + m) + (n + m)(n + m)` multiply-adds.
#[derive(Debug, Clone)]
pub struct General {
    gains: Gains,
    channels: Channels,
    /// One `kappa` per sample and input.
    kappa: Vec<f64>,
    work: Vec<f64>,
}

impl General {
    /// Creates the solver for the given channels.
    pub fn new(gains: Gains, channels: Channels) -> Self {
        let Sizes { n, m, targets, .. } = gains.sizes();
        let (kappa, work) =
            (vec![0.0; gains.n_samples() * m], vec![0.0; 2 * (n + m) + targets + m]);
        Self { gains, channels, kappa, work }
    }

    /// Creates the solver for signals that consist of this problem's channels only: every input,
    /// and a target for every output that has one, already paired.
    pub fn alone(gains: Gains) -> Self {
        let channels = Channels {
            inputs: (0..gains.n_inputs()).collect(),
            outputs: (0..gains.n_targets()).collect(),
            shifts: vec![0; gains.n_targets()],
        };
        Self::new(gains, channels)
    }

    /// Returns the gains.
    pub fn gains(&self) -> &Gains {
        &self.gains
    }

    /// Returns the gains, for [`Gains::refactor`].
    pub fn gains_mut(&mut self) -> &mut Gains {
        &mut self.gains
    }

    /// [`Sweep::solve`] for any sizes.
    fn any(&mut self, run: &mut Run) {
        let Self { gains, channels, kappa, work } = self;
        let Sizes { n, m, targets: p, held, .. } = gains.sizes();
        let rows = n + m;
        let last = gains.n_samples().saturating_sub(1);
        let (state, rest) = work.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(rows);
        let (error, rest) = rest.split_at_mut(p);
        let input = &mut rest[..m];
        let (inputs, outputs) = (&channels.inputs[..m], &channels.outputs[..p]);
        let shifts = &channels.shifts[..p];

        state.fill(0.0);
        let mut k = gains.n_samples();
        for place in 0..gains.n_stored() {
            let (count, at) = gains.set(place);
            for _ in 0..count {
                k -= 1;
                for i in 0..p {
                    // Beyond the end of the run the weight is zero: any finite value will do.
                    let sample = (k + shifts[i]).min(last);
                    error[i] = run.error[sample * run.n_outputs + outputs[i]];
                }
                sum.fill(0.0);
                let mut columns = at.back[n * rows..].chunks_exact(rows);
                add(sum, &mut columns, error);
                if held > 0 {
                    let values = &run.input[k * run.n_inputs..(k + 1) * run.n_inputs];
                    for i in 0..m {
                        input[i] = values[inputs[i]];
                    }
                    add(sum, &mut columns, input);
                }
                add(sum, &mut at.back[..n * rows].chunks_exact(rows), state);
                state.copy_from_slice(&sum[..n]);
                kappa[k * m..(k + 1) * m].copy_from_slice(&sum[n..]);
            }
        }

        state.fill(0.0);
        for place in (0..gains.n_stored()).rev() {
            let (count, at) = gains.set(place);
            for _ in 0..count {
                let kappa = &kappa[k * m..(k + 1) * m];
                sum[..n].fill(0.0);
                sum[n..].copy_from_slice(kappa);
                add(&mut sum[..n], &mut at.fore[n * rows..].chunks_exact(n.max(1)), kappa);
                add(sum, &mut at.fore[..n * rows].chunks_exact(rows), state);
                state.copy_from_slice(&sum[..n]);
                for i in 0..m {
                    let index = k * run.n_inputs + inputs[i];
                    run.next[index] = run.input[index] + sum[n + i];
                }
                k += 1;
            }
        }
    }
}

/// Adds multiples of the columns.
#[inline]
fn add(sum: &mut [f64], columns: &mut std::slice::ChunksExact<f64>, factors: &[f64]) {
    for (factor, column) in factors.iter().zip(columns) {
        for (value, entry) in sum.iter_mut().zip(column) {
            *value += entry * factor;
        }
    }
}

impl Sweep for General {
    fn solve(&mut self, run: &mut Run) {
        if !fixed::solve(&self.gains, &self.channels, &mut self.kappa, run) {
            self.any(run);
        }
    }
}
