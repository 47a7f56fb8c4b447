//! Errors of a single move. Copy, as moves are also planned between two ticks; `trajectory` makes
//! the sentence where it is shown.

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
        /// The limited quantity.
        quantity: Quantity,
        /// The value given.
        value: f64,
    },
    /// A limit of an axis is not a positive number.
    AxisLimit {
        /// Index of the axis.
        axis: usize,
        /// The limited quantity.
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
    /// No axes, or more than [`super::MAX_AXES`].
    Axes {
        /// The number given.
        n_axes: usize,
    },
    /// A coordinate that is not finite, or too far from the origin.
    Position {
        /// Index of the axis.
        axis: usize,
        /// The value given.
        position: f64,
        /// Largest distance allowed.
        limit: f64,
    },
}

impl MoveError {
    /// Returns the axis concerned, if it is a single one.
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
