//! Refusals of a plan, as values; `refusal` makes the sentence.

use crate::interpolate::{MoveError, Quantity};

/// A refused plan; axes and segments count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrajectoryError {
    /// A move, its limits or its points.
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
    /// The ends of an arc are not equally far from its centre.
    Arc {
        /// Index of the segment.
        segment: usize,
        /// Distance of the start.
        from_radius: f64,
        /// Distance of the end.
        to_radius: f64,
    },
    /// An arc where only lines can be.
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
    /// A row of set points that is too far from those before it.
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
    /// A set point of a planned path that is too far from those before it.
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
    /// No α holds the limits.
    Alpha {
        /// Index of the segment.
        segment: usize,
        /// `start-up`, `transition` or `end`.
        place: &'static str,
        /// The α that comes nearest.
        alpha: f64,
        /// The limit that it breaks most.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit along the path.
        limit: f64,
    },
    /// The programmed oscillation breaks a limit, whatever its start.
    Programmed {
        /// Index of the segment.
        segment: usize,
        /// The limit that it breaks.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit along the path.
        limit: f64,
    },
    /// The largest α wanted is so small that an end is not over within its leg.
    AlphaMax {
        /// Index of the segment.
        segment: usize,
        /// `start-up`, `transition` or `end`.
        place: &'static str,
        /// The value given.
        value: f64,
        /// The smallest that is over in time.
        min: f64,
    },
    /// A leg is over before its ends can be.
    Hurried {
        /// Index of the segment.
        segment: usize,
        /// Its duration.
        lasts_s: f64,
        /// The duration that both ends need.
        needs_s: f64,
    },
    /// A parameter of a shape is not usable.
    Shape {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The values allowed.
        allowed: &'static str,
    },
    /// A curve has a point at which its direction is not defined.
    Cusp {
        /// Where.
        at: f64,
    },
    /// No speed was found at which a curve holds the limits.
    Unproven {
        /// Index of the axis.
        axis: usize,
        /// Where, along the curve.
        at: f64,
        /// The limit concerned.
        quantity: Quantity,
        /// The value reached.
        reached: f64,
        /// The limit.
        limit: f64,
        /// Attempts made.
        rounds: usize,
    },
    /// There is no segment.
    Empty,
    /// The cycle, a dwell or the blend window is not in its range.
    Time {
        /// `cycle`, `sample time`, `dwell`, `dwell before`, `dwell after` or `blend window`.
        name: &'static str,
        /// The value given.
        value_s: f64,
        /// Smallest allowed.
        low_s: f64,
        /// Largest allowed.
        high_s: f64,
    },
    /// The run has more samples than a plan may hold.
    TooLong {
        /// Its duration.
        duration_s: f64,
        /// Samples it would have.
        n_samples: f64,
        /// Samples allowed.
        n_samples_max: usize,
    },
    /// A blended path would break a limit of an axis.
    Exceeds {
        /// Index of the axis.
        axis: usize,
        /// The limit concerned.
        quantity: Quantity,
        /// Largest value that the set points reach.
        reached: f64,
        /// The limit.
        limit: f64,
        /// Factor on every feed at which all limits hold; 0 if none was found.
        feed_factor: f64,
        /// The feed of the fastest segment times that factor.
        feed_admissible: f64,
        /// A blend window at which all limits hold at the programmed feed, if one was found.
        window_admissible_s: Option<f64>,
    },
}

impl TrajectoryError {
    /// The axis of the refusal, if it concerns a single one.
    pub fn axis(&self) -> Option<usize> {
        match *self {
            Self::Move(refused) => refused.axis(),
            Self::Unproven { axis, .. }
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
