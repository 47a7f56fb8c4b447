//! Time-varying low-pass: a cut-off that is low in slow motion and high in fast motion.

use std::f64::consts::PI;

use super::channel::{check_channel, check_sample_time};
use super::{SignalError, ZeroPhase, butterworth};

/// A segment of the run with one cut-off; it lasts until the next segment starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// First sample.
    pub start: usize,
    /// Cut-off of one pass in hertz.
    pub cutoff_hz: f64,
}

/// A zero-phase Butterworth low-pass with a different cut-off for each segment of the run.
///
/// `y[k] = sum_i w_i[k] (Q_i x)[k]`, `sum_i w_i[k] = 1`
///
/// Each filter `Q_i` runs over the whole signal, so none starts in the middle of it; at a segment's
/// boundary the weights cross-fade along half a cosine, so the switch is bumpless.
///
/// # Units
/// - cut-offs in hertz, `dt_s` in seconds, starts and blend in samples
/// # Source
/// - \[filter-based\], Eq. (12): cut-offs of 10, 50 and 10 Hz. The source switches abruptly and
///   does not describe the filter's state; the cross-fade is ours.
/// # Examples
/// ```
/// use ilc_rt::signal::{Segment, SwitchedFilter};
///
/// let segments = [(0, 10.0), (300, 50.0), (600, 10.0)]
///     .map(|(start, cutoff_hz)| Segment { start, cutoff_hz });
/// let mut filter = SwitchedFilter::new(2, &segments, 50, 2e-3)?.for_samples(1000)?;
/// let mut signal = vec![1.0; 1000];
/// filter.apply(&mut signal, 0, 1)?;
/// assert!(signal.iter().all(|value| (value - 1.0).abs() < 1e-9));
/// # Ok::<(), ilc_rt::signal::SignalError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SwitchedFilter {
    order: usize,
    segments: Vec<Segment>,
    blend: usize,
    dt_s: f64,
}

impl SwitchedFilter {
    /// Designs the filter: Butterworth of the given order, with a cross-fade of `blend` samples
    /// between segments, half of them before the later one starts.
    ///
    /// # Errors
    /// - [`SignalError::NoSegment`] or [`SignalError::SegmentOrder`].
    /// - [`SignalError::Order`], [`SignalError::Cutoff`] or [`SignalError::SampleTime`].
    pub fn new(
        order: usize,
        segments: &[Segment],
        blend: usize,
        dt_s: f64,
    ) -> Result<Self, SignalError> {
        check_sample_time(dt_s)?;
        if segments.is_empty() {
            return Err(SignalError::NoSegment);
        }
        for (index, segment) in segments.iter().enumerate() {
            let in_order = match index.checked_sub(1) {
                None => segment.start == 0,
                Some(before) => segment.start > segments[before].start,
            };
            if !in_order {
                return Err(SignalError::SegmentOrder { index, start: segment.start });
            }
            butterworth(order, segment.cutoff_hz, dt_s)?;
        }
        Ok(Self { order, segments: segments.to_vec(), blend, dt_s })
    }

    /// Returns the order of one pass.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Returns the segments in order of time.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Returns the length of the cross-fade in samples.
    pub fn blend(&self) -> usize {
        self.blend
    }

    /// Returns the sample time in seconds.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Returns the highest cut-off of any segment in hertz.
    pub fn highest_hz(&self) -> f64 {
        self.segments.iter().fold(0.0, |highest, segment| highest.max(segment.cutoff_hz))
    }

    /// Sets the filter up for signals of `n_samples` samples.
    ///
    /// # Errors
    /// - [`SignalError::TooShort`] if the signal cannot be extended at its ends.
    /// - [`SignalError::SegmentBeyondEnd`] if a segment starts after its end.
    pub fn for_samples(&self, n_samples: usize) -> Result<Switched, SignalError> {
        let mut bands: Vec<(f64, Band)> = Vec::new();
        for (index, segment) in self.segments.iter().enumerate() {
            if segment.start >= n_samples {
                let start = segment.start;
                return Err(SignalError::SegmentBeyondEnd { index, start, n_samples });
            }
            // Segments with the same cut-off share their filter.
            let same =
                |(cutoff_hz, _): &(f64, Band)| cutoff_hz.to_bits() == segment.cutoff_hz.to_bits();
            let place = if let Some(place) = bands.iter().position(same) {
                place
            } else {
                let sections = butterworth(self.order, segment.cutoff_hz, self.dt_s)?;
                let filter = ZeroPhase::new(sections, n_samples)?;
                bands.push((segment.cutoff_hz, Band { filter, weights: vec![0.0; n_samples] }));
                bands.len() - 1
            };
            for (k, weight) in bands[place].1.weights.iter_mut().enumerate() {
                let begun = if index == 0 { 1.0 } else { self.begun(segment.start, k) };
                let ended =
                    self.segments.get(index + 1).map_or(0.0, |next| self.begun(next.start, k));
                *weight += begun - ended;
            }
        }
        Ok(Switched {
            bands: bands.into_iter().map(|(_, band)| band).collect(),
            filtered: vec![0.0; n_samples],
            sum: vec![0.0; n_samples],
        })
    }

    /// Returns the weight at sample `k` of a segment that starts at `start`: 0 before, 1 after.
    fn begun(&self, start: usize, k: usize) -> f64 {
        // Relative to the boundary, half-way between the last sample before the segment and its
        // first.
        let after = k as f64 + 0.5 - start as f64;
        let half = 0.5 * self.blend as f64;
        if after >= half {
            1.0
        } else if after <= -half {
            0.0
        } else {
            0.5 + 0.5 * (PI * after / self.blend as f64).sin()
        }
    }
}

/// One filter and its weights along the run.
#[derive(Debug, Clone)]
struct Band {
    filter: ZeroPhase,
    weights: Vec<f64>,
}

/// A [`SwitchedFilter`] with its workspace.
///
/// # Shapes
/// - one channel of a signal of fixed length, possibly interleaved with others
/// # Real Time
/// Allocates at creation, never in [`Switched::apply`].
#[derive(Debug, Clone)]
pub struct Switched {
    bands: Vec<Band>,
    filtered: Vec<f64>,
    sum: Vec<f64>,
}

impl Switched {
    /// Returns the number of samples the filter was set up for.
    pub fn n_samples(&self) -> usize {
        self.sum.len()
    }

    /// Filters one channel in place.
    ///
    /// # Shapes
    /// - `signal`: time first, `n_samples` x `n_channels`; only `channel` is read and written
    /// # Errors
    /// - [`SignalError::Length`] if the signal has another length.
    pub fn apply(
        &mut self,
        signal: &mut [f64],
        channel: usize,
        n_channels: usize,
    ) -> Result<(), SignalError> {
        check_channel(signal, channel, n_channels, self.n_samples())?;
        self.sum.fill(0.0);
        for Band { filter, weights } in &mut self.bands {
            for (value, given) in
                self.filtered.iter_mut().zip(signal.iter().skip(channel).step_by(n_channels))
            {
                *value = *given;
            }
            filter.apply(&mut self.filtered, 0, 1)?;
            for ((sum, weight), value) in self.sum.iter_mut().zip(weights).zip(&self.filtered) {
                *sum += *weight * value;
            }
        }
        for (place, sum) in signal.iter_mut().skip(channel).step_by(n_channels).zip(&self.sum) {
            *place = *sum;
        }
        Ok(())
    }

    /// Applies the transpose (adjoint) of [`Switched::apply`]: weights first, then each filter.
    ///
    /// # Shapes
    /// - as [`Switched::apply`]
    /// # Errors
    /// - [`SignalError::Length`] if the signal has another length.
    pub fn apply_transposed(
        &mut self,
        signal: &mut [f64],
        channel: usize,
        n_channels: usize,
    ) -> Result<(), SignalError> {
        check_channel(signal, channel, n_channels, self.n_samples())?;
        self.sum.fill(0.0);
        for Band { filter, weights } in &mut self.bands {
            let given = signal.iter().skip(channel).step_by(n_channels);
            for ((value, weight), given) in self.filtered.iter_mut().zip(weights).zip(given) {
                *value = *weight * given;
            }
            filter.apply_transposed(&mut self.filtered, 0, 1)?;
            for (sum, value) in self.sum.iter_mut().zip(&self.filtered) {
                *sum += value;
            }
        }
        for (place, sum) in signal.iter_mut().skip(channel).step_by(n_channels).zip(&self.sum) {
            *place = *sum;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 2e-3;

    fn filter(blend: usize) -> SwitchedFilter {
        let segments = [(0, 10.0), (200, 50.0), (400, 10.0)]
            .map(|(start, cutoff_hz)| Segment { start, cutoff_hz });
        SwitchedFilter::new(2, &segments, blend, DT_S).unwrap()
    }

    fn noise(n_samples: usize) -> Vec<f64> {
        let mut state = 1_u64;
        (0..n_samples)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 40) as f64 / 16_777_216.0 - 0.5
            })
            .collect()
    }

    #[test]
    fn inside_a_segment_it_is_the_plain_filter() {
        let x = noise(600);
        for blend in [0, 40] {
            let mut switched = x.clone();
            let mut runner = filter(blend).for_samples(600).unwrap();
            assert_eq!(runner.bands.len(), 2);
            runner.apply(&mut switched, 0, 1).unwrap();
            for (cutoff_hz, range) in [(10.0, 0..180), (50.0, 220..380), (10.0, 420..600)] {
                let sections = butterworth(2, cutoff_hz, DT_S).unwrap();
                let mut plain = x.clone();
                ZeroPhase::new(sections, 600).unwrap().apply(&mut plain, 0, 1).unwrap();
                for k in range {
                    assert!((switched[k] - plain[k]).abs() < 1e-15);
                }
            }
        }
    }

    #[test]
    fn weights_add_up_to_one_even_where_blends_overlap() {
        for blend in [0, 1, 2, 40, 500] {
            let runner = filter(blend).for_samples(600).unwrap();
            for k in 0..600 {
                let weights = || runner.bands.iter().map(|band| band.weights[k]);
                assert!((weights().sum::<f64>() - 1.0).abs() < 1e-15);
                assert!(weights().all(|weight| (-1e-15..=1.0 + 1e-15).contains(&weight)));
            }
        }
    }

    #[test]
    fn a_blended_switch_does_not_jump() {
        // Largest step between neighbouring samples: abrupt switching has one, the cross-fade has
        // not.
        let alternating: Vec<f64> =
            (0..600).map(|k| (2.0 * PI * 25.0 * DT_S * f64::from(k)).cos()).collect();
        let step_at = |blend| {
            let mut signal = alternating.clone();
            filter(blend).for_samples(600).unwrap().apply(&mut signal, 0, 1).unwrap();
            (signal[200] - signal[199]).abs()
        };
        assert!(step_at(0) > 0.5 && step_at(60) < 0.2);
    }

    #[test]
    fn segments_out_of_order_are_refused() {
        let make = |segments: &[(usize, f64)]| {
            let segments: Vec<Segment> = segments
                .iter()
                .map(|(start, cutoff_hz)| Segment { start: *start, cutoff_hz: *cutoff_hz })
                .collect();
            SwitchedFilter::new(2, &segments, 0, DT_S)
        };
        assert_eq!(make(&[]), Err(SignalError::NoSegment));
        assert_eq!(make(&[(1, 9.0)]), Err(SignalError::SegmentOrder { index: 0, start: 1 }));
        let error = make(&[(0, 9.0), (5, 8.0), (5, 7.0)]).unwrap_err();
        assert_eq!(error, SignalError::SegmentOrder { index: 2, start: 5 });
        assert!(matches!(make(&[(0, 250.0)]), Err(SignalError::Cutoff { .. })));
        let error = filter(0).for_samples(400).unwrap_err();
        let beyond = SignalError::SegmentBeyondEnd { index: 2, start: 400, n_samples: 400 };
        assert_eq!(error, beyond);
    }
}
