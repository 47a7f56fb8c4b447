//! Events of a running campaign: the same objects on standard output and on Zenoh.
//!
//! Their JSON schema is `docs/events.schema.json`, which the Python classes are tested against.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fault::Fault;
use super::figures::Figures;
use super::late::{AnswerTimes, LateCounts, LateCycle, StageSpans};
use crate::rt::{LatencyFigures, RtReport};

/// Version of the events and of all that a cell publishes. Within a version fields are only added, and none changes
/// its type or its unit.
pub const SCHEMA: u32 = 1;

/// An event; JSON with the field `event` as its name.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A campaign begins.
    Start {
        /// Version of the events; within one, fields are only added.
        schema: u32,
        /// Name of the cell.
        cell: String,
        /// Identifier of the campaign in the library.
        campaign: String,
        /// Samples in a run.
        n_samples: usize,
        /// Number of axes.
        n_axes: usize,
        /// Names of the axes.
        axis_names: Vec<String>,
        /// Unit of each axis' learned input.
        input_units: Vec<String>,
        /// Servo cycle.
        cycle_s: f64,
        /// Number of the first run; above 0 when resumed.
        first_index: u32,
        /// Runs in the whole campaign.
        iterations: u32,
        /// Measurement to learn from.
        measure: String,
        /// Law.
        law: String,
        /// Bus address.
        bus: String,
        /// `realtime` or `lockstep`.
        mode: &'static str,
        /// Socket that `ilc-rt ctl` commands it with, if there is one.
        ctl: Option<String>,
        /// Real-time settings granted to the thread of the loop; absent in lock-step.
        #[schemars(with = "Option<serde_json::Value>")]
        rt: Option<RtReport>,
    },
    /// The cell entered a state.
    State {
        /// The state.
        state: StateName,
        /// The run it belongs to.
        iteration: u32,
    },
    /// Digital inputs have changed.
    Inputs {
        /// All inputs of the cell, in their order.
        inputs: Vec<InputState>,
    },
    /// A drive has changed its state.
    Drives {
        /// All axes of the cell, in their order.
        drives: Vec<DriveState>,
    },
    /// Progress of the current run; about ten per second.
    Progress {
        /// Number of the run.
        iteration: u32,
        /// Sample reached.
        sample: usize,
        /// Samples in a run.
        n_samples: usize,
    },
    /// A run ended and is stored.
    Iteration {
        /// Campaign it belongs to.
        campaign: String,
        /// Row in the library.
        id: i64,
        /// Number of the run.
        index: u32,
        /// SHA-256 of its arrays.
        digest: String,
        /// Figures.
        #[serde(flatten)]
        figures: Figures,
    },
    /// The law decided on a run that was already published, as it was still computing.
    Judged {
        /// Campaign it belongs to.
        campaign: String,
        /// Row in the library.
        id: i64,
        /// Number of the run.
        index: u32,
        /// True if the best input was restored after it.
        rolled_back: bool,
        /// True if learning is off.
        learning_off: bool,
        /// Reason; one sentence.
        remark: Option<String>,
    },
    /// A frozen input does not fit the machine any more: the error has grown too far.
    Drift {
        /// Number of the run.
        index: u32,
        /// Its error over that of the run the input was taken from; absent if that one had none.
        ratio: Option<f64>,
        /// Largest ratio allowed.
        allowed: f64,
        /// Run that the input was taken from.
        origin: String,
        /// Campaign in which learning starts again, if it does.
        relearned_in: Option<String>,
    },
    /// Timing of the loop over the whole campaign; in real time only.
    Latency {
        /// Lateness of the loop on its grid.
        #[schemars(with = "serde_json::Value")]
        wake_late_us: LatencyFigures,
        /// Execution time of a tick.
        #[schemars(with = "serde_json::Value")]
        execution_us: LatencyFigures,
        /// Taking the messages that had arrived.
        #[schemars(with = "serde_json::Value")]
        receive_us: LatencyFigures,
        /// Computing the commands.
        #[schemars(with = "serde_json::Value")]
        control_us: LatencyFigures,
        /// Passing the commands and SYNC to the bus.
        #[schemars(with = "serde_json::Value")]
        send_us: LatencyFigures,
        /// Answers of each node.
        answers: Vec<AnswerTimes>,
        /// Times that another thread took the processor of the loop.
        preemptions: u32,
        /// Page faults of the loop that needed no disk.
        minor_faults: u32,
        /// Page faults of the loop that waited for a disk.
        major_faults: u32,
        /// Late cycles.
        late: LateCounts,
        /// The worst of them; absent if no cycle was late.
        worst: Option<LateCycle>,
        /// Stages of a cycle in the middle of those that were not late.
        good: Option<StageSpans>,
        /// File with the worst cycles, for `ilc-rt why`; absent if it could not be written.
        file: Option<String>,
    },
    /// A cycle of the loop lost its deadline; about one a second, and every one that is worse than all before.
    Late {
        /// The run it belongs to.
        iteration: u32,
        /// Late cycles since the last event, this one included.
        count: u64,
        /// The cycle.
        #[serde(flatten)]
        cycle: LateCycle,
    },
    /// A recording begins, loses records, or ends early; the runs go on in any case.
    Recording {
        /// File.
        file: String,
        /// Records lost so far, as this computer wrote too slowly.
        lost: u64,
        /// Reason of a loss or an early end; one sentence.
        reason: Option<String>,
    },
    /// A fault stopped the axes.
    Fault {
        /// One sentence.
        reason: String,
        /// The same in fields.
        #[serde(flatten)]
        fault: Fault,
    },
    /// The campaign is over and the axes are at rest.
    End {
        /// Outcome.
        status: EndStatus,
        /// One sentence.
        reason: String,
        /// Runs kept in the whole campaign.
        iterations: u32,
    },
}

/// State of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DriveState {
    /// Name of the axis.
    pub axis: String,
    /// State of CiA 402 in words, as `operation enabled`; absent before it is known.
    pub state: Option<String>,
}

/// A digital input of a cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct InputState {
    /// Name.
    pub name: String,
    /// `guard`, `start`, `stop` or `limit`.
    #[serde(rename = "use")]
    pub purpose: String,
    /// True for a closed guard, a pressed button, a limit switch that is reached; absent before it is known.
    pub on: Option<bool>,
}

impl InputState {
    /// Returns its state in a word.
    pub fn in_words(&self) -> &'static str {
        match (self.purpose.as_str(), self.on) {
            (_, None) => "unknown",
            ("guard", Some(true)) => "closed",
            ("guard", Some(false)) => "open",
            ("limit", Some(true)) => "reached",
            ("limit", Some(false)) => "free",
            (_, Some(true)) => "pressed",
            (_, Some(false)) => "released",
        }
    }
}

/// States of a cell, as published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StateName {
    /// Nodes are reset, checked and configured.
    BringingUp,
    /// Drives search their home.
    Homing,
    /// Drives are enabled, holding their position.
    Enabling,
    /// Axes move to the start.
    Returning,
    /// Axes rest at the start.
    Settling,
    /// Axes rest at the start until the run is released.
    Waiting,
    /// A run is in progress.
    Running,
    /// A run is held on its path.
    Paused,
    /// Axes are being stopped early.
    Stopping,
    /// Drives are disabled.
    Stopped,
}

/// Outcome of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EndStatus {
    /// All runs were made.
    Completed,
    /// A stop was requested.
    Interrupted,
    /// A fault stopped it.
    Fault,
}
