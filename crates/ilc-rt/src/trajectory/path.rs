//! What a run shall do: a path of straight segments, how corners are taken, and rests. Cold.

use super::MAX_AXES;
use super::error::TrajectoryError;
use super::limits::{AxisLimits, Line, is_positive};

/// Farthest position of a plan; the blend's fixed-point numbers hold it with room to spare.
const POSITION_MAX_M: f64 = 4096.0;
/// Servo cycles that a plan accepts.
pub(super) const CYCLE_S: (f64, f64) = (1e-5, 1.0);
/// Longest rest before or after the motion.
const DWELL_MAX_S: f64 = 3600.0;

/// A straight move.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSegment {
    /// End point, one coordinate an axis.
    pub to_m: Vec<f64>,
    /// Speed along the segment.
    pub feed_m_s: f64,
}

/// How corners are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CornerRule {
    /// Come to rest at every corner; the feed is an upper bound.
    ExactStop,
    /// Keep the feed and round each corner within an averaging window.
    Blend {
        /// Length of the window, rounded up to whole cycles.
        window_s: f64,
    },
}

/// A run from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSpec {
    /// Start, one coordinate an axis.
    pub start_m: Vec<f64>,
    /// Straight moves in order.
    pub segments: Vec<PathSegment>,
    /// How corners are taken.
    pub corner: CornerRule,
    /// Rest at the start that belongs to the run.
    pub dwell_before_s: f64,
    /// Rest at the end that belongs to the run.
    pub dwell_after_s: f64,
}

impl PathSpec {
    /// Checks every value, and gives each segment as a line.
    ///
    /// # Errors
    /// [`TrajectoryError`] for the first value that is out of its range.
    pub(super) fn lines(
        &self,
        limits: &[AxisLimits],
        cycle_s: f64,
    ) -> Result<Vec<Line>, TrajectoryError> {
        let n_axes = self.start_m.len();
        if !(1..=MAX_AXES).contains(&n_axes) {
            return Err(TrajectoryError::Axes { n_axes });
        }
        if limits.len() != n_axes {
            return Err(TrajectoryError::LimitCount { found: limits.len(), expected: n_axes });
        }
        for (axis, limit) in limits.iter().enumerate() {
            limit.check(axis)?;
        }
        check_time("cycle", cycle_s, CYCLE_S)?;
        check_time("dwell before", self.dwell_before_s, (0.0, DWELL_MAX_S))?;
        check_time("dwell after", self.dwell_after_s, (0.0, DWELL_MAX_S))?;
        if self.segments.is_empty() {
            return Err(TrajectoryError::Empty);
        }
        let mut from_m = point(&self.start_m)?;
        let mut lines = Vec::with_capacity(self.segments.len());
        for (index, segment) in self.segments.iter().enumerate() {
            if segment.to_m.len() != n_axes {
                return Err(TrajectoryError::Coordinates {
                    segment: index,
                    found: segment.to_m.len(),
                    expected: n_axes,
                });
            }
            if !is_positive(segment.feed_m_s) {
                return Err(TrajectoryError::Feed { segment: index, feed_m_s: segment.feed_m_s });
            }
            let line = Line::new(from_m, point(&segment.to_m)?);
            if line.length_m == 0.0 {
                return Err(TrajectoryError::ZeroLength { segment: index });
            }
            from_m = line.to_m;
            lines.push(line);
        }
        Ok(lines)
    }

    /// The same path with every feed times `factor`.
    pub(super) fn with_feed_times(&self, factor: f64) -> Self {
        let mut slower = self.clone();
        for segment in &mut slower.segments {
            segment.feed_m_s *= factor;
        }
        slower
    }

    /// The feed of the fastest segment.
    pub(super) fn feed_max_m_s(&self) -> f64 {
        self.segments.iter().fold(0.0, |most, segment| most.max(segment.feed_m_s))
    }
}

/// Refuses a time that is not finite or not in its range.
pub(super) fn check_time(
    name: &'static str,
    value_s: f64,
    (low_s, high_s): (f64, f64),
) -> Result<(), TrajectoryError> {
    if (low_s..=high_s).contains(&value_s) {
        Ok(())
    } else {
        Err(TrajectoryError::Time { name, value_s, low_s, high_s })
    }
}

/// A point in the array of the tick; unused axes are 0.
pub(super) fn point(coordinates_m: &[f64]) -> Result<[f64; MAX_AXES], TrajectoryError> {
    let mut point_m = [0.0; MAX_AXES];
    for (axis, (to, &position_m)) in point_m.iter_mut().zip(coordinates_m).enumerate() {
        if !(-POSITION_MAX_M..=POSITION_MAX_M).contains(&position_m) {
            return Err(TrajectoryError::Position { axis, position_m, limit_m: POSITION_MAX_M });
        }
        *to = position_m;
    }
    Ok(point_m)
}
