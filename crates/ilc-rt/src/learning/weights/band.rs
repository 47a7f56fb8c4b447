//! Butterworth filters for frequency-dependent weights, as state-space models of all channels.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::learning::{LearningError, Result};
use crate::model::{StateSpace, from_transfer_function};
use crate::signal::{Section, butterworth, butterworth_high_pass};

/// Side of its cut-off on which a filter passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pass {
    /// Low frequencies.
    Low,
    /// High frequencies.
    #[default]
    High,
}

/// Largest number of channels of a filter.
const CHANNELS_MAX: usize = 100;

/// Returns a causal Butterworth filter of `n_channels` equal channels, block-diagonal.
///
/// # Units
/// - `cutoff_hz` in hertz, `dt_s` in seconds
/// # Errors
/// - [`LearningError::Parameter`] unless there are 1 to 100 channels; [`LearningError::Signal`] as [`butterworth`] and
///   [`butterworth_high_pass`].
pub fn band(
    pass: Pass,
    (order, cutoff_hz): (usize, f64),
    dt_s: f64,
    n_channels: usize,
) -> Result<StateSpace> {
    if !(1..=CHANNELS_MAX).contains(&n_channels) {
        let value = n_channels as f64;
        return Err(LearningError::Parameter {
            what: "n_channels",
            value,
            allowed: "allowed 1 to 100",
        });
    }
    let sections = match pass {
        Pass::Low => butterworth(order, cutoff_hz, dt_s)?,
        Pass::High => butterworth_high_pass(order, cutoff_hz, dt_s)?,
    };
    let mut one = StateSpace::static_gain(DMatrix::identity(1, 1), Some(dt_s))?;
    for Section { b, a } in sections {
        one = one.series(&from_transfer_function(&b, &[1.0, a[0], a[1]], Some(dt_s))?)?;
    }
    let mut all = one.clone();
    for _ in 1..n_channels {
        all = all.append(&one)?;
    }
    Ok(all)
}
