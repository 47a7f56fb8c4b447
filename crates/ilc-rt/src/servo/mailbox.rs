//! Messages between the servo cycle and its owner, without locks and without allocation.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use super::inputs::InputBits;
use super::orders::{Orders, OrdersSeen};
use super::phase::PhaseName;
use crate::fieldbus::BusError;
use crate::fieldbus::canopen::NmtState;
use crate::fieldbus::cia402::State;
use crate::fieldbus::network::Stranger;
use crate::interpolate::MAX_AXES;
use crate::rt::Stamps;

/// State of each drive by its last statusword; `None` before the first one, and beyond the axes of the cell.
pub type DriveStates = [Option<State>; MAX_AXES];

/// One servo cycle: commands and measurements of the same SYNC.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Count of SYNCs since the loop began.
    pub sync: u64,
    /// Run and sample number, during a run.
    pub at: Option<(u32, u32)>,
    /// Set points without the learned input.
    pub reference_m: [f64; MAX_AXES],
    /// Learned input as applied.
    pub input: [f64; MAX_AXES],
    /// Encoders.
    pub encoder_m: [f64; MAX_AXES],
    /// Tool centre point; zeros without such a measurement.
    pub tool_m: [f64; MAX_AXES],
    /// True if a measurement never arrived and an older one is in its place.
    pub missing: bool,
}

/// Reason of a premature stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StopReason {
    /// Requested, with the number of the signal.
    Asked(i32),
    /// A drive reported a fault; its last emergency code, or 0 if it sent none.
    DriveFault {
        /// Axis.
        axis: usize,
        /// Emergency code of the drive.
        code: u16,
        /// Following error that the drive reported last.
        following_error_m: f64,
    },
    /// A drive did not reach, or left, operation enabled.
    NotEnabled {
        /// Axis.
        axis: usize,
        /// Statusword of the drive.
        statusword: u16,
    },
    /// A drive did not answer.
    SilentAxis {
        /// Axis.
        axis: usize,
        /// Cycles without an answer.
        cycles: u32,
    },
    /// One of a drive's two PDOs is missing, the other one is not.
    SilentPdo {
        /// Axis.
        axis: usize,
        /// Number of the TPDO, 1 or 2.
        pdo: u8,
        /// Cycles without it.
        cycles: u32,
    },
    /// A PDO of a node is unreadable, as its length differs from its mapping.
    WrongLength {
        /// CANopen node.
        node: u8,
        /// Number of the TPDO, 1 or 2.
        pdo: u8,
        /// Its length.
        n_bytes: u8,
        /// The length of its mapping.
        needed: u8,
    },
    /// The tool measurement did not answer.
    SilentTool {
        /// Cycles without an answer.
        cycles: u32,
    },
    /// A node restarted: it sent its boot-up message.
    NodeLeft {
        /// CANopen node.
        node: u8,
    },
    /// A node reports that it is not operational any more.
    NodeStopped {
        /// CANopen node.
        node: u8,
        /// Its state instead.
        state: NmtState,
    },
    /// Another master commands on the bus.
    OtherMaster(Stranger),
    /// Command and encoder differ too much.
    FollowingError {
        /// Axis.
        axis: usize,
        /// Following error.
        error_m: f64,
    },
    /// An axis is outside its limits before its drive is enabled.
    OutsideLimits {
        /// Axis.
        axis: usize,
        /// Its position.
        position_m: f64,
    },
    /// A position jumped farther than the axis can move.
    Jump {
        /// Axis.
        axis: usize,
        /// Size of the jump, from one answer to the next.
        step_m: f64,
    },
    /// The position of an axis stands still under a force that must move it.
    NoMotion {
        /// Axis.
        axis: usize,
        /// Increase of the force since it stands still.
        force_n: f64,
    },
    /// A number in the command was not finite.
    NotFinite {
        /// Axis.
        axis: usize,
    },
    /// A drive missed its commands because this computer stalled.
    Stalled {
        /// Axis.
        axis: usize,
        /// Consecutive cycles missed.
        cycles: u32,
    },
    /// The loop could not keep its cycle.
    Overrun {
        /// Consecutive cycles missed.
        cycles: u32,
    },
    /// The bus took no frames.
    Congested {
        /// Consecutive cycles with a frame that was not sent.
        cycles: u32,
    },
    /// The bus failed.
    Bus(BusError),
    /// A guard is open.
    GuardOpen {
        /// Input.
        input: usize,
    },
    /// A stop button is pressed.
    StopButton {
        /// Input.
        input: usize,
    },
    /// An axis moves towards a limit switch that it has reached.
    LimitSwitch {
        /// Input.
        input: usize,
        /// Axis.
        axis: usize,
    },
}

impl StopReason {
    /// Returns the axis whose measurement has failed, or may have, if that is the reason.
    pub(super) fn distrusted(self) -> Option<usize> {
        match self {
            Self::SilentAxis { axis, .. }
            | Self::SilentPdo { axis, pdo: 1, .. }
            | Self::FollowingError { axis, .. }
            | Self::Jump { axis, .. }
            | Self::NoMotion { axis, .. } => Some(axis),
            Self::Asked(_)
            | Self::DriveFault { .. }
            | Self::NotEnabled { .. }
            | Self::SilentPdo { .. }
            | Self::WrongLength { .. }
            | Self::SilentTool { .. }
            | Self::NodeLeft { .. }
            | Self::NodeStopped { .. }
            | Self::OtherMaster(_)
            | Self::OutsideLimits { .. }
            | Self::NotFinite { .. }
            | Self::Stalled { .. }
            | Self::Overrun { .. }
            | Self::GuardOpen { .. }
            | Self::StopButton { .. }
            | Self::LimitSwitch { .. }
            | Self::Congested { .. }
            | Self::Bus(_) => None,
        }
    }
}

/// A message of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// A cycle.
    Sample(Sample),
    /// A new phase, and the run it belongs to.
    Phase(PhaseName, u32),
    /// A run began with the input table of this number.
    RunStarted {
        /// Run.
        run: u32,
        /// Number of the table.
        table: u32,
    },
    /// All samples of a run have been sent.
    RunEnded {
        /// Run.
        run: u32,
        /// Cycles in it that began a whole cycle late.
        overruns: u32,
        /// Cycles in it at another feed than 100 %.
        scaled: u32,
    },
    /// A cycle before a stop, complete or not; oldest first, followed by the stop.
    Before(Sample),
    /// Digital inputs have changed.
    Inputs(InputBits),
    /// A drive has changed its state.
    Drives(DriveStates),
    /// Stages of a cycle: of one that was late or in which a stop began, and of those before it, oldest first.
    Cycle(Stamps),
    /// The axes are being stopped.
    Stopping(StopReason),
}

/// An input table on its way into the loop, or the replaced one on its way back.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) number: u32,
    pub(super) input: Box<[f64]>,
}

/// The campaign's side.
#[derive(Debug)]
pub struct Mailbox {
    messages: Consumer<Message>,
    tables: Producer<Table>,
    spent: Consumer<Table>,
    stop: Arc<AtomicI32>,
}

/// The loop's side.
#[derive(Debug)]
pub struct LoopSide {
    messages: Producer<Message>,
    pub(super) tables: Consumer<Table>,
    spent: Producer<Table>,
    stop: Arc<AtomicI32>,
    orders: Arc<Orders>,
    /// Orders, and the signal that requested a stop or 0, as this tick reads them.
    pub(super) seen: OrdersSeen,
    pub(super) asked: i32,
    dropped: u64,
}

/// Returns the two sides; `capacity` messages may wait, and setting `stop` to a signal's number
/// stops the axes.
pub fn mailbox(capacity: usize, stop: Arc<AtomicI32>) -> (Mailbox, LoopSide) {
    let (messages_in, messages_out) = RingBuffer::new(capacity);
    let (tables_in, tables_out) = RingBuffer::new(2);
    // One more than can be in transit, so that returning one never fails.
    let (spent_in, spent_out) = RingBuffer::new(4);
    (
        Mailbox {
            messages: messages_out,
            tables: tables_in,
            spent: spent_out,
            stop: Arc::clone(&stop),
        },
        LoopSide {
            messages: messages_in,
            tables: tables_out,
            spent: spent_in,
            stop,
            orders: Arc::default(),
            seen: OrdersSeen::default(),
            asked: 0,
            dropped: 0,
        },
    )
}

impl Mailbox {
    /// Returns the next message, if there is one.
    pub fn read(&mut self) -> Option<Message> {
        self.messages.pop().ok()
    }

    /// Passes the input of the next run to the loop; returns it if two are already waiting.
    ///
    /// # Errors
    /// The unchanged table.
    pub fn send_table(&mut self, number: u32, input: Box<[f64]>) -> Result<(), Box<[f64]>> {
        while self.spent.pop().is_ok() {}
        self.tables.push(Table { number, input }).map_err(|refused| match refused {
            rtrb::PushError::Full(table) => table.input,
        })
    }

    /// Requests a stop of the axes, as if the signal of this number had arrived.
    pub fn stop(&self, signal: i32) {
        self.stop.store(signal, Ordering::Relaxed);
    }
}

impl LoopSide {
    /// Follows the orders of an operator from now on.
    #[must_use]
    pub fn following(self, orders: Arc<Orders>) -> Self {
        Self { orders, ..self }
    }

    /// Sends a message; messages without room are counted.
    #[expect(clippy::large_types_passed_by_value, reason = "it moves into the ring")]
    pub(super) fn tell(&mut self, message: Message) {
        if self.messages.push(message).is_err() {
            self.dropped += 1;
        }
    }

    /// Takes the newest waiting input table; the replaced one goes back to be freed elsewhere.
    pub(super) fn newest_table(&mut self, current: &mut Table) -> bool {
        let mut changed = false;
        while !self.spent.is_full() {
            let Ok(table) = self.tables.pop() else { break };
            let old = std::mem::replace(current, table);
            // There is space, checked above; the box must not be freed in the loop.
            if let Err(rtrb::PushError::Full(old)) = self.spent.push(old) {
                std::mem::forget(old);
            }
            changed = true;
        }
        changed
    }

    /// Reads what the other threads ask of this tick: once, so that the tick is a function of what it read.
    pub(super) fn look(&mut self) {
        (self.seen, self.asked) = (self.orders.seen(), self.stop.load(Ordering::Relaxed));
    }

    /// Lets a run start, from this tick on.
    pub(super) fn release(&mut self, run: u32) {
        self.orders.release(run);
        self.seen.released = self.seen.released.max(run.saturating_add(1));
    }
}
