//! A CAN interface of Linux, real or virtual, through a raw socket.
//!
//! Frames with 11-bit identifiers only: extended and remote frames are skipped, and FD frames never reach a socket
//! that did not request them. The kernel passes a sent frame to every other socket on the interface, but not
//! back to this one. Error frames, which the kernel makes of what the controller reports, become [`CanFact`]s.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::io;
use std::os::fd::AsFd;
use std::time::{Duration, SystemTime};

use socketcan::id::FdFlags;
use socketcan::timestamp::{
    SOF_TIMESTAMPING_OPT_CMSG, SOF_TIMESTAMPING_RX_SOFTWARE, SOF_TIMESTAMPING_SOFTWARE,
};
use socketcan::{
    CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, EmbeddedFrame, Id, Socket,
    SocketOptions, StandardId,
};

use super::super::bus::{Bus, BusError};
use super::super::can_fact::{CLASSES, CanFact};
use super::super::frame::Frame;
use super::opening::{Format, OpenError};
use super::wait::Deadline;

/// Receive buffer for about a thousand frames.
const RECEIVE_BUFFER_BYTES: usize = 1 << 20;

/// Send buffer for some tens of frames: a command that waits longer than that is worth nothing.
const SEND_BUFFER_BYTES: usize = 1 << 15;

/// Limit on foreign frames skipped in one `recv` without waiting, so that a flood cannot stall a
/// tick.
const SKIP_MAX: usize = 256;

/// `ARPHRD_CAN` of Linux: the type of a CAN interface in `/sys/class/net/*/type`.
const INTERFACE_TYPE_CAN: &str = "280";

/// Length of a CAN FD frame in Linux: the MTU of an interface that carries them.
const MTU_FD: u32 = 72;

/// The part of an identifier that names a node; 0 is all of them.
const NODE_MASK: u32 = 0x7F;
/// A whole 11-bit identifier.
const ID_MASK: u32 = 0x7FF;
/// Identifiers of NMT and SYNC, which are for all nodes.
const BROADCASTS: [u32; 2] = [0x000, 0x080];

/// A raw socket on one CAN interface.
pub struct SocketCan {
    socket: CanFdSocket,
    format: Format,
    /// Time at which the kernel received the last frame.
    arrival: Option<Duration>,
    /// The fault that was reported last, until the controller reports another fact.
    reported: Option<CanFact>,
}

impl SocketCan {
    /// Opens a CAN interface by its name, for frames of a format.
    ///
    /// # Real Time
    /// Cold.
    /// # Errors
    /// [`OpenError::NoCan`] if the kernel has no CAN, [`OpenError::NoInterface`] with the existing
    /// ones, [`OpenError::NoFd`] for CAN FD on an interface without it, [`OpenError::Os`] for other errors of the system.
    pub fn open(interface: &str, format: Format) -> Result<Self, OpenError> {
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
        if format.is_fd && mtu(interface).is_some_and(|mtu| mtu < MTU_FD) {
            return Err(OpenError::NoFd { interface: interface.to_owned() });
        }
        let socket = CanFdSocket::open(interface).map_err(os("opening the interface"))?;
        socket.set_nonblocking(true).map_err(os("making the socket non-blocking"))?;
        let fd = libc::c_int::from(format.is_fd);
        socket
            .set_socket_option_int(libc::SOL_CAN_RAW, libc::CAN_RAW_FD_FRAMES, fd)
            .map_err(os("choosing the format of the frames"))?;
        socket.set_error_filter(CLASSES).map_err(os("asking for error frames"))?;
        // A system without time stamps gives none.
        let _ = socket.set_timestamping(
            SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_OPT_CMSG,
        );
        let raw = socket.as_raw_socket();
        raw.set_recv_buffer_size(RECEIVE_BUFFER_BYTES)
            .map_err(os("enlarging the receive buffer"))?;
        raw.set_send_buffer_size(SEND_BUFFER_BYTES).map_err(os("limiting the send buffer"))?;
        Ok(Self { socket, format, arrival: None, reported: None })
    }

    /// Returns the next CANopen frame that has already arrived.
    fn next(&mut self, skip_max: usize) -> Result<Next, BusError> {
        for _ in 0..skip_max {
            let (frame, times) = match self.socket.read_frame_with_timestamps() {
                Ok(read) => read,
                Err(error) => match error.kind() {
                    io::ErrorKind::WouldBlock => return Ok(Next::Empty),
                    // Neither a classical nor an FD frame.
                    io::ErrorKind::Interrupted | io::ErrorKind::InvalidData => continue,
                    _ => return Err(bus_error(&error)),
                },
            };
            let frame = match frame {
                CanAnyFrame::Normal(data) => from_socket(data.id(), data.data()),
                CanAnyFrame::Fd(data) => from_socket(data.id(), data.data()),
                CanAnyFrame::Error(error) => {
                    self.take_fact(&error)?;
                    None
                }
                CanAnyFrame::Remote(_) => None,
            };
            if let Some(frame) = frame {
                let since = |time: SystemTime| time.duration_since(SystemTime::UNIX_EPOCH).ok();
                self.arrival = times.sw.and_then(since);
                return Ok(Next::Frame(frame));
            }
        }
        Ok(Next::Skipped)
    }

    /// Reports a fault, each one once: a bus without a second node makes an error frame of every attempt.
    fn take_fact(&mut self, error: &CanErrorFrame) -> Result<(), BusError> {
        let mut data = [0; 8];
        for (room, byte) in data.iter_mut().zip(error.data()) {
            *room = *byte;
        }
        let fact = CanFact::decode(error.error_bits(), data);
        let is_new = fact != self.reported;
        self.reported = fact;
        match fact {
            Some(fact) if fact.is_fault() && is_new => Err(BusError::Controller(fact)),
            _ => Ok(()),
        }
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
        let (id, payload) = (frame.id(), frame.payload());
        if payload.len() > self.format.payload_max() {
            return Err(BusError::TooLong);
        }
        // A `Frame` always has 11 bits of identifier and a length that its format has; the type does not
        // express it.
        let impossible = BusError::Os(libc::EINVAL);
        let id = StandardId::new(id).ok_or(impossible)?;
        let written = if self.format.is_fd {
            let data = CanFdFrame::with_flags(id, payload, FdFlags::BRS).ok_or(impossible)?;
            self.socket.write_frame(&data)
        } else {
            self.socket.write_frame(&CanDataFrame::new(id, payload).ok_or(impossible)?)
        };
        written.map_err(|error| bus_error(&error))
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

    fn keep_to(&mut self, nodes: &[u8]) -> Result<(), BusError> {
        // Extended and remote frames match none of them.
        let flags = libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG;
        let own = nodes.iter().map(|node| (u32::from(*node), NODE_MASK | flags));
        let all = BROADCASTS.into_iter().map(|id| (id, ID_MASK | flags));
        let filters: Vec<(u32, u32)> = own.chain(all).collect();
        self.socket.set_filters(&filters).map_err(|error| bus_error(&error))
    }

    fn arrival(&self) -> Option<Duration> {
        self.arrival
    }
}

impl fmt::Debug for SocketCan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SocketCan").finish_non_exhaustive()
    }
}

fn from_socket(id: Id, data: &[u8]) -> Option<Frame> {
    match id {
        Id::Standard(id) => Frame::fd(id.as_raw(), data),
        Id::Extended(_) => None,
    }
}

fn bus_error(error: &io::Error) -> BusError {
    match error.raw_os_error() {
        Some(libc::ENOBUFS | libc::EAGAIN) => BusError::Full,
        Some(libc::ENETDOWN) => BusError::Down,
        Some(libc::ENODEV | libc::ENXIO) => BusError::Gone,
        Some(errno) => BusError::Os(errno),
        // Only a short read or write has no number; a raw CAN socket never does either.
        None => BusError::Os(libc::EIO),
    }
}

/// Returns the MTU of an interface: 16 for classical frames, 72 with CAN FD.
fn mtu(interface: &str) -> Option<u32> {
    let path = std::path::Path::new("/sys/class/net").join(interface).join("mtu");
    std::fs::read_to_string(path).ok()?.trim().parse().ok()
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
