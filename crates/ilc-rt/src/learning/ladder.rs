//! The ladder mechanism: several runs with the same input before each step of learning.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::check_learns_from_every_run;
use super::{Law, LearningError, Result, Surrogate};
use crate::schema::field_order;

/// `[learning.ladder]`: several runs with the same input before each step of learning, with a gain
/// that follows the decay of the error.
///
/// # Units
/// - numbers of runs and ratios
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct LadderRule {
    /// Runs with the same input before each step.
    #[schemars(range(min = 1, max = 1000))]
    pub repeats: usize,
    /// Ratio of the error to that before the last step above which it decays too slowly.
    #[schemars(range(min = 1e-3, max = 1.0))]
    pub slow: f64,
    /// Factor by which the gain is then raised; 1 to leave it alone.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub increase: f64,
    /// Lowest gain.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub lowest: f64,
    /// Highest gain.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub highest: f64,
}

impl Default for LadderRule {
    fn default() -> Self {
        Self::new(2)
    }
}

impl LadderRule {
    /// Returns the rule with the given number of repeats: a decay of less than a fifth per step
    /// raises the gain by a quarter, up to 1.5; growth halves it, down to 1/16.
    pub fn new(repeats: usize) -> Self {
        Self { repeats, slow: 0.8, increase: 1.25, lowest: 0.0625, highest: 1.5 }
    }
}

/// A wrapper whose law learns from the mean error of several runs with the same input.
///
/// `m_j = (e_1 + .. + e_n) / n`, `u_{j+1} = u_j + g_j (law(u_j, m_j) - u_j)`
///
/// The part that does not repeat falls with the root of n. Between the steps the input is the same; if the
/// runs do not come with the same input, the mean starts over.
///
/// The gain `g`, 1 at first, follows the decay of the repeatable error `f_j`, with
/// `f_j^2 = ms(m_j) - s_j^2 / n` and `s_j^2` the mean variance from run to run (0 for one repeat):
///
/// - `f_j > f_{j-1}`: the error grew, so `g` is halved;
/// - `slow f_{j-1} < f_j <= f_{j-1}`: it decays too slowly, so `g` is raised;
/// - otherwise, or if `f_j` is less than twice the noise `s_j / sqrt(n)` of the mean, so that its
///   ratio is meaningless: `g` stays.
///
/// Where the caller rolls an input back ([`Law::on_rollback`]) the error grew too, though the
/// law never learns from that run: `g` is halved, and the mean starts over.
///
/// # Shapes
/// - those of the inner law
/// # Real Time
/// Cold path. Allocates in the first [`Law::update`] only.
/// # Source
/// - \[filter-based\], Section 6.2 (Fig. 32): average of repeated runs, and a gain that is raised
///   if the error attenuates too slowly. It gives no rule; this one is ours.
#[derive(Debug)]
pub struct Ladder<L> {
    law: L,
    rule: LadderRule,
    gain: f64,
    runs: usize,
    input: Vec<f64>,
    mean: Vec<f64>,
    /// Sum over the runs of the squared deviations from their mean.
    deviation: f64,
    figure: Option<f64>,
    noise: f64,
}

impl<L: Law> Ladder<L> {
    /// Wraps a law.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] for 0 repeats.
    /// - [`LearningError::Parameter`] unless `0 < slow <= 1`, `increase >= 1` and
    ///   `0 < lowest <= 1 <= highest`, all finite.
    /// - [`LearningError::Measures`] for a law that makes runs which only measure.
    pub fn new(law: L, rule: LadderRule) -> Result<Self> {
        check_learns_from_every_run("ladder", &law)?;
        let LadderRule { repeats, slow, increase, lowest, highest } = rule;
        if repeats == 0 {
            return Err(LearningError::Empty { what: "repeats" });
        }
        for (what, value, is_right, allowed) in [
            ("slow", slow, slow > 0.0 && slow <= 1.0, "it must lie above 0 and not above 1"),
            (
                "increase",
                increase,
                increase >= 1.0 && increase.is_finite(),
                "it must be finite, at least 1",
            ),
            (
                "lowest",
                lowest,
                lowest > 0.0 && lowest <= 1.0,
                "it must lie above 0 and not above 1",
            ),
            (
                "highest",
                highest,
                highest >= 1.0 && highest.is_finite(),
                "it must be finite, at least 1",
            ),
        ] {
            if !is_right {
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        Ok(Self {
            law,
            rule,
            gain: 1.0,
            runs: 0,
            input: Vec::new(),
            mean: Vec::new(),
            deviation: 0.0,
            figure: None,
            noise: 0.0,
        })
    }

    /// Returns the gain of the next step.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Returns the number of runs in the mean for the next step.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Returns the RMS of the repeatable error before the last step.
    pub fn figure(&self) -> Option<f64> {
        self.figure
    }

    /// Returns the RMS of the noise left in the mean of the last step.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Returns the inner law.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// Returns the inner law.
    pub fn law_mut(&mut self) -> &mut L {
        &mut self.law
    }

    /// Adds a run to mean and deviation.
    fn take(&mut self, input: &[f64], error: &[f64]) {
        let is_same = self.mean.len() == error.len() && self.input == input;
        if self.runs == 0 || !is_same {
            self.input.clear();
            self.input.extend_from_slice(input);
            self.mean.clear();
            self.mean.extend_from_slice(error);
            (self.runs, self.deviation) = (1, 0.0);
            return;
        }
        self.runs += 1;
        let n = self.runs as f64;
        // Welford's recursion: no difference of large sums.
        for (mean, error) in self.mean.iter_mut().zip(error) {
            let off = error - *mean;
            *mean += off / n;
            self.deviation += off * (error - *mean);
        }
    }

    /// Adapts the gain to the decay since the last step.
    fn adapt(&mut self) {
        let n = self.runs as f64;
        let count = self.mean.len().max(1) as f64;
        let noise_square = self.deviation / ((n - 1.0).max(1.0) * count * n);
        let mean_square = self.mean.iter().map(|m| m * m).sum::<f64>() / count;
        let figure = (mean_square - noise_square).max(0.0).sqrt();
        self.noise = noise_square.sqrt();
        let LadderRule { slow, increase, lowest, highest, .. } = self.rule;
        if let Some(before) = self.figure.filter(|_| figure > 2.0 * self.noise) {
            if figure > before {
                self.gain = (0.5 * self.gain).max(lowest);
            } else if figure > slow * before {
                self.gain = (increase * self.gain).min(highest);
            }
        }
        self.figure = Some(figure);
    }
}

impl<L: Law> Law for Ladder<L> {
    fn inner(&self) -> Option<&dyn Law> {
        Some(&self.law)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        Some(&mut self.law)
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let is_finite = input.iter().chain(error).all(|value| value.is_finite());
        if next.len() != input.len() || !is_finite {
            // The inner law knows the shapes and returns their errors, without having learned.
            self.law.update(input, error, next)?;
            let allowed = "input and error must be finite, and the next input as long as the input";
            let value = next.len() as f64;
            return Err(LearningError::Parameter { what: "next", value, allowed });
        }
        self.take(input, error);
        if self.runs < self.rule.repeats {
            next.copy_from_slice(input);
            return Ok(());
        }
        self.law.update(input, &self.mean, next)?;
        self.adapt();
        for (next, input) in next.iter_mut().zip(input) {
            *next = input + self.gain * (*next - input);
        }
        self.runs = 0;
        Ok(())
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.law.recall(input, error, disturbance)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        self.law.take_over(reference, input)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        self.law.first_input()
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Inside(&mut self.law)
    }

    fn on_rollback(&mut self) {
        self.gain = (0.5 * self.gain).max(self.rule.lowest);
        self.runs = 0;
        self.law.on_rollback();
    }

    fn reset(&mut self) {
        self.law.reset();
        (self.gain, self.runs, self.figure, self.noise) = (1.0, 0, None, 0.0);
    }

    fn describe(&self) -> String {
        let LadderRule { repeats, slow, increase, lowest, highest } = self.rule;
        format!(
            r#"{{"law":"ladder","repeats":{repeats},"slow":{slow},"increase":{increase},"lowest":{lowest},"highest":{highest},"inner":{}}}"#,
            self.law.describe()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::law::pd::{Pd, PdGains};
    use crate::learning::law::q_filter::QFilter;

    fn ladder(rule: LadderRule, n_samples: usize) -> Ladder<Pd> {
        let gains = PdGains { kp: 1.0, kd: 0.0, lead_samples: 0 };
        Ladder::new(Pd::new(gains, n_samples, 1, QFilter::None).unwrap(), rule).unwrap()
    }

    #[test]
    fn the_mean_of_the_repeats_is_learned_once() {
        let mut law = ladder(LadderRule::new(3), 2);
        let mut next = [0.0; 2];
        for (k, error) in [[1.0, 2.0], [2.0, 4.0]].iter().enumerate() {
            law.update(&[10.0, 20.0], error, &mut next).unwrap();
            assert_eq!((next, law.runs()), ([10.0, 20.0], k + 1));
        }
        law.update(&[10.0, 20.0], &[6.0, 0.0], &mut next).unwrap();
        assert_eq!((next, law.runs()), ([13.0, 22.0], 0));
        // Variances 7 and 4, mean square of the mean (9 + 4) / 2.
        assert!((law.noise() - (5.5_f64 / 3.0).sqrt()).abs() < 1e-14);
        assert!((law.figure().unwrap() - (6.5_f64 - 5.5 / 3.0).sqrt()).abs() < 1e-14);
    }

    #[test]
    fn another_input_begins_a_new_mean() {
        let mut law = ladder(LadderRule::new(2), 1);
        let mut next = [0.0];
        law.update(&[1.0], &[50.0], &mut next).unwrap();
        law.update(&[2.0], &[1.0], &mut next).unwrap();
        assert_eq!((next, law.runs()), ([2.0], 1));
        law.update(&[2.0], &[3.0], &mut next).unwrap();
        assert!((next[0] - 4.0).abs() < 1e-15);
    }

    #[test]
    fn the_gain_follows_the_decay() {
        let mut law = ladder(LadderRule::new(1), 1);
        let mut gain_after = |error: f64| {
            let mut next = [0.0];
            law.update(&[0.0], &[error], &mut next).unwrap();
            assert!((next[0] - law.gain() * error).abs() < 1e-15);
            law.gain()
        };
        let expected = [
            (10.0, 1.0),
            (5.0, 1.0),
            (4.5, 1.25),
            (4.4, 1.5),
            (4.3, 1.5),
            (4.35, 0.75),
            (5.0, 0.375),
            (1.0, 0.375),
        ];
        for (error, gain) in expected {
            assert!((gain_after(error) - gain).abs() < 1e-15, "{error}");
        }
        for size in 2..20 {
            gain_after(f64::from(size));
        }
        assert!((gain_after(30.0) - 0.0625).abs() < 1e-15);
    }

    #[test]
    fn an_input_that_is_taken_back_halves_the_gain_and_begins_a_new_mean() {
        let mut law = ladder(LadderRule::new(2), 1);
        let mut next = [0.0];
        law.update(&[1.0], &[8.0], &mut next).unwrap();
        law.on_rollback();
        assert_eq!((law.runs(), law.gain().to_bits()), (0, 0.5_f64.to_bits()));
        // The same input again: earlier runs with it do not count.
        law.update(&[1.0], &[2.0], &mut next).unwrap();
        law.update(&[1.0], &[4.0], &mut next).unwrap();
        assert!((next[0] - 2.5).abs() < 1e-15);
        for _ in 0..9 {
            law.on_rollback();
        }
        assert!((law.gain() - 0.0625).abs() < 1e-15);
    }

    #[test]
    fn noise_does_not_move_the_gain() {
        // The repeatable part is gone; the remainder changes sign from run to run.
        let mut law = ladder(LadderRule::new(2), 1);
        let mut next = [0.0];
        for size in [1.0, 1.1, 1.3, 0.9] {
            law.update(&[0.0], &[size], &mut next).unwrap();
            law.update(&[0.0], &[-0.9 * size], &mut next).unwrap();
            assert!((law.gain() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn noise_that_is_learned_falls_with_the_root_of_the_repeats() {
        let mut seed = 3_u64;
        let mut noise = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f64 / 16_777_216.0 - 0.5
        };
        let mut learned = |repeats: usize| {
            let mut law = ladder(LadderRule::new(repeats), 4000);
            let mut next = vec![0.0; 4000];
            for _ in 0..repeats {
                let error: Vec<f64> = (0..4000).map(|_| noise()).collect();
                law.update(&vec![0.0; 4000], &error, &mut next).unwrap();
            }
            (next.iter().map(|u| u * u).sum::<f64>() / 4000.0).sqrt()
        };
        let once = learned(1);
        for repeats in [4, 16, 64] {
            let ratio = learned(repeats) * (repeats as f64).sqrt() / once;
            assert!((0.9..1.1).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn wrong_rules_and_signals_are_refused_one_at_a_time() {
        let rule = LadderRule::new(2);
        let refuse = |rule| {
            let law = Pd::new(PdGains { kp: 1.0, kd: 0.0, lead_samples: 0 }, 1, 1, QFilter::None)
                .unwrap();
            Ladder::new(law, rule).unwrap_err().to_string()
        };
        assert!(refuse(LadderRule::new(0)).contains("repeats = 0"));
        assert!(refuse(LadderRule { slow: 1.1, ..rule }).contains("slow = 1.1"));
        assert!(refuse(LadderRule { increase: 0.9, ..rule }).contains("increase = 0.9"));
        assert!(refuse(LadderRule { lowest: 0.0, ..rule }).contains("lowest = 0"));
        assert!(refuse(LadderRule { highest: f64::INFINITY, ..rule }).contains("highest = inf"));
        let mut law = ladder(rule, 2);
        assert!(law.update(&[0.0; 2], &[f64::NAN, 0.0], &mut [0.0; 2]).is_err());
        assert!(law.update(&[0.0; 2], &[0.0; 2], &mut [0.0; 1]).is_err());
        assert_eq!(law.runs(), 0);
    }
}
