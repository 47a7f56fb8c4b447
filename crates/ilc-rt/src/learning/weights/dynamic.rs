//! Dynamic (frequency-dependent) weights: the error is filtered before it is weighted.

use nalgebra::DMatrix;

use super::Weight;
use crate::learning::{LearningError, Result};
use crate::model::StateSpace;

/// A pole counts as stable up to this magnitude, so that integrators do in spite of rounding.
const STABLE: f64 = 1.0 + 1e-9;

/// A filter applied to the error before weighting.
///
/// `J_e = sum_k |w_k|^2_Q + |z_k|^2_plain`, `w = F (G z)`, `z` the predicted error
///
/// One band of frequencies can thus count more than another, or one axis can take over what another
/// is too slow for. `G` couples the channels at each sample, like contour gains; `F` is causal, so
/// that it can run along with the plant. A zero-phase filter has no state to append to the plant's:
/// use the causal one of the same magnitude.
///
/// # Shapes
/// - for `p` outputs of the plant, `g` inputs and `f` outputs of the filter: `G` (`g`, `p`) at each
///   sample, the identity by default; `w` `f` channels
/// # Source
/// - \[barton2010\], Eq. (J.10) to (J.13), (J.17) to (J.19).
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamic {
    filter: StateSpace,
    /// Empty, or one per sample.
    coupling: Vec<DMatrix<f64>>,
    plain: Option<Weight>,
}

/// Refuses a filter that is continuous, unstable or without signals.
pub(super) fn check_filter(filter: &StateSpace) -> Result {
    if filter.n_inputs() == 0 {
        return Err(LearningError::Empty { what: "inputs of the filter" });
    }
    if filter.n_outputs() == 0 {
        return Err(LearningError::Empty { what: "outputs of the filter" });
    }
    filter.markov(1)?;
    let largest = filter.poles()?.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    if largest > STABLE {
        return Err(LearningError::Parameter {
            what: "largest pole of the filter",
            value: largest,
            allowed: "a dynamic weight is causal and stable, with all poles within the unit \
                      circle; for a filter that runs backwards take the causal one of the \
                      same magnitude",
        });
    }
    Ok(())
}

impl Dynamic {
    /// Creates a weight of a filter's output.
    ///
    /// # Errors
    /// - [`LearningError::Model`] for a continuous filter.
    /// - [`LearningError::Parameter`] for a filter with a pole outside the unit circle, e.g. one
    ///   meant to run backward.
    /// - [`LearningError::Empty`] for a filter without inputs or outputs.
    pub fn new(filter: StateSpace) -> Result<Self> {
        check_filter(&filter)?;
        Ok(Self { filter, coupling: Vec::new(), plain: None })
    }

    /// Creates the weight of one signal that unlike axes contribute to, each through its own
    /// filter: `w = sum_i W_i(q) c_i[k] z_i[k]`, e.g. the contour error of a fast and a slow axis.
    ///
    /// # Shapes
    /// - `filters`: one single-input, single-output filter per output of the plant; `gains`: one
    ///   row (1, `p`) per sample, as [`Contour::couplings`](super::Contour::couplings) of two axes
    /// # Errors
    /// - as [`Dynamic::new`]; [`LearningError::Weight`] for gains of the wrong shape.
    /// # Source
    /// - \[barton2010\], Eq. (J.12): with `W_fast = T_fast / T_slow F_lowpass`, `W_slow = 1`.
    pub fn unlike_axes(filters: &[StateSpace], gains: &[DMatrix<f64>]) -> Result<Self> {
        let Some((first, others)) = filters.split_first() else {
            return Err(LearningError::Empty { what: "filters" });
        };
        let p = filters.len();
        let mut all = first.clone();
        for filter in others {
            all = all.append(filter)?;
        }
        let sum = StateSpace::static_gain(DMatrix::from_element(1, p, 1.0), first.dt_s())?;
        let apart: Vec<DMatrix<f64>> = gains
            .iter()
            .enumerate()
            .map(|(k, row)| {
                if row.shape() == (1, p) {
                    return Ok(DMatrix::from_diagonal(&row.row(0).transpose()));
                }
                let (rows, cols) = row.shape();
                let reason = format!("gains of {rows} x {cols}; 1 x {p} are needed");
                Err(LearningError::Weight { what: "coupling", sample: k, reason })
            })
            .collect::<Result<_, _>>()?;
        Self::new(all.series(&sum)?)?.with_coupling(apart)
    }

    /// Couples the channels before the filter, sample by sample.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] unless there is at least one matrix, all have the same shape
    ///   with one row per input of the filter, and all entries are finite.
    pub fn with_coupling(mut self, coupling: Vec<DMatrix<f64>>) -> Result<Self> {
        let refused = |sample: usize, reason: String| {
            Err(LearningError::Weight { what: "coupling", sample, reason })
        };
        let Some(first) = coupling.first() else {
            return refused(0, "no matrices; one a sample is needed".to_owned());
        };
        let (rows, cols) = (self.filter.n_inputs(), first.ncols());
        for (k, c) in coupling.iter().enumerate() {
            if c.shape() != (rows, cols) {
                let found = format!("{} x {}", c.nrows(), c.ncols());
                return refused(k, format!("a matrix of {found}; {rows} x {cols} is needed"));
            }
            if let Some(entry) = c.iter().find(|entry| !entry.is_finite()) {
                return refused(k, format!("{entry}; only finite values are allowed"));
            }
        }
        self.coupling = coupling;
        Ok(self)
    }

    /// Weights the unfiltered error as well.
    #[must_use]
    pub fn with_plain(mut self, plain: Weight) -> Self {
        self.plain = Some(plain);
        self
    }

    /// Returns true if the filter is the same at every sample.
    pub fn is_constant(&self) -> bool {
        self.coupling.is_empty()
    }

    /// Returns the number of plant outputs it takes.
    pub fn n_outputs(&self) -> usize {
        self.coupling.first().map_or(self.filter.n_inputs(), DMatrix::ncols)
    }

    /// Returns the number of filtered channels.
    pub fn n_filtered(&self) -> usize {
        self.filter.n_outputs()
    }

    /// Returns the model to append to the plant at sample `k`: its outputs are all weighted
    /// signals, first the unfiltered error, if it is weighted, and then the filtered one.
    ///
    /// # Errors
    /// - [`LearningError::Model`] if a number overflows.
    /// # Panics
    /// If the coupling varies and `k` is beyond the end of the run.
    pub fn at(&self, k: usize) -> Result<StateSpace> {
        let (a, c) = (self.filter.a().clone(), self.filter.c());
        let (b, d) = match self.coupling.get(k) {
            Some(coupling) => (self.filter.b() * coupling, self.filter.d() * coupling),
            None => (self.filter.b().clone(), self.filter.d().clone()),
        };
        let (p, n) = (self.n_outputs(), a.nrows());
        let skip = if self.plain.is_some() { p } else { 0 };
        let mut all_c = DMatrix::zeros(skip + c.nrows(), n);
        all_c.view_mut((skip, 0), c.shape()).copy_from(c);
        let mut all_d = DMatrix::zeros(skip + d.nrows(), p);
        all_d.view_mut((0, 0), (skip, p)).fill_with_identity();
        all_d.view_mut((skip, 0), d.shape()).copy_from(&d);
        Ok(StateSpace::new(a, b, all_c, all_d, self.filter.dt_s())?)
    }

    /// Returns the weight of all weighted signals, with `q` the weight of the filtered ones.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a part, or a coupling, that does not match the run.
    pub fn weight(&self, n_samples: usize, q: &Weight) -> Result<Weight> {
        let (p, f) = (self.n_outputs(), self.filter.n_outputs());
        let count = self.coupling.len();
        if count != 0 && count != n_samples {
            let reason = format!("{count} matrices given; {n_samples} are needed");
            return Err(LearningError::Weight { what: "coupling", sample: 0, reason });
        }
        q.check("q", n_samples, f)?;
        let Some(plain) = &self.plain else {
            return Ok(q.clone());
        };
        plain.check("plain", n_samples, p)?;
        Ok(Weight::beside(&[(plain, p), (q, f)], n_samples))
    }

    /// Returns the filter from a run's error to all weighted signals.
    pub fn error_filter(&self) -> ErrorFilter {
        let n = self.filter.n_states();
        ErrorFilter {
            filter: self.filter.clone(),
            coupling: self.coupling.clone(),
            n_inputs: self.n_outputs(),
            passes: self.plain.is_some(),
            coupled: vec![0.0; self.filter.n_inputs()],
            state: vec![0.0; n],
            next: vec![0.0; n],
        }
    }
}

/// The filter applied to a run's error before the law receives it.
///
/// # Real Time
/// Cold path. Allocates at creation, never in [`ErrorFilter::run`].
#[derive(Debug, Clone)]
pub struct ErrorFilter {
    filter: StateSpace,
    coupling: Vec<DMatrix<f64>>,
    n_inputs: usize,
    passes: bool,
    coupled: Vec<f64>,
    state: Vec<f64>,
    next: Vec<f64>,
}

impl ErrorFilter {
    /// Returns the number of input channels.
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Returns the number of output channels.
    pub fn n_outputs(&self) -> usize {
        self.filter.n_outputs() + if self.passes { self.n_inputs } else { 0 }
    }

    /// Filters a whole run from rest.
    ///
    /// # Shapes
    /// - `error`: `n_samples` x `n_inputs`; `filtered`: `n_samples` x `n_outputs`, overwritten; the
    ///   shorter one determines the number of samples
    pub fn run(&mut self, error: &[f64], filtered: &mut [f64]) {
        let n_outputs = self.n_outputs();
        let Self { filter, coupling, n_inputs, passes, coupled, state, next } = self;
        let skip = if *passes { *n_inputs } else { 0 };
        state.fill(0.0);
        let samples = error.chunks_exact(*n_inputs).zip(filtered.chunks_exact_mut(n_outputs));
        for (k, (sample, out)) in samples.enumerate() {
            match coupling.get(k) {
                Some(coupling) => {
                    coupled.iter_mut().enumerate().for_each(|(i, v)| *v = dot(coupling, i, sample));
                }
                None => coupled.copy_from_slice(sample),
            }
            let (plain, out) = out.split_at_mut(skip);
            plain.copy_from_slice(&sample[..skip]);
            for (i, value) in out.iter_mut().enumerate() {
                *value = dot(filter.c(), i, state) + dot(filter.d(), i, coupled);
            }
            for (i, value) in next.iter_mut().enumerate() {
                *value = dot(filter.a(), i, state) + dot(filter.b(), i, coupled);
            }
            std::mem::swap(state, next);
        }
    }

    /// Applies the adjoint of [`ErrorFilter::run`]: the same recursion from the end of the run.
    ///
    /// # Shapes
    /// - as [`ErrorFilter::run`]; `error` is overwritten
    pub fn run_transposed(&mut self, filtered: &[f64], error: &mut [f64]) {
        let n_outputs = self.n_outputs();
        let Self { filter, coupling, n_inputs, passes, coupled, state, next } = self;
        let skip = if *passes { *n_inputs } else { 0 };
        let n_samples = (filtered.len() / n_outputs.max(1)).min(error.len() / (*n_inputs).max(1));
        state.fill(0.0);
        for k in (0..n_samples).rev() {
            let (plain, out) = filtered[k * n_outputs..(k + 1) * n_outputs].split_at(skip);
            for (i, value) in coupled.iter_mut().enumerate() {
                *value = dot_column(filter.b(), i, state) + dot_column(filter.d(), i, out);
            }
            for (i, value) in next.iter_mut().enumerate() {
                *value = dot_column(filter.a(), i, state) + dot_column(filter.c(), i, out);
            }
            std::mem::swap(state, next);
            let sample = &mut error[k * *n_inputs..(k + 1) * *n_inputs];
            match coupling.get(k) {
                Some(coupling) => {
                    let to = sample.iter_mut().enumerate();
                    to.for_each(|(i, value)| *value = dot_column(coupling, i, coupled));
                }
                None => sample.copy_from_slice(coupled),
            }
            for (value, plain) in sample.iter_mut().zip(plain) {
                *value += plain;
            }
        }
    }
}

fn dot_column(matrix: &DMatrix<f64>, col: usize, signal: &[f64]) -> f64 {
    signal.iter().enumerate().map(|(row, value)| matrix[(row, col)] * value).sum()
}

fn dot(matrix: &DMatrix<f64>, row: usize, signal: &[f64]) -> f64 {
    signal.iter().enumerate().map(|(col, value)| matrix[(row, col)] * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::from_transfer_function;
    use nalgebra::DVector;
    use proptest::prelude::*;

    fn low_pass(pole: f64) -> StateSpace {
        from_transfer_function(&[1.0 - pole], &[1.0, -pole], Some(0.1)).unwrap()
    }

    fn filter() -> StateSpace {
        low_pass(0.6703).append(&low_pass(-0.2)).unwrap()
    }

    #[test]
    fn the_weight_stands_on_the_error_first_and_then_on_the_filtered() {
        let q = Weight::Block(DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 3.0]));
        let dynamic = Dynamic::new(filter()).unwrap();
        assert_eq!(dynamic.weight(4, &q).unwrap(), q);
        let both = dynamic.with_plain(Weight::PerSample(vec![5.0, 6.0, 7.0, 8.0]));
        let found = both.weight(4, &q).unwrap().at(2, 4);
        #[rustfmt::skip]
        let expected = DMatrix::from_row_slice(4, 4, &[
            7.0, 0.0, 0.0, 0.0,
            0.0, 7.0, 0.0, 0.0,
            0.0, 0.0, 2.0, 1.0,
            0.0, 0.0, 1.0, 3.0,
        ]);
        assert_eq!(found, expected);
    }

    #[test]
    fn unlike_axes_add_up_by_hand() {
        // w = c_1 z_1 one sample late + c_2 z_2.
        let late = from_transfer_function(&[1.0], &[1.0, 0.0], Some(0.1)).unwrap();
        let one = StateSpace::static_gain(DMatrix::identity(1, 1), Some(0.1)).unwrap();
        let row = |c: [f64; 2]| DMatrix::from_row_slice(1, 2, &c);
        let gains = [row([1.0, 10.0]), row([2.0, 20.0]), row([3.0, 30.0])];
        let dynamic = Dynamic::unlike_axes(&[late, one], &gains).unwrap();
        let mut found = [f64::NAN; 3];
        dynamic.error_filter().run(&[1.0, 1.0, 5.0, 2.0, 0.0, 3.0], &mut found);
        for (found, expected) in found.into_iter().zip([10.0, 1.0 + 40.0, 10.0 + 90.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn filters_that_cannot_run_along_are_refused() {
        let told = |filter: StateSpace| Dynamic::new(filter).unwrap_err().to_string();
        let line = told(from_transfer_function(&[1.0], &[1.0, -1.25], Some(0.1)).unwrap());
        assert!(line.contains("1.25") && line.contains("causal"), "{line}");
        let continuous = from_transfer_function(&[1.0], &[1.0, 1.0], None).unwrap();
        assert!(told(continuous).contains("discrete model"));
        let deaf = StateSpace::static_gain(DMatrix::zeros(1, 0), Some(0.1)).unwrap();
        assert!(told(deaf).contains("inputs of the filter"));
        let mute = StateSpace::static_gain(DMatrix::zeros(0, 1), Some(0.1)).unwrap();
        assert!(told(mute).contains("outputs of the filter"));
        let integrator = from_transfer_function(&[0.1], &[1.0, -1.0], Some(0.1)).unwrap();
        assert!(Dynamic::new(integrator).is_ok());
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let good = || Dynamic::new(filter()).unwrap();
        let q = Weight::Scalar(1.0);
        let wide = good().with_plain(Weight::Block(DMatrix::identity(3, 3)));
        assert!(wide.weight(5, &q).unwrap_err().to_string().starts_with("plain"));
        let short = Weight::PerSample(vec![1.0; 4]);
        assert!(good().weight(5, &short).unwrap_err().to_string().starts_with("q at"));
        let told =
            |coupling: Vec<DMatrix<f64>>| good().with_coupling(coupling).unwrap_err().to_string();
        assert!(told(Vec::new()).contains("no matrices"));
        assert!(told(vec![DMatrix::zeros(1, 2)]).contains("1 x 2; 2 x 2"));
        assert!(told(vec![DMatrix::zeros(2, 2), DMatrix::zeros(2, 3)]).contains("sample 1"));
        assert!(told(vec![DMatrix::from_element(2, 2, f64::NAN)]).contains("NaN"));
        let four = good().with_coupling(vec![DMatrix::zeros(2, 2); 4]).unwrap();
        assert!(four.weight(5, &q).unwrap_err().to_string().contains("4 matrices"));
        let gains = vec![DMatrix::zeros(1, 3)];
        let unlike = Dynamic::unlike_axes(&[low_pass(0.5), low_pass(0.5)], &gains).unwrap_err();
        assert!(unlike.to_string().contains("1 x 3; 1 x 2"));
        assert!(Dynamic::unlike_axes(&[], &gains).unwrap_err().to_string().contains("filters"));
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn the_error_filter_is_the_lifted_filter(
            error in prop::collection::vec(-1.0..1.0_f64, 3 * 9),
            poles in prop::array::uniform2(-0.9..0.9_f64),
            entries in prop::collection::vec(-2.0..2.0_f64, 6 * 9),
        ) {
            let filter = low_pass(poles[0]).append(&low_pass(poles[1])).unwrap();
            let coupling: Vec<DMatrix<f64>> =
                entries.chunks(6).map(|block| DMatrix::from_row_slice(2, 3, block)).collect();
            let coupled = DMatrix::from_fn(18, 27, |i, j| {
                if i / 2 == j / 3 { coupling[i / 2][(i % 2, j % 3)] } else { 0.0 }
            });
            let lifted = filter.lifted(9).unwrap() * coupled * DVector::from_row_slice(&error);
            let dynamic = Dynamic::new(filter).unwrap().with_coupling(coupling).unwrap();
            let mut found = vec![f64::NAN; 18];
            let mut error_filter = dynamic.error_filter();
            // Twice: the second run starts from rest, too.
            error_filter.run(&error, &mut found);
            error_filter.run(&error, &mut found);
            for (found, expected) in found.iter().zip(lifted.iter()) {
                prop_assert!((found - expected).abs() < 1e-12);
            }
            let mut both = dynamic.with_plain(Weight::Scalar(1.0)).error_filter();
            let mut stacked = vec![f64::NAN; 45];
            both.run(&error, &mut stacked);
            for k in 0..9 {
                prop_assert_eq!(&stacked[5 * k..5 * k + 3], &error[3 * k..3 * k + 3]);
                prop_assert_eq!(&stacked[5 * k + 3..5 * k + 5], &found[2 * k..2 * k + 2]);
            }
        }
    }
}
