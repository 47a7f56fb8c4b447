//! The tracking problem, stage by stage.

use std::ops::Range;

use nalgebra::DMatrix;

/// The matrices of one sample.
///
/// # Shapes
/// - `a` (n, n), `b` (n, m), `c` (p, n), `d` (p, m), `q` (p, p), `s` and `r` (m, m); `q`, `s` and
///   `r` symmetric and positive semidefinite
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// State transition.
    pub a: DMatrix<f64>,
    /// Effect of the input's change on the next state.
    pub b: DMatrix<f64>,
    /// Effect of the state on the error.
    pub c: DMatrix<f64>,
    /// Direct effect of the input's change on the error.
    pub d: DMatrix<f64>,
    /// Weight of the error.
    pub q: DMatrix<f64>,
    /// Weight of the input.
    pub s: DMatrix<f64>,
    /// Weight of the input's change.
    pub r: DMatrix<f64>,
}

impl Stage {
    /// Returns the number of states.
    pub fn n_states(&self) -> usize {
        self.a.nrows()
    }

    /// Returns the number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.b.ncols()
    }

    /// Returns the number of outputs, including those of penalties.
    pub fn n_outputs(&self) -> usize {
        self.c.nrows()
    }
}

/// A tracking problem: its stages along the run.
///
/// All stages of a problem have the same shapes.
pub trait Stages {
    /// Returns the number of samples of a run.
    fn n_samples(&self) -> usize;

    /// Returns the number of outputs that have a target; further rows of `c` are penalties with
    /// target 0.
    fn n_targets(&self) -> usize;

    /// Returns the matrices at sample `k`.
    fn stage(&self, k: usize) -> Stage;

    /// Overwrites `stage`, one of this problem's, with the matrices at sample `k`.
    ///
    /// Implement this without allocation for repeated factorisation; by default it replaces the
    /// stage.
    fn stage_into(&self, k: usize, stage: &mut Stage) {
        *stage = self.stage(k);
    }

    /// Overwrites the weights in `stage`, which holds the matrices of another sample, with those of
    /// sample `k`; called only if the plant is [constant](Stages::has_constant_plant).
    ///
    /// By default it overwrites everything.
    fn weights_into(&self, k: usize, stage: &mut Stage) {
        self.stage_into(k, stage);
    }

    /// Returns a range of samples at which all stages are equal; empty if there is none.
    fn constant(&self) -> Range<usize>;

    /// Returns true if the input itself has a cost at any sample: some `s` is non-zero.
    fn holds_input(&self) -> bool {
        true
    }

    /// Returns true if `a`, `b`, and the rows of `c` and `d` with a target are the same at every
    /// sample, so that only weights and penalties vary.
    fn has_constant_plant(&self) -> bool {
        self.constant() == (0..self.n_samples())
    }

    /// Returns true if the last states, one per input, are its last change, on which nothing but
    /// penalties depends.
    fn remembers_change(&self) -> bool {
        false
    }
}

impl<S: Stages + ?Sized> Stages for &S {
    fn n_samples(&self) -> usize {
        (**self).n_samples()
    }

    fn n_targets(&self) -> usize {
        (**self).n_targets()
    }

    fn stage(&self, k: usize) -> Stage {
        (**self).stage(k)
    }

    fn stage_into(&self, k: usize, stage: &mut Stage) {
        (**self).stage_into(k, stage);
    }

    fn weights_into(&self, k: usize, stage: &mut Stage) {
        (**self).weights_into(k, stage);
    }

    fn constant(&self) -> Range<usize> {
        (**self).constant()
    }

    fn holds_input(&self) -> bool {
        (**self).holds_input()
    }

    fn has_constant_plant(&self) -> bool {
        (**self).has_constant_plant()
    }

    fn remembers_change(&self) -> bool {
        (**self).remembers_change()
    }
}
