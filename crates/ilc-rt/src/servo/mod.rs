//! The servo cycle: receive, measure, control, add the learned input, limit, send.
//!
//! Hot throughout and independent of learning: it receives a table of inputs and returns samples.
//! The campaign sets it up, paces it (by the clock or in lock-step) and reads its mailbox.

mod advance;
mod command;
mod cycle;
mod feed;
mod gate;
mod input;
mod inputs;
mod interlock;
mod mailbox;
mod mode;
mod node;
mod orders;
mod pending;
mod phase;
mod realtime;
mod receive;
mod rows;
mod silence;
mod spec;
mod stall;
mod states;
mod stopping;
mod strangers;
mod tap;

pub use crate::fieldbus::network::Stranger;
pub use cycle::{Cycle, TickStatus};
pub use inputs::{INPUTS_MAX, InputBits, InputRole, InputSpec};
pub use mailbox::{DriveStates, LoopSide, Mailbox, Message, Sample, StopReason, mailbox};
pub use orders::{FEED_WHOLE, Orders, OrdersSeen};
pub use phase::PhaseName;
pub use realtime::{StageTimes, Timing, run_on_clock, run_until};
pub use spec::{AxisSpec, ForceSpec, Pace, ServoSpec, ToolSpec};
pub use tap::{AxisRow, LoopRecord, LoopRow, Tap};
