//! Paths of lines and arcs: their description, and the plan that walks along them tick by tick.

pub(crate) mod blended;
pub(crate) mod spec;

pub use spec::{ArcSpec, CornerRule, PathSegment, PathSpec};
pub(crate) use spec::{
    CYCLE_S, DWELL_MAX_S, POSITION_MAX_M, check_limits, check_time, checked_lines, point,
};
