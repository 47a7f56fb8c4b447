//! CAN frames on a Zenoh key expression.
//!
//! Each endpoint publishes under `KEY/<its own random id>` and subscribes to `KEY/*`; a frame is two
//! bytes of identifier, little endian, and its payload. Zenoh never runs in the caller's thread: a ring
//! buffer each way stands between. Unless the address names endpoints, sessions listen on the host's own
//! address only: a simulated bus must not command the drives of another machine.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::time::Duration;

use super::super::bus::{Bus, BusError};
use super::super::frame::{FD_PAYLOAD_MAX, Frame};
use super::opening::{Ends, Link, OpenError, ZenohSettings};
use super::queue::{Inbox, Outbox};

/// Bytes of the identifier before the payload.
const ID_BYTES: usize = 2;

/// Time that [`ZenohBus::open`] waits for an endpoint named in the address.
const CONNECT_WAIT: Duration = Duration::from_secs(3);

/// An endpoint on a Zenoh key expression.
pub struct ZenohBus {
    outgoing: Outbox,
    incoming: Inbox,
    link: Link,
    payload_max: usize,
}

impl ZenohBus {
    /// Opens its own session and joins the bus.
    ///
    /// If the settings name an endpoint to connect to, waits up to three seconds until an endpoint
    /// on the other side listens to this bus, and continues without it after that.
    ///
    /// # Real Time
    /// Cold: starts threads.
    /// # Errors
    /// [`OpenError::Zenoh`] with the failed step, e.g. listening on an endpoint in use.
    pub fn open(settings: &ZenohSettings) -> Result<Self, OpenError> {
        let Ends { outgoing, incoming, link } = Link::open(settings)?;
        let bus = Self { outgoing, incoming, link, payload_max: settings.format.payload_max() };
        if !settings.connect.is_empty() {
            bus.wait_for_peer(CONNECT_WAIT);
        }
        Ok(bus)
    }

    /// Waits until another endpoint receives the frames sent here; returns false after the timeout.
    ///
    /// # Real Time
    /// Cold: sleeps.
    pub fn wait_for_peer(&self, timeout: Duration) -> bool {
        self.link.wait_for_peer(timeout)
    }
}

impl Bus for ZenohBus {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if frame.payload().len() > self.payload_max {
            return Err(BusError::TooLong);
        }
        self.outgoing.put(frame)?;
        self.link.wake_publisher();
        Ok(())
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.incoming.take(timeout)
    }
}

impl fmt::Debug for ZenohBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ZenohBus").finish_non_exhaustive()
    }
}

/// Returns the bytes of a frame on Zenoh and their number.
pub(super) fn encode(frame: &Frame) -> ([u8; ID_BYTES + FD_PAYLOAD_MAX], usize) {
    let mut bytes = [0; ID_BYTES + FD_PAYLOAD_MAX];
    let payload = frame.payload();
    let len = ID_BYTES + payload.len();
    bytes[..ID_BYTES].copy_from_slice(&frame.id().to_le_bytes());
    bytes[ID_BYTES..len].copy_from_slice(payload);
    (bytes, len)
}

/// Returns the frame in a sample, or `None` if it is invalid, or longer than the bus carries.
pub(super) fn decode(bytes: &[u8], payload_max: usize) -> Option<Frame> {
    let (id, payload) = bytes.split_first_chunk::<ID_BYTES>()?;
    Frame::fd(u16::from_le_bytes(*id), payload).filter(|_| payload.len() <= payload_max)
}
