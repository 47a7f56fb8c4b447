//! Errors of filters and their signals.

use thiserror::Error;

/// A refused filter or signal.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum SignalError {
    /// An unsupported filter order.
    #[error("order = {order}; a Butterworth filter has an order of 1 to {max}")]
    Order {
        /// The order given.
        order: usize,
        /// Highest order supported.
        max: usize,
    },
    /// A cut-off outside 0 to the Nyquist frequency.
    #[error(
        "cutoff_hz = {cutoff_hz} Hz; it must lie above 0 Hz and below half the sampling rate, \
         {limit_hz} Hz"
    )]
    Cutoff {
        /// The cut-off given, in hertz.
        cutoff_hz: f64,
        /// Nyquist frequency, in hertz.
        limit_hz: f64,
    },
    /// A cut-off so low that rounding ruins the filter's coefficients.
    #[error(
        "cutoff_hz = {cutoff_hz} Hz; at this sample time a filter of order {order} needs at least \
         {lowest_hz} Hz, below which its coefficients have no digits left"
    )]
    CutoffTooLow {
        /// The cut-off given, in hertz.
        cutoff_hz: f64,
        /// The order given.
        order: usize,
        /// The lowest cut-off of that order, in hertz.
        lowest_hz: f64,
    },
    /// A section without a finite static gain: it has a pole at frequency zero or NaN coefficients.
    #[error(
        "section {index} has the gain {gain} at frequency 0; a filter that starts settled needs a \
         finite one"
    )]
    StaticGain {
        /// Index of the section.
        index: usize,
        /// Its gain.
        gain: f64,
    },
    /// A non-finite filtered signal.
    #[error(
        "sample {sample} of the filtered signal is {value}: the filter is unstable or the signal too large"
    )]
    Overflow {
        /// Index of the first such sample.
        sample: usize,
        /// Its value.
        value: f64,
    },
    /// Too many taps.
    #[error("{found} taps; at most {max} are allowed")]
    TooManyTaps {
        /// Taps requested.
        found: usize,
        /// Largest number allowed.
        max: usize,
    },
    /// A sample time that is not a positive number.
    #[error("dt_s = {dt_s} s; a sample time must be finite and greater than 0 s")]
    SampleTime {
        /// The sample time given, in seconds.
        dt_s: f64,
    },
    /// A signal too short to be extended at its ends.
    #[error("the signal has {n_samples} samples; more than {padding} are needed here")]
    TooShort {
        /// Samples given.
        n_samples: usize,
        /// Samples of extension at either end.
        padding: usize,
    },
    /// A frequency outside 0 to the Nyquist frequency.
    #[error(
        "{what} = {value_hz} Hz; it must lie above 0 Hz and below half the sampling rate, \
         {limit_hz} Hz"
    )]
    Frequency {
        /// Name of the parameter.
        what: &'static str,
        /// The frequency given, in hertz.
        value_hz: f64,
        /// Nyquist frequency, in hertz.
        limit_hz: f64,
    },
    /// A time that is negative or NaN.
    #[error("{what} = {value_s} s; a time must be finite and not negative")]
    Time {
        /// Name of the parameter.
        what: &'static str,
        /// The time given, in seconds.
        value_s: f64,
    },
    /// Two cut-offs in the wrong order.
    #[error("low_hz = {low_hz} Hz and high_hz = {high_hz} Hz; low_hz must be the smaller one")]
    CutoffOrder {
        /// The lower cut-off given, in hertz.
        low_hz: f64,
        /// The higher cut-off given, in hertz.
        high_hz: f64,
    },
    /// Segments out of order.
    #[error(
        "segment {index} starts at sample {start}; the first one starts at 0 and each other one \
         after the one before"
    )]
    SegmentOrder {
        /// Index of the segment.
        index: usize,
        /// Its first sample.
        start: usize,
    },
    /// An empty list of segments.
    #[error("0 segments; a switched filter has at least 1")]
    NoSegment,
    /// A segment that starts after the end of the signal.
    #[error("segment {index} starts at sample {start}; the signal has {n_samples} samples")]
    SegmentBeyondEnd {
        /// Index of the segment.
        index: usize,
        /// Its first sample.
        start: usize,
        /// Samples of the signal.
        n_samples: usize,
    },
    /// An even number of taps: there is no middle one.
    #[error("{found} taps; a symmetric filter has an odd number of them")]
    TapCount {
        /// Taps given.
        found: usize,
    },
    /// A tap that is infinite or NaN.
    #[error("tap {index} = {value}; only finite numbers are allowed")]
    TapValue {
        /// Index of the tap.
        index: usize,
        /// The value given.
        value: f64,
    },
    /// Asymmetric taps, which would shift the signal.
    #[error(
        "tap {index} = {value} but its mirror image = {mirrored}; only symmetric taps filter \
         without lag"
    )]
    TapSymmetry {
        /// Index of the tap.
        index: usize,
        /// The value given.
        value: f64,
        /// The tap at the same distance from the other end.
        mirrored: f64,
    },
    /// A signal of a different length than the filter was set up for.
    #[error("the signal has {found} samples; this filter was set up for {expected}")]
    Length {
        /// Samples given.
        found: usize,
        /// Samples the filter was set up for.
        expected: usize,
    },
}
