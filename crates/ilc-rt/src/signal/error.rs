//! What can be wrong with a filter or the signal it is given.

use thiserror::Error;

/// Why a filter or a signal was refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum SignalError {
    /// A filter order that is not offered.
    #[error("order = {order}; a Butterworth filter has an order of 1 to {max}")]
    Order {
        /// The order given.
        order: usize,
        /// The highest order offered.
        max: usize,
    },
    /// A cut-off that the sample time does not allow.
    #[error(
        "cutoff_hz = {cutoff_hz} Hz; it must lie above 0 Hz and below half the sampling rate, \
         {limit_hz} Hz"
    )]
    Cutoff {
        /// The cut-off given, in hertz.
        cutoff_hz: f64,
        /// Half the sampling rate, in hertz.
        limit_hz: f64,
    },
    /// A sample time that is not a positive number.
    #[error("dt_s = {dt_s} s; a sample time must be finite and greater than 0 s")]
    SampleTime {
        /// The sample time given, in seconds.
        dt_s: f64,
    },
    /// A signal too short to be extended at its ends.
    #[error("the signal has {n_samples} samples; this zero-phase filter needs more than {padding}")]
    TooShort {
        /// Samples given.
        n_samples: usize,
        /// Samples of extension at either end.
        padding: usize,
    },
    /// A signal of another length than the filter was set up for.
    #[error("the signal has {found} samples; this filter was set up for {expected}")]
    Length {
        /// Samples given.
        found: usize,
        /// Samples the filter was set up for.
        expected: usize,
    },
}
