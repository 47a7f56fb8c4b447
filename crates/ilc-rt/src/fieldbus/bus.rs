//! The contract of every transport: frames out, frames in, never blocking longer than asked.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::can_fact::CanFact;
use super::frame::Frame;

/// A bus that carries frames between the controller and its nodes.
///
/// The contract, tested for every transport: frames of one sender arrive whole and in order; a
/// sender does not receive its own frames; `send` never waits for a receiver; `recv` with a zero
/// timeout returns at once; foreign or malformed traffic is skipped, never an error.
pub trait Bus: Send {
    /// Passes a frame to the transport.
    ///
    /// # Errors
    /// [`BusError::Full`] if the transport's queue is full (the frame is dropped, not queued late);
    /// [`BusError::TooLong`] if the bus has no frames of this length; [`BusError::Down`] and
    /// [`BusError::Gone`] if the interface carries nothing; [`BusError::Closed`] if the other side is gone
    /// permanently; [`BusError::Os`] otherwise.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError>;

    /// Returns the next frame, or `None` if none arrived within `timeout`.
    ///
    /// # Errors
    /// [`BusError::Controller`] for a fault of the bus, reported once; what arrives later is read as before.
    /// [`BusError::Down`] and [`BusError::Gone`] if the interface carries nothing; [`BusError::Closed`] if
    /// nothing can arrive any more; [`BusError::Os`] otherwise.
    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError>;

    /// Lets the system drop the frames of all nodes but some, from now on. What any node or another master sends
    /// to all of them (NMT, SYNC) still arrives, as does what another master sends to one of these nodes.
    ///
    /// A transport that cannot drop them passes them on. Cold.
    ///
    /// # Errors
    /// [`BusError::Os`] if the system refuses.
    fn keep_to(&mut self, _nodes: &[u8]) -> Result<(), BusError> {
        Ok(())
    }

    /// Returns the time at which the system received the frame that `recv` returned last, since the epoch of
    /// the system's clock; `None` if the transport does not know it.
    fn arrival(&self) -> Option<Duration> {
        None
    }
}

impl<B: Bus + ?Sized> Bus for Box<B> {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        (**self).recv(timeout)
    }

    fn keep_to(&mut self, nodes: &[u8]) -> Result<(), BusError> {
        (**self).keep_to(nodes)
    }

    fn arrival(&self) -> Option<Duration> {
        (**self).arrival()
    }
}

/// Reason that a frame was not sent or received. `Copy`, so that the tick can carry it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BusError {
    /// The transmit queue is full.
    #[error(
        "the transmit queue of the bus is full: no frame leaves it; check that another node acknowledges, the \
         bit rate, and the load of the bus (`ilc-rt check`)"
    )]
    Full,
    /// More than 8 bytes for a bus that carries classical frames.
    #[error("a frame of more than 8 bytes does not fit this bus: its address has no `fd=1`")]
    TooLong,
    /// The interface is down.
    #[error("the CAN interface is down: `ip link set INTERFACE up` starts it")]
    Down,
    /// The interface does not exist any more.
    #[error("the CAN interface is gone: check whether its adapter was unplugged")]
    Gone,
    /// The CAN controller reports a fault of the bus.
    #[error("{0}")]
    Controller(CanFact),
    /// The bus is closed.
    #[error("the bus is closed")]
    Closed,
    /// An error of the operating system, with its number.
    #[error("the operating system reported error {0} on the bus")]
    Os(i32),
}

impl BusError {
    /// Returns whether the bus may work again later, without being opened again.
    pub const fn may_pass(self) -> bool {
        match self {
            Self::Full | Self::Down | Self::Controller(_) => true,
            Self::TooLong | Self::Gone | Self::Closed | Self::Os(_) => false,
        }
    }
}
