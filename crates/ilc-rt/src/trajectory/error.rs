//! Why a plan was refused: each line names the value and what is allowed. Copy, as moves are also
//! planned between two ticks.

use std::fmt;

use crate::interpolate::MAX_AXES;

/// What a limit is set on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// m/s
    Velocity,
    /// m/s²
    Acceleration,
    /// m/s³
    Jerk,
}

impl Quantity {
    /// The unit in which the quantity is stated.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s^2",
            Self::Jerk => "m/s^3",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
        })
    }
}

/// A refused plan; axes and segments count from 0 here and from 1 in the text.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// The length of a move is not a positive number.
    #[error("length {length_m} m: a move needs a finite length above 0")]
    Length {
        /// The value given.
        length_m: f64,
    },
    /// A limit along the path, or the feed, is not a positive number.
    #[error("{quantity} limit {value} {}: must be finite and above 0", quantity.unit())]
    Limit {
        /// Which limit.
        quantity: Quantity,
        /// The value given.
        value: f64,
    },
    /// A limit of an axis is not a positive number.
    #[error("axis {}: {quantity} limit {value} {}: must be finite and above 0", axis + 1, quantity.unit())]
    AxisLimit {
        /// Which axis.
        axis: usize,
        /// Which limit.
        quantity: Quantity,
        /// The value given.
        value: f64,
    },
    /// The values are so far apart that the duration cannot be computed.
    #[error(
        "a move of {length_m} m at these limits would last {duration_s} s: must be finite and above 0"
    )]
    Duration {
        /// Length of the move.
        length_m: f64,
        /// What came out.
        duration_s: f64,
    },
    /// No axes, or more than a set point holds.
    #[error("{n_axes} axes: allowed 1 to {MAX_AXES}")]
    Axes {
        /// The number given.
        n_axes: usize,
    },
    /// The number of limits is not the number of coordinates.
    #[error("limits of {found} axes for points of {expected} coordinates: must be equal")]
    LimitCount {
        /// Number of limits given.
        found: usize,
        /// Number of coordinates of the start.
        expected: usize,
    },
    /// A point has too few or too many coordinates.
    #[error("segment {}: {found} coordinates: must be {expected}, as the start has", segment + 1)]
    Coordinates {
        /// Which segment.
        segment: usize,
        /// Number of coordinates given.
        found: usize,
        /// Number of coordinates of the start.
        expected: usize,
    },
    /// A coordinate is not finite, or too far away.
    #[error("axis {}: position {position_m} m: must be finite and within {limit_m} m of 0", axis + 1)]
    Position {
        /// Which axis.
        axis: usize,
        /// The value given.
        position_m: f64,
        /// The farthest allowed.
        limit_m: f64,
    },
    /// A feed is not a positive number.
    #[error("segment {}: feed {feed_m_s} m/s: must be finite and above 0", segment + 1)]
    Feed {
        /// Which segment.
        segment: usize,
        /// The value given.
        feed_m_s: f64,
    },
    /// A segment ends where it starts.
    #[error("segment {}: ends where it starts: leave it out, or move", segment + 1)]
    ZeroLength {
        /// Which segment.
        segment: usize,
    },
    /// An arc is not in the plane of two of the axes.
    #[error("segment {}: an arc in the plane of axes {} and {}: must be two of the path's own", segment + 1, plane[0] + 1, plane[1] + 1)]
    Plane {
        /// Which segment.
        segment: usize,
        /// The two axes, from 0.
        plane: [usize; 2],
    },
    /// The ends of an arc are not equally far from its centre.
    #[error(
        "segment {}: an arc that starts {} m from its centre and ends {} m from it: must be equal to \
         a thousandth, finite and above 0", segment + 1, Figure(*from_radius_m), Figure(*to_radius_m)
    )]
    Arc {
        /// Which segment.
        segment: usize,
        /// Distance of the start.
        from_radius_m: f64,
        /// Distance of the end.
        to_radius_m: f64,
    },
    /// An arc where only lines can be.
    #[error("segment {}: an arc: only straight segments are interpolated in this way", segment + 1)]
    NotStraight {
        /// Which segment.
        segment: usize,
    },
    /// Amplitude or frequency of an oscillation is not usable.
    #[error("segment {}: {name} {value} {unit}", segment + 1)]
    Oscillation {
        /// Which segment.
        segment: usize,
        /// `amplitude` or `frequency`.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Unit, and what is allowed.
        unit: &'static str,
    },
    /// A row of set points that is too far from those before it.
    #[error(
        "row {}: axis {}: the {quantity} over the cycle is {} {unit}, limit {} {unit}: let the set \
         points change more slowly, and rest at the first and the last",
        row + 1, axis + 1, Figure(*reached), Figure(*limit), unit = quantity.unit()
    )]
    Row {
        /// Which row; those after the last one are the rest at the end.
        row: usize,
        /// Which axis.
        axis: usize,
        /// Which limit.
        quantity: Quantity,
        /// What is reached there.
        reached: f64,
        /// The limit.
        limit: f64,
    },
    /// A set point of a planned path that is too far from those before it.
    #[error(
        "axis {}: at {} s the {quantity} of the set points over the cycle is {} {unit}, limit {} {unit}: \
         lower the feed or smooth the path",
        axis + 1, Figure(*at_s), Figure(*reached), Figure(*limit), unit = quantity.unit()
    )]
    SetPoint {
        /// When, from the first set point.
        at_s: f64,
        /// Which axis.
        axis: usize,
        /// Which limit.
        quantity: Quantity,
        /// What is reached there.
        reached: f64,
        /// The limit.
        limit: f64,
    },
    /// No α holds the limits.
    #[error(
        "segment {} {place}: no alpha holds every limit: at alpha {} the {quantity} along the path \
         reaches {} {unit}, limit {} {unit}; lower the feed or the oscillation",
        segment + 1, Figure(*alpha), Figure(*reached), Figure(*limit), unit = quantity.unit()
    )]
    Alpha {
        /// Which segment.
        segment: usize,
        /// `start-up`, `transition` or `end`.
        place: &'static str,
        /// The α that comes nearest.
        alpha: f64,
        /// The limit that it breaks most.
        quantity: Quantity,
        /// What is reached there.
        reached: f64,
        /// The limit along the path.
        limit: f64,
    },
    /// The programmed oscillation breaks a limit, whatever its start.
    #[error(
        "segment {}: the {quantity} of the programmed oscillation reaches {} {unit} along the path, \
         limit {} {unit}; lower its amplitude or its frequency",
        segment + 1, Figure(*reached), Figure(*limit), unit = quantity.unit()
    )]
    Programmed {
        /// Which segment.
        segment: usize,
        /// The limit that it breaks.
        quantity: Quantity,
        /// What is reached.
        reached: f64,
        /// The limit along the path.
        limit: f64,
    },
    /// The largest α wanted is so small that an end is not over within its leg.
    #[error(
        "segment {} {place}: alpha_max {value}: must be at least {}, as the {place} is not over \
         within its segment otherwise", segment + 1, Figure(*least)
    )]
    AlphaMax {
        /// Which segment.
        segment: usize,
        /// `start-up`, `transition` or `end`.
        place: &'static str,
        /// The value given.
        value: f64,
        /// The smallest that is over in time.
        least: f64,
    },
    /// A leg is over before its ends can be.
    #[error(
        "segment {}: lasts {} s at its feed, and its oscillation has to be 0 for {} s of that near \
         the corners: lower the amplitude, or make the segment longer",
        segment + 1, Figure(*lasts_s), Figure(*needs_s)
    )]
    Hurried {
        /// Which segment.
        segment: usize,
        /// How long it lasts.
        lasts_s: f64,
        /// What both ends need.
        needs_s: f64,
    },
    /// A parameter of a shape is not usable.
    #[error("{name} = {value}: allowed {allowed}")]
    Shape {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A curve has a point at which its direction is not defined.
    #[error("the curve stands still or has a corner at {} m from its start: two points may not be the same", Figure(*at_m))]
    Cusp {
        /// Where.
        at_m: f64,
    },
    /// No speed was found at which a curve holds the limits.
    #[error(
        "axis {}: at {} m from the start of the curve the {quantity} is {} {unit}, limit {} {unit}, after \
         {rounds} attempts to slow down: raise the limit or smooth the curve",
        axis + 1, Figure(*at_m), Figure(*reached), Figure(*limit), unit = quantity.unit()
    )]
    Unproven {
        /// Which axis.
        axis: usize,
        /// Where, along the curve.
        at_m: f64,
        /// Which limit.
        quantity: Quantity,
        /// What is reached there.
        reached: f64,
        /// The limit.
        limit: f64,
        /// Attempts made.
        rounds: usize,
    },
    /// There is no segment.
    #[error("a path of 0 segments: at least 1 is needed")]
    Empty,
    /// The cycle, a dwell or the blend window is not in its range.
    #[error("{name} {value_s} s: allowed {low_s} to {high_s} s")]
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
    #[error("the run lasts {duration_s} s, {n_samples} samples: allowed {n_samples_max}")]
    TooLong {
        /// How long it would last.
        duration_s: f64,
        /// Samples it would have.
        n_samples: f64,
        /// Samples allowed.
        n_samples_max: usize,
    },
    /// A blended path would break a limit of an axis.
    #[error(
        "axis {}: {quantity} reaches {} {unit}, limit {limit} {unit}: {}",
        axis + 1,
        Figure(*reached),
        Remedy(*feed_factor, *feed_admissible_m_s, *window_admissible_s),
        unit = quantity.unit()
    )]
    Exceeds {
        /// Which axis.
        axis: usize,
        /// Which limit.
        quantity: Quantity,
        /// Largest value that the set points reach.
        reached: f64,
        /// The limit.
        limit: f64,
        /// Factor on every feed at which all limits hold; 0 if none was found.
        feed_factor: f64,
        /// The feed of the fastest segment times that factor.
        feed_admissible_m_s: f64,
        /// A blend window at which all limits hold at the programmed feed, if one was found.
        window_admissible_s: Option<f64>,
    },
}

impl TrajectoryError {
    /// The axis that the refusal is about, if it is about one.
    pub fn axis(&self) -> Option<usize> {
        match *self {
            Self::AxisLimit { axis, .. }
            | Self::Position { axis, .. }
            | Self::Unproven { axis, .. }
            | Self::Row { axis, .. }
            | Self::SetPoint { axis, .. }
            | Self::Exceeds { axis, .. } => Some(axis),
            _ => None,
        }
    }
}

/// What the user can do about a blended path that is too fast.
struct Remedy(f64, f64, Option<f64>);

impl fmt::Display for Remedy {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(factor, feed_m_s, window_s) = self;
        if *factor > 0.0 {
            let (feed, factor) = (Figure(*feed_m_s), Figure(*factor));
            write!(out, "largest admissible feed {feed} m/s (every feed times {factor})")?;
        } else {
            out.write_str("no lower feed was found that holds the limits")?;
        }
        match window_s {
            Some(window_s) => write!(out, ", or blend window {} s", Figure(*window_s)),
            None => Ok(()),
        }
    }
}

/// A measured number to six digits.
struct Figure(f64);

impl fmt::Display for Figure {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scale = 10.0_f64.powf(5.0 - self.0.abs().log10().floor());
        let rounded = (self.0 * scale).round() / scale;
        write!(out, "{}", if rounded.is_finite() { rounded } else { self.0 })
    }
}
