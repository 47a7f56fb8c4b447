//! The messages of a recording, one struct per kind of channel.

use serde::{Deserialize, Serialize};

use super::exact;
use crate::record::fingerprint;
use crate::servo::PhaseName;

/// `/cycle`: the loop in one tick: its state, and all that it read of other threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CycleMessage {
    /// Number of the tick since the loop began.
    pub cycle: u64,
    /// Cycles skipped before it.
    pub missed: u32,
    /// Signal that requested a stop, or 0.
    pub asked: i32,
    /// Runs of lower numbers may start.
    pub released: u32,
    /// Feed override in percent.
    pub feed_percent: u32,
    /// True if the path is held.
    pub paused: bool,
    /// Number of the input table in use.
    pub table: u32,
    /// Phase at the end of the tick.
    pub phase: PhaseName,
    /// Run, the next one between two runs.
    pub run: u32,
    /// Next sample of the run in progress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<u32>,
    /// Cycles of this run that began late.
    pub overruns: u32,
    /// Cycles of this run at another feed than 100 %.
    pub scaled_cycles: u32,
    /// Scale of the time along the path, 0 to 1.
    #[serde(with = "exact")]
    pub scale: f64,
    /// First coordinate of the tool, m.
    #[serde(with = "exact")]
    pub tool_x_m: f64,
    /// Second coordinate of the tool, m.
    #[serde(with = "exact")]
    pub tool_y_m: f64,
    /// Digital inputs that are known, one bit each.
    pub inputs_known: u16,
    /// Digital inputs that are on, one bit each.
    pub inputs_on: u16,
    /// Reason of a stop; empty without one.
    pub stopping: String,
    /// Records lost so far.
    pub lost: u64,
}

/// `/axes/NAME`: one axis in one tick.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisMessage {
    /// Number of the tick.
    pub cycle: u64,
    /// Set point without the learned input, m.
    #[serde(with = "exact")]
    pub reference_m: f64,
    /// Its velocity, m/s.
    #[serde(with = "exact")]
    pub reference_m_s: f64,
    /// Learned input as applied, in its unit.
    #[serde(with = "exact")]
    pub correction: f64,
    /// Newest measured position, m.
    #[serde(with = "exact")]
    pub position_m: f64,
    /// Velocity derived from it, m/s.
    #[serde(with = "exact")]
    pub velocity_m_s: f64,
    /// Set point of the exchange that this position answers, minus the position, m.
    #[serde(with = "exact")]
    pub error_m: f64,
    /// Following error, m.
    #[serde(with = "exact")]
    pub following_error_m: f64,
    /// Command: m, m/s or N by the mode.
    #[serde(with = "exact")]
    pub command: f64,
    /// Controlword as sent.
    pub controlword: u16,
    /// Target as sent, in counts or counts/s.
    pub target_counts: i32,
    /// Torque or torque offset as sent, thousandths of the rated one.
    pub torque_offset: i16,
    /// Velocity offset as sent, counts/s.
    pub velocity_offset_counts_s: i32,
    /// Statusword.
    pub statusword: u16,
    /// Velocity that the drive reports, counts/s; absent if it is not mapped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive_velocity_counts_s: Option<i32>,
    /// Torque that the drive reports, thousandths of the rated one; absent if it is not mapped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive_torque: Option<i16>,
}

/// `/frames`: the traffic of one tick, as candump notes frames: `181#37020A00`. A failure is a word after `!`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FramesMessage {
    /// Number of the tick; after the last one the number of ticks.
    pub cycle: u64,
    /// Frames received, in order.
    pub received: Vec<String>,
    /// Time of each since the time of the message, ns; empty in lock-step.
    pub received_ns: Vec<i64>,
    /// Frames sent, in order.
    pub sent: Vec<String>,
    /// Time of each since the time of the message, ns; empty in lock-step.
    pub sent_ns: Vec<i64>,
}

/// `/tables`: an input table on its way into the loop.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TableMessage {
    /// Its number; the loop tells in `/cycle` which one it uses.
    pub table: u32,
    /// Input, time first.
    #[serde(with = "exact::list")]
    pub input: Vec<f64>,
    /// Digest of the column of each axis.
    pub digests: Vec<String>,
}

/// `/timing`: stages of one tick, in ns after its time on the grid; in real time only.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimingMessage {
    /// Number of the tick in the flight recorder.
    pub cycle: u64,
    /// Time on the grid, of the loop's clock.
    pub due_ns: u64,
    /// It began.
    pub woke_ns: u64,
    /// All messages that had arrived were taken.
    pub received_ns: u64,
    /// All commands were computed.
    pub controlled_ns: u64,
    /// The exchange was passed to the bus.
    pub sent_ns: u64,
    /// It was over.
    pub ended_ns: u64,
    /// Cycles skipped before it.
    pub missed: u32,
    /// Time from the exchange to the answer of each place: the axes, then the tool; 0 if none came.
    pub answer_ns: Vec<u32>,
    /// Places, one bit each, whose late answer came.
    pub late_answers: u16,
    /// Longest time that taking one message took.
    pub waited_ns: u32,
    /// Place that sent it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waited_for: Option<u8>,
    /// True if the bus did not take every frame.
    pub refused: bool,
    /// Times that another thread took the processor.
    pub preemptions: u32,
    /// Page faults that needed no disk.
    pub minor_faults: u32,
    /// Page faults that waited for a disk.
    pub major_faults: u32,
    /// True if the cycle lost its deadline.
    pub late: bool,
    /// True if the loop stopped for a fault in it.
    pub stopped: bool,
}

/// Returns the topic of an axis.
pub fn axis_topic(name: &str) -> String {
    format!("/axes/{name}")
}

/// Returns the digest of the column of an axis in an input table.
pub(crate) fn column_digest(input: &[f64], axis: usize, n_axes: usize) -> String {
    use std::fmt::Write as _;
    let mut bits = String::with_capacity(17 * input.len() / n_axes.max(1) + 17);
    for value in input.iter().skip(axis).step_by(n_axes.max(1)) {
        // Writing to a string cannot fail.
        let _ = write!(bits, "{:x} ", value.to_bits());
    }
    fingerprint(&bits)
}
