//! A fault in fields: kind, place, numbers, and the cycles before it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::late::LateCycle;

/// The cause of a controlled stop that was not requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A drive reported a fault; `code` is its emergency code, `value` its following error.
    DriveFault,
    /// A drive did not reach, or left, operation enabled; `code` is its statusword.
    NotEnabled,
    /// A drive did not answer; `value` is the number of cycles.
    SilentDrive,
    /// One of the PDOs of a drive is missing; `code` is its number, `value` the number of cycles.
    SilentPdo,
    /// A PDO has a different length than its mapping; `code` is its number, `value` its bytes,
    /// `limit` 8.
    WrongLength,
    /// The tool measurement did not answer; `value` is the number of cycles.
    SilentTool,
    /// An axis did not find its home, or rests outside its limits there.
    NotHomed,
    /// A node restarted.
    NodeRestarted,
    /// A node left operation; `code` is its NMT state.
    NodeStopped,
    /// Another master commands on the bus.
    OtherMaster,
    /// Command and encoder differ too much.
    FollowingError,
    /// An axis is outside its limits before its drive is enabled; `limit` is the nearer one.
    OutsideLimits,
    /// A position jumped farther than the axis can move.
    PositionJump,
    /// The position of an axis stands still under a force that must move it; `value` is its increase.
    NoMotion,
    /// A number in the command was not finite.
    NotFinite,
    /// A drive missed its commands because this computer stalled; `value` is the number of cycles.
    Stall,
    /// The loop could not keep its cycle; `value` is the number of cycles missed.
    Overrun,
    /// The bus failed, or took no frames for `value` cycles; `code` is the error number of the system, if there
    /// is one.
    Bus,
    /// A guard is open; `input` names it, `code` is its bit in object 0x60FD.
    GuardOpen,
    /// An axis moved towards a limit switch that it has reached; `input` names it, `code` is its bit in object 0x60FD.
    LimitSwitch,
    /// The CAN controller reports a fault of the bus; `code` is its class as Linux numbers it, e.g. 0x40 for
    /// bus-off, 0x20 for a missing acknowledgement.
    CanController,
    /// A run could not be stored.
    Library,
    /// The law refused a run.
    Law,
    /// The disturbance of a run could not be measured.
    Disturbance,
    /// Samples of a run were lost on their way to the record.
    SamplesLost,
    /// The thread of the loop died.
    LoopDied,
}

/// A fault.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Fault {
    /// Cause.
    pub kind: FaultKind,
    /// Name of the axis, if it concerns one axis.
    pub axis: Option<String>,
    /// CANopen node, if it concerns one node.
    pub node: Option<u8>,
    /// Name of the digital input, if it concerns one.
    pub input: Option<String>,
    /// Number defined by the kind.
    pub code: Option<u32>,
    /// Value found.
    pub value: Option<f64>,
    /// Limit exceeded.
    pub limit: Option<f64>,
    /// Unit of both.
    pub unit: Option<String>,
    /// Cycle that was late before the stop; absent if no cycle was.
    pub late: Option<LateCycle>,
    /// Last servo cycles before the stop.
    pub cycles: LastCycles,
}

/// Consecutive servo cycles, oldest first; one row per cycle, one column per axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct LastCycles {
    /// Count of SYNCs at the first one; absent without cycles.
    pub first_sync: Option<u64>,
    /// Set points without the learned input.
    pub reference_m: Vec<Vec<f64>>,
    /// Learned input as applied.
    pub input: Vec<Vec<f64>>,
    /// Encoders.
    pub encoder_m: Vec<Vec<f64>>,
    /// Tool centre point; zeros without such a measurement.
    pub tool_m: Vec<Vec<f64>>,
    /// True for a cycle whose measurement has not arrived: the last known one stands in for it.
    pub missing: Vec<bool>,
}

impl Fault {
    /// Creates a fault without further fields.
    pub fn new(kind: FaultKind) -> Self {
        let cycles = LastCycles::default();
        Self {
            kind,
            axis: None,
            node: None,
            input: None,
            code: None,
            value: None,
            limit: None,
            unit: None,
            late: None,
            cycles,
        }
    }
}
