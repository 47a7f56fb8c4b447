//! A bus that records its traffic: every frame received and sent, and every failure, in order.
//!
//! The only seam through which a fieldbus reaches the loop, so that what passes here is all that a replay needs of
//! it. Writes to a ring without waiting; what the ring has no room for is lost, and counted.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rtrb::Producer;

use crate::fieldbus::bus::{Bus, BusError};
use crate::fieldbus::frame::Frame;
use crate::rt::{Clock, Nanos};

/// Count of the ticks and of the lost records, of the taps of one loop.
#[derive(Debug, Default)]
pub struct TapCount {
    tick: AtomicU64,
    lost: AtomicU64,
}

impl TapCount {
    /// Sets the number of the tick that begins.
    pub fn set_tick(&self, tick: u64) {
        self.tick.store(tick, Ordering::Relaxed);
    }

    /// Counts lost records.
    pub fn lose(&self, n_records: u64) {
        self.lost.fetch_add(n_records, Ordering::Relaxed);
    }

    /// Returns the number of lost records.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}

/// An event on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// A frame was received.
    Received(Frame),
    /// Receiving failed.
    Failed(BusError),
    /// A frame was sent.
    Sent(Frame),
    /// A frame was not sent.
    Refused(Frame, BusError),
}

/// An event on the bus with its tick and its time since the epoch; 0 without a clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusRecord {
    /// Tick in which it happened; after the last one, the number of ticks.
    pub tick: u64,
    /// Time at which the system received the frame, or at which it was sent.
    pub at: Nanos,
    /// The event.
    pub event: BusEvent,
}

/// A bus with a tap.
pub struct TappedBus {
    bus: Box<dyn Bus>,
    records: Producer<BusRecord>,
    count: Arc<TapCount>,
    clock: Option<Arc<dyn Clock>>,
}

impl std::fmt::Debug for TappedBus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TappedBus").field("count", &self.count).finish_non_exhaustive()
    }
}

impl TappedBus {
    /// Creates the tap of a bus, with a clock for its times. Cold.
    pub fn new(
        bus: Box<dyn Bus>,
        records: Producer<BusRecord>,
        count: Arc<TapCount>,
        clock: Option<Arc<dyn Clock>>,
    ) -> Self {
        Self { bus, records, count, clock }
    }

    fn record(&mut self, event: BusEvent, at: Option<Duration>) {
        let now = || self.clock.as_ref().map(|clock| clock.since_epoch());
        let at = match (&self.clock, at) {
            (Some(_), Some(at)) => Nanos::from(at),
            _ => now().unwrap_or_default(),
        };
        let tick = self.count.tick.load(Ordering::Relaxed);
        if self.records.push(BusRecord { tick, at, event }).is_err() {
            self.count.lose(1);
        }
    }
}

impl Bus for TappedBus {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let sent = self.bus.send(frame);
        let event = match sent {
            Ok(()) => BusEvent::Sent(*frame),
            Err(error) => BusEvent::Refused(*frame, error),
        };
        self.record(event, None);
        sent
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let received = self.bus.recv(timeout);
        match received {
            Ok(Some(frame)) => self.record(BusEvent::Received(frame), self.bus.arrival()),
            Ok(None) => {}
            Err(error) => self.record(BusEvent::Failed(error), None),
        }
        received
    }

    fn keep_to(&mut self, nodes: &[u8]) -> Result<(), BusError> {
        self.bus.keep_to(nodes)
    }

    fn arrival(&self) -> Option<Duration> {
        self.bus.arrival()
    }
}
