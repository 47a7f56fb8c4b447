//! Buses in memory: a pair of endpoints for two threads, and a responder in the caller's thread.
//!
//! [`pair`] connects two threads of one process. [`InProcess`] has no thread at all: each frame is
//! answered before `send` returns, so a run is deterministic, and as fast as the processor allows.
//! The simulated drives run on it in lock-step.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::io;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::doorbell::{Ringer, bell};
use super::queue::{Inbox, Outbox};
use crate::fieldbus::{Bus, BusError, Frame};

/// One end of a bus between two threads.
///
/// The fields are dropped in this order: the queues are abandoned before the peer's bell closes, so
/// that a peer woken by it finds them abandoned.
#[derive(Debug)]
pub struct Loopback {
    outgoing: Outbox,
    incoming: Inbox,
    peer: Ringer,
}

/// Returns the two ends of a bus that holds up to `capacity` frames in each direction.
///
/// # Real Time
/// Cold: allocates both directions.
/// # Errors
/// The system's error if there are no descriptors left for waking a receiver.
pub fn pair(capacity: usize) -> io::Result<(Loopback, Loopback)> {
    let (to_right, from_left) = RingBuffer::new(capacity);
    let (to_left, from_right) = RingBuffer::new(capacity);
    let (right_ringer, right_bell) = bell()?;
    let (left_ringer, left_bell) = bell()?;
    let end = |outgoing, incoming, bell, peer| Loopback {
        outgoing: Outbox::new(outgoing),
        incoming: Inbox::new(incoming, bell),
        peer,
    };
    Ok((
        end(to_right, from_right, left_bell, right_ringer),
        end(to_left, from_left, right_bell, left_ringer),
    ))
}

impl Bus for Loopback {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.outgoing.put(frame)?;
        self.peer.ring();
        Ok(())
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.incoming.take(timeout)
    }
}

/// The far side of an [`InProcess`] bus.
pub trait Responder: Send {
    /// Receives a frame and passes each answer to `reply`, in order.
    fn receive(&mut self, frame: &Frame, reply: &mut dyn FnMut(Frame));
}

/// A bus whose far side runs in the caller's thread, inside `send`.
///
/// `recv` never waits, whatever its timeout: nothing can arrive unless something is sent.
pub struct InProcess<R> {
    responder: R,
    /// Both ends of the queue of answers.
    replies: (Producer<Frame>, Consumer<Frame>),
}

impl<R: Responder> InProcess<R> {
    /// Returns a bus to `responder` that holds up to `capacity` answers.
    ///
    /// # Real Time
    /// Cold: allocates the answers' queue.
    pub fn new(responder: R, capacity: usize) -> Self {
        Self { responder, replies: RingBuffer::new(capacity) }
    }

    /// Returns the far side, for reading.
    pub fn responder(&self) -> &R {
        &self.responder
    }

    /// Returns the far side, for changing.
    pub fn responder_mut(&mut self) -> &mut R {
        &mut self.responder
    }
}

impl<R: Responder> Bus for InProcess<R> {
    /// Passes a frame to the responder and queues its answers.
    ///
    /// # Errors
    /// [`BusError::Full`] if an answer did not fit: the frame was received, the answer is lost.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let replies = &mut self.replies.0;
        let mut fits = true;
        self.responder.receive(frame, &mut |reply| fits &= replies.push(reply).is_ok());
        if fits { Ok(()) } else { Err(BusError::Full) }
    }

    fn recv(&mut self, _timeout: Duration) -> Result<Option<Frame>, BusError> {
        Ok(self.replies.1.pop().ok())
    }
}

impl<R: fmt::Debug> fmt::Debug for InProcess<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InProcess")
            .field("responder", &self.responder)
            .field("queued", &self.replies.1.slots())
            .finish()
    }
}
