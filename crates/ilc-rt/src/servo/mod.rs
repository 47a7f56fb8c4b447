//! The servo cycle: receive, measure, control, add the learned input, limit, send.
//!
//! Hot from end to end and ignorant of learning: it is handed a table of inputs and gives back
//! samples. The campaign sets it up, paces it (on the clock or in lock-step) and reads its mailbox.

mod advance;
mod command;
mod cycle;
mod gate;
mod input;
mod mailbox;
mod mode;
mod node;
mod pending;
mod phase;
mod realtime;
mod receive;
mod silence;
mod spec;
mod stall;
mod stopping;
mod strangers;

pub use cycle::{Cycle, TickStatus};
pub use mailbox::{LoopSide, Mailbox, Message, Sample, StopReason, Stranger, mailbox};
pub use phase::PhaseName;
pub use realtime::{Timing, run_on_clock};
pub use spec::{AxisSpec, Pace, ServoSpec, ToolSpec};
