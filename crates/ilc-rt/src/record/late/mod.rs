//! Lost deadlines: the cycle, its stages, and who was late, as facts. `judge` finds the cause; the command line and
//! the report make the sentences.

mod judge;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use judge::{Verdict, judge, judge_stop, spans};

/// The part of controller and machine that was late.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum LateCause {
    /// The host woke the loop late.
    WakeUp,
    /// The host gave the processor to another thread in the middle of the cycle.
    Preemption,
    /// Messages came late, or took long to take: of one node, or of the whole bus.
    Receive,
    /// The commands took long to compute.
    Computation,
    /// The bus took the commands late, or not all of them.
    Send,
}

/// Times of the stages of a cycle, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageSpans {
    /// From its place on the grid, or from the end of the cycle before if that was later, to its start.
    pub wake_us: f64,
    /// Taking the messages that had arrived.
    pub receive_us: f64,
    /// Computing the commands.
    pub control_us: f64,
    /// Passing the commands and SYNC to the bus.
    pub send_us: f64,
    /// Left until the next cycle; negative if it was late for that.
    pub slack_us: f64,
}

impl StageSpans {
    /// Returns the four stages with their names, in order.
    pub const fn named(&self) -> [(&'static str, f64); 4] {
        [
            ("wake", self.wake_us),
            ("receive", self.receive_us),
            ("control", self.control_us),
            ("send", self.send_us),
        ]
    }

    /// Returns the time of all stages.
    pub fn used_us(&self) -> f64 {
        self.named().iter().map(|(_, span_us)| span_us).sum()
    }
}

/// A cycle that lost its deadline, and the cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LateCycle {
    /// Number of the tick since the loop began.
    pub tick: u64,
    /// Part that was late.
    pub cause: LateCause,
    /// Axis that was waited for, if it was one.
    pub axis: Option<String>,
    /// CANopen node that was waited for, if it was one.
    pub node: Option<u8>,
    /// Cycles that were skipped because of it.
    pub missed: u32,
    /// Time that the cycle may use: `late_share` of its period.
    pub allowed_us: f64,
    /// Its stages.
    pub stages: StageSpans,
    /// The stages of the cycles before it: the median of each.
    pub usual: StageSpans,
    /// Time from SYNC to the answer that was waited for; absent if none came, or none was.
    pub answer_us: Option<f64>,
    /// Median of this time in the cycles before.
    pub usual_answer_us: Option<f64>,
    /// True if the bus did not take every frame.
    pub refused: bool,
    /// Times that another thread took the processor since the cycle before.
    pub preemptions: u32,
    /// Page faults since the cycle before that needed no disk.
    pub minor_faults: u32,
    /// Page faults since the cycle before that waited for a disk.
    pub major_faults: u32,
}

/// Late cycles of a campaign by their causes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LateCounts {
    /// The host woke the loop late.
    pub wake_up: u64,
    /// The host gave the processor to another thread.
    pub preemption: u64,
    /// A node or the bus was late.
    pub receive: u64,
    /// The computation took long.
    pub computation: u64,
    /// The bus took the commands late.
    pub send: u64,
    /// Cycles skipped because of them.
    pub missed: u64,
}

impl LateCounts {
    /// Counts one cycle.
    pub fn add(&mut self, cause: LateCause) {
        *match cause {
            LateCause::WakeUp => &mut self.wake_up,
            LateCause::Preemption => &mut self.preemption,
            LateCause::Receive => &mut self.receive,
            LateCause::Computation => &mut self.computation,
            LateCause::Send => &mut self.send,
        } += 1;
    }

    /// Returns each cause with its number of cycles.
    pub const fn by_cause(&self) -> [(LateCause, u64); 5] {
        [
            (LateCause::WakeUp, self.wake_up),
            (LateCause::Preemption, self.preemption),
            (LateCause::Receive, self.receive),
            (LateCause::Computation, self.computation),
            (LateCause::Send, self.send),
        ]
    }

    /// Returns the number of late cycles.
    pub fn all(&self) -> u64 {
        self.by_cause().iter().map(|(_, n)| n).sum()
    }
}

/// Times from SYNC to the answers of a node, in microseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AnswerTimes {
    /// Axis; absent for the tool.
    pub axis: Option<String>,
    /// CANopen node.
    pub node: u8,
    /// Number of answers.
    pub count: u64,
    /// Median.
    pub p50_us: f64,
    /// 99th percentile.
    pub p99_us: f64,
    /// Maximum.
    pub max_us: f64,
}
