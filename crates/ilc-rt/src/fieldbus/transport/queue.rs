//! Bounded queue of frames between an endpoint and another thread: full is an error, never a wait.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use rtrb::{Consumer, Producer};

use super::doorbell::Bell;
use super::wait::Deadline;
use crate::fieldbus::{BusError, Frame};

/// The sending end.
#[derive(Debug)]
pub(super) struct Outbox(Producer<Frame>);

impl Outbox {
    pub(super) fn new(frames: Producer<Frame>) -> Self {
        Self(frames)
    }

    /// Puts a frame in.
    ///
    /// # Errors
    /// [`BusError::Closed`] if the other end is gone, [`BusError::Full`] if the queue is full.
    pub(super) fn put(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.0.is_abandoned() {
            return Err(BusError::Closed);
        }
        self.0.push(*frame).map_err(|_| BusError::Full)
    }
}

/// The receiving end, with the bell that announces frames.
///
/// The fields are dropped in this order, so that the thread that fills the queue notices first that
/// it was abandoned.
#[derive(Debug)]
pub(super) struct Inbox {
    frames: Consumer<Frame>,
    bell: Bell,
}

impl Inbox {
    pub(super) fn new(frames: Consumer<Frame>, bell: Bell) -> Self {
        Self { frames, bell }
    }

    /// Takes the next frame, or returns `None` after the timeout.
    ///
    /// # Errors
    /// [`BusError::Closed`] if the other end is gone and all its frames are taken; [`BusError::Os`] if
    /// the system refuses to wait.
    pub(super) fn take(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let frames = &mut self.frames;
        let mut take = || {
            // Checked before the queue: the peer may send its last frame and close in between.
            let abandoned = frames.is_abandoned();
            match frames.pop() {
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
