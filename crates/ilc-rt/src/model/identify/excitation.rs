//! The whole input of an experiment: periods of a waveform, from rest to rest.

use serde::{Deserialize, Serialize};

use super::{Spacing, multisine, swept_sine};
use crate::model::ModelError;

/// Largest number of samples of an experiment.
const SAMPLES_MAX: f64 = 4e6;
/// Smallest number of cycles of the lowest frequency per period.
const CYCLES_MIN: f64 = 5.0;
/// Largest excited frequency as a share of the Nyquist frequency.
const NYQUIST_SHARE: f64 = 0.9;
/// Share of a sweep's period in which the axis comes to rest.
const REST: f64 = 0.2;

/// Waveform of one period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Waveform {
    /// A sine whose frequency rises linearly with time, then rest.
    LinearSweep,
    /// A sine whose frequency rises exponentially with time, then rest.
    LogarithmicSweep,
    /// Every harmonic of the period in the band, with phases that keep the peak low.
    Multisine,
}

/// An experiment's input: waveform, amplitude, band, and number of periods.
///
/// # Units
/// - `amplitude` (the peak) in the unit of the input: m or m/s; the rest as named
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Excitation {
    /// Waveform of one period.
    pub waveform: Waveform,
    /// Peak of the input.
    pub amplitude: f64,
    /// Lowest frequency.
    pub from_hz: f64,
    /// Highest frequency.
    pub to_hz: f64,
    /// Length of a period, including the rest of a sweep.
    pub period_s: f64,
    /// Evaluated periods: their scatter is noise.
    pub periods: usize,
}

/// An excitation on a sample grid.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcitationSignal {
    /// The input, from rest to rest.
    pub values: Vec<f64>,
    /// First sample of the first evaluated period.
    pub first_sample: usize,
    /// Samples in a period.
    pub period_samples: usize,
    /// Evaluated periods.
    pub periods: usize,
}

impl Excitation {
    /// Samples the excitation.
    ///
    /// Sweeps rest at the end of each period, so every period is evaluated. A multisine has no
    /// rest: one more period, faded in, comes first, in which the axis reaches its steady state,
    /// and a quarter of one fades out at the end.
    ///
    /// # Units
    /// - `dt_s` in seconds
    /// # Errors
    /// - [`ModelError::Parameter`] or [`ModelError::SampleTime`] for a value out of range.
    /// # Examples
    /// ```
    /// use ilc_rt::model::identify::{Excitation, Waveform};
    /// let sweep = Excitation {
    ///     waveform: Waveform::LogarithmicSweep,
    ///     amplitude: 1e-3,
    ///     from_hz: 1.0,
    ///     to_hz: 40.0,
    ///     period_s: 8.0,
    ///     periods: 3,
    /// };
    /// assert_eq!(sweep.signal(1e-3)?.values.len(), 24_000);
    /// # Ok::<(), ilc_rt::model::ModelError>(())
    /// ```
    pub fn signal(&self, dt_s: f64) -> Result<ExcitationSignal, ModelError> {
        let n = self.period_samples(dt_s)?;
        let (amplitude, band) = (self.amplitude, (self.from_hz, self.to_hz));
        match self.waveform {
            Waveform::LinearSweep | Waveform::LogarithmicSweep => {
                let spacing = match self.waveform {
                    Waveform::LinearSweep => Spacing::Linear,
                    _ => Spacing::Logarithmic,
                };
                let moving = part(n, 1.0 - REST);
                let mut period = swept_sine(amplitude, band, moving, dt_s, spacing)?;
                period.resize(n, 0.0);
                Ok(ExcitationSignal {
                    values: period.repeat(self.periods),
                    first_sample: 0,
                    period_samples: n,
                    periods: self.periods,
                })
            }
            Waveform::Multisine => {
                let period = multisine(amplitude, band, n, dt_s)?;
                let (fade_in, fade_out) = (part(n, 0.5), part(n, 0.25));
                let mut values = period.repeat(self.periods + 1);
                for (k, value) in values.iter_mut().take(fade_in).enumerate() {
                    *value *= rise(k as f64 / fade_in as f64);
                }
                let tail = period.iter().take(fade_out).enumerate();
                values.extend(tail.map(|(k, u)| u * rise(1.0 - (k + 1) as f64 / fade_out as f64)));
                Ok(ExcitationSignal {
                    values,
                    first_sample: n,
                    period_samples: n,
                    periods: self.periods,
                })
            }
        }
    }

    fn period_samples(&self, dt_s: f64) -> Result<usize, ModelError> {
        if !(dt_s.is_finite() && dt_s > 0.0) {
            return Err(ModelError::SampleTime { dt_s });
        }
        if self.periods == 0 {
            return Err(refused("periods", 0.0, "at least one period must be evaluated"));
        }
        let n = (self.period_s / dt_s).round();
        let total = n * (self.periods as f64 + 1.25);
        if !(n >= 8.0 && total <= SAMPLES_MAX) {
            let allowed = "at least 8 samples a period and at most 4 million in all are needed";
            return Err(refused("period_s", self.period_s, allowed));
        }
        if self.from_hz * self.period_s < CYCLES_MIN {
            let allowed = "a period must hold at least 5 cycles of the lowest frequency";
            return Err(refused("from_hz", self.from_hz, allowed));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let n = n as usize;
        Ok(n)
    }
}

impl ExcitationSignal {
    /// Returns the evaluated samples: whole periods.
    pub fn evaluated(&self) -> std::ops::Range<usize> {
        self.first_sample..self.first_sample + self.period_samples * self.periods
    }
}

/// Returns half a cosine from 0 to 1.
pub(super) fn rise(share: f64) -> f64 {
    0.5 * (1.0 - (std::f64::consts::PI * share.clamp(0.0, 1.0)).cos())
}

/// Checks amplitude and band of a waveform.
pub(super) fn check(amplitude: f64, band_hz: (f64, f64), dt_s: f64) -> Result<(), ModelError> {
    let (from_hz, to_hz) = band_hz;
    if !(dt_s.is_finite() && dt_s > 0.0) {
        return Err(ModelError::SampleTime { dt_s });
    }
    if !(amplitude.is_finite() && amplitude > 0.0) {
        return Err(refused("amplitude", amplitude, "it must be finite and greater than 0"));
    }
    if !(from_hz.is_finite() && from_hz > 0.0) {
        return Err(refused("from_hz", from_hz, "it must be finite and greater than 0 Hz"));
    }
    if !(to_hz.is_finite() && to_hz > from_hz && to_hz <= NYQUIST_SHARE * 0.5 / dt_s) {
        let allowed = "it must be above from_hz and at most 0.45 / dt_s";
        return Err(refused("to_hz", to_hz, allowed));
    }
    Ok(())
}

pub(super) fn refused(what: &'static str, value: f64, allowed: &'static str) -> ModelError {
    ModelError::Parameter { what, value, allowed }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
fn part(n: usize, share: f64) -> usize {
    (n as f64 * share).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn excitation(waveform: Waveform) -> Excitation {
        Excitation {
            waveform,
            amplitude: 2e-3,
            from_hz: 1.0,
            to_hz: 60.0,
            period_s: 6.0,
            periods: 3,
        }
    }

    #[test]
    fn every_waveform_repeats_exactly_within_its_peak_and_begins_and_ends_at_rest() {
        for waveform in [Waveform::LinearSweep, Waveform::LogarithmicSweep, Waveform::Multisine] {
            let signal = excitation(waveform).signal(2e-3).unwrap();
            let used = &signal.values[signal.evaluated()];
            assert_eq!(used.len(), 3 * 3000);
            assert_eq!(used[..3000], used[3000..6000]);
            assert_eq!(used[..3000], used[6000..]);
            let peak = signal.values.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
            assert!((peak / 2e-3 - 1.0).abs() < 2e-3 && peak <= 2e-3, "{waveform:?}: {peak}");
            assert!(signal.values[0].abs() < 1e-12);
            assert!(signal.values[signal.values.len() - 1].abs() < 1e-12);
            let step = signal.values.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            assert!(step <= 2e-3 * std::f64::consts::TAU * 60.0 * 2e-3 * 1.01, "{step}");
        }
    }

    #[test]
    fn one_wrong_value_at_a_time_is_named() {
        let good = excitation(Waveform::Multisine);
        let wrong = |change: &dyn Fn(&mut Excitation)| {
            let mut bad = good;
            change(&mut bad);
            bad.signal(2e-3).unwrap_err().to_string()
        };
        assert!(wrong(&|e| e.amplitude = 0.0).contains("amplitude = 0"));
        assert!(wrong(&|e| e.from_hz = 0.1).contains("5 cycles"));
        assert!(wrong(&|e| e.from_hz = f64::NAN).contains("from_hz = NaN"));
        assert!(wrong(&|e| e.to_hz = 0.5).contains("to_hz = 0.5"));
        assert!(wrong(&|e| e.to_hz = 240.0).contains("to_hz = 240"));
        assert!(wrong(&|e| e.period_s = f64::INFINITY).contains("period_s"));
        assert!(wrong(&|e| e.periods = 0).contains("periods = 0"));
        assert!(good.signal(0.0).is_err());
    }
}
