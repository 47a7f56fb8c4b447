//! Refusals of a single move. Copy, as moves are also planned between two ticks; the sentence is made
//! where it is shown, by `trajectory`.

use super::quantity::Quantity;

/// A refused move; axes count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MoveError {
    /// The length of the move is not a positive number.
    Length {
        /// The value given.
        length: f64,
    },
    /// A limit along the path, or the feed, is not a positive number.
    Limit {
        /// Which limit.
        quantity: Quantity,
        /// The value given.
        value: f64,
    },
    /// A limit of an axis is not a positive number.
    AxisLimit {
        /// Which axis.
        axis: usize,
        /// Which limit.
        quantity: Quantity,
        /// The value given.
        value: f64,
    },
    /// The values are so far apart that the duration cannot be computed.
    Duration {
        /// Length of the move.
        length: f64,
        /// The duration computed.
        duration_s: f64,
    },
    /// No axes, or more than a set point holds.
    Axes {
        /// The number given.
        n_axes: usize,
    },
    /// A coordinate is not finite, or too far away.
    Position {
        /// Which axis.
        axis: usize,
        /// The value given.
        position: f64,
        /// The farthest allowed.
        limit: f64,
    },
}

impl MoveError {
    /// The axis of the refusal, if it concerns a single one.
    pub fn axis(&self) -> Option<usize> {
        match *self {
            Self::AxisLimit { axis, .. } | Self::Position { axis, .. } => Some(axis),
            Self::Length { .. }
            | Self::Limit { .. }
            | Self::Duration { .. }
            | Self::Axes { .. } => None,
        }
    }
}
