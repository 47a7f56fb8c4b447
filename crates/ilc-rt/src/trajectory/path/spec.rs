//! What a run shall do: a path of lines and arcs, how corners are taken, and rests. Cold.

use crate::interpolate::MAX_AXES;
use crate::interpolate::arc::Arc;
use crate::interpolate::element::Element;
use crate::trajectory::error::{Quantity, TrajectoryError};
use crate::interpolate::limits::{AxisLimits, Line, is_positive};
use crate::trajectory::verify::TOLERANCE;

/// Farthest position of a plan; the blend's fixed-point numbers hold it with room to spare.
pub(crate) const POSITION_MAX_M: f64 = 4096.0;
/// Servo cycles that a plan accepts.
pub(crate) const CYCLE_S: (f64, f64) = (1e-5, 1.0);
/// Longest rest before or after the motion.
pub(crate) const DWELL_MAX_S: f64 = 3600.0;

/// A move along a line or an arc.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSegment {
    /// End point, one coordinate an axis.
    pub to_m: Vec<f64>,
    /// Speed along the segment.
    pub feed_m_s: f64,
    /// What makes it an arc; none for a line.
    pub arc: Option<ArcSpec>,
    /// Rest at its end.
    pub dwell_s: f64,
}

impl PathSegment {
    /// A straight move without rest.
    pub fn line(to_m: Vec<f64>, feed_m_s: f64) -> Self {
        Self { to_m, feed_m_s, arc: None, dwell_s: 0.0 }
    }
}

/// An arc in the plane of two axes; the others go along in proportion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArcSpec {
    /// The two axes; anticlockwise is from the first to the second.
    pub plane: [usize; 2],
    /// Centre, in the two axes.
    pub center_m: [f64; 2],
    /// Which way round.
    pub clockwise: bool,
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
    /// Moves in order.
    pub segments: Vec<PathSegment>,
    /// How corners are taken.
    pub corner: CornerRule,
    /// Rest at the start that belongs to the run.
    pub dwell_before_s: f64,
    /// Rest at the end that belongs to the run.
    pub dwell_after_s: f64,
}

impl PathSpec {
    /// Checks every value, and gives each segment as an element.
    ///
    /// # Errors
    /// [`TrajectoryError`] for the first value that is out of its range.
    pub(crate) fn elements(
        &self,
        limits: &[AxisLimits],
        cycle_s: f64,
    ) -> Result<Vec<Element>, TrajectoryError> {
        check_time("cycle", cycle_s, CYCLE_S)?;
        check_time("dwell before", self.dwell_before_s, (0.0, DWELL_MAX_S))?;
        check_time("dwell after", self.dwell_after_s, (0.0, DWELL_MAX_S))?;
        for segment in &self.segments {
            check_time("dwell", segment.dwell_s, (0.0, DWELL_MAX_S))?;
        }
        checked_elements(&self.start_m, &self.segments, limits)
    }

    /// Refuses feeds at which an axis would have to be faster than it may: a plan with exact stops
    /// would be slower instead. Segments that are `rapid` are not looked at.
    ///
    /// # Errors
    /// [`TrajectoryError::Exceeds`] for the axis that a feed is most too high for, with the factor on
    /// every feed that would do; others for values out of range.
    pub fn check_feeds(
        &self,
        limits: &[AxisLimits],
        rapid: &[bool],
    ) -> Result<(), TrajectoryError> {
        let elements = checked_elements(&self.start_m, &self.segments, limits)?;
        let mut worst: Option<(f64, usize, f64)> = None;
        for (index, (element, segment)) in elements.iter().zip(&self.segments).enumerate() {
            if rapid.get(index).copied().unwrap_or(false) {
                continue;
            }
            for (axis, limit) in limits.iter().enumerate() {
                let reached = element.share(axis) * segment.feed_m_s;
                let ratio = reached / limit.velocity_max_m_s;
                if ratio > 1.0 + TOLERANCE && worst.is_none_or(|(most, ..)| ratio > most) {
                    worst = Some((ratio, axis, reached));
                }
            }
        }
        let Some((ratio, axis, reached)) = worst else { return Ok(()) };
        Err(TrajectoryError::Exceeds {
            axis,
            quantity: Quantity::Velocity,
            reached,
            limit: limits[axis].velocity_max_m_s,
            feed_factor: 1.0 / ratio,
            feed_admissible_m_s: self.feed_max_m_s() / ratio,
            window_admissible_s: None,
        })
    }

    /// The same path with every feed times `factor`.
    pub(crate) fn with_feed_times(&self, factor: f64) -> Self {
        let mut slower = self.clone();
        for segment in &mut slower.segments {
            segment.feed_m_s *= factor;
        }
        slower
    }

    /// The feed of the fastest segment.
    pub(crate) fn feed_max_m_s(&self) -> f64 {
        self.segments.iter().fold(0.0, |most, segment| most.max(segment.feed_m_s))
    }
}

/// Checks points, feeds and limits, and gives each segment as an element.
fn checked_elements(
    start_m: &[f64],
    segments: &[PathSegment],
    limits: &[AxisLimits],
) -> Result<Vec<Element>, TrajectoryError> {
    check_limits(start_m.len(), limits)?;
    if segments.is_empty() {
        return Err(TrajectoryError::Empty);
    }
    let mut from_m = point(start_m)?;
    let mut elements = Vec::with_capacity(segments.len());
    for (index, segment) in segments.iter().enumerate() {
        if segment.to_m.len() != start_m.len() {
            return Err(TrajectoryError::Coordinates {
                segment: index,
                found: segment.to_m.len(),
                expected: start_m.len(),
            });
        }
        if !is_positive(segment.feed_m_s) {
            return Err(TrajectoryError::Feed { segment: index, feed_m_s: segment.feed_m_s });
        }
        let to_m = point(&segment.to_m)?;
        let element = match segment.arc {
            None => Element::Line(Line::new(from_m, to_m)),
            Some(ArcSpec { plane, center_m, clockwise }) => {
                let [p, q] = plane;
                if p == q || p.max(q) >= start_m.len() {
                    return Err(TrajectoryError::Plane { segment: index, plane });
                }
                Element::Arc(Arc::new(from_m, to_m, plane, center_m, clockwise).ok_or_else(
                    || TrajectoryError::Arc {
                        segment: index,
                        from_radius_m: (from_m[p] - center_m[0]).hypot(from_m[q] - center_m[1]),
                        to_radius_m: (to_m[p] - center_m[0]).hypot(to_m[q] - center_m[1]),
                    },
                )?)
            }
        };
        if element.length_m() == 0.0 {
            return Err(TrajectoryError::ZeroLength { segment: index });
        }
        from_m = to_m;
        elements.push(element);
    }
    Ok(elements)
}

/// As [`checked_elements`], for segments without arcs.
pub(crate) fn checked_lines(
    start_m: &[f64],
    segments: &[PathSegment],
    limits: &[AxisLimits],
) -> Result<Vec<Line>, TrajectoryError> {
    let elements = checked_elements(start_m, segments, limits)?;
    elements
        .into_iter()
        .enumerate()
        .map(|(segment, element)| match element {
            Element::Line(line) => Ok(line),
            Element::Arc(_) => Err(TrajectoryError::NotStraight { segment }),
        })
        .collect()
}

/// Refuses a number of axes or limits that cannot be, and limits that are not positive.
pub(crate) fn check_limits(n_axes: usize, limits: &[AxisLimits]) -> Result<(), TrajectoryError> {
    if !(1..=MAX_AXES).contains(&n_axes) {
        return Err(TrajectoryError::Axes { n_axes });
    }
    if limits.len() != n_axes {
        return Err(TrajectoryError::LimitCount { found: limits.len(), expected: n_axes });
    }
    for (axis, limit) in limits.iter().enumerate() {
        limit.check(axis)?;
    }
    Ok(())
}

/// Refuses a time that is not finite or not in its range.
pub(crate) fn check_time(
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
pub(crate) fn point(coordinates_m: &[f64]) -> Result<[f64; MAX_AXES], TrajectoryError> {
    let mut point_m = [0.0; MAX_AXES];
    for (axis, (to, &position_m)) in point_m.iter_mut().zip(coordinates_m).enumerate() {
        if !(-POSITION_MAX_M..=POSITION_MAX_M).contains(&position_m) {
            return Err(TrajectoryError::Position { axis, position_m, limit_m: POSITION_MAX_M });
        }
        *to = position_m;
    }
    Ok(point_m)
}
