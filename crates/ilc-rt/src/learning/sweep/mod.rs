//! The linear-time solver of the tracking problem behind every norm-optimal law.
//!
//! One backward and one forward sweep along the run solve exactly the dense `N x N` system of the
//! textbooks; the laws under [`super::law`] describe their stages here and import nothing else.
//!
//! With `v_k` the change of the input, `x_k` the deviation it causes (`x_0 = 0`) and `e_k` the error
//! before it,
//!
//! `x_{k+1} = A x_k + B v_k`, `z_k = e_k - C x_k - D v_k`,
//!
//! `J = sum_k |z_k|^2_Q + |u_k + v_k|^2_S + |v_k|^2_R -> min`.
//!
//! [`Stages`] gives the matrices at each sample, [`Gains`] are the result of the backward Riccati
//! recursion (they depend on model and weights alone), and [`Sweep`] applies them to one run's
//! input and error without allocating.
//!
//! Family: `factor`, `recursion` and `square_root` are one backward sweep in its two forms.
//!
//! The sweeps take several samples at one step, whose gains `steps` multiplies out: `fixed` for sizes
//! known at compile time, `general` for any, and `single` for one axis in several segments at a time
//! (`lanes`). `varying` takes several segments at a time as well, sample by sample, each with gains of
//! its own.

mod cholesky;
mod factor;
mod fading;
mod fixed;
mod fixed_step;
mod general;
mod interleaved;
mod inverse;
mod lane_step;
mod lanes;
mod rate;
mod record;
mod recursion;
mod side_by_side;
mod single;
mod square_root;
mod stage;
mod steps;
mod tile;
mod varying;
mod varying_step;
pub(in crate::learning) mod wide;

pub use factor::{FactorError, Form, Gains};
pub use general::General;
pub use inverse::Inverse;
pub use rate::Rate;
pub use stage::{Stage, Stages};

use wide::Instructions;

/// Indices of a solver's signals among those of the whole machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channels {
    /// Index of each of its inputs.
    pub inputs: Vec<usize>,
    /// Index of each of its outputs.
    pub outputs: Vec<usize>,
    /// Delay of each output: samples until it first responds to an input.
    pub shifts: Vec<usize>,
}

/// The signals of one run, time first.
#[derive(Debug)]
pub struct Run<'a> {
    /// Input of the run, `n_samples` x `n_inputs`.
    pub input: &'a [f64],
    /// Its error, `n_samples` x `n_outputs`.
    pub error: &'a [f64],
    /// Input of the next run, `n_samples` x `n_inputs`, written by the sweep.
    pub next: &'a mut [f64],
    /// Inputs of the whole machine.
    pub n_inputs: usize,
    /// Outputs of the whole machine.
    pub n_outputs: usize,
}

/// Gains with their workspace: the two sweeps along a run.
pub trait Sweep: Send + std::fmt::Debug {
    /// Writes the next input of this solver's channels. The lengths in `run` must agree.
    ///
    /// # Real Time
    /// Cold path. Allocates nothing; `O(n_samples)`.
    fn solve(&mut self, run: &mut Run);
}

/// Returns the fastest solver for the given channels.
pub fn solver(gains: &Gains, stages: &impl Stages, channels: Channels) -> Box<dyn Sweep> {
    let how = Instructions::best();
    single::single(gains, &channels, how)
        .or_else(|| varying::varying(gains, stages, &channels, how))
        .unwrap_or_else(|| Box::new(General::new(gains, channels)))
}
