//! The inverse Hessian of a tracking problem and the adjoint of its update.

use std::ops::Range;

use nalgebra::DMatrix;

use super::factor::{FactorError, Gains};
use super::general::General;
use super::{Channels, Run, Stage, Stages, Sweep};

/// Weight of the targets that carry a right-hand side into the recursion: a power of two, so that
/// multiplication and division are exact, and too small to change any weight.
const TINY: f64 = 1.0 / (1_u128 << 100) as f64 / (1_u128 << 100) as f64;

/// The problem whose solution is `H^-1 g`, with `H` the Hessian of another problem.
///
/// `m` targets of weight [`TINY`] on the change itself precede the outputs, which become penalties
/// with target 0: with `g / TINY` as target the recursion reads `g` as linear term. The same weight
/// is subtracted from the effort, so that what costs nothing still costs nothing.
struct Solving<'a>(&'a dyn Stages);

impl Stages for Solving<'_> {
    fn n_samples(&self) -> usize {
        self.0.n_samples()
    }

    fn n_targets(&self) -> usize {
        self.0.stage(0).n_inputs()
    }

    fn stage(&self, k: usize) -> Stage {
        let Stage { a, b, c, d, q, s, mut r } = self.0.stage(k);
        let (m, p, n) = (b.ncols(), c.nrows(), a.nrows());
        let below = |rows: &DMatrix<f64>, cols: usize| {
            let mut grown = DMatrix::zeros(p + m, cols);
            grown.view_mut((m, 0), (p, cols)).copy_from(rows);
            grown
        };
        let (c, mut d) = (below(&c, n), below(&d, m));
        let mut weights = DMatrix::zeros(p + m, p + m);
        weights.view_mut((m, m), (p, p)).copy_from(&q);
        for i in 0..m {
            d[(i, i)] = 1.0;
            weights[(i, i)] = TINY;
            r[(i, i)] -= TINY;
        }
        Stage { a, b, c, d, q: weights, s, r }
    }

    fn constant(&self) -> Range<usize> {
        self.0.constant()
    }

    fn holds_input(&self) -> bool {
        false
    }

    fn has_constant_plant(&self) -> bool {
        false
    }
}

/// The inverse Hessian of a tracking problem, and the adjoint of its update.
///
/// The change that a problem asks for is `v = H^-1 (P'Q e - S u)`, `H = P'QP + S + R` plus its
/// penalties. So with `z = H^-1 x` the adjoint of `u + v` is `x - S z` towards the input and `Q P
/// z` towards the error.
///
/// # Real Time
/// Cold path; `O(n_samples)` per product.
pub struct Inverse {
    stages: Box<dyn Stages + Send>,
    solver: General,
    channels: Channels,
    stage: Stage,
    right: Vec<f64>,
    zero: Vec<f64>,
    solution: Vec<f64>,
    state: Vec<f64>,
    next: Vec<f64>,
}

impl std::fmt::Debug for Inverse {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Inverse").field("channels", &self.channels).finish_non_exhaustive()
    }
}

impl Inverse {
    /// Factorises the Hessian of a problem; `free_samples` as in [`Gains::new`].
    ///
    /// # Errors
    /// - as [`Gains::new`].
    pub fn new(
        stages: Box<dyn Stages + Send>,
        channels: Channels,
        free_samples: usize,
    ) -> Result<Self, FactorError> {
        let solver = General::alone(&Gains::new(&Solving(&*stages), free_samples)?);
        let stage = stages.stage(0);
        let (n, size) = (stage.n_states(), stages.n_samples() * stage.n_inputs());
        Ok(Self {
            stages,
            solver,
            channels,
            stage,
            right: vec![0.0; size],
            zero: vec![0.0; size],
            solution: vec![0.0; size],
            state: vec![0.0; n],
            next: vec![0.0; n],
        })
    }

    /// Writes `H^-1 x` for this problem's channels of a machine with `n_inputs` inputs.
    pub fn solve(&mut self, x: &[f64], z: &mut [f64], n_inputs: usize) {
        self.solve_own(x, n_inputs);
        let m = self.channels.inputs.len();
        for (own, whole) in self.solution.chunks_exact(m).zip(z.chunks_exact_mut(n_inputs)) {
            for (value, input) in own.iter().zip(&self.channels.inputs) {
                whole[*input] = *value;
            }
        }
    }

    fn solve_own(&mut self, x: &[f64], n_inputs: usize) {
        let m = self.channels.inputs.len();
        for (own, whole) in self.right.chunks_exact_mut(m).zip(x.chunks_exact(n_inputs)) {
            for (value, input) in own.iter_mut().zip(&self.channels.inputs) {
                *value = whole[*input] / TINY;
            }
        }
        self.solver.solve(&mut Run {
            input: &self.zero,
            error: &self.right,
            next: &mut self.solution,
            n_inputs: m,
            n_outputs: m,
        });
    }

    /// Writes the adjoint's share of this problem's inputs to `to_input`, and adds that of its
    /// outputs to `to_error`, for a machine with the given numbers of inputs and outputs.
    pub fn transposed(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
        (n_inputs, n_outputs): (usize, usize),
    ) {
        self.solve_own(dual, n_inputs);
        let Self { stages, channels, stage, solution, state, next, .. } = self;
        let (m, p) = (channels.inputs.len(), channels.outputs.len());
        let mut output = vec![0.0; p];
        state.fill(0.0);
        let constant = stages.constant();
        for k in 0..stages.n_samples() {
            if !constant.contains(&k) || k == constant.start {
                stages.stage_into(k, stage);
            }
            let change = &solution[k * m..(k + 1) * m];
            for (i, input) in channels.inputs.iter().enumerate() {
                let held: f64 = (0..m).map(|j| stage.s[(i, j)] * change[j]).sum();
                to_input[k * n_inputs + input] = dual[k * n_inputs + input] - held;
            }
            for (row, value) in output.iter_mut().enumerate() {
                *value = product(&stage.c, row, state) + product(&stage.d, row, change);
            }
            for (row, (channel, shift)) in channels.outputs.iter().zip(&channels.shifts).enumerate()
            {
                if k + shift < stages.n_samples() {
                    to_error[(k + shift) * n_outputs + channel] +=
                        (0..p).map(|col| stage.q[(row, col)] * output[col]).sum::<f64>();
                }
            }
            for (row, value) in next.iter_mut().enumerate() {
                *value = product(&stage.a, row, state) + product(&stage.b, row, change);
            }
            std::mem::swap(state, next);
        }
    }
}

fn product(matrix: &DMatrix<f64>, row: usize, signal: &[f64]) -> f64 {
    signal.iter().enumerate().map(|(col, value)| matrix[(row, col)] * value).sum()
}
