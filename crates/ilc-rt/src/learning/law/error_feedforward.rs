//! Feed-forward learned from the filtered error: P-type ILC of the parallel structure.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawName;
use super::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff, needs_inputs,
};
use super::q_filter::{QFilter, QRunner};
use crate::fieldbus::cia402::InputKind;
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::{Law, LearningError, LowPass, Result, Surrogate};
use crate::schema::{Violation, field_order};

/// `[learning.error_feedforward]`: gain, lead, and the zero-phase Butterworth low-pass of the error.
///
/// Only with `interface = "csv"` on every axis: the learned input is added to the output of the
/// controller's position loop, which keeps acting on the error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ErrorFeedforwardParameters {
    /// Learned velocity per error.
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub gain_per_s: f64,
    /// Lead (look-ahead) of the error over the input.
    #[schemars(range(min = 0, max = 1000))]
    pub lead_samples: usize,
    /// Order of the zero-phase Butterworth low-pass (Q-filter).
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency.
    pub cutoff_hz: f64,
}

impl Default for ErrorFeedforwardParameters {
    fn default() -> Self {
        Self { gain_per_s: 10.0, lead_samples: 1, order: 2, cutoff_hz: 5.0 }
    }
}

impl LawParameters for ErrorFeedforwardParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_cutoff("[learning.error_feedforward] cutoff_hz", Some(self.cutoff_hz), cell)
    }

    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        let law = LawName::ErrorFeedforward;
        // The law adds to the output of a controller that keeps acting on the error.
        if let Some(axis) = cell.axes.iter().find(|axis| axis.corrects_set_point()) {
            return Err(LawCell::unfit(
                law,
                format!(
                    "only with interface = \"csv\" on every axis, as it adds to the output of the \
                     position loop here; axis {} has its position loop in the drive",
                    axis.name
                ),
            ));
        }
        if let Some(axis) = cell.axes.iter().find(|axis| axis.input == InputKind::Torque) {
            return Err(LawCell::unfit(
                law,
                format!(
                    "only with velocities, as its gain is per second; axis {} learns a torque",
                    axis.name
                ),
            ));
        }
        needs_inputs(law, cell)
    }

    /// The loop saturates the input at its bound; the law knows the bound, so that it does not wind
    /// up (anti-windup).
    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let Self { gain_per_s, lead_samples, order, cutoff_hz } = *self;
        let input_max = context.cell.axes.iter().map(|axis| axis.input_max);
        let input_max = input_max.fold(f64::INFINITY, f64::min);
        let filter = QFilter::low_pass(order, cutoff_hz, context.cell.cycle_s)
            .map_err(LearningError::from)?;
        let rule = Feedforward { gain_per_s, lead_samples, input_max };
        let law = ErrorFeedforward::new(rule, context.n_samples(), context.n_axes(), filter)?;
        Ok(Box::new(law))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: true,
            learning: "law = \"error_feedforward\"\ninput_max_m_s = 0.1\n\
                       [learning.error_feedforward]\ngain_per_s = 30.0\nlead_samples = 30\n\
                       cutoff_hz = 5.0",
            error_left: 0.2,
        }]
    }
}

/// Parameters of an [`ErrorFeedforward`] law.
///
/// # Units
/// - `gain_per_s`: input units per error unit; `input_max` in input units
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedforward {
    /// Learning gain, in the paper phi.
    pub gain_per_s: f64,
    /// Samples by which the error is taken ahead: 1 for an axis without dead time.
    pub lead_samples: usize,
    /// Bound of the learned feed-forward; infinite for unlimited.
    pub input_max: f64,
}

/// Open-loop learning from the filtered error, each channel separately.
///
/// `w_j[k] = clamp(w_{j-1}[k] + phi (Q e_{j-1})[k + lead])`, the drive being given `w_j + C e_j`
///
/// Only the error is filtered, so what was learned stays: it does not decay as in a law that
/// filters its input each time. Beyond the end of the run the filtered error is held. The bound
/// keeps the feed-forward out of the drive's saturation (anti-windup);
/// [`ErrorFeedforward::n_limited`] returns how often it was active.
///
/// # Shapes
/// - `input` (w), `error`, `next`: `n_samples` x `n_channels`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples n_channels)`.
/// # Source
/// - \[filter-based\], Eq. (2), with the lead of Eq. (9) and the filter of Section 4.
#[derive(Debug)]
pub struct ErrorFeedforward {
    rule: Feedforward,
    n_samples: usize,
    n_channels: usize,
    q_filter: QFilter,
    runner: QRunner,
    filtered: Vec<f64>,
    n_limited: usize,
}

impl ErrorFeedforward {
    /// Creates the law for runs of `n_samples` samples of `n_channels` axes.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a gain that is not finite, or a bound that is not
    ///   positive.
    /// - [`LearningError::Empty`] for 0 samples or channels.
    /// - [`LearningError::Signal`] if the run is too short for the filter.
    pub fn new(
        rule: Feedforward,
        n_samples: usize,
        n_channels: usize,
        q_filter: QFilter,
    ) -> Result<Self> {
        let Feedforward { gain_per_s: gain, input_max: limit, .. } = rule;
        if !gain.is_finite() {
            let allowed = "a gain must be finite";
            return Err(LearningError::Parameter { what: "gain_per_s", value: gain, allowed });
        }
        if limit.is_nan() || limit <= 0.0 {
            let allowed = "a bound must be greater than 0";
            return Err(LearningError::Parameter { what: "input_max", value: limit, allowed });
        }
        check_counts(&[("n_samples", n_samples), ("n_channels", n_channels)])?;
        let runner = q_filter.for_samples(n_samples)?;
        let filtered = vec![0.0; n_samples * n_channels];
        Ok(Self { rule, n_samples, n_channels, q_filter, runner, filtered, n_limited: 0 })
    }

    /// Returns the number of saturated values of the last input.
    pub fn n_limited(&self) -> usize {
        self.n_limited
    }

    /// Creates the law without its bound, with another filter.
    fn unlimited(&self, q_filter: QFilter) -> Option<Box<dyn Law>> {
        let rule = Feedforward { input_max: f64::INFINITY, ..self.rule };
        let law = Self::new(rule, self.n_samples, self.n_channels, q_filter).ok()?;
        Some(Box::new(law))
    }
}

impl Law for ErrorFeedforward {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let (n_samples, n_channels) = (self.n_samples, self.n_channels);
        check_update(input, error, next, n_samples, [n_channels; 2])?;
        self.filtered.copy_from_slice(error);
        self.runner.apply(&mut self.filtered, n_channels)?;
        let Feedforward { gain_per_s: gain, lead_samples: lead, input_max: limit } = self.rule;
        self.n_limited = 0;
        for k in 0..n_samples {
            let ahead = k.saturating_add(lead).min(n_samples - 1);
            for channel in 0..n_channels {
                let here = k * n_channels + channel;
                let wanted = input[here] + gain * self.filtered[ahead * n_channels + channel];
                next[here] = wanted.clamp(-limit, limit);
                self.n_limited += usize::from(wanted.abs() > limit);
            }
        }
        check("next", next, n_samples, n_channels)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let (n_samples, n_channels) = (self.n_samples, self.n_channels);
        check_adjoint(dual, to_input, to_error, n_samples, [n_channels; 2])?;
        to_input.copy_from_slice(dual);
        to_error.fill(0.0);
        let Feedforward { gain_per_s: gain, lead_samples: lead, .. } = self.rule;
        for k in 0..n_samples {
            let ahead = k.saturating_add(lead).min(n_samples - 1);
            for channel in 0..n_channels {
                to_error[ahead * n_channels + channel] += gain * dual[k * n_channels + channel];
            }
        }
        self.runner.apply_transposed(to_error, n_channels)?;
        Ok(true)
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        if self.rule.input_max.is_infinite() {
            return Surrogate::Itself;
        }
        self.unlimited(self.q_filter.clone()).map_or(Surrogate::Itself, Surrogate::Unbounded)
    }

    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        let cutoff_hz = self.q_filter.cutoff_hz(dt_s)?;
        Some(LowPass { cutoff_hz, unfiltered: self.unlimited(QFilter::None)? })
    }

    fn reset(&mut self) {
        self.n_limited = 0;
    }

    fn describe(&self) -> String {
        let Feedforward { gain_per_s: gain, lead_samples: lead, input_max: limit } = self.rule;
        let limit = if limit.is_finite() { limit.to_string() } else { "null".to_owned() };
        format!(
            r#"{{"law":"error_feedforward","gain_per_s":{gain},"lead_samples":{lead},"input_max":{limit},"filter":{},"n_samples":{},"n_channels":{}}}"#,
            self.q_filter.describe(),
            self.n_samples,
            self.n_channels
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::from_transfer_function;
    use crate::signal::{FirFilter, butterworth};

    const PLAIN: Feedforward =
        Feedforward { gain_per_s: 0.5, lead_samples: 1, input_max: f64::INFINITY };

    #[test]
    fn the_equation_holds_sample_by_sample() {
        let mut next = [0.0; 4];
        let error = [1.0, 3.0, 7.0, 4.0];
        let mut law = ErrorFeedforward::new(PLAIN, 4, 1, QFilter::None).unwrap();
        law.update(&[10.0; 4], &error, &mut next).unwrap();
        assert_eq!(next.to_vec(), [11.5, 13.5, 12.0, 12.0]);
        // The mean of three neighbours, one ahead: 11/3, 14/3, 15/3, 15/3.
        let mean = FirFilter::new(&[1.0 / 3.0; 3]).unwrap();
        let mut law = ErrorFeedforward::new(PLAIN, 4, 1, QFilter::Fir(mean)).unwrap();
        law.update(&[0.0; 4], &error, &mut next).unwrap();
        for (found, expected) in next.iter().zip([11.0 / 6.0, 14.0 / 6.0, 2.5, 2.5]) {
            assert!((found - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn the_limit_bounds_every_channel_and_is_counted() {
        let rule = Feedforward { gain_per_s: 1.0, lead_samples: 0, input_max: 2.0 };
        let mut law = ErrorFeedforward::new(rule, 2, 2, QFilter::None).unwrap();
        let mut next = [0.0; 4];
        law.update(&[0.0; 4], &[1.0, -3.0, 2.0, 5.0], &mut next).unwrap();
        assert_eq!(next.to_vec(), [1.0, -2.0, 2.0, 2.0]);
        assert_eq!(law.n_limited(), 2);
        law.reset();
        assert_eq!(law.n_limited(), 0);
    }

    /// The axis of the paper with its feedback: `y = P (w + C r)`, `P = G / (1 + C G)`.
    fn root_mean_squares(q_filter: QFilter, runs: usize) -> Vec<f64> {
        let (n_samples, kp) = (1500, 2.0);
        let (num, den) = ([0.00475, 0.00475], [1.0, -1.85, 0.85]);
        let closed = [den[0], den[1] + kp * num[0], den[2] + kp * num[1]];
        let plant = from_transfer_function(&num, &closed, Some(2e-3)).unwrap();
        let reference: Vec<f64> = (0..n_samples)
            .map(|k| {
                let t_s = f64::from(k) * 2e-3;
                2e-3 * (1.0 - (2.0 * t_s).cos() + 0.3 * (7.0 * t_s).sin().powi(3))
            })
            .collect();
        let n_samples = reference.len();
        let mut law = ErrorFeedforward::new(PLAIN, n_samples, 1, q_filter).unwrap();
        let (mut w, mut next) = (vec![0.0; n_samples], vec![0.0; n_samples]);
        let mut seed = 7_u64;
        (0..runs)
            .map(|_| {
                let command: Vec<f64> = w.iter().zip(&reference).map(|(w, r)| w + kp * r).collect();
                let y = plant.simulate(&command, None).unwrap();
                let error: Vec<f64> = reference
                    .iter()
                    .zip(y)
                    .map(|(r, y)| {
                        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                        r - y + 0.3e-6 * 3.46 * ((seed >> 40) as f64 / 16_777_216.0 - 0.5)
                    })
                    .collect();
                law.update(&w, &error, &mut next).unwrap();
                w.copy_from_slice(&next);
                (error.iter().map(|e| e * e).sum::<f64>() / n_samples as f64).sqrt()
            })
            .collect()
    }

    #[test]
    fn without_filter_the_error_falls_and_then_rises_with_it_it_stays_low() {
        let plain = root_mean_squares(QFilter::None, 120);
        let least = plain.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least < 0.2 * plain[0] && plain[119] > 2.0 * least, "{plain:?}");
        let filter = QFilter::ZeroPhase(butterworth(3, 10.0, 2e-3).unwrap());
        let filtered = root_mean_squares(filter, 120);
        assert!(filtered.windows(2).all(|pair| pair[1] < pair[0] + 0.03e-6), "{filtered:?}");
        assert!(filtered[119] < 0.1 * filtered[0], "{filtered:?}");
    }

    #[test]
    fn wrong_numbers_are_refused_one_at_a_time() {
        let line =
            |rule, n, m| ErrorFeedforward::new(rule, n, m, QFilter::None).unwrap_err().to_string();
        assert!(
            line(Feedforward { gain_per_s: f64::NAN, ..PLAIN }, 4, 1).contains("gain_per_s = NaN")
        );
        assert!(line(Feedforward { input_max: 0.0, ..PLAIN }, 4, 1).contains("input_max = 0"));
        assert!(
            line(Feedforward { input_max: f64::NAN, ..PLAIN }, 4, 1).contains("input_max = NaN")
        );
        assert!(line(PLAIN, 0, 1).contains("n_samples = 0"));
        assert!(line(PLAIN, 4, 0).contains("n_channels = 0"));
        let mut law = ErrorFeedforward::new(PLAIN, 4, 1, QFilter::None).unwrap();
        assert!(law.update(&[0.0; 3], &[0.0; 4], &mut [0.0; 4]).is_err());
        assert!(law.update(&[0.0; 4], &[0.0; 3], &mut [0.0; 4]).is_err());
        assert!(law.update(&[0.0; 4], &[0.0; 4], &mut [0.0; 3]).is_err());
        assert!(law.update(&[f64::NAN; 4], &[0.0; 4], &mut [0.0; 4]).is_err());
    }
}
