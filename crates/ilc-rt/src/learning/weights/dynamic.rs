//! Weights with memory: the error passes a filter before it is weighed.

use nalgebra::DMatrix;

use super::Weight;
use crate::learning::LearningError;
use crate::model::StateSpace;

/// A pole counts as stable up to this magnitude: an integrator does, whatever its rounding.
const STABLE: f64 = 1.0 + 1e-9;

/// A weight that looks at the error through a filter, and perhaps at the error itself as well.
///
/// `J_e = sum_k |w_k|^2_{Q_w} + |z_k|^2_{Q_z}`, `w = F z`, `z` the predicted error
///
/// So a band of frequencies counts more than another, or one axis takes over what another is too
/// slow for. The sum is again a tracking problem, for the model with `F` behind it: what weighs
/// [`Dynamic::behind`] of the model with [`Dynamic::weight`] on a run's
/// error as [`ErrorFilter`] passes it on solves the problem exactly, whatever delay plant and filter have together.
///
/// `F` is causal, so it can be run along with the plant. A filter that runs backwards too
/// (zero-phase) has no state to add to the plant's; take the causal one of the same magnitude.
///
/// # Shapes
/// - for `p` outputs of the plant and `f` of the filter: `w` `f` channels
/// # Source
/// - \[barton2010\], Eq. (J.10) to (J.13), (J.17) to (J.19).
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamic {
    filter: StateSpace,
    filtered: Weight,
    plain: Option<Weight>,
}

impl Dynamic {
    /// Makes the weight of what comes out of a filter.
    ///
    /// # Errors
    /// - [`LearningError::Model`] for a continuous filter.
    /// - [`LearningError::Parameter`] for a filter with a pole outside the unit circle, as one has
    ///   that is meant to run backwards.
    /// - [`LearningError::Empty`] for a filter without inputs or outputs.
    pub fn new(filter: StateSpace, filtered: Weight) -> Result<Self, LearningError> {
        for (what, count) in [
            ("inputs of the filter", filter.n_inputs()),
            ("outputs of the filter", filter.n_outputs()),
        ] {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        filter.markov(1)?;
        let largest = filter.poles()?.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
        if largest > STABLE {
            return Err(LearningError::Parameter {
                what: "largest pole of the filter",
                value: largest,
                allowed: "a dynamic weight is a causal, stable filter with all poles within the \
                          unit circle; for one that runs backwards take the causal filter of the \
                          same magnitude",
            });
        }
        Ok(Self { filter, filtered, plain: None })
    }

    /// Weighs the error itself as well.
    #[must_use]
    pub fn with_plain(mut self, plain: Weight) -> Self {
        self.plain = Some(plain);
        self
    }

    /// Returns the model whose output is all that is weighed: the error, if it is, and what the
    /// filter makes of it.
    ///
    /// # Errors
    /// - [`LearningError::Model`] unless the filter has an input for each output of the model and
    ///   its sample time.
    pub fn behind(&self, model: &StateSpace) -> Result<StateSpace, LearningError> {
        Ok(model.series(&self.with_error()?)?)
    }

    /// Returns the weight of all that is weighed.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a part that does not fit.
    pub fn weight(&self, n_samples: usize) -> Result<Weight, LearningError> {
        let (p, f) = (self.filter.n_inputs(), self.filter.n_outputs());
        self.filtered.check("q", n_samples, f)?;
        let Some(plain) = &self.plain else {
            return Ok(self.filtered.clone());
        };
        plain.check("plain", n_samples, p)?;
        let at = |k: usize| {
            let mut block = DMatrix::zeros(p + f, p + f);
            block.view_mut((0, 0), (p, p)).copy_from(&plain.at(k, p));
            block.view_mut((p, p), (f, f)).copy_from(&self.filtered.at(k, f));
            block
        };
        if plain.is_constant() && self.filtered.is_constant() {
            return Ok(Weight::Block(at(0)));
        }
        Ok(Weight::Blocks((0..n_samples).map(at).collect()))
    }

    /// Returns what turns a run's error into the error of all that is weighed.
    ///
    /// # Errors
    /// - [`LearningError::Model`] for a filter that is none.
    pub fn error_filter(&self) -> Result<ErrorFilter, LearningError> {
        let model = self.with_error()?;
        let n = model.n_states();
        Ok(ErrorFilter { state: vec![0.0; n], next: vec![0.0; n], model })
    }

    /// Returns the filter with the error itself in front of its outputs, if that is weighed.
    fn with_error(&self) -> Result<StateSpace, LearningError> {
        if self.plain.is_none() {
            return Ok(self.filter.clone());
        }
        let (n, p, f) = (self.filter.n_states(), self.filter.n_inputs(), self.filter.n_outputs());
        let mut c = DMatrix::zeros(p + f, n);
        c.view_mut((p, 0), (f, n)).copy_from(self.filter.c());
        let mut d = DMatrix::zeros(p + f, p);
        d.view_mut((0, 0), (p, p)).fill_with_identity();
        d.view_mut((p, 0), (f, p)).copy_from(self.filter.d());
        let (a, b) = (self.filter.a().clone(), self.filter.b().clone());
        Ok(StateSpace::new(a, b, c, d, self.filter.dt_s())?)
    }
}

/// The filter that a run's error passes before the law sees it.
///
/// # Real Time
/// Cold path. Allocates when it is made, never in [`ErrorFilter::run`].
#[derive(Debug, Clone)]
pub struct ErrorFilter {
    model: StateSpace,
    state: Vec<f64>,
    next: Vec<f64>,
}

impl ErrorFilter {
    /// Returns the channels it takes.
    pub fn n_inputs(&self) -> usize {
        self.model.n_inputs()
    }

    /// Returns the channels it gives.
    pub fn n_outputs(&self) -> usize {
        self.model.n_outputs()
    }

    /// Filters a whole run from rest.
    ///
    /// # Shapes
    /// - `error`: `n_samples` x `n_inputs`; `filtered`: `n_samples` x `n_outputs`, overwritten; of
    ///   unequal lengths the shorter counts
    pub fn run(&mut self, error: &[f64], filtered: &mut [f64]) {
        let (a, b, c, d) = (self.model.a(), self.model.b(), self.model.c(), self.model.d());
        let row = |matrix: &DMatrix<f64>, row: usize, signal: &[f64]| -> f64 {
            signal.iter().enumerate().map(|(col, value)| matrix[(row, col)] * value).sum()
        };
        self.state.fill(0.0);
        let samples = error.chunks_exact(b.ncols());
        for (sample, out) in samples.zip(filtered.chunks_exact_mut(c.nrows())) {
            for (i, value) in out.iter_mut().enumerate() {
                *value = row(c, i, &self.state) + row(d, i, sample);
            }
            for (i, value) in self.next.iter_mut().enumerate() {
                *value = row(a, i, &self.state) + row(b, i, sample);
            }
            std::mem::swap(&mut self.state, &mut self.next);
        }
    }
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

    fn plant() -> StateSpace {
        let x = from_transfer_function(&[1.0, 0.2], &[1.0, -0.5, 0.1], Some(0.1)).unwrap();
        let y = from_transfer_function(&[0.5], &[1.0, -0.9], Some(0.1)).unwrap();
        x.append(&y).unwrap()
    }

    fn filter() -> StateSpace {
        low_pass(0.6703).append(&low_pass(-0.2)).unwrap()
    }

    #[test]
    fn the_model_behind_is_the_product_of_the_lifted_operators() {
        let n = 7;
        let dynamic = Dynamic::new(filter(), Weight::Scalar(1.0)).unwrap();
        let product = filter().lifted(n).unwrap() * plant().lifted(n).unwrap();
        let behind = dynamic.behind(&plant()).unwrap();
        assert!((behind.lifted(n).unwrap() - &product).amax() < 1e-14);
        let both = dynamic.with_plain(Weight::Scalar(1.0)).behind(&plant()).unwrap();
        let (both, alone) = (both.lifted(n).unwrap(), plant().lifted(n).unwrap());
        for k in 0..n {
            assert!((both.rows(4 * k, 2) - alone.rows(2 * k, 2)).amax() < 1e-14);
            assert!((both.rows(4 * k + 2, 2) - product.rows(2 * k, 2)).amax() < 1e-14);
        }
    }

    #[test]
    fn the_weight_stands_on_the_error_first_and_then_on_the_filtered() {
        let block = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 3.0]);
        let dynamic = Dynamic::new(filter(), Weight::Block(block)).unwrap();
        assert_eq!(dynamic.weight(4).unwrap().at(0, 2)[(0, 1)], 1.0);
        let both = dynamic.with_plain(Weight::PerSample(vec![5.0, 6.0, 7.0, 8.0]));
        let found = both.weight(4).unwrap().at(2, 4);
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
    fn filters_that_cannot_run_along_are_refused() {
        let told =
            |filter: StateSpace| Dynamic::new(filter, Weight::Scalar(1.0)).unwrap_err().to_string();
        let backwards = from_transfer_function(&[1.0], &[1.0, -1.25], Some(0.1)).unwrap();
        let line = told(backwards);
        assert!(line.contains("1.25") && line.contains("causal"), "{line}");
        let continuous = from_transfer_function(&[1.0], &[1.0, 1.0], None).unwrap();
        assert!(told(continuous).contains("discrete model"));
        let deaf = StateSpace::static_gain(DMatrix::zeros(1, 0), Some(0.1)).unwrap();
        assert!(told(deaf).contains("inputs of the filter"));
        let integrator = from_transfer_function(&[0.1], &[1.0, -1.0], Some(0.1)).unwrap();
        assert!(Dynamic::new(integrator, Weight::Scalar(1.0)).is_ok());
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let dynamic = Dynamic::new(filter(), Weight::Scalar(1.0)).unwrap();
        assert!(dynamic.behind(&low_pass(0.5)).unwrap_err().to_string().contains("signals meet"));
        let late = from_transfer_function(&[1.0], &[1.0, -0.5], Some(0.2)).unwrap();
        let late = late.append(&late).unwrap();
        assert!(dynamic.behind(&late).unwrap_err().to_string().contains("dt_s"));
        let wide = dynamic.clone().with_plain(Weight::Block(DMatrix::identity(3, 3)));
        assert!(wide.weight(5).unwrap_err().to_string().starts_with("plain"));
        let short = Dynamic::new(filter(), Weight::PerSample(vec![1.0; 4])).unwrap();
        assert!(short.weight(5).unwrap_err().to_string().starts_with("q at"));
    }

    proptest! {
        #[test]
        fn the_error_filter_is_the_lifted_filter(
            error in prop::collection::vec(-1.0..1.0_f64, 2 * 9), poles in prop::array::uniform2(-0.9..0.9_f64),
        ) {
            let filter = low_pass(poles[0]).append(&low_pass(poles[1])).unwrap();
            let lifted = filter.lifted(9).unwrap() * DVector::from_row_slice(&error);
            let dynamic = Dynamic::new(filter, Weight::Scalar(1.0)).unwrap();
            let mut found = vec![f64::NAN; 18];
            let mut error_filter = dynamic.error_filter().unwrap();
            // Twice: the second run starts from rest too.
            error_filter.run(&error, &mut found);
            error_filter.run(&error, &mut found);
            for (found, expected) in found.iter().zip(lifted.iter()) {
                prop_assert!((found - expected).abs() < 1e-12);
            }
            let mut both = dynamic.with_plain(Weight::Scalar(1.0)).error_filter().unwrap();
            let mut stacked = vec![f64::NAN; 36];
            both.run(&error, &mut stacked);
            for k in 0..9 {
                prop_assert_eq!(&stacked[4 * k..4 * k + 2], &error[2 * k..2 * k + 2]);
                prop_assert_eq!(&stacked[4 * k + 2..4 * k + 4], &found[2 * k..2 * k + 2]);
            }
        }
    }
}
