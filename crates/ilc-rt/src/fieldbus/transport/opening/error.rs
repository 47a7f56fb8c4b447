//! Reasons that a bus cannot be opened, in one line that names the address and what is allowed.

use std::fmt;
use std::io;

use super::address::syntaxes;

/// Reason that a bus cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// An unknown kind of bus.
    #[error("`{address}` is not a bus address: allowed are {}", syntaxes(true))]
    Scheme {
        /// The address as given.
        address: String,
    },
    /// A part of the address with an invalid value.
    #[error("`{address}`: {part} `{value}` is not allowed: {allowed}")]
    Part {
        /// The address as given.
        address: String,
        /// Part of the address: group, port, option, ...
        part: &'static str,
        /// The value as given.
        value: String,
        /// Allowed values of the part.
        allowed: &'static str,
    },
    /// An in-process bus, by its address alone.
    #[error(
        "`{address}` cannot be opened by its address alone: its other end lives in the same process, \
         which makes both ends with `loopback::pair` or `loopback::InProcess`"
    )]
    NeedsPeer {
        /// The address as given.
        address: String,
    },
    /// A kernel without CAN.
    #[error(
        "`can:{interface}`: the kernel of this machine has no CAN (socket family AF_CAN); \
         `tests/vcan/run` provides one for tests, `udp:` and `zenoh:` work without"
    )]
    NoCan {
        /// Requested interface.
        interface: String,
    },
    /// A missing interface.
    #[error(
        "`can:{interface}`: there is no such CAN interface; this machine has {}",
        list(available)
    )]
    NoInterface {
        /// Requested interface.
        interface: String,
        /// CAN interfaces of this machine.
        available: Vec<String>,
    },
    /// An interface for classical frames.
    #[error(
        "`can:{interface}?fd=1`: the interface carries classical frames only; \
         `ip link set {interface} type can bitrate N dbitrate N fd on` turns CAN FD on, and of a virtual one `mtu 72`"
    )]
    NoFd {
        /// Requested interface.
        interface: String,
    },
    /// An error of the operating system.
    #[error("`{address}`: {action} failed: {source}")]
    Os {
        /// The address, as far as it is known.
        address: String,
        /// Failed action.
        action: &'static str,
        /// Error of the system.
        source: io::Error,
    },
    /// An error of Zenoh.
    #[error("`zenoh:{key}`: {action} failed: {reason}")]
    Zenoh {
        /// Key expression of the bus.
        key: String,
        /// Failed action.
        action: &'static str,
        /// Error of Zenoh.
        reason: String,
    },
}

impl OpenError {
    /// Returns the system's error at an address, for hot files, which format no text.
    pub(in crate::fieldbus::transport) fn os(
        address: fmt::Arguments<'_>,
        action: &'static str,
        source: io::Error,
    ) -> Self {
        Self::Os { address: address.to_string(), action, source }
    }
}

fn list(interfaces: &[String]) -> String {
    if interfaces.is_empty() { "none".to_owned() } else { interfaces.join(", ") }
}
