//! Reasons that a bus cannot be opened, in one line that names the address and what is allowed.

use std::fmt;
use std::io;

use super::address::syntaxes;

/// Reason that a bus cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Not the address of any kind of bus.
    #[error("`{address}` is not a bus address: allowed are {}", syntaxes(true))]
    Scheme {
        /// The address as given.
        address: String,
    },
    /// A part of the address has a value that is not allowed.
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
    /// A bus in one process, by its address.
    #[error(
        "`{address}` cannot be opened by its address alone: its other end lives in the same process, \
         which makes both ends with `loopback::pair` or `loopback::InProcess`"
    )]
    NeedsPeer {
        /// The address as given.
        address: String,
    },
    /// The kernel has no CAN.
    #[error(
        "`can:{interface}`: the kernel of this machine has no CAN (socket family AF_CAN); \
         `tests/vcan/run` provides one for tests, `udp:` and `zenoh:` work without"
    )]
    NoCan {
        /// Interface asked for.
        interface: String,
    },
    /// No such interface.
    #[error(
        "`can:{interface}`: there is no such CAN interface; this machine has {}",
        list(available)
    )]
    NoInterface {
        /// Interface asked for.
        interface: String,
        /// CAN interfaces of this machine.
        available: Vec<String>,
    },
    /// The operating system refused.
    #[error("`{address}`: {action} failed: {source}")]
    Os {
        /// The address, as far as it is known.
        address: String,
        /// Failed action.
        action: &'static str,
        /// Error of the system.
        source: io::Error,
    },
    /// Zenoh refused.
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
    /// Returns the system's error at an address, for hot files, which make no text themselves.
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
