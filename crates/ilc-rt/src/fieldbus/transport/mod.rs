//! The transports: a real CAN interface, UDP multicast, Zenoh, and memory.
//!
//! Each file is one transport behind the [`Bus`](super::Bus) trait, hot in `send` and `recv`;
//! `opening`, which is cold, opens the address of a cell description. Used by `servo`, `campaign`,
//! the simulator and the tools, which know nothing but the address.
//!
//! Family: `opening`, `socketcan`, `udp_multicast` and `zenoh`: each carrier is opened cold, from
//! its parts.

mod doorbell;
mod group;
pub mod loopback;
pub(crate) mod opening;
mod queue;
pub mod socketcan;
mod tapped;
pub mod timed;
pub mod udp_codec;
pub mod udp_multicast;
mod wait;
pub mod zenoh;

pub use group::{Group, GroupSide};
pub use loopback::{InProcess, Loopback, Responder};
pub use opening::{
    Address, Format, OpenError, SCHEMES, Scheme, ZenohSettings, format_of, open, scheme_of,
    syntaxes,
};
pub use socketcan::SocketCan;
pub use tapped::{BusEvent, BusRecord, TapCount, TappedBus};
pub use timed::{Timed, in_process};
pub use udp_multicast::UdpMulticast;
pub use zenoh::ZenohBus;
