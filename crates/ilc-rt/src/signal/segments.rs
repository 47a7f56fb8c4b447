//! Design of a switched filter: segments of fast motion, found from the reference.

use super::channel::{check_frequency, check_sample_time};
use super::hilbert::analytic;
use super::{Segment, SignalError, SwitchedFilter};

/// A signal below this share of its peak amplitude is at rest and has no frequency.
const REST: f64 = 1e-3;

/// Rule for the segments of a [`SwitchedFilter`].
///
/// # Units
/// - frequencies in hertz, times in seconds
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwitchRule {
    /// Butterworth order of one pass.
    pub order: usize,
    /// Cut-off for slow motion.
    pub low_hz: f64,
    /// Cut-off for fast motion.
    pub high_hz: f64,
    /// Instantaneous frequency above which the motion is fast.
    pub threshold_hz: f64,
    /// Averaging window of the instantaneous frequency.
    pub window_s: f64,
    /// Margin by which a fast segment is extended on either side.
    pub margin_s: f64,
    /// Duration of the cross-fade between segments.
    pub blend_s: f64,
}

impl SwitchRule {
    /// Returns a rule with second-order filters, a window of one period of the threshold, and a
    /// margin and cross-fade of one period of the lower cut-off.
    pub fn new(low_hz: f64, high_hz: f64, threshold_hz: f64) -> Self {
        Self {
            order: 2,
            low_hz,
            high_hz,
            threshold_hz,
            window_s: threshold_hz.recip(),
            margin_s: low_hz.recip(),
            blend_s: low_hz.recip(),
        }
    }

    /// Designs the filter for a motion.
    ///
    /// A sample is fast where `sum(a^2 f) / sum(a^2)` over the window around it exceeds the
    /// threshold in any channel; `f` is the instantaneous frequency and `a` the amplitude of the
    /// signal minus its mean. Weighting by the amplitude removes the spikes of the unweighted
    /// frequency where the amplitude passes through zero. Fast segments are extended by the margin,
    /// and merged where they then touch.
    ///
    /// # Shapes
    /// - `signal`: time first, `n_samples` x `n_channels`; fast segments show better in a velocity
    ///   than in a position, which its slow sweep dominates
    /// # Errors
    /// - [`SignalError::CutoffOrder`], [`SignalError::Frequency`], [`SignalError::Time`] or
    ///   [`SignalError::SampleTime`] for the rule.
    /// - [`SignalError::TooShort`] for fewer than two samples, [`SignalError::Length`] for channels
    ///   of different length.
    pub fn design(
        &self,
        signal: &[f64],
        n_channels: usize,
        dt_s: f64,
    ) -> Result<SwitchedFilter, SignalError> {
        let limit_hz = check_sample_time(dt_s)?;
        let Self { low_hz, high_hz, threshold_hz, .. } = *self;
        for (what, value_hz) in
            [("low_hz", low_hz), ("high_hz", high_hz), ("threshold_hz", threshold_hz)]
        {
            check_frequency(what, value_hz, limit_hz)?;
        }
        if low_hz >= high_hz {
            return Err(SignalError::CutoffOrder { low_hz, high_hz });
        }
        for (what, value_s) in
            [("window_s", self.window_s), ("margin_s", self.margin_s), ("blend_s", self.blend_s)]
        {
            if !(value_s.is_finite() && value_s >= 0.0) {
                return Err(SignalError::Time { what, value_s });
            }
        }
        let n_samples = signal.len().checked_div(n_channels).unwrap_or(0);
        if n_samples < 2 {
            return Err(SignalError::TooShort { n_samples, padding: 1 });
        }
        if n_samples * n_channels != signal.len() {
            return Err(SignalError::Length { found: n_samples + 1, expected: n_samples });
        }
        // Spans are bounded by the length of the signal, so none overflows.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative and no longer than the signal"
        )]
        let samples = |time_s: f64| (time_s / dt_s).round().min(n_samples as f64) as usize;
        let mut fast = vec![false; n_samples];
        for channel in 0..n_channels {
            let x: Vec<f64> = signal.iter().skip(channel).step_by(n_channels).copied().collect();
            mark_fast(&x, samples(self.window_s) / 2, threshold_hz * dt_s, &mut fast);
        }
        let margin = samples(self.margin_s);
        let segments = self.segments(&fast, margin);
        SwitchedFilter::new(self.order, &segments, samples(self.blend_s), dt_s)
    }

    /// Returns the segments for a mask of fast samples.
    fn segments(&self, fast: &[bool], margin: usize) -> Vec<Segment> {
        let mut open = fast.to_vec();
        widen(fast.iter().zip(open.iter_mut()), margin);
        widen(fast.iter().rev().zip(open.iter_mut().rev()), margin);
        let mut segments: Vec<Segment> = Vec::new();
        for (start, is_open) in open.iter().enumerate() {
            let cutoff_hz = if *is_open { self.high_hz } else { self.low_hz };
            if segments.last().is_none_or(|last| last.cutoff_hz.to_bits() != cutoff_hz.to_bits()) {
                segments.push(Segment { start, cutoff_hz });
            }
        }
        segments
    }
}

/// Marks the `margin` samples after each fast one.
fn widen<'a>(samples: impl Iterator<Item = (&'a bool, &'a mut bool)>, margin: usize) {
    let mut left = 0;
    for (is_fast, is_open) in samples {
        *is_open |= left > 0;
        left = if *is_fast { margin } else { left.saturating_sub(1) };
    }
}

/// Marks the samples of one channel whose averaged frequency, in cycles per sample, exceeds the
/// threshold.
fn mark_fast(x: &[f64], half_window: usize, threshold: f64, fast: &mut [bool]) {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let swing: Vec<f64> = x.iter().map(|value| value - mean).collect();
    let signal = analytic(&swing);
    // Cumulative sums, so that the sum over any window is one difference.
    let (mut energy, mut turned) = (vec![0.0], vec![0.0]);
    let (mut energy_sum, mut turned_sum) = (0.0, 0.0);
    for pair in signal.windows(2) {
        let product = pair[1] * pair[0].conj();
        let weight = product.norm();
        energy_sum += weight;
        turned_sum += weight * product.arg() / (2.0 * std::f64::consts::PI);
        energy.push(energy_sum);
        turned.push(turned_sum);
    }
    let largest = signal.iter().fold(0.0, |largest: f64, value| largest.max(value.norm_sqr()));
    let last = energy.len() - 1;
    for (k, is_fast) in fast.iter_mut().enumerate() {
        let (from, to) = (k.saturating_sub(half_window + 1), (k + half_window).min(last));
        let weight = energy[to] - energy[from];
        let at_rest = weight <= REST * REST * largest * (to - from) as f64;
        *is_fast |= !at_rest && turned[to] - turned[from] > threshold * weight;
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const DT_S: f64 = 2e-3;

    /// 1 Hz, then 8 Hz between 2 s and 3 s, then 1 Hz again.
    fn burst() -> Vec<f64> {
        (0..2500)
            .map(|k| {
                let t_s = f64::from(k) * DT_S;
                let f_hz = if (2.0..3.0).contains(&t_s) { 8.0 } else { 1.0 };
                (2.0 * PI * f_hz * t_s).sin()
            })
            .collect()
    }

    #[test]
    fn the_fast_stretch_is_found() {
        let filter = SwitchRule::new(10.0, 50.0, 4.0).design(&burst(), 1, DT_S).unwrap();
        let [first, second, third] = filter.segments()[..] else {
            panic!("{:?}", filter.segments());
        };
        assert_eq!((first.start, first.cutoff_hz.to_bits()), (0, 10_f64.to_bits()));
        assert_eq!(second.cutoff_hz.to_bits(), 50_f64.to_bits());
        // 2 s to 3 s is 1000 to 1500; the margin is 50 samples, the window 62 to either side.
        assert!((888..=1000).contains(&second.start), "{}", second.start);
        assert!((1500..=1612).contains(&third.start), "{}", third.start);
        assert_eq!(filter.blend(), 50);
    }

    #[test]
    fn one_fast_channel_opens_the_filter() {
        let slow = (0..2500).map(|k| (2.0 * PI * f64::from(k) * DT_S).cos());
        let both: Vec<f64> = slow.zip(burst()).flat_map(|(a, b)| [a, b]).collect();
        let rule = SwitchRule::new(10.0, 50.0, 4.0);
        let alone = rule.design(&burst(), 1, DT_S).unwrap();
        assert_eq!(rule.design(&both, 2, DT_S).unwrap(), alone);
    }

    #[test]
    fn a_slow_motion_and_a_motion_at_rest_have_one_segment() {
        let rule = SwitchRule::new(10.0, 50.0, 4.0);
        let slow: Vec<f64> = (0..2000).map(|k| (2.0 * PI * f64::from(k) * DT_S).sin()).collect();
        assert_eq!(rule.design(&slow, 1, DT_S).unwrap().segments().len(), 1);
        assert_eq!(rule.design(&[0.7; 2000], 1, DT_S).unwrap().segments().len(), 1);
        // Rest after a slow motion, with rounding noise in it.
        let mut rests = slow.clone();
        rests.extend((0..2000).map(|k| if k % 2 == 0 { 1e-6 } else { -1e-6 }));
        assert_eq!(rule.design(&rests, 1, DT_S).unwrap().segments().len(), 1);
    }

    #[test]
    fn wrong_rules_are_refused_one_at_a_time() {
        let rule = SwitchRule::new(10.0, 50.0, 4.0);
        let line = |rule: SwitchRule| rule.design(&burst(), 1, DT_S).unwrap_err().to_string();
        assert!(line(SwitchRule { low_hz: 60.0, ..rule }).contains("low_hz = 60 Hz"));
        assert!(line(SwitchRule { high_hz: 250.0, ..rule }).contains("high_hz = 250 Hz"));
        assert!(line(SwitchRule { threshold_hz: f64::NAN, ..rule }).contains("threshold_hz = NaN"));
        assert!(line(SwitchRule { margin_s: -1.0, ..rule }).contains("margin_s = -1 s"));
        assert!(line(SwitchRule { order: 0, ..rule }).contains("order = 0"));
        assert!(matches!(rule.design(&[1.0], 1, DT_S), Err(SignalError::TooShort { .. })));
        assert!(matches!(rule.design(&[1.0; 5], 2, DT_S), Err(SignalError::Length { .. })));
        assert!(rule.design(&burst(), 1, 0.0).is_err());
    }
}
