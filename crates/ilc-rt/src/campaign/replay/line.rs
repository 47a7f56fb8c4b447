//! The bus of a replay: it hands out the recorded frames of a tick, and compares what the loop sends.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::fieldbus::transport::BusEvent;
use crate::fieldbus::{Bus, BusError, Frame};

/// A frame that differs: recorded, and sent in the replay.
pub(super) type Unlike = (Option<Frame>, Option<Frame>);

/// The traffic of one tick.
#[derive(Debug, Default)]
pub(super) struct Line {
    received: VecDeque<BusEvent>,
    sent: VecDeque<BusEvent>,
    unlike: Option<Unlike>,
    n_sent: u64,
}

impl Line {
    /// Begins a tick with its recorded traffic.
    pub(super) fn begin(&mut self, received: Vec<BusEvent>, sent: Vec<BusEvent>) {
        (self.received, self.sent, self.unlike) = (received.into(), sent.into(), None);
    }

    /// Ends a tick: returns the first frame sent that differs, and the number of recorded messages that the loop did
    /// not take.
    pub(super) fn end(&mut self) -> (Option<Unlike>, usize) {
        let left = self.sent.pop_front().map(|event| (frame_of(&event), None));
        (self.unlike.take().or(left), self.received.len())
    }

    /// Returns the number of frames sent so far.
    pub(super) fn n_sent(&self) -> u64 {
        self.n_sent
    }
}

fn frame_of(event: &BusEvent) -> Option<Frame> {
    match event {
        BusEvent::Received(frame) | BusEvent::Sent(frame) | BusEvent::Refused(frame, _) => {
            Some(*frame)
        }
        BusEvent::Failed(_) => None,
    }
}

/// One end of the line; the player keeps the other one.
#[derive(Clone, Debug, Default)]
pub(super) struct ReplayBus(Arc<Mutex<Line>>);

impl ReplayBus {
    pub(super) fn line(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Bus for ReplayBus {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let mut line = self.line();
        line.n_sent += 1;
        let recorded = line.sent.pop_front();
        let expected = recorded.as_ref().and_then(frame_of);
        if expected != Some(*frame) && line.unlike.is_none() {
            line.unlike = Some((expected, Some(*frame)));
        }
        match recorded {
            Some(BusEvent::Refused(_, error)) => Err(error),
            _ => Ok(()),
        }
    }

    fn recv(&mut self, _timeout: Duration) -> Result<Option<Frame>, BusError> {
        match self.line().received.pop_front() {
            Some(BusEvent::Received(frame)) => Ok(Some(frame)),
            Some(BusEvent::Failed(error)) => Err(error),
            _ => Ok(None),
        }
    }
}
