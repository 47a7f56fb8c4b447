//! CAN over UDP multicast, wire-compatible with python-can's `udp_multicast` interface.
//!
//! Two sockets: one bound to the group, shared with every other process on the port, and one with
//! its own port to send from, which identifies its frames when they come back. With a time-to-live
//! of 0 (the default) everything goes through the loopback interface, which needs no network and
//! cannot leave the host: a simulated bus must not command the drives of another machine.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::os::fd::AsFd;
use std::time::Duration;

use socket2::{Domain, Protocol, SockAddr, Socket, Type};

use super::super::bus::{Bus, BusError};
use super::super::frame::Frame;
use super::opening::{Format, OpenError};
use super::udp_codec::{decode_in, encode_in};
use super::wait::Deadline;

/// python-can's port for this interface.
pub const DEFAULT_PORT: u16 = 43113;

/// Default time-to-live: frames stay on this host.
pub const DEFAULT_TTL: u8 = 0;

/// Receive buffer for some thousands of frames; the system may grant less.
const RECEIVE_BUFFER_BYTES: usize = 4 << 20;

/// Limit on own and foreign datagrams skipped in one `recv` without waiting, so that a flood cannot
/// stall a tick.
const SKIP_MAX: usize = 256;

/// Bytes read of a datagram: twice the size of an FD frame; a longer one is not a valid frame.
const DATAGRAM_MAX_BYTES: usize = 512;

/// An endpoint on a multicast group.
#[derive(Debug)]
pub struct UdpMulticast {
    receiver: UdpSocket,
    sender: UdpSocket,
    /// Source address of own frames.
    own: SocketAddr,
    format: Format,
}

impl UdpMulticast {
    /// Joins a multicast group.
    ///
    /// `ttl` is the number of network hops: 0 for this host, 1 for the local network.
    ///
    /// # Real Time
    /// Cold.
    /// # Errors
    /// [`OpenError::Os`] with the failed step.
    pub fn open(group: Ipv4Addr, port: u16, ttl: u8) -> Result<Self, OpenError> {
        let os = |action| {
            move |source| {
                OpenError::os(format_args!("udp:{group}:{port}?ttl={ttl}"), action, source)
            }
        };
        let receiver = receiver(group, port, ttl).map_err(os("joining the group"))?;
        let sender = sender(group, port, ttl).map_err(os("addressing the group"))?;
        let own = sender.local_addr().map_err(os("reading the own address"))?;
        Ok(Self { receiver, sender, own, format: Format::default() })
    }

    /// Returns the endpoint with frames of another format than classical CAN.
    #[must_use]
    pub fn with_format(self, format: Format) -> Self {
        Self { format, ..self }
    }

    /// Returns the next frame from another sender, if one has arrived.
    fn next(&self) -> Result<Next, BusError> {
        for _ in 0..SKIP_MAX {
            let mut datagram = [0; DATAGRAM_MAX_BYTES];
            match self.receiver.recv_from(&mut datagram) {
                Ok((_, source)) if source == self.own => {}
                Ok((len, _)) => {
                    if let Some(frame) = decode_in(self.format.is_fd, &datagram[..len]) {
                        return Ok(Next::Frame(frame));
                    }
                }
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
    /// Only own and foreign datagrams so far; there may be more.
    Skipped,
}

impl Bus for UdpMulticast {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if frame.payload().len() > self.format.payload_max() {
            return Err(BusError::TooLong);
        }
        let encoded = encode_in(self.format.is_fd, frame).ok_or(BusError::Os(libc::EMSGSIZE))?;
        match self.sender.send(encoded.as_bytes()) {
            Ok(_) => Ok(()),
            Err(error) => Err(bus_error(&error)),
        }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        match self.next()? {
            Next::Frame(frame) => return Ok(Some(frame)),
            Next::Empty | Next::Skipped if timeout.is_zero() => return Ok(None),
            Next::Empty | Next::Skipped => {}
        }
        let deadline = Deadline::after(timeout);
        while deadline.readable(self.receiver.as_fd())? {
            if let Next::Frame(frame) = self.next()? {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }
}

fn receiver(group: Ipv4Addr, port: u16, ttl: u8) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    // python-can sets both; the system lets sockets share a port only if all of them set them.
    socket.set_reuse_address(true)?;
    socket.set_reuse_port(true)?;
    socket.set_recv_buffer_size(RECEIVE_BUFFER_BYTES)?;
    // Bound to the group, not to any address: other groups on the same port are other buses.
    socket.bind(&SockAddr::from(SocketAddrV4::new(group, port)))?;
    if ttl == 0 {
        socket.join_multicast_v4(&group, &Ipv4Addr::LOCALHOST)?;
        // Frames sent through a network interface are received too, if there is one: python-can
        // sends so.
        let _ = socket.join_multicast_v4(&group, &Ipv4Addr::UNSPECIFIED);
    } else {
        socket.join_multicast_v4(&group, &Ipv4Addr::UNSPECIFIED)?;
        let _ = socket.join_multicast_v4(&group, &Ipv4Addr::LOCALHOST);
    }
    socket.set_nonblocking(true)?;
    Ok(socket.into())
}

fn sender(group: Ipv4Addr, port: u16, ttl: u8) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_multicast_ttl_v4(u32::from(ttl))?;
    if ttl == 0 {
        socket.set_multicast_if_v4(&Ipv4Addr::LOCALHOST)?;
    }
    socket.connect(&SockAddr::from(SocketAddrV4::new(group, port)))?;
    socket.set_nonblocking(true)?;
    Ok(socket.into())
}

fn bus_error(error: &io::Error) -> BusError {
    match error.raw_os_error() {
        Some(libc::ENOBUFS | libc::EAGAIN) => BusError::Full,
        Some(errno) => BusError::Os(errno),
        None => BusError::Os(libc::EIO),
    }
}
