//! The carriers of frames: a real CAN interface, UDP multicast, Zenoh, and memory.
//!
//! Each file is one carrier behind the [`Bus`] trait, hot in `send` and `recv`, cold when it is opened;
//! [`open`] turns an address from a cell description into one. Used by `servo`, `supervisor`, the
//! simulator and the tools, which know the address and nothing else of the carrier.

mod doorbell;
pub mod loopback;
pub(crate) mod opening;
pub mod socketcan;
pub mod udp_codec;
pub mod udp_multicast;
mod wait;
pub mod zenoh;

pub use loopback::{InProcess, Loopback, Responder};
pub use opening::{Address, OpenError, ZenohSettings};
pub use socketcan::SocketCan;
pub use udp_multicast::UdpMulticast;
pub use zenoh::ZenohBus;

use super::bus::Bus;

/// Opens the bus that an address names.
///
/// | address | carrier |
/// |---|---|
/// | `can:vcan0` | the CAN interface of that name |
/// | `udp:239.74.163.2[:port][?ttl=N]` | UDP multicast, in the format of python-can's `udp_multicast` |
/// | `zenoh:KEY[?listen=ENDPOINT][&connect=ENDPOINT][&scouting=off][&insecure=1]` | a Zenoh key expression |
///
/// # Errors
/// [`OpenError`]: one line with the address, what is wrong with it and what is allowed. `loopback:` has
/// its other end in the same process and cannot be opened by address.
pub fn open(address: &str) -> Result<Box<dyn Bus>, OpenError> {
    Ok(match address.parse()? {
        Address::Can { interface } => Box::new(SocketCan::open(&interface)?),
        Address::Udp { group, port, ttl } => Box::new(UdpMulticast::open(group, port, ttl)?),
        Address::Zenoh(settings) => Box::new(ZenohBus::open(&settings)?),
        Address::Loopback => return Err(OpenError::NeedsPeer { address: address.to_owned() }),
    })
}
