//! Buses in memory: a pair of endpoints for two threads, and a far side that answers in the caller's
//! thread.
//!
//! [`pair`] connects two threads of one process. [`InProcess`] has no thread at all: what is sent is
//! answered before `send` returns, so a run is the same run every time, as fast as the processor allows.
//! The simulated drives are run on it in lock-step.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::io;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::super::bus::{Bus, BusError};
use super::super::frame::Frame;
use super::doorbell::{Bell, Ringer, bell};
use super::wait::Deadline;

/// One end of a bus between two threads.
///
/// The fields are dropped in this order: the buffers are given up before the bell falls silent, so that a
/// peer that the bell wakes finds them given up.
#[derive(Debug)]
pub struct Loopback {
    outgoing: Producer<Frame>,
    incoming: Consumer<Frame>,
    peer: Ringer,
    bell: Bell,
}

/// Returns the two ends of a bus that holds up to `capacity` frames each way.
///
/// # Real Time
/// Cold: allocates both directions.
/// # Errors
/// The system's error if it has no descriptors left for waking a receiver.
pub fn pair(capacity: usize) -> io::Result<(Loopback, Loopback)> {
    let (to_right, from_left) = RingBuffer::new(capacity);
    let (to_left, from_right) = RingBuffer::new(capacity);
    let (right_ringer, right_bell) = bell()?;
    let (left_ringer, left_bell) = bell()?;
    Ok((
        Loopback { outgoing: to_right, incoming: from_right, peer: right_ringer, bell: left_bell },
        Loopback { outgoing: to_left, incoming: from_left, peer: left_ringer, bell: right_bell },
    ))
}

impl Bus for Loopback {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.outgoing.is_abandoned() {
            return Err(BusError::Closed);
        }
        self.outgoing.push(*frame).map_err(|_| BusError::Full)?;
        self.peer.ring();
        Ok(())
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let incoming = &mut self.incoming;
        let mut take = || {
            // Asked before the buffer is looked at: the peer may send its last frame and go in between.
            let abandoned = incoming.is_abandoned();
            match incoming.pop() {
                Ok(frame) => Ok(Some(frame)),
                Err(_) if abandoned => Err(BusError::Closed),
                Err(_) => Ok(None),
            }
        };
        match take() {
            Ok(None) if !timeout.is_zero() => self.bell.wait(Deadline::after(timeout), take),
            taken => taken,
        }
    }
}

/// What answers on the far side of an [`InProcess`] bus.
pub trait Responder: Send {
    /// Takes a frame that was sent and hands each answer to `reply`, in order.
    fn receive(&mut self, frame: &Frame, reply: &mut dyn FnMut(Frame));
}

/// A bus whose far side runs in the caller's thread, inside `send`.
///
/// `recv` never waits, whatever its time-out: nothing can arrive unless something is sent.
pub struct InProcess<R> {
    responder: R,
    replies: Replies,
}

impl<R: Responder> InProcess<R> {
    /// Returns a bus to `responder` that holds up to `capacity` answers.
    ///
    /// # Real Time
    /// Cold: allocates the answers' queue.
    pub fn new(responder: R, capacity: usize) -> Self {
        Self { responder, replies: Replies::new(capacity) }
    }

    /// The far side, to look at.
    pub fn responder(&self) -> &R {
        &self.responder
    }

    /// The far side, to change.
    pub fn responder_mut(&mut self) -> &mut R {
        &mut self.responder
    }
}

impl<R: Responder> Bus for InProcess<R> {
    /// Hands a frame to the responder and queues its answers.
    ///
    /// # Errors
    /// [`BusError::Full`] if an answer did not fit: the frame was received, that answer is lost.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let replies = &mut self.replies;
        let mut fits = true;
        self.responder.receive(frame, &mut |reply| fits &= replies.push(reply));
        if fits { Ok(()) } else { Err(BusError::Full) }
    }

    fn recv(&mut self, _timeout: Duration) -> Result<Option<Frame>, BusError> {
        Ok(self.replies.pop())
    }
}

impl<R: fmt::Debug> fmt::Debug for InProcess<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("InProcess")
            .field("responder", &self.responder)
            .field("queued", &self.replies.len)
            .finish()
    }
}

/// A queue of fixed capacity. Not a `rtrb` ring: both ends are in one thread and need no atomics.
struct Replies {
    slots: Box<[Frame]>,
    head: usize,
    len: usize,
}

impl Replies {
    #[expect(clippy::disallowed_macros, reason = "cold: set-up")]
    fn new(capacity: usize) -> Self {
        Self { slots: vec![Frame::default(); capacity].into_boxed_slice(), head: 0, len: 0 }
    }

    fn push(&mut self, frame: Frame) -> bool {
        if self.len == self.slots.len() {
            return false;
        }
        let tail = self.wrap(self.head + self.len);
        self.slots[tail] = frame;
        self.len += 1;
        true
    }

    fn pop(&mut self) -> Option<Frame> {
        if self.len == 0 {
            return None;
        }
        let frame = self.slots[self.head];
        self.head = self.wrap(self.head + 1);
        self.len -= 1;
        Some(frame)
    }

    /// Brings an index below twice the capacity back into the slots, without a division.
    fn wrap(&self, index: usize) -> usize {
        if index < self.slots.len() { index } else { index - self.slots.len() }
    }
}
