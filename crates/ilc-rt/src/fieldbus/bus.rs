//! The contract of every transport: frames out, frames in, never blocking longer than asked.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

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
    /// [`BusError::Closed`] if the other side is gone permanently; [`BusError::Os`] otherwise.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError>;

    /// Returns the next frame, or `None` if none arrived within `timeout`.
    ///
    /// # Errors
    /// [`BusError::Closed`] if nothing can arrive any more; [`BusError::Os`] otherwise.
    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError>;
}

impl<B: Bus + ?Sized> Bus for Box<B> {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        (**self).recv(timeout)
    }
}

/// Reason that a frame was not sent or received. `Copy`, so that the tick can carry it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BusError {
    /// The transmit queue is full.
    #[error("the transmit queue of the bus is full")]
    Full,
    /// The bus is closed.
    #[error("the bus is closed")]
    Closed,
    /// An error of the operating system, with its number.
    #[error("the operating system reported error {0} on the bus")]
    Os(i32),
}
