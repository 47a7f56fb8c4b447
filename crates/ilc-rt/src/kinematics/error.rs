//! Errors of kinematics.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use thiserror::Error;

/// A refused mechanism, pose or set of joint angles.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum KinematicsError {
    /// A length outside its range.
    #[error("{what} = {value_m} m; {allowed}")]
    Length {
        /// Name of the length.
        what: &'static str,
        /// The value given.
        value_m: f64,
        /// The rule, as a sentence.
        allowed: &'static str,
    },
    /// A coordinate that is infinite or NaN.
    #[error("{what}[{index}] = {value}; only finite values are allowed")]
    NotFinite {
        /// Name of the quantity.
        what: &'static str,
        /// Index of the coordinate.
        index: usize,
        /// The value given.
        value: f64,
    },
    /// A pose out of reach.
    #[error(
        "pose ({:.6}, {:.6}, {:.6}) m is out of reach of leg {leg}: {reason}",
        pose_m[0], pose_m[1], pose_m[2]
    )]
    Unreachable {
        /// The requested pose.
        pose_m: [f64; 3],
        /// The leg that cannot reach it, from 0.
        leg: usize,
        /// Reason.
        reason: &'static str,
    },
    /// Joint angles for which the rods do not meet.
    #[error(
        "joint angles ({:.6}, {:.6}, {:.6}) rad do not close the mechanism: {reason}",
        joints_rad[0], joints_rad[1], joints_rad[2]
    )]
    Open {
        /// The angles given.
        joints_rad: [f64; 3],
        /// Reason.
        reason: &'static str,
    },
    /// A singular pose: the tool can move with locked joints, or a joint cannot move the tool.
    #[error(
        "joint angles ({:.6}, {:.6}, {:.6}) rad are singular: {reason}",
        joints_rad[0], joints_rad[1], joints_rad[2]
    )]
    Singular {
        /// The angles given.
        joints_rad: [f64; 3],
        /// The degree of freedom gained or lost.
        reason: &'static str,
    },
}

/// Refuses infinite and NaN coordinates.
pub(super) fn finite(what: &'static str, values: &[f64]) -> Result<(), KinematicsError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => Err(KinematicsError::NotFinite { what, index, value: values[index] }),
    }
}
