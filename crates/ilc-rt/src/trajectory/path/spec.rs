//! Description of a run: a path of lines and arcs, its corners, and rests.

use crate::interpolate::arc::Arc;
use crate::interpolate::element::{Element, Leg};
use crate::interpolate::limits::is_positive;
use crate::interpolate::line::Line;
use crate::interpolate::{AxisLimits, MAX_AXES, MoveError, Quantity};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{CYCLE_S, DWELL_MAX_S, check_time};
use crate::trajectory::verify::TOLERANCE;

/// Farthest position of a plan; within the range of the blend's fixed-point numbers.
pub(in crate::trajectory) const POSITION_MAX_M: f64 = 4096.0;

/// A move along a line or an arc.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSegment {
    /// End point, one coordinate per axis.
    pub to_m: Vec<f64>,
    /// Feed along the segment.
    pub feed_m_s: f64,
    /// The arc; `None` for a line.
    pub arc: Option<ArcSpec>,
    /// Dwell at its end.
    pub dwell_s: f64,
}

impl PathSegment {
    /// Returns a straight move without dwell.
    pub fn line(to_m: Vec<f64>, feed_m_s: f64) -> Self {
        Self { to_m, feed_m_s, arc: None, dwell_s: 0.0 }
    }
}

/// An arc in the plane of two axes; the other axes move in proportion (helix).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArcSpec {
    /// The two axes; counter-clockwise is from the first to the second.
    pub plane: [usize; 2],
    /// Centre, in the two axes.
    pub center_m: [f64; 2],
    /// Clockwise instead of anticlockwise.
    pub clockwise: bool,
}

/// A run from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSpec {
    /// Start, one coordinate per axis.
    pub start_m: Vec<f64>,
    /// Moves in order.
    pub segments: Vec<PathSegment>,
    /// Length of the window within which corners are rounded at the feed, in whole cycles rounded up;
    /// `None` to come to rest at every corner, with the feed as an upper bound.
    pub blend_s: Option<f64>,
    /// Dwell at the start, part of the run.
    pub dwell_before_s: f64,
    /// Dwell at the end, part of the run.
    pub dwell_after_s: f64,
}

impl PathSpec {
    /// Checks every value, and returns each segment as a leg.
    ///
    /// # Errors
    /// [`TrajectoryError`] for the first value out of range.
    pub(in crate::trajectory) fn legs(
        &self,
        limits: &[AxisLimits],
        cycle_s: f64,
    ) -> Result<Vec<Leg>, TrajectoryError> {
        check_time("cycle", cycle_s, CYCLE_S)?;
        check_time("dwell before", self.dwell_before_s, (0.0, DWELL_MAX_S))?;
        check_time("dwell after", self.dwell_after_s, (0.0, DWELL_MAX_S))?;
        for segment in &self.segments {
            check_time("dwell", segment.dwell_s, (0.0, DWELL_MAX_S))?;
        }
        checked_legs(&self.start_m, &self.segments, limits)
    }

    /// Refuses feeds at which an axis would exceed its velocity limit; a plan with exact stops
    /// would silently be slower. `rapid` segments are skipped.
    ///
    /// # Errors
    /// [`TrajectoryError::Exceeds`] for the axis whose limit is exceeded most, with the admissible
    /// factor on every feed; others for values out of range.
    pub fn check_feeds(
        &self,
        limits: &[AxisLimits],
        rapid: &[bool],
    ) -> Result<(), TrajectoryError> {
        let legs = checked_legs(&self.start_m, &self.segments, limits)?;
        let mut worst: Option<(f64, usize, f64)> = None;
        for (index, leg) in legs.iter().enumerate() {
            if rapid.get(index).copied().unwrap_or(false) {
                continue;
            }
            for (axis, limit) in limits.iter().enumerate() {
                let reached = leg.element.share(axis) * leg.feed_m_s;
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
            feed_admissible: feed_max_m_s(&legs) / ratio,
            window_admissible_s: None,
        })
    }
}

/// Checks points, feeds and limits, and returns each segment as a leg.
fn checked_legs(
    start_m: &[f64],
    segments: &[PathSegment],
    limits: &[AxisLimits],
) -> Result<Vec<Leg>, TrajectoryError> {
    check_limits(start_m.len(), limits)?;
    if segments.is_empty() {
        return Err(TrajectoryError::Empty);
    }
    let mut from_m = point(start_m)?;
    let mut legs = Vec::with_capacity(segments.len());
    for (index, segment) in segments.iter().enumerate() {
        let PathSegment { to_m, feed_m_s, arc, dwell_s } = segment;
        let to_m = end_of(index, to_m, *feed_m_s, start_m.len())?;
        let element = match *arc {
            None => Element::Line(Line::new(from_m, to_m)),
            Some(ArcSpec { plane, center_m, clockwise }) => {
                let [p, q] = plane;
                if p == q || p.max(q) >= start_m.len() {
                    return Err(TrajectoryError::Plane { segment: index, plane });
                }
                Element::Arc(Arc::new(from_m, to_m, plane, center_m, clockwise).ok_or_else(
                    || TrajectoryError::Arc {
                        segment: index,
                        from_radius: (from_m[p] - center_m[0]).hypot(from_m[q] - center_m[1]),
                        to_radius: (to_m[p] - center_m[0]).hypot(to_m[q] - center_m[1]),
                    },
                )?)
            }
        };
        if element.length_m() == 0.0 {
            return Err(TrajectoryError::ZeroLength { segment: index });
        }
        from_m = to_m;
        legs.push(Leg { element, feed_m_s: *feed_m_s, dwell_s: *dwell_s });
    }
    Ok(legs)
}

/// Checks the end of a segment and its feed, and returns its point.
fn end_of(
    segment: usize,
    to_m: &[f64],
    feed_m_s: f64,
    n_axes: usize,
) -> Result<[f64; MAX_AXES], TrajectoryError> {
    if to_m.len() != n_axes {
        return Err(TrajectoryError::Coordinates { segment, found: to_m.len(), expected: n_axes });
    }
    if !is_positive(feed_m_s) {
        return Err(TrajectoryError::Feed { segment, feed: feed_m_s });
    }
    point(to_m)
}

/// Checks the end of a straight move from a point and its feed, and returns its line.
pub(in crate::trajectory) fn checked_line(
    segment: usize,
    from_m: [f64; MAX_AXES],
    to_m: &[f64],
    feed_m_s: f64,
    n_axes: usize,
) -> Result<Line, TrajectoryError> {
    let line = Line::new(from_m, end_of(segment, to_m, feed_m_s, n_axes)?);
    if line.length_m == 0.0 {
        return Err(TrajectoryError::ZeroLength { segment });
    }
    Ok(line)
}

/// Returns the feed of the fastest leg.
pub(super) fn feed_max_m_s(legs: &[Leg]) -> f64 {
    legs.iter().fold(0.0, |highest, leg| highest.max(leg.feed_m_s))
}

/// As [`checked_legs`], for segments without arcs.
pub(in crate::trajectory) fn checked_lines(
    start_m: &[f64],
    segments: &[PathSegment],
    limits: &[AxisLimits],
) -> Result<Vec<Line>, TrajectoryError> {
    let legs = checked_legs(start_m, segments, limits)?;
    legs.into_iter()
        .enumerate()
        .map(|(segment, leg)| match leg.element {
            Element::Line(line) => Ok(line),
            Element::Arc(_) => Err(TrajectoryError::NotStraight { segment }),
        })
        .collect()
}

/// Refuses an invalid number of axes or limits, and limits that are not positive.
pub(in crate::trajectory) fn check_limits(
    n_axes: usize,
    limits: &[AxisLimits],
) -> Result<(), TrajectoryError> {
    if !(1..=MAX_AXES).contains(&n_axes) {
        return Err(MoveError::Axes { n_axes }.into());
    }
    if limits.len() != n_axes {
        return Err(TrajectoryError::LimitCount { found: limits.len(), expected: n_axes });
    }
    for (axis, limit) in limits.iter().enumerate() {
        limit.check(axis)?;
    }
    Ok(())
}

/// Returns a point as an array of all axes; unused axes are 0.
pub(in crate::trajectory) fn point(
    coordinates_m: &[f64],
) -> Result<[f64; MAX_AXES], TrajectoryError> {
    let mut point_m = [0.0; MAX_AXES];
    for (axis, (to, &position_m)) in point_m.iter_mut().zip(coordinates_m).enumerate() {
        if !(-POSITION_MAX_M..=POSITION_MAX_M).contains(&position_m) {
            return Err(
                MoveError::Position { axis, position: position_m, limit: POSITION_MAX_M }.into()
            );
        }
        *to = position_m;
    }
    Ok(point_m)
}
