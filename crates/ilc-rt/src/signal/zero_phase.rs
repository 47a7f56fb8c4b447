//! Forward-backward (zero-phase) filtering: no lag, squared gain.
#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::channel::check_channel;
use super::{Section, SignalError, SosFilter};

/// A zero-phase filter with its workspace.
///
/// The signal is extended at either end by its point reflection (`2 x[0] - x[i]`), filtered forward
/// and then backward; each pass starts in the steady state of its first sample. The gain is
/// `|H|^2`: one half at the cut-off of a Butterworth filter.
///
/// # Shapes
/// - one channel of a signal of fixed length, possibly interleaved with others
/// # Real Time
/// Allocates at creation, never in [`ZeroPhase::apply`].
/// # Source
/// - \[gustafsson1996\]: forward-backward filtering and its initial state.
#[derive(Debug, Clone)]
pub struct ZeroPhase {
    filter: SosFilter,
    padding: usize,
    extended: Vec<f64>,
}

impl ZeroPhase {
    /// Creates the filter and its workspace for signals of `n_samples` samples.
    ///
    /// # Errors
    /// - [`SignalError::TooShort`] unless the signal is longer than the extension at each end,
    ///   three times the length of the filter's polynomials.
    /// - [`SignalError::StaticGain`] for a section that has no steady state to start from.
    #[expect(clippy::disallowed_macros, reason = "cold: set-up")]
    pub fn new(sections: Vec<Section>, n_samples: usize) -> Result<Self, SignalError> {
        for (index, section) in sections.iter().enumerate() {
            let gain = section.static_gain();
            if !gain.is_finite() {
                return Err(SignalError::StaticGain { index, gain });
            }
        }
        let missing = |last: fn(&Section) -> f64| {
            sections.iter().filter(|section| last(section) == 0.0).count()
        };
        let shorter = missing(|section| section.b[2]).min(missing(|section| section.a[1]));
        let padding = 3 * (2 * sections.len() + 1 - shorter);
        if n_samples <= padding {
            return Err(SignalError::TooShort { n_samples, padding });
        }
        let extended = vec![0.0; n_samples + 2 * padding];
        Ok(Self { filter: SosFilter::new(sections), padding, extended })
    }

    /// Returns the number of samples the filter was set up for.
    pub fn n_samples(&self) -> usize {
        self.extended.len() - 2 * self.padding
    }

    /// Filters one channel in place.
    ///
    /// # Shapes
    /// - `signal`: time first, `n_samples` x `n_channels`; only `channel` is read and written
    /// # Errors
    /// - [`SignalError::Length`] if the signal has another length.
    /// - [`SignalError::Overflow`] if the result is not finite; the signal is then unchanged.
    pub fn apply(
        &mut self,
        signal: &mut [f64],
        channel: usize,
        n_channels: usize,
    ) -> Result<(), SignalError> {
        let expected = self.n_samples();
        check_channel(signal, channel, n_channels, expected)?;
        let at = |sample: usize| sample * n_channels + channel;
        let last = expected - 1;
        let (first_level, last_level) = (signal[at(0)], signal[at(last)]);
        for i in 0..self.padding {
            self.extended[i] = 2.0 * first_level - signal[at(self.padding - i)];
            self.extended[self.padding + expected + i] =
                2.0 * last_level - signal[at(last - 1 - i)];
        }
        for k in 0..expected {
            self.extended[self.padding + k] = signal[at(k)];
        }
        self.filter.settle(self.extended[0]);
        for value in &mut self.extended {
            *value = self.filter.step(*value);
        }
        if let Some(end) = self.extended.last() {
            self.filter.settle(*end);
        }
        for value in self.extended.iter_mut().rev() {
            *value = self.filter.step(*value);
        }
        let filtered = &self.extended[self.padding..self.padding + expected];
        if let Some(sample) = filtered.iter().position(|value| !value.is_finite()) {
            return Err(SignalError::Overflow { sample, value: filtered[sample] });
        }
        for k in 0..expected {
            signal[at(k)] = self.extended[self.padding + k];
        }
        Ok(())
    }

    /// Applies the transpose (adjoint) of [`ZeroPhase::apply`], for the analysis of laws with a
    /// filter.
    ///
    /// The filter is symmetric, but its ends are not: each sample of the extension is made of two
    /// samples of the signal.
    ///
    /// # Shapes
    /// - as [`ZeroPhase::apply`]
    /// # Errors
    /// - [`SignalError::Length`] if the signal has another length.
    pub fn apply_transposed(
        &mut self,
        signal: &mut [f64],
        channel: usize,
        n_channels: usize,
    ) -> Result<(), SignalError> {
        let expected = self.n_samples();
        check_channel(signal, channel, n_channels, expected)?;
        let at = |sample: usize| sample * n_channels + channel;
        let (padding, last) = (self.padding, expected - 1);
        self.extended.fill(0.0);
        for k in 0..expected {
            self.extended[padding + k] = signal[at(k)];
        }
        // A pass that starts in the steady state of x[0] is `H x + (g - H 1) x[0]`: its transpose
        // runs backward from rest and adds the share of the constants to the first sample.
        let gain: f64 = self.filter.sections().iter().map(super::Section::static_gain).product();
        let before: f64 = self.extended.iter().sum();
        self.filter.reset();
        for value in &mut self.extended {
            *value = self.filter.step(*value);
        }
        let after: f64 = self.extended.iter().sum();
        if let Some(end) = self.extended.last_mut() {
            *end += gain * before - after;
        }
        let before: f64 = self.extended.iter().sum();
        self.filter.reset();
        for value in self.extended.iter_mut().rev() {
            *value = self.filter.step(*value);
        }
        let after: f64 = self.extended.iter().sum();
        self.extended[0] += gain * before - after;
        for k in 0..expected {
            signal[at(k)] = self.extended[padding + k];
        }
        for i in 0..padding {
            let (early, late) = (self.extended[i], self.extended[padding + expected + i]);
            signal[at(0)] += 2.0 * early;
            signal[at(padding - i)] -= early;
            signal[at(last)] += 2.0 * late;
            signal[at(last - 1 - i)] -= late;
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::super::butterworth;
    use super::*;

    fn filter(n_samples: usize) -> ZeroPhase {
        ZeroPhase::new(butterworth(2, 20.0, 2e-3).unwrap(), n_samples).unwrap()
    }

    #[test]
    fn a_straight_line_passes_unchanged() {
        let mut line: Vec<f64> = (0..200).map(|k| 3.0 - 0.25 * f64::from(k)).collect();
        let original = line.clone();
        filter(200).apply(&mut line, 0, 1).unwrap();
        // The first pass lags a ramp by a constant, which the second one cancels, except where the
        // transient at the start of the extension has not yet decayed.
        for k in 60..140 {
            assert!((line[k] - original[k]).abs() < 1e-3, "sample {k}");
        }
    }

    #[test]
    fn the_pulse_response_is_symmetric_and_keeps_its_area() {
        let mut pulse = vec![0.0; 401];
        pulse[200] = 1.0;
        filter(401).apply(&mut pulse, 0, 1).unwrap();
        for k in 0..200 {
            assert!((pulse[k] - pulse[400 - k]).abs() < 1e-12);
        }
        assert!((pulse.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_transpose_has_the_same_inner_products() {
        let wave = |step: i32| -> Vec<f64> {
            (0..60).map(|k| f64::from((k * k * step) % 23) - 11.0).collect()
        };
        let (x, y) = (wave(3), wave(7));
        let (mut forward, mut backward) = (x.clone(), y.clone());
        filter(60).apply(&mut forward, 0, 1).unwrap();
        filter(60).apply_transposed(&mut backward, 0, 1).unwrap();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (left, right) = (dot(&forward, &y), dot(&x, &backward));
        assert!((left - right).abs() < 1e-10 * left.abs(), "{left} {right}");
    }

    #[test]
    fn channels_are_filtered_one_by_one() {
        let x: Vec<f64> = (0..100).map(|k| f64::from(k * k % 17)).collect();
        let mut both: Vec<f64> = x.iter().flat_map(|v| [-v, *v]).collect();
        let mut alone = x.clone();
        filter(100).apply(&mut alone, 0, 1).unwrap();
        filter(100).apply(&mut both, 1, 2).unwrap();
        for k in 0..100 {
            assert_eq!(both[2 * k].to_bits(), (-x[k]).to_bits());
            assert_eq!(both[2 * k + 1].to_bits(), alone[k].to_bits());
        }
    }

    #[test]
    fn short_and_wrong_signals_are_refused() {
        let sections = butterworth(2, 20.0, 2e-3).unwrap();
        let error = ZeroPhase::new(sections, 9).unwrap_err();
        assert_eq!(error, SignalError::TooShort { n_samples: 9, padding: 9 });
        let error = filter(20).apply(&mut [0.0; 42], 0, 2).unwrap_err();
        assert_eq!(error, SignalError::Length { found: 21, expected: 20 });
    }
}
