//! A bus that returns to its lender when the borrower, which may be a thread, is done with it. For `homing` only.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use crate::fieldbus::{Bus, BusError, Frame};

/// A bus on loan.
pub(super) struct Lent {
    bus: Option<Box<dyn Bus>>,
    back: Sender<Box<dyn Bus>>,
}

impl Lent {
    /// Lends a bus, which arrives at the receiver when the loan is dropped.
    pub(super) fn new(bus: Box<dyn Bus>) -> (Self, Receiver<Box<dyn Bus>>) {
        let (back, returned) = channel();
        (Self { bus: Some(bus), back }, returned)
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(bus) = self.bus.take() {
            // A lender that is gone wants it no more.
            let _ = self.back.send(bus);
        }
    }
}

/// It keeps to no nodes: the lender speaks to others later.
impl Bus for Lent {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.bus.as_mut().map_or(Err(BusError::Closed), |bus| bus.send(frame))
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.bus.as_mut().map_or(Err(BusError::Closed), |bus| bus.recv(timeout))
    }
}
