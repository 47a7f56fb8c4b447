//! Interface between the law and the solvers of its groups of axes.

use super::BoundsError;
use crate::learning::sweep::Run;

/// Limits of one kind of row along the run.
#[derive(Debug, Clone)]
pub(super) struct Band {
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// The largest finite limit as given by the user.
    pub(super) size: f64,
}

impl Band {
    /// Creates a band without limits.
    pub(super) fn open(count: usize) -> Self {
        Self { lower: vec![f64::NEG_INFINITY; count], upper: vec![f64::INFINITY; count], size: 0.0 }
    }

    /// Tightens the limits at a place; `size` is their magnitude as given.
    pub(super) fn narrow(&mut self, place: usize, lower: f64, upper: f64, size: f64) {
        self.lower[place] = self.lower[place].max(lower);
        self.upper[place] = self.upper[place].min(upper);
        self.size = self.size.max(size);
    }

    /// Returns the lower and the upper limit at a place.
    #[inline]
    pub(super) fn at(&self, place: usize) -> (f64, f64) {
        (self.lower[place], self.upper[place])
    }
}

/// The bounds of one group of axes.
///
/// `input` applies to the next input itself, `step` and `bend` to its first and second difference
/// (it is 0 before the run), `change` to its change from run to run, and `output`, shifted to the
/// sample of the input it responds to, to `-z`, the output minus its reference.
#[derive(Debug, Clone, Default)]
pub(super) struct Bands {
    pub(super) n_samples: usize,
    pub(super) input: Option<Band>,
    pub(super) change: Option<Band>,
    pub(super) step: Option<Band>,
    pub(super) bend: Option<Band>,
    pub(super) output: Option<Band>,
}

/// Places of the signals of a group among those of the machine.
#[derive(Debug, Clone)]
pub(super) struct Places {
    pub(super) inputs: Vec<usize>,
    pub(super) outputs: Vec<usize>,
    /// Delay of each output: samples until it first responds to an input.
    pub(super) shifts: Vec<usize>,
}

/// Outcome of a solution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outcome {
    pub(super) is_solved: bool,
    pub(super) iterations: usize,
    /// Remaining gap, relative to the cost.
    pub(super) gap: f64,
}

/// The bounded problem of one group of axes, with its workspace.
pub(super) trait Solver: Send + std::fmt::Debug {
    /// Solves for the next input and stores it. Does not allocate.
    fn solve(&mut self, run: &Run) -> Outcome;

    /// Writes the stored next input.
    fn write(&self, run: &mut Run);

    /// Returns the first sample at which bounds contradict each other for this run's input.
    fn conflict(&self, run: &Run) -> Option<BoundsError>;

    /// Forgets the last solution.
    fn forget(&mut self);
}
