//! Configuration of the servo cycle: its nodes, their limits, and its time-outs.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use super::inputs::InputSpec;
use crate::control::PositionLoop;
use crate::fieldbus::canopen::NodeId;
use crate::fieldbus::cia402::{Mode, Scale};
use crate::interpolate::AxisLimits;
use crate::rt::Nanos;

/// One axis.
#[derive(Clone, Copy, Debug)]
pub struct AxisSpec {
    /// Node of the drive.
    pub node: NodeId,
    /// Command interface.
    pub mode: Mode,
    /// Counts of the drive's encoder.
    pub scale: Scale,
    /// Limits of motion.
    pub limits: AxisLimits,
    /// Lowest position.
    pub position_min_m: f64,
    /// Highest position.
    pub position_max_m: f64,
    /// Largest following error.
    pub following_error_max_m: f64,
    /// Position loop of a velocity-commanded drive; ignored otherwise.
    pub position_loop: PositionLoop,
    /// Bound of the learned input: m (position-commanded) or m/s (velocity-commanded).
    pub input_max: f64,
}

/// A node that measures the tool centre point.
#[derive(Clone, Copy, Debug)]
pub struct ToolSpec {
    /// Its node.
    pub node: NodeId,
    /// Its counts.
    pub scale: Scale,
}

/// Source of the pace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The clock; answers that have not arrived are late.
    Clock,
    /// The nodes' answers (lock-step); there is no clock, and a node that is silent for this long
    /// is lost.
    Answers(Duration),
}

/// The whole cycle.
#[derive(Clone, Debug)]
pub struct ServoSpec {
    /// Axes in the order of the coordinates.
    pub axes: Vec<AxisSpec>,
    /// Tool measurement, if there is one.
    pub tool: Option<ToolSpec>,
    /// Digital inputs; those beyond [`INPUTS_MAX`](super::INPUTS_MAX) are ignored.
    pub inputs: Vec<InputSpec>,
    /// True if a press of a start button releases the run that waits.
    pub starts_on_input: bool,
    /// Servo cycle.
    pub cycle: Nanos,
    /// Source of the pace.
    pub pace: Pace,
    /// Number of the first run, and of the run after the last one.
    pub runs: std::ops::Range<u32>,
    /// Start of each run.
    pub start_m: Vec<f64>,
    /// Velocity of the move to the start.
    pub return_feed_m_s: f64,
    /// Velocity of the first move to the start, from wherever the axes are when their drives are enabled.
    pub approach_feed_m_s: f64,
    /// True if faults that drives have when the loop begins are reset; otherwise they end it.
    pub resets_faults: bool,
    /// Settling time between the arrival at the start and the run.
    pub settle_ticks: u32,
    /// Time-out for a drive to switch on.
    pub enable_ticks: u32,
    /// Consecutive unanswered cycles at which a node is lost.
    pub silent_cycles_max: u32,
    /// Consecutive overrun cycles at which the axes stop.
    pub overrun_cycles_max: u32,
    /// Cycles for which the loop pauses, sending nothing, when nodes stop answering; 0 for real
    /// nodes, which would move on.
    pub hold_cycles_max: u32,
}
