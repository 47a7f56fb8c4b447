//! Disturbance- and performance-weighted ILC (DPW-ILC): the next input from all past runs, each
//! weighted by the similarity of its disturbance and the size of its error.

mod index;
mod parameters;
#[cfg(test)]
mod proof;
mod proposals;
mod shares;
mod shelved;
mod weights;

use std::fmt;

use super::expectation::{Expectation, check as check_disturbance};
use crate::learning::error::{check, check_learns_from_every_run};
use crate::learning::{Law, LearningError, Result, Surrogate};

use index::{DISTURBANCES_MAX, Index, index};
use proposals::Proposals;
use weights::normalise;

pub use parameters::RelevanceParameters;
pub use proposals::{Each, Shelf};
pub(crate) use shares::shares;
pub use weights::RelevanceWeights;

/// Size of the runs that a [`Relevance`] law learns from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunShape {
    /// Samples of a run.
    pub n_samples: usize,
    /// Channels of the input.
    pub n_inputs: usize,
    /// Channels of the error.
    pub n_outputs: usize,
    /// Number of disturbances of a run; 0 to 7.
    pub n_disturbances: usize,
    /// Sample time.
    pub dt_s: f64,
}

/// DPW-ILC: learning from every past run, weighted by its relevance for the coming one.
///
/// `u_i = sum_j w_j (Gamma_2 u_j + Gamma_1 (L(u_j, e_j) - u_j))`, `w_j = N_j / sum_k N_k`
///
/// with `N_j` the relevance ([`RelevanceWeights`]) and `L` the core law: its proposal after a run
/// depends on that run alone, so it is computed once and only the proposal is stored. With both
/// gains 1 the next input is the weighted mean of all proposals. With `top` the sum and the weights
/// run over the `top` most relevant runs only, exactly those of a search through all; of equally
/// relevant ones the older.
///
/// The disturbance of each run is set before it ([`Law::set_disturbance`]), including the first
/// one. A run without a disturbance is not stored; a single stored run has weight 1.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`; disturbance:
///   `n_disturbances`
/// # Real Time
/// Cold path. `O(n_samples top + log n_runs)`, or `O(n_samples n_runs)` without `top`. An update
/// allocates nothing up to the number of runs given to [`Relevance::with_capacity`], as long as they
/// are searched one by one (512 runs, or any number without `top`). Beyond, it allocates for what is
/// kept (a block of about a megabyte at a time, never moved by growth) and for the tree over the runs
/// (rebuilt after about `4 sqrt(n_runs)` of them, and a list of `top` numbers a search).
/// # Source
/// - \[dimarco2016\], Eq. (4.2) to (4.14), Appendix C. The listing computes the sum over all runs
///   again after each; `top` and [`Relevance::trim`] are its future work (Sec. 5.1).
pub struct Relevance {
    core: Box<dyn Law>,
    shape: RunShape,
    weights: RelevanceWeights,
    top: Option<usize>,
    told: Expectation,
    /// Remembered runs may arrive again as new runs.
    is_replayed: bool,
    proposals: Proposals,
    disturbances: Vec<f64>,
    index: Box<dyn Index>,
    proposal: Vec<f64>,
    /// Proposal of a run from the shelf.
    spare: Vec<f64>,
    found: Vec<(usize, f64)>,
    sums: Vec<f64>,
}

impl Relevance {
    /// Creates the law around a core law, with an empty memory.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] for 0 samples or channels, or `top` = 0.
    /// - [`LearningError::Parameter`] for a weight or a sample time out of its range, or more than 7
    ///   disturbances; [`LearningError::Disturbance`] for the wrong number of disturbance weights.
    /// - [`LearningError::Measures`] for a core law that makes runs which only measure.
    pub fn new(
        core: Box<dyn Law>,
        shape: RunShape,
        weights: RelevanceWeights,
        top: Option<usize>,
    ) -> Result<Self> {
        check_learns_from_every_run("relevance", &core)?;
        let RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s } = shape;
        for (what, count) in [
            ("n_samples", n_samples),
            ("n_inputs", n_inputs),
            ("n_outputs", n_outputs),
            ("top", top.unwrap_or(1)),
        ] {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        if !(dt_s.is_finite() && dt_s > 0.0) {
            let allowed = "a sample time must be finite and above 0";
            return Err(LearningError::Parameter { what: "dt_s", value: dt_s, allowed });
        }
        let Some(index) = index(n_samples, n_disturbances) else {
            let allowed = "at most 7 disturbances can describe a run";
            let (what, value) = ("n_disturbances", n_disturbances as f64);
            return Err(LearningError::Parameter { what, value, allowed });
        };
        let weights = weights.spread(n_disturbances)?;
        let length = n_samples * n_inputs;
        Ok(Self {
            core,
            shape,
            weights,
            top,
            told: Expectation::new(n_disturbances),
            is_replayed: false,
            proposals: Proposals::new(length),
            disturbances: Vec::new(),
            index,
            proposal: vec![0.0; length],
            spare: Vec::new(),
            found: Vec::new(),
            sums: Vec::new(),
        })
    }

    /// Reserves space for `n_runs`, so that storing them does not allocate.
    #[must_use]
    pub fn with_capacity(mut self, n_runs: usize) -> Self {
        self.proposals.reserve(n_runs);
        self.disturbances.reserve(n_runs * self.shape.n_disturbances);
        self.index.reserve(n_runs);
        self.sums.reserve(n_runs);
        if self.top.is_some() {
            self.found.reserve(n_runs);
        }
        self
    }

    /// Returns the number of runs in memory.
    pub fn len(&self) -> usize {
        self.proposals.len()
    }

    /// Returns true if the memory is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the size of the runs.
    pub fn shape(&self) -> RunShape {
        self.shape
    }

    /// Adds an earlier run, or one made elsewhere, to the memory.
    ///
    /// When a campaign is resumed, its runs pass through the law again: updates from runs that are
    /// already in memory, bit by bit, add nothing until the first new one.
    ///
    /// # Errors
    /// - [`LearningError::Length`], [`LearningError::NotFinite`], [`LearningError::Disturbance`],
    ///   or any error of the core law.
    pub fn remember(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result {
        check_disturbance(disturbance, self.shape.n_disturbances)?;
        self.propose(input, error)?;
        self.keep(error, disturbance);
        self.is_replayed = true;
        Ok(())
    }

    /// Returns the runs that count under a disturbance with their weights, the most relevant first.
    ///
    /// # Errors
    /// - [`LearningError::Disturbance`], [`LearningError::NotFinite`].
    pub fn relevant(&self, disturbance: &[f64]) -> Result<Vec<(usize, f64)>> {
        check_disturbance(disturbance, self.shape.n_disturbances)?;
        let mut found = Vec::new();
        self.index.nearest(&self.weights, disturbance, self.top.unwrap_or(self.len()), &mut found);
        let mut weights: Vec<f64> = found.iter().map(|(_, sum)| *sum).collect();
        normalise(&mut weights, self.weights.epsilon);
        Ok(found.into_iter().zip(weights).map(|((number, _), weight)| (number, weight)).collect())
    }

    /// Keeps only the `keep` runs with the largest weights under coming disturbances.
    ///
    /// A run's share is the sum of its weights (Eq. 4.13, over all runs) under each of
    /// `disturbances`, one after the other; by default under the disturbance of every stored run,
    /// as if the past were repeated. The largest shares stay; of equal ones the older. With one
    /// disturbance these are exactly the runs most relevant for it. Returns the indices of the
    /// remaining runs, ascending. `O(n_runs n_disturbances_given)`.
    ///
    /// # Errors
    /// - [`LearningError::Disturbance`] if `disturbances` is not a whole number of them;
    ///   [`LearningError::NotFinite`].
    pub fn trim(&mut self, keep: usize, disturbances: &[f64]) -> Result<Vec<usize>> {
        let width = self.shape.n_disturbances;
        let given = if disturbances.is_empty() { &self.disturbances } else { disturbances };
        let mut shares = vec![0.0; self.len()];
        let mut sums = Vec::new();
        // Without disturbances that distinguish runs, one pass suffices.
        let mut looks = given.chunks(width.max(1));
        let no_disturbance: &[f64] = &[];
        let mut first = (width == 0).then_some(no_disturbance);
        while let Some(disturbance) = first.take().or_else(|| looks.next()) {
            check_disturbance(disturbance, width)?;
            self.index.sums(&self.weights, disturbance, &mut sums);
            normalise(&mut sums, self.weights.epsilon);
            for (share, weight) in shares.iter_mut().zip(&sums) {
                *share += weight;
            }
        }
        let mut kept: Vec<usize> = (0..shares.len()).collect();
        kept.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]).then(a.cmp(&b)));
        kept.truncate(keep);
        kept.sort_unstable();
        self.retain(&kept);
        Ok(kept)
    }

    /// Computes the proposal of a run.
    fn propose(&mut self, input: &[f64], error: &[f64]) -> Result {
        let mut proposal = std::mem::take(&mut self.proposal);
        let computed = self.compute(input, error, &mut proposal);
        self.proposal = proposal;
        computed
    }

    /// Computes the proposal of a run.
    fn compute(&mut self, input: &[f64], error: &[f64], proposal: &mut [f64]) -> Result {
        let RunShape { n_samples, n_inputs, n_outputs, .. } = self.shape;
        check("input", input, n_samples, n_inputs)?;
        check("error", error, n_samples, n_outputs)?;
        self.core.update(input, error, proposal)?;
        let RelevanceWeights { error_gain, input_gain, .. } = self.weights;
        #[expect(clippy::float_cmp, reason = "gains of exactly 1 leave every bit as it is")]
        if error_gain != 1.0 || input_gain != 1.0 {
            for (next, u) in proposal.iter_mut().zip(input) {
                *next = input_gain * u + error_gain * (*next - u);
            }
        }
        check("next", proposal, n_samples, n_inputs)
    }

    fn keep(&mut self, error: &[f64], disturbance: &[f64]) {
        let sum = self.weights.error_sum(error, self.shape.n_outputs, self.shape.dt_s);
        self.proposals.push(&self.proposal);
        self.disturbances.extend_from_slice(disturbance);
        self.index.push(&self.weights, sum, disturbance);
    }

    /// Writes the weighted mean of the runs that count under a disturbance; of none, the proposal.
    fn weigh(&mut self, disturbance: &[f64], next: &mut [f64]) -> Result {
        // Again if runs have left the shelf: others count then.
        while !self.search(disturbance)? {}
        let epsilon = self.weights.epsilon;
        if self.is_empty() {
            next.copy_from_slice(&self.proposal);
            return Ok(());
        }
        next.fill(0.0);
        if self.top.is_none() {
            normalise(&mut self.sums, epsilon);
            for (number, &weight) in self.sums.iter().enumerate() {
                self.proposals.add(number, weight, next);
            }
        } else {
            self.sums.clear();
            self.sums.extend(self.found.iter().map(|(_, sum)| *sum));
            normalise(&mut self.sums, epsilon);
            for ((number, _), &weight) in self.found.iter().zip(&self.sums) {
                self.proposals.add(*number, weight, next);
            }
        }
        Ok(())
    }

    /// Finds the runs that count, and computes the proposals of those on the shelf; false if some
    /// are not there any more, and are forgotten.
    fn search(&mut self, disturbance: &[f64]) -> Result<bool> {
        match self.top {
            None => self.index.sums(&self.weights, disturbance, &mut self.sums),
            Some(top) => {
                self.index.nearest(&self.weights, disturbance, top, &mut self.found);
            }
        }
        if !self.proposals.has_shelf() {
            return Ok(true);
        }
        let wanted: Vec<usize> = match self.top {
            None => (0..self.len()).collect(),
            Some(_) => self.found.iter().map(|(number, _)| *number).collect(),
        };
        let gone = self.fetch(&wanted)?;
        if !gone.is_empty() {
            let kept: Vec<usize> =
                (0..self.len()).filter(|run| gone.binary_search(run).is_err()).collect();
            self.retain(&kept);
        }
        Ok(gone.is_empty())
    }

    /// Keeps only these runs, given in ascending order.
    fn retain(&mut self, kept: &[usize]) {
        let width = self.shape.n_disturbances;
        self.proposals.retain(kept);
        self.index.retain(kept);
        let old = std::mem::take(&mut self.disturbances);
        for &number in kept {
            self.disturbances.extend_from_slice(&old[number * width..][..width]);
        }
    }
}

impl Law for Relevance {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let RunShape { n_samples, n_inputs, n_disturbances, .. } = self.shape;
        if next.len() != n_samples * n_inputs {
            let (what, found, n_channels) = ("next", next.len(), n_inputs);
            return Err(LearningError::Length { what, found, n_samples, n_channels });
        }
        self.propose(input, error)?;
        let (finished, coming) = self.told.settle()?;
        // On the stack, so that an update does not allocate for them.
        let copy = |disturbance: &[f64]| {
            let mut place = [0.0; DISTURBANCES_MAX];
            place[..n_disturbances].copy_from_slice(disturbance);
            place
        };
        let (finished, coming) = (finished.map(copy), copy(coming));
        let coming = &coming[..n_disturbances];
        if let Some(finished) = finished {
            let finished = &finished[..n_disturbances];
            self.is_replayed = self.is_replayed && self.knows(error, finished)?;
            if !self.is_replayed {
                self.keep(error, finished);
            }
        }
        self.weigh(coming, next)?;
        check("next", next, n_samples, n_inputs)
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        self.told.announce(disturbance);
        self.core.set_disturbance(disturbance);
    }

    /// The proposals converge where the core law does.
    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Inside(self.core.as_mut())
    }

    fn n_disturbances(&self) -> Option<usize> {
        Some(self.shape.n_disturbances)
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.remember(input, error, disturbance).map(|()| true)
    }

    /// The weighted mean of the runs in memory.
    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        let Some(coming) = self.told.coming().map(<[f64]>::to_vec) else { return Ok(None) };
        let mut input = vec![0.0; self.shape.n_samples * self.shape.n_inputs];
        if !self.is_empty() {
            self.weigh(&coming, &mut input)?;
        }
        // Runs may have left their shelf.
        Ok((!self.is_empty()).then_some(input))
    }

    fn reset(&mut self) {
        self.core.reset();
        self.told.forget();
        self.is_replayed = false;
        self.proposals.clear();
        self.disturbances.clear();
        self.index.retain(&[]);
    }

    fn describe(&self) -> String {
        let RelevanceWeights {
            error,
            error_rate,
            disturbance,
            epsilon,
            rate_filter_s,
            error_gain,
            input_gain,
        } = &self.weights;
        let RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s } = self.shape;
        let top = self.top.map_or_else(|| "null".to_owned(), |top| top.to_string());
        let core = self.core.describe();
        format!(
            r#"{{"law":"relevance","core":{core},"error":{error},"error_rate":{error_rate},"disturbance":{disturbance:?},"epsilon":{epsilon},"rate_filter_s":{rate_filter_s},"error_gain":{error_gain},"input_gain":{input_gain},"top":{top},"dt_s":{dt_s},"n_samples":{n_samples},"n_inputs":{n_inputs},"n_outputs":{n_outputs},"n_disturbances":{n_disturbances}}}"#
        )
    }
}

impl fmt::Debug for Relevance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} with {:?}", self.describe(), self.index)
    }
}
