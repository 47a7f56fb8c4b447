//! Element of a path, a line or an arc, as exact-stop and blended motion traverse it.

use super::MAX_AXES;
use super::arc::Arc;
use super::limits::{AxisLimits, PathLimits};
use super::line::Line;

/// A line or an arc.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Element {
    Line(Line),
    Arc(Arc),
}

impl Element {
    pub(crate) fn start_m(&self) -> [f64; MAX_AXES] {
        match self {
            Self::Line(line) => line.from_m,
            Self::Arc(arc) => arc.from_m,
        }
    }

    pub(crate) fn end_m(&self) -> [f64; MAX_AXES] {
        match self {
            Self::Line(line) => line.to_m,
            Self::Arc(arc) => arc.to_m,
        }
    }

    pub(crate) fn length_m(&self) -> f64 {
        match self {
            Self::Line(line) => line.length_m,
            Self::Arc(arc) => arc.length_m,
        }
    }

    /// Returns the point at `s_m` from the start; exact at the end.
    pub(crate) fn point_m(&self, s_m: f64) -> [f64; MAX_AXES] {
        match self {
            Self::Line(line) => line.point_m(s_m),
            Self::Arc(arc) => arc.point_m(s_m),
        }
    }

    /// Returns the unit tangent at `s_m` from the start times `scale`.
    pub(crate) fn along(&self, s_m: f64, scale: f64) -> [f64; MAX_AXES] {
        match self {
            Self::Line(line) => line.along(scale),
            Self::Arc(arc) => arc.along(s_m, scale),
        }
    }

    /// Returns the largest share of the path speed that an axis takes anywhere on it.
    pub(crate) fn share(&self, axis: usize) -> f64 {
        match self {
            Self::Line(line) => line.direction[axis].abs(),
            Self::Arc(arc) => arc.share(axis),
        }
    }

    /// Returns the path limits of a jerk-limited move, from the axes' limits and the feed.
    pub(crate) fn limits(&self, limits: &[AxisLimits], feed_m_s: f64) -> PathLimits {
        match self {
            Self::Line(line) => PathLimits::along(&line.direction, limits, feed_m_s),
            Self::Arc(arc) => arc.limits(limits, feed_m_s),
        }
    }
}

/// An element, the speed along it, and the dwell at its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leg {
    pub(crate) element: Element,
    pub(crate) feed_m_s: f64,
    pub(crate) dwell_s: f64,
}
