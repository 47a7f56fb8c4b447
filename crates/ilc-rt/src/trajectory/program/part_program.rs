//! A part program after reading: its settings and its moves.

use crate::trajectory::path::PathSegment;

/// The settings for reading a program.
#[derive(Clone, Copy, Debug)]
pub struct GcodeSetting<'a> {
    /// Start, one coordinate an axis: X Y Z A B C are the first six.
    pub start_m: &'a [f64],
    /// Speed along the path until the first F.
    pub feed_m_s: f64,
    /// Speed of G0.
    pub rapid_m_s: f64,
    /// True for rotary axes: their numbers are degrees. Axes beyond its end are linear.
    pub rotary: &'a [bool],
    /// True if the path comes to rest at its corners (G61, G61.1), false if it rounds them (G64).
    pub exact_corners: bool,
    /// Skips blocks that begin with `/`; LinuxCNC's switch is off by default.
    pub block_delete: bool,
}

/// The moves of a program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GcodeProgram {
    /// Moves in order.
    pub segments: Vec<PathSegment>,
    /// The line of each move, from 1.
    pub lines: Vec<usize>,
    /// True for each move that is rapid (G0).
    pub rapid: Vec<bool>,
    /// Dwell before the first move.
    pub dwell_before_s: f64,
}
