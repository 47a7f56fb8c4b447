//! Paths of lines and arcs: their description, and the blend of their corners.

mod blended;
mod spec;

pub(in crate::trajectory) use blended::BlendedPath;
pub use spec::{ArcSpec, PathSegment, PathSpec};
pub(in crate::trajectory) use spec::{
    POSITION_MAX_M, check_limits, checked_line, checked_lines, point,
};
