//! PD-type ILC with a low-pass Q-filter.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff};
use super::q_filter::{QFilter, QRunner};
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::{Law, LearningError, LowPass, Result, Structure};
use crate::schema::{Violation, field_order};

/// `[learning.pd]`: gains and the zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PdParameters {
    /// Proportional gain.
    #[schemars(range(min = -1e3, max = 1e3))]
    pub kp: f64,
    /// Derivative gain, per sample difference.
    #[schemars(range(min = -1e3, max = 1e3))]
    pub kd: f64,
    /// Lead (look-ahead) of the error over the input: the relative degree of the axis, 1 without
    /// delay.
    #[schemars(range(min = 0, max = 1000))]
    pub lead_samples: usize,
    /// Order of the zero-phase Butterworth low-pass (Q-filter).
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency.
    pub cutoff_hz: f64,
}

impl Default for PdParameters {
    fn default() -> Self {
        Self { kp: 0.5, kd: 0.0, lead_samples: 1, order: 2, cutoff_hz: 10.0 }
    }
}

impl LawParameters for PdParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_cutoff("[learning.pd] cutoff_hz", Some(self.cutoff_hz), cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let Self { kp, kd, lead_samples, order, cutoff_hz } = *self;
        let filter = QFilter::low_pass(order, cutoff_hz, context.cell.cycle_s)
            .map_err(LearningError::from)?;
        let gains = PdGains { kp, kd, lead_samples };
        Ok(Box::new(Pd::new(gains, context.n_samples(), context.n_axes(), filter)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"pd\"\n[learning.pd]\nkp = 0.5\nlead_samples = 10\ncutoff_hz = 8.0",
            error_left: 0.1,
        }]
    }
}

/// Gains and lead of a [`Pd`] law.
///
/// # Units
/// - `kp`, `kd`: input units per error unit
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PdGains {
    /// Proportional gain.
    pub kp: f64,
    /// Gain of the error's difference from one sample to the next.
    pub kd: f64,
    /// Samples by which the error is taken ahead: the relative degree of the axis, 1 without dead
    /// time.
    pub lead_samples: usize,
}

/// Proportional-derivative learning, each channel separately.
///
/// `u_{j+1}[n] = Q (u_j[n] + kp e_j[n + lead] + kd (e_j[n + lead] - e_j[n + lead - 1]))`
///
/// Beyond the end of the run the error is held at its last value (and before its start at the first
/// one), so the derivative part is zero there.
///
/// # Shapes
/// - `input`, `error`, `next`: `n_samples` x `n_channels`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples n_channels)`.
/// # Source
/// - \[haas2016\], Eq. (4); \[dimarco2016\], Eq. (3.2).
#[derive(Debug)]
pub struct Pd {
    gains: PdGains,
    n_samples: usize,
    n_channels: usize,
    q_filter: QFilter,
    runner: QRunner,
}

impl Pd {
    /// Creates the law for runs of `n_samples` samples of `n_channels` axes.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a gain that is not finite.
    /// - [`LearningError::Empty`] for 0 samples or channels.
    /// - [`LearningError::Signal`] if the run is too short for the filter.
    pub fn new(
        gains: PdGains,
        n_samples: usize,
        n_channels: usize,
        q_filter: QFilter,
    ) -> Result<Self> {
        for (what, value) in [("kp", gains.kp), ("kd", gains.kd)] {
            if !value.is_finite() {
                let allowed = "a gain must be finite";
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        check_counts(&[("n_samples", n_samples), ("n_channels", n_channels)])?;
        let runner = q_filter.for_samples(n_samples)?;
        Ok(Self { gains, n_samples, n_channels, q_filter, runner })
    }
}

impl Law for Pd {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let (n_samples, n_channels) = (self.n_samples, self.n_channels);
        check_update(input, error, next, n_samples, [n_channels; 2])?;
        let PdGains { kp, kd, lead_samples: lead } = self.gains;
        let last = n_samples - 1;
        for channel in 0..n_channels {
            let at = |sample: usize| sample.min(last) * n_channels + channel;
            for k in 0..n_samples {
                let ahead = error[at(k.saturating_add(lead))];
                let before = error[at(k.saturating_add(lead).saturating_sub(1))];
                next[at(k)] = input[at(k)] + kp * ahead + kd * (ahead - before);
            }
        }
        self.runner.apply(next, n_channels)?;
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
        self.runner.apply_transposed(to_input, n_channels)?;
        let PdGains { kp, kd, lead_samples: lead } = self.gains;
        let last = n_samples - 1;
        for channel in 0..n_channels {
            let at = |sample: usize| sample.min(last) * n_channels + channel;
            for k in 0..n_samples {
                let value = to_input[at(k)];
                to_error[at(k.saturating_add(lead))] += (kp + kd) * value;
                to_error[at(k.saturating_add(lead).saturating_sub(1))] -= kd * value;
            }
        }
        Ok(true)
    }

    fn structure(&self) -> Structure<'_> {
        Structure::Pd(self.gains)
    }

    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        let cutoff_hz = self.q_filter.cutoff_hz(dt_s)?;
        let plain = Self::new(self.gains, self.n_samples, self.n_channels, QFilter::None);
        Some(LowPass { cutoff_hz, unfiltered: Box::new(plain.ok()?) })
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        format!(
            r#"{{"law":"pd","kp":{},"kd":{},"lead_samples":{},"q_filter":{},"n_samples":{},"n_channels":{}}}"#,
            self.gains.kp,
            self.gains.kd,
            self.gains.lead_samples,
            self.q_filter.describe(),
            self.n_samples,
            self.n_channels
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::butterworth;

    fn pd(kp: f64, kd: f64, lead: usize, n_channels: usize) -> Pd {
        Pd::new(PdGains { kp, kd, lead_samples: lead }, 4, n_channels, QFilter::None).unwrap()
    }

    #[test]
    fn the_equation_holds_sample_by_sample() {
        let mut next = [0.0; 4];
        let error = [1.0, 3.0, 7.0, 4.0];
        pd(2.0, 10.0, 1, 1).update(&[100.0; 4], &error, &mut next).unwrap();
        // Beyond the end the error stays 4 and its difference 0.
        assert_eq!(next.to_vec(), [126.0, 154.0, 78.0, 108.0]);
        pd(2.0, 10.0, 0, 1).update(&[0.0; 4], &error, &mut next).unwrap();
        assert_eq!(next.to_vec(), [2.0, 26.0, 54.0, -22.0]);
        pd(1.0, 0.0, 9, 1).update(&[0.0; 4], &error, &mut next).unwrap();
        assert_eq!(next.to_vec(), [4.0; 4]);
    }

    #[test]
    fn channels_do_not_mix() {
        let mut next = [0.0; 8];
        let error = [1.0, -1.0, 3.0, -3.0, 7.0, -7.0, 4.0, -4.0];
        pd(2.0, 10.0, 1, 2).update(&[0.0; 8], &error, &mut next).unwrap();
        for pair in next.chunks_exact(2) {
            assert!((pair[0] + pair[1]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_filter_removes_what_alternates() {
        let gains = PdGains { kp: 0.0, kd: 0.0, lead_samples: 1 };
        let sections = butterworth(2, 20.0, 2e-3).unwrap();
        let alternating: Vec<f64> = (0..200).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        for filter in [QFilter::ZeroPhase(sections.clone()), QFilter::Causal(sections)] {
            let mut next = vec![0.0; 200];
            let mut law = Pd::new(gains, 200, 1, filter).unwrap();
            law.update(&alternating, &[0.0; 200], &mut next).unwrap();
            assert!(next[80..120].iter().all(|value| value.abs() < 1e-3), "{:?}", law.describe());
        }
    }

    #[test]
    fn wrong_signals_are_refused_one_at_a_time() {
        let mut law = pd(1.0, 1.0, 1, 1);
        let mut next = [0.0; 4];
        let line = law.update(&[0.0; 3], &[0.0; 4], &mut next).unwrap_err().to_string();
        assert!(line.contains("input holds 3 values"), "{line}");
        let line = law.update(&[0.0; 4], &[0.0; 5], &mut next).unwrap_err().to_string();
        assert!(line.contains("error holds 5 values"), "{line}");
        let error = [0.0, 0.0, f64::NAN, 0.0];
        let line = law.update(&[0.0; 4], &error, &mut next).unwrap_err().to_string();
        assert!(line.contains("error is NaN at sample 2, channel 0"), "{line}");
        assert!(law.update(&[0.0; 4], &[0.0; 4], &mut [0.0; 3]).is_err());
        let gains = PdGains { kp: f64::INFINITY, kd: 0.0, lead_samples: 1 };
        assert!(Pd::new(gains, 4, 1, QFilter::None).is_err());
    }
}
