//! Checks of an interleaved signal and one of its channels, shared by all whole-signal filters.

use super::SignalError;

/// Refuses a signal that does not have `expected` samples of `n_channels` channels.
pub(super) fn check_channel(
    signal: &[f64],
    channel: usize,
    n_channels: usize,
    expected: usize,
) -> Result<(), SignalError> {
    if n_channels == 0 || channel >= n_channels || signal.len() != expected * n_channels {
        let found = signal.len().checked_div(n_channels).unwrap_or(0);
        return Err(SignalError::Length { found, expected });
    }
    Ok(())
}

/// Refuses a sample time that is not a positive number; returns the Nyquist frequency in hertz.
pub(super) fn check_sample_time(dt_s: f64) -> Result<f64, SignalError> {
    let limit_hz = 0.5 / dt_s;
    if dt_s > 0.0 && limit_hz > 0.0 && limit_hz.is_finite() {
        Ok(limit_hz)
    } else {
        Err(SignalError::SampleTime { dt_s })
    }
}

/// Refuses a frequency outside 0 to the Nyquist frequency, both excluded.
pub(super) fn check_frequency(
    what: &'static str,
    value_hz: f64,
    limit_hz: f64,
) -> Result<(), SignalError> {
    if value_hz > 0.0 && value_hz < limit_hz {
        Ok(())
    } else {
        Err(SignalError::Frequency { what, value_hz, limit_hz })
    }
}
