//! A CAN interface of Linux, real or virtual, through a raw socket.
//!
//! Classical frames with 11-bit identifiers only: extended, remote and error frames are skipped,
//! and FD frames never reach a socket that did not request them. The kernel passes a sent frame to
//! every other socket on the interface, but not back to this one.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::io;
use std::os::fd::AsFd;
use std::time::Duration;

use socketcan::{CanDataFrame, CanFrame, CanSocket, EmbeddedFrame, Id, Socket, StandardId};

use super::super::bus::{Bus, BusError};
use super::super::frame::Frame;
use super::opening::OpenError;
use super::wait::Deadline;

/// Receive buffer for about a thousand frames.
const RECEIVE_BUFFER_BYTES: usize = 1 << 20;

/// Limit on foreign frames skipped in one `recv` without waiting, so that a flood cannot stall a
/// tick.
const SKIP_MAX: usize = 256;

/// `ARPHRD_CAN` of Linux: the type of a CAN interface in `/sys/class/net/*/type`.
const INTERFACE_TYPE_CAN: &str = "280";

/// A raw socket on one CAN interface.
pub struct SocketCan {
    socket: CanSocket,
}

impl SocketCan {
    /// Opens a CAN interface by its name.
    ///
    /// # Real Time
    /// Cold.
    /// # Errors
    /// [`OpenError::NoCan`] if the kernel has no CAN, [`OpenError::NoInterface`] with the existing
    /// ones, [`OpenError::Os`] for other errors of the system.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        let os =
            |action| move |source| OpenError::os(format_args!("can:{interface}"), action, source);
        // Checked first: without CAN in the kernel the interface is missing too, which is not the
        // cause.
        let can = socket2::Domain::from(libc::AF_CAN);
        let raw = socket2::Protocol::from(libc::CAN_RAW);
        if let Err(source) = socket2::Socket::new(can, socket2::Type::RAW, Some(raw)) {
            return Err(match source.raw_os_error() {
                Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => {
                    OpenError::NoCan { interface: interface.to_owned() }
                }
                _ => os("opening a CAN socket")(source),
            });
        }
        let interfaces = can_interfaces();
        if !interfaces.iter().any(|name| name == interface) {
            return Err(OpenError::NoInterface {
                interface: interface.to_owned(),
                available: interfaces,
            });
        }
        let socket = CanSocket::open(interface).map_err(os("opening the interface"))?;
        socket.set_nonblocking(true).map_err(os("making the socket non-blocking"))?;
        socket
            .as_raw_socket()
            .set_recv_buffer_size(RECEIVE_BUFFER_BYTES)
            .map_err(os("enlarging the receive buffer"))?;
        Ok(Self { socket })
    }

    /// Returns the next CANopen frame that has already arrived.
    fn next(&self, skip_max: usize) -> Result<Next, BusError> {
        for _ in 0..skip_max {
            match self.socket.read_frame() {
                Ok(CanFrame::Data(data)) => {
                    if let Some(frame) = from_socket(&data) {
                        return Ok(Next::Frame(frame));
                    }
                }
                Ok(CanFrame::Remote(_) | CanFrame::Error(_)) => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(Next::Empty),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(bus_error(&error)),
            }
        }
        Ok(Next::Skipped)
    }
}

/// Result of a look at the socket.
enum Next {
    Frame(Frame),
    /// Empty.
    Empty,
    /// Only foreign frames so far; there may be more.
    Skipped,
}

impl Bus for SocketCan {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        // A `Frame` always has 11 bits of identifier and up to 8 bytes; the type does not express
        // it.
        let data = StandardId::new(frame.id())
            .and_then(|id| CanDataFrame::new(id, frame.payload()))
            .ok_or(BusError::Os(libc::EINVAL))?;
        self.socket.write_frame(&data).map_err(|error| bus_error(&error))
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        match self.next(SKIP_MAX)? {
            Next::Frame(frame) => return Ok(Some(frame)),
            Next::Empty | Next::Skipped if timeout.is_zero() => return Ok(None),
            Next::Empty | Next::Skipped => {}
        }
        let deadline = Deadline::after(timeout);
        while deadline.readable(self.socket.as_fd())? {
            if let Next::Frame(frame) = self.next(SKIP_MAX)? {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }
}

impl fmt::Debug for SocketCan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SocketCan").finish_non_exhaustive()
    }
}

fn from_socket(data: &CanDataFrame) -> Option<Frame> {
    match data.id() {
        Id::Standard(id) => Frame::new(id.as_raw(), data.data()),
        Id::Extended(_) => None,
    }
}

fn bus_error(error: &io::Error) -> BusError {
    match error.raw_os_error() {
        Some(libc::ENOBUFS | libc::EAGAIN) => BusError::Full,
        Some(libc::ENETDOWN | libc::ENODEV | libc::ENXIO) => BusError::Closed,
        Some(errno) => BusError::Os(errno),
        // Only a short read or write has no number; a raw CAN socket never does either.
        None => BusError::Os(libc::EIO),
    }
}

#[expect(clippy::disallowed_types, reason = "cold: set-up")]
fn can_interfaces() -> Vec<String> {
    let Ok(entries) = std::fs::read_dir("/sys/class/net") else { return Vec::new() };
    let mut names: Vec<String> = entries
        .flatten()
        .filter(|entry| {
            std::fs::read_to_string(entry.path().join("type"))
                .is_ok_and(|kind| kind.trim() == INTERFACE_TYPE_CAN)
        })
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}
