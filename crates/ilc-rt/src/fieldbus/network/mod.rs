//! The seam between the servo loop and a fieldbus: a network of axes, above frames.
//!
//! The loop commands axes and reads answers through [`AxisNetwork`]; identifiers, maps and frames are below
//! it, in one file per fieldbus. Imported by `servo` (the trait), `design` and tests (the networks).

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

pub mod canopen;
mod still;

use std::time::Duration;

use super::bus::BusError;
use super::canopen::{NmtCommand, NmtState, NodeId};
use super::cia402::{CommandRpdo1, Reading};

pub use canopen::{CanopenAxes, SIMULATED_INPUTS, Station};
pub use still::StillAxes;

/// A network of axes that exchanges commands and answers once per cycle.
///
/// # Real Time
/// No method allocates, locks or waits, but for `next` with a timeout.
pub trait AxisNetwork: Send {
    /// Passes the command of an axis on; it takes effect at the next [`exchange`](Self::exchange).
    ///
    /// # Errors
    /// [`BusError`] if the command is lost: the axis misses it, the next one is sent as usual.
    fn write(&mut self, axis: usize, command: &CommandRpdo1) -> Result<(), BusError>;

    /// Makes all axes sample their positions, take their commands over and answer.
    ///
    /// # Errors
    /// [`BusError`] if the axes were not reached.
    fn exchange(&mut self) -> Result<(), BusError>;

    /// Returns the next message, or `None` if none arrived within `timeout`.
    ///
    /// # Errors
    /// [`BusError`] if nothing can arrive any more.
    fn next(&mut self, timeout: Duration) -> Result<Option<Arrival>, BusError>;

    /// Returns the time since the epoch at which the system received the message that `next` returned last; `None`
    /// if the fieldbus does not know it.
    fn arrival(&self) -> Option<Duration> {
        None
    }

    /// Returns which parts of an answer an axis sends: status, motion.
    fn parts(&self, axis: usize) -> [bool; 2];

    /// Returns the agreed length of a part of the answer of an axis, in bytes.
    fn part_bytes(&self, axis: usize, part: AnswerPart) -> u8;

    /// Takes all nodes out of operation, when the loop is over.
    ///
    /// # Errors
    /// [`BusError`] if the nodes were not reached.
    fn release(&mut self) -> Result<(), BusError>;

    /// Asks the drive of an axis for the reason of its fault, when the loop is over; `None` if it gives
    /// none. Waits for the answer.
    fn error_code(&mut self, _axis: usize) -> Option<u16> {
        None
    }
}

/// A message from the network, as the loop sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Part of the answer of an axis to an exchange.
    Answer {
        /// Axis.
        axis: usize,
        /// Part of the answer.
        part: AnswerPart,
        /// Values in it.
        reading: Reading,
    },
    /// The coordinates of the tool, in counts.
    Tool([i32; 2]),
    /// A part of an answer whose length differs from the agreed one.
    Unreadable {
        /// Axis.
        axis: usize,
        /// Part of the answer.
        part: AnswerPart,
        /// Its length.
        n_bytes: u8,
    },
    /// A measurement of the tool whose length differs from the agreed one.
    UnreadableTool {
        /// Its length.
        n_bytes: u8,
    },
    /// An emergency message of an axis.
    Emergency {
        /// Axis.
        axis: usize,
        /// Its code; 0: the error is gone.
        code: u16,
    },
    /// State of a node of this cell.
    Node {
        /// Node.
        node: NodeId,
        /// Its state.
        state: NmtState,
    },
    /// The trace of another master.
    Stranger(Stranger),
    /// Traffic that does not concern the loop.
    Other,
}

/// A part of an axis's answer; each arrives on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerPart {
    /// State and position (TPDO1).
    Status,
    /// The values that do not fit there (TPDO2).
    Motion,
}

impl AnswerPart {
    /// Returns its place in a pair.
    pub const fn index(self) -> usize {
        match self {
            Self::Status => 0,
            Self::Motion => 1,
        }
    }
}

/// A message of another master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stranger {
    /// It produces SYNC.
    Sync,
    /// It sends NMT commands; `None`: to all nodes.
    Nmt(NmtCommand, Option<NodeId>),
    /// It commands a drive of this cell.
    Command(NodeId),
    /// It reads or writes objects of a node of this cell.
    Request(NodeId),
}
