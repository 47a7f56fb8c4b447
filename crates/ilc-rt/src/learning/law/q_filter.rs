//! The Q-filter of a law, of any kind; every law with a filter uses this one.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use nalgebra::Complex;

use crate::signal::{
    FirFilter, GaussianFilter, Section, SignalError, SosFilter, Switched, SwitchedFilter,
    Symmetric, ZeroPhase, butterworth,
};

/// Filter of a law.
#[derive(Debug, Clone, PartialEq)]
pub enum QFilter {
    /// No filter: the law converges only where the model allows it.
    None,
    /// Forward and backward: zero-phase.
    ZeroPhase(Vec<Section>),
    /// Forward only, from rest: lags; for comparison.
    Causal(Vec<Section>),
    /// Gaussian: zero-phase, without overshoot.
    Gaussian(GaussianFilter),
    /// Zero-phase with a different cut-off on each segment of the run.
    Switched(SwitchedFilter),
    /// Symmetric FIR: zero-phase.
    Fir(FirFilter),
}

impl QFilter {
    /// Returns a zero-phase Butterworth low-pass.
    ///
    /// # Errors
    /// - [`SignalError`] for an invalid order or cut-off.
    pub fn low_pass(order: usize, cutoff_hz: f64, dt_s: f64) -> Result<Self, SignalError> {
        Ok(Self::ZeroPhase(butterworth(order, cutoff_hz, dt_s)?))
    }

    /// Sets the filter up for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`SignalError::TooShort`] if the run is too short for it, [`SignalError::SegmentBeyondEnd`]
    ///   if it switches after the run's end.
    pub fn for_samples(&self, n_samples: usize) -> Result<QRunner, SignalError> {
        Ok(QRunner(match self {
            Self::None => Kind::None,
            Self::ZeroPhase(sections) => {
                Kind::ZeroPhase(ZeroPhase::new(sections.clone(), n_samples)?)
            }
            Self::Causal(sections) => Kind::Causal(SosFilter::new(sections.clone())),
            Self::Gaussian(filter) => Kind::Symmetric(filter.for_samples(n_samples)?),
            Self::Switched(filter) => Kind::Switched(filter.for_samples(n_samples)?),
            Self::Fir(filter) => Kind::Symmetric(filter.for_samples(n_samples)?),
        }))
    }

    /// Returns the highest frequency that one pass lets through with `1 / sqrt 2` or more, for
    /// signals sampled every `dt_s`: the cut-off of a low-pass, the highest one of a switched
    /// filter.
    ///
    /// `None` without a filter, or for one whose gain is below that at every frequency.
    pub fn cutoff_hz(&self, dt_s: f64) -> Option<f64> {
        match self {
            Self::None => None,
            Self::ZeroPhase(sections) | Self::Causal(sections) => highest_passed_hz(dt_s, |z| {
                let gain = |Section { b, a }: &Section| {
                    (b[0] + (b[1] + b[2] / z) / z) / (1.0 + (a[0] + a[1] / z) / z)
                };
                sections.iter().map(gain).product()
            }),
            Self::Gaussian(filter) => Some(filter.bandwidth_hz() * filter.dt_s() / dt_s),
            Self::Switched(filter) => Some(filter.highest_hz() * filter.dt_s() / dt_s),
            Self::Fir(filter) => highest_passed_hz(dt_s, |z| {
                filter.taps().iter().rev().fold(Complex::new(0.0, 0.0), |sum, tap| sum / z + *tap)
            }),
        }
    }

    /// Returns the filter and its parameters as JSON, for the record of the run.
    pub fn describe(&self) -> String {
        let sections = |kind: &str, sections: &[Section]| {
            let rows: Vec<String> = sections
                .iter()
                .map(|Section { b: [b0, b1, b2], a: [a1, a2] }| {
                    format!("[{b0},{b1},{b2},1,{a1},{a2}]")
                })
                .collect();
            format!(r#"{{"kind":"{kind}","sos":[{}]}}"#, rows.join(","))
        };
        match self {
            Self::None => "null".to_owned(),
            Self::ZeroPhase(given) => sections("zero_phase", given),
            Self::Causal(given) => sections("causal", given),
            Self::Gaussian(filter) => format!(
                r#"{{"kind":"gaussian","bandwidth_hz":{},"dt_s":{}}}"#,
                filter.bandwidth_hz(),
                filter.dt_s()
            ),
            Self::Switched(filter) => {
                let segments: Vec<String> = filter
                    .segments()
                    .iter()
                    .map(|segment| format!("[{},{}]", segment.start, segment.cutoff_hz))
                    .collect();
                format!(
                    r#"{{"kind":"switched","order":{},"segments":[{}],"blend":{},"dt_s":{}}}"#,
                    filter.order(),
                    segments.join(","),
                    filter.blend(),
                    filter.dt_s()
                )
            }
            Self::Fir(filter) => {
                let taps: Vec<String> = filter.taps().iter().map(f64::to_string).collect();
                format!(r#"{{"kind":"fir","taps":[{}]}}"#, taps.join(","))
            }
        }
    }
}

/// Returns the highest frequency at which a response on the unit circle falls below `1 / sqrt 2`.
fn highest_passed_hz(dt_s: f64, response: impl Fn(Complex<f64>) -> Complex<f64>) -> Option<f64> {
    const STEPS: usize = 4096;
    let passes =
        |omega_rad: f64| response(Complex::from_polar(1.0, omega_rad)).norm() >= FRAC_1_SQRT_2;
    let omega_rad = |place: usize| PI * place as f64 / STEPS as f64;
    let place = (0..=STEPS).rev().find(|place| passes(omega_rad(*place)))?;
    let (mut low, mut high) = (omega_rad(place), omega_rad(place + 1).min(PI));
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if passes(middle) { low = middle } else { high = middle }
    }
    Some(low / (TAU * dt_s))
}

/// A [`QFilter`] with its workspace.
#[derive(Debug, Clone)]
pub struct QRunner(Kind);

#[derive(Debug, Clone)]
enum Kind {
    None,
    ZeroPhase(ZeroPhase),
    Causal(SosFilter),
    Symmetric(Symmetric),
    Switched(Switched),
}

impl QRunner {
    /// Filters every channel in place.
    ///
    /// # Shapes
    /// - `signal`: time first, `n_samples` x `n_channels`
    /// # Real Time
    /// Cold path, but does not allocate.
    /// # Errors
    /// - [`SignalError::Length`] if the signal has a different length than the filter was set up
    ///   for.
    pub fn apply(&mut self, signal: &mut [f64], n_channels: usize) -> Result<(), SignalError> {
        (0..n_channels).try_for_each(|channel| match &mut self.0 {
            Kind::None => Ok(()),
            Kind::ZeroPhase(filter) => filter.apply(signal, channel, n_channels),
            Kind::Causal(filter) => {
                filter.reset();
                for value in signal.iter_mut().skip(channel).step_by(n_channels) {
                    *value = filter.step(*value);
                }
                Ok(())
            }
            Kind::Symmetric(filter) => filter.apply(signal, channel, n_channels),
            Kind::Switched(filter) => filter.apply(signal, channel, n_channels),
        })
    }

    /// Applies the transpose (adjoint) of the filter to every channel in place, for the analysis of
    /// laws; shapes are those of [`QRunner::apply`].
    ///
    /// # Errors
    /// - as [`QRunner::apply`].
    pub fn apply_transposed(
        &mut self,
        signal: &mut [f64],
        n_channels: usize,
    ) -> Result<(), SignalError> {
        (0..n_channels).try_for_each(|channel| match &mut self.0 {
            Kind::None => Ok(()),
            Kind::ZeroPhase(filter) => filter.apply_transposed(signal, channel, n_channels),
            Kind::Causal(filter) => {
                filter.reset();
                for value in signal.iter_mut().skip(channel).step_by(n_channels).rev() {
                    *value = filter.step(*value);
                }
                Ok(())
            }
            Kind::Symmetric(filter) => filter.apply_transposed(signal, channel, n_channels),
            Kind::Switched(filter) => filter.apply_transposed(signal, channel, n_channels),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{Segment, butterworth};

    fn every_kind() -> Vec<QFilter> {
        let sections = butterworth(3, 40.0, 2e-3).unwrap();
        let segments =
            [(0, 10.0), (50, 60.0)].map(|(start, cutoff_hz)| Segment { start, cutoff_hz });
        vec![
            QFilter::None,
            QFilter::ZeroPhase(sections.clone()),
            QFilter::Causal(sections),
            QFilter::Gaussian(GaussianFilter::new(30.0, 2e-3).unwrap()),
            QFilter::Switched(SwitchedFilter::new(2, &segments, 20, 2e-3).unwrap()),
            QFilter::Fir(FirFilter::new(&[0.25, 0.5, 0.25]).unwrap()),
        ]
    }

    #[test]
    fn every_kind_treats_its_channels_alike_and_alone() {
        let x: Vec<f64> = (0..120).map(|k| f64::from(k * k % 23) - 11.0).collect();
        for filter in every_kind() {
            let mut runner = filter.for_samples(120).unwrap();
            let mut both: Vec<f64> = x.iter().flat_map(|value| [*value, -2.0 * value]).collect();
            runner.apply(&mut both, 2).unwrap();
            let mut alone = x.clone();
            runner.apply(&mut alone, 1).unwrap();
            for k in 0..120 {
                assert!((both[2 * k] - alone[k]).abs() < 1e-13);
                assert!((both[2 * k + 1] + 2.0 * alone[k]).abs() < 1e-12);
            }
            assert_eq!(alone == x, filter == QFilter::None);
        }
    }

    #[test]
    fn every_kind_says_what_it_is_in_json() {
        let mut kinds: Vec<String> = every_kind()
            .iter()
            .map(|filter| {
                let json: serde_json::Value = serde_json::from_str(&filter.describe()).unwrap();
                json["kind"].as_str().unwrap_or("none").to_owned()
            })
            .collect();
        kinds.sort();
        assert_eq!(kinds, ["causal", "fir", "gaussian", "none", "switched", "zero_phase"]);
    }

    #[test]
    fn every_low_pass_tells_its_cut_off() {
        let told: Vec<Option<f64>> =
            every_kind().iter().map(|filter| filter.cutoff_hz(2e-3)).collect();
        // cos^2 (w / 2) = 1 / sqrt 2 for the taps.
        let taps_hz = 2.0 * (0.5_f64.sqrt().sqrt()).acos() / (TAU * 2e-3);
        let expected = [None, Some(40.0), Some(40.0), Some(30.0), Some(60.0), Some(taps_hz)];
        for (found, expected) in told.iter().zip(expected) {
            match (found, expected) {
                (Some(found), Some(expected)) => {
                    assert!((found - expected).abs() < 1e-6, "{told:?}");
                }
                (found, expected) => assert_eq!(*found, expected),
            }
        }
        let nothing = QFilter::Fir(FirFilter::new(&[0.1]).unwrap());
        assert_eq!(nothing.cutoff_hz(2e-3), None);
        let all = QFilter::Fir(FirFilter::new(&[1.0]).unwrap());
        assert!((all.cutoff_hz(2e-3).unwrap() - 250.0).abs() < 1e-6);
    }

    #[test]
    fn a_run_too_short_for_its_filter_is_refused() {
        let short: Vec<bool> =
            every_kind().iter().map(|filter| filter.for_samples(3).is_err()).collect();
        assert_eq!(short, [false, true, false, true, true, false]);
    }
}
