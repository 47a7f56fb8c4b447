//! What a mechanism cannot do.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use thiserror::Error;

/// Why a mechanism, a pose or joint angles were refused.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum KinematicsError {
    /// A length that no mechanism has.
    #[error("{what} = {value_m} m; {allowed}")]
    Length {
        /// Which length.
        what: &'static str,
        /// The value given.
        value_m: f64,
        /// The rule, as a sentence.
        allowed: &'static str,
    },
    /// A coordinate that is not a number.
    #[error("{what}[{index}] = {value}; only finite values are allowed")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
        /// Which coordinate of it.
        index: usize,
        /// The value given.
        value: f64,
    },
    /// No joint angles reach the pose.
    #[error(
        "pose ({:.6}, {:.6}, {:.6}) m is out of reach of leg {leg}: {reason}",
        pose_m[0], pose_m[1], pose_m[2]
    )]
    Unreachable {
        /// The pose asked for.
        pose_m: [f64; 3],
        /// The leg that does not reach it, from 0.
        leg: usize,
        /// What is in the way.
        reason: &'static str,
    },
    /// The rods do not meet.
    #[error(
        "joint angles ({:.6}, {:.6}, {:.6}) rad do not close the mechanism: {reason}",
        joints_rad[0], joints_rad[1], joints_rad[2]
    )]
    Open {
        /// The angles given.
        joints_rad: [f64; 3],
        /// What is in the way.
        reason: &'static str,
    },
    /// The mechanism can move without its joints, or its joints without it.
    #[error(
        "joint angles ({:.6}, {:.6}, {:.6}) rad are singular: {reason}",
        joints_rad[0], joints_rad[1], joints_rad[2]
    )]
    Singular {
        /// The angles given.
        joints_rad: [f64; 3],
        /// Which freedom is lost or gained.
        reason: &'static str,
    },
}

/// Refuses a coordinate that is infinite or not a number.
pub(super) fn finite(what: &'static str, values: &[f64]) -> Result<(), KinematicsError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => Err(KinematicsError::NotFinite { what, index, value: values[index] }),
    }
}
