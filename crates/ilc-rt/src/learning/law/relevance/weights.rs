//! The relevance equation: weight of a past run for the coming one.

use crate::learning::{LearningError, Result};

/// Bound of a coordinate: its square, and the sum of eight squares, are still finite.
const FAR: f64 = 1e150;

/// Weights of the relevance.
///
/// `N_j = 1 / (sum_k [N_e |e_j[k]|^2 + N_er |de_j[k]|^2 + sum_i N_d,i (d_i - d_j,i)^2] + epsilon)`
///
/// The sum runs over the samples of a run, as in the source's listing; its integral is `dt_s` times
/// that, a factor that cancels in the weights and only scales `epsilon`. With several channels
/// `|e|` is the Euclidean norm of the error. The rate `de` is the error through
/// `s / (rate_filter_s s + 1)`, at rest before the run, discretised with a zero-order hold.
///
/// `epsilon` is the sum below which runs count as equally good: choose the weights in proportion to
/// it.
///
/// # Units
/// - `error`: 1 / error unit^2; `error_rate`: s^2 / error unit^2; `disturbance`: 1 / disturbance unit^2
/// # Source
/// - \[dimarco2016\], Eq. (4.12) and Appendix C: sums, `epsilon` = 1, `error` = 10, `error_rate` = 2,
///   `disturbance` = 0.5, filter of 0.1 s; Eq. (4.5), (4.6): both gains 1.
#[derive(Debug, Clone, PartialEq)]
pub struct RelevanceWeights {
    /// Weight `N_e` of the error.
    pub error: f64,
    /// Weight `N_er` of the error's rate.
    pub error_rate: f64,
    /// Weights `N_d`, one per disturbance, or one for all.
    pub disturbance: Vec<f64>,
    /// Added to every sum; with 0 a run without error under the same disturbance takes all weight.
    pub epsilon: f64,
    /// Time constant of the filter that computes the error's rate.
    pub rate_filter_s: f64,
    /// Gain `Gamma_1` of the core law's correction.
    pub error_gain: f64,
    /// Gain `Gamma_2` of the input.
    pub input_gain: f64,
}

impl Default for RelevanceWeights {
    fn default() -> Self {
        Self {
            error: 10.0,
            error_rate: 2.0,
            disturbance: vec![0.5],
            epsilon: 1.0,
            rate_filter_s: 0.1,
            error_gain: 1.0,
            input_gain: 1.0,
        }
    }
}

impl RelevanceWeights {
    /// Returns the weights, checked, with one weight for each of `n_disturbances`.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a number that is not finite, a negative weight, or a
    ///   filter time that is not positive.
    /// - [`LearningError::Disturbance`] for a number of weights other than 1 or `n_disturbances`.
    pub fn spread(mut self, n_disturbances: usize) -> Result<Self> {
        let weights =
            [("error", self.error), ("error_rate", self.error_rate), ("epsilon", self.epsilon)];
        let each = self.disturbance.iter().map(|&weight| ("disturbance", weight));
        for (what, value) in weights.into_iter().chain(each) {
            if !(value.is_finite() && value >= 0.0) {
                let allowed = "a weight must be finite and not negative";
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        for (what, value) in [("error_gain", self.error_gain), ("input_gain", self.input_gain)] {
            if !value.is_finite() {
                let allowed = "a gain must be finite";
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        if !(self.rate_filter_s.is_finite() && self.rate_filter_s > 0.0) {
            let (what, value) = ("rate_filter_s", self.rate_filter_s);
            let allowed = "a time constant must be finite and above 0";
            return Err(LearningError::Parameter { what, value, allowed });
        }
        if let [weight] = self.disturbance[..] {
            self.disturbance = vec![weight; n_disturbances];
        }
        let found = self.disturbance.len();
        if found != n_disturbances {
            return Err(LearningError::Disturbance { found, expected: n_disturbances });
        }
        Ok(self)
    }

    /// Returns the share of a run's sum due to its error, in a single pass without memory.
    pub(super) fn error_sum(&self, error: &[f64], n_outputs: usize, dt_s: f64) -> f64 {
        let mut sum = self.error * error.iter().map(|e| e * e).sum::<f64>();
        if self.error_rate > 0.0 {
            let decay = (-dt_s / self.rate_filter_s).exp();
            let mut squares = 0.0;
            for channel in 0..n_outputs {
                let mut slow = 0.0;
                for e in error.iter().skip(channel).step_by(n_outputs) {
                    let rate = (e - slow) / self.rate_filter_s;
                    squares += rate * rate;
                    slow = decay * slow + (1.0 - decay) * e;
                }
            }
            sum += self.error_rate * squares;
        }
        sum
    }

    /// Returns the position of a run in the space where its sum is a squared distance.
    ///
    /// `(sqrt(E_j), sqrt(N_d,1 n_samples) d_1, ...)`; the coming run, with an error of 0, is at
    /// `error_sum = 0`.
    pub(super) fn place<const K: usize>(
        &self,
        error_sum: f64,
        disturbance: &[f64],
        n_samples: usize,
    ) -> [f64; K] {
        let mut place = [0.0; K];
        place[0] = error_sum.sqrt().min(FAR);
        for ((axis, d), weight) in place[1..].iter_mut().zip(disturbance).zip(&self.disturbance) {
            *axis = ((weight * n_samples as f64).sqrt() * d).clamp(-FAR, FAR);
        }
        place
    }
}

/// Turns sums into weights that add up to 1.
///
/// `w_j = N_j / sum_k N_k` with `N_j = 1 / (sum_j + epsilon)`; runs whose denominator is 0 share all.
///
/// # Source
/// - \[dimarco2016\], Eq. (4.13).
pub(super) fn normalise(sums: &mut [f64], epsilon: f64) {
    // Relative to the smallest denominator, so that nothing overflows.
    let least = sums.iter().fold(f64::INFINITY, |least, &sum| least.min(sum + epsilon));
    let mut total = 0.0;
    for sum in sums.iter_mut() {
        let denominator = *sum + epsilon;
        *sum = if denominator > least { least / denominator } else { 1.0 };
        total += *sum;
    }
    for weight in sums {
        *weight /= total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_of_three_runs_by_hand() {
        // Denominators 2, 4 and 8: 4 + 2 + 1 = 7 shares.
        let mut sums = [1.0, 3.0, 7.0];
        normalise(&mut sums, 1.0);
        for (weight, shares) in sums.iter().zip([4.0, 2.0, 1.0]) {
            assert!((weight - shares / 7.0).abs() < 1e-15);
        }
        let mut perfect = [0.0, 5.0, 0.0];
        normalise(&mut perfect, 0.0);
        assert_eq!(perfect.to_vec(), [0.5, 0.0, 0.5]);
        let mut huge = [f64::MAX, f64::MAX / 2.0];
        normalise(&mut huge, 1.0);
        assert!((huge[1] - 2.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn the_error_sum_by_hand() {
        let weights = RelevanceWeights { error: 10.0, error_rate: 2.0, ..Default::default() };
        // Steps of one filter time: the slow part goes 0, (1 - 1/e) 1, ...
        let q = (-1.0_f64).exp();
        let rates = [1.0 / 0.1, (2.0 - (1.0 - q)) / 0.1];
        let expected = 10.0 * 5.0 + 2.0 * (rates[0] * rates[0] + rates[1] * rates[1]);
        let sum = weights.error_sum(&[1.0, 2.0], 1, 0.1);
        assert!((sum - expected).abs() < 1e-9, "{sum} {expected}");
        // Two channels add up.
        let both = weights.error_sum(&[1.0, 1.0, 2.0, 2.0], 2, 0.1);
        assert!((both - 2.0 * expected).abs() < 1e-9);
    }

    #[test]
    fn one_wrong_weight_at_a_time_is_refused() {
        let good = RelevanceWeights::default();
        assert_eq!(good.clone().spread(3).unwrap().disturbance, [0.5; 3]);
        for wrong in [
            RelevanceWeights { error: -1.0, ..good.clone() },
            RelevanceWeights { error_rate: f64::NAN, ..good.clone() },
            RelevanceWeights { disturbance: vec![1.0, -1.0, 1.0], ..good.clone() },
            RelevanceWeights { disturbance: vec![1.0, 1.0], ..good.clone() },
            RelevanceWeights { epsilon: -1e-9, ..good.clone() },
            RelevanceWeights { rate_filter_s: 0.0, ..good.clone() },
            RelevanceWeights { error_gain: f64::INFINITY, ..good.clone() },
            RelevanceWeights { input_gain: f64::NAN, ..good.clone() },
        ] {
            assert!(wrong.clone().spread(3).is_err(), "{wrong:?}");
        }
    }
}
