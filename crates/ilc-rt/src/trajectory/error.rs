//! Errors of plans, as values; `refusal` makes the sentence.

use crate::interpolate::{MoveError, Quantity};

/// A refused plan; axes and segments count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrajectoryError {
    /// A move, its limits or its points are refused.
    Move(MoveError),
    /// The number of limits is not the number of coordinates.
    LimitCount {
        /// Number of limits given.
        found: usize,
        /// Number of coordinates of the start.
        expected: usize,
    },
    /// A point has too few or too many coordinates.
    Coordinates {
        /// Index of the segment.
        segment: usize,
        /// Number of coordinates given.
        found: usize,
        /// Number of coordinates of the start.
        expected: usize,
    },
    /// A feed is not a positive number.
    Feed {
        /// Index of the segment.
        segment: usize,
        /// The value given.
        feed: f64,
    },
    /// A program begins faster than an axis may move.
    StartVelocity {
        /// Index of the axis.
        axis: usize,
        /// The value given.
        velocity: f64,
        /// The limit.
        limit: f64,
    },
    /// A segment ends where it starts.
    ZeroLength {
        /// Index of the segment.
        segment: usize,
    },
    /// An arc is not in the plane of two of the axes.
    Plane {
        /// Index of the segment.
        segment: usize,
        /// The two axes, from 0.
        plane: [usize; 2],
    },
    /// The radii at start and end of an arc disagree.
    Arc {
        /// Index of the segment.
        segment: usize,
        /// Radius at the start.
        from_radius: f64,
        /// Radius at the end.
        to_radius: f64,
    },
    /// An arc where only lines are supported.
    NotStraight {
        /// Index of the segment.
        segment: usize,
    },
    /// The amplitude of an oscillation is negative, or not finite.
    Amplitude {
        /// Index of the segment.
        segment: usize,
        /// The value given.
        amplitude: f64,
    },
    /// The frequency of an oscillation is not a positive number.
    Frequency {
        /// Index of the segment.
        segment: usize,
        /// The value given.
        frequency_hz: f64,
    },
    /// A row of set points that violates a limit.
    Row {
        /// Index of the row; those after the last one are the rest at the end.
        row: usize,
        /// Index of the axis.
        axis: usize,
        /// The limit concerned.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit.
        limit: f64,
    },
    /// A set point of a planned path that violates a limit.
    SetPoint {
        /// Time from the first set point.
        at_s: f64,
        /// Index of the axis.
        axis: usize,
        /// The limit concerned.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit.
        limit: f64,
    },
    /// No α satisfies the limits.
    Alpha {
        /// Index of the segment.
        segment: usize,
        /// `start-up`, `transition` or `end`.
        place: &'static str,
        /// The α that comes nearest.
        alpha: f64,
        /// The most violated limit.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit along the path.
        limit: f64,
    },
    /// The programmed oscillation violates a limit, whatever its start.
    Programmed {
        /// Index of the segment.
        segment: usize,
        /// The violated limit.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit along the path.
        limit: f64,
    },
    /// The requested upper bound of α is so small that an end does not fit its leg.
    AlphaMax {
        /// Index of the segment.
        segment: usize,
        /// `start-up`, `transition` or `end`.
        place: &'static str,
        /// The value given.
        value: f64,
        /// Smallest value that fits.
        min: f64,
    },
    /// A leg is too short for its ends.
    Hurried {
        /// Index of the segment.
        segment: usize,
        /// Its duration.
        lasts_s: f64,
        /// The duration that both ends need.
        needs_s: f64,
    },
    /// A parameter of a shape is out of range.
    Shape {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The values allowed.
        allowed: &'static str,
    },
    /// A curve has a point with undefined direction.
    Cusp {
        /// Position along the curve.
        at: f64,
    },
    /// No speed was found at which a curve satisfies the limits.
    Unproven {
        /// Index of the axis.
        axis: usize,
        /// Position along the curve.
        at: f64,
        /// The limit concerned.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit.
        limit: f64,
        /// Number of attempts.
        rounds: usize,
    },
    /// A path without segments.
    Empty,
    /// The cycle, a dwell or the blend window is out of range.
    Time {
        /// `cycle`, `sample time`, `dwell`, `dwell before`, `dwell after` or `blend window`.
        name: &'static str,
        /// The value given.
        value_s: f64,
        /// Smallest value allowed.
        low_s: f64,
        /// Largest value allowed.
        high_s: f64,
    },
    /// The run has too many samples.
    TooLong {
        /// Its duration.
        duration_s: f64,
        /// Samples of the run.
        n_samples: f64,
        /// Largest number of samples.
        n_samples_max: usize,
    },
    /// A blended path violates a limit of an axis.
    Exceeds {
        /// Index of the axis.
        axis: usize,
        /// The limit concerned.
        quantity: Quantity,
        /// Largest value that the set points reach.
        reached: f64,
        /// The limit.
        limit: f64,
        /// Factor on every feed that satisfies all limits; 0 if none was found.
        feed_factor: f64,
        /// The feed of the fastest segment times that factor.
        feed_admissible: f64,
        /// A blend window that satisfies all limits at the programmed feed, if one was found.
        window_admissible_s: Option<f64>,
    },
}

impl TrajectoryError {
    /// Returns the axis concerned, if it is a single one.
    pub fn axis(&self) -> Option<usize> {
        match *self {
            Self::Move(refused) => refused.axis(),
            Self::StartVelocity { axis, .. }
            | Self::Unproven { axis, .. }
            | Self::Row { axis, .. }
            | Self::SetPoint { axis, .. }
            | Self::Exceeds { axis, .. } => Some(axis),
            _ => None,
        }
    }
}

impl From<MoveError> for TrajectoryError {
    fn from(refused: MoveError) -> Self {
        Self::Move(refused)
    }
}
