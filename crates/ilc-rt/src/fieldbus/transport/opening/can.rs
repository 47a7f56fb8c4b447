//! `can:` addresses.

use super::error::OpenError;
use super::scheme::{Parts, Place, Scheme};
use crate::fieldbus::Bus;
use crate::fieldbus::transport::SocketCan;

/// Longest name of a network interface in Linux (`IFNAMSIZ` without the terminating zero).
const INTERFACE_NAME_MAX: usize = 15;

/// A CAN interface of Linux.
pub(super) static SCHEME: Scheme = Scheme {
    name: "can",
    syntax: "can:INTERFACE",
    example: "can:can0",
    summary: "SocketCAN",
    has_bits: true,
    in_process: false,
    parse,
};

#[derive(Debug)]
struct Interface(String);

impl Place for Interface {
    fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        Ok(Box::new(SocketCan::open(&self.0)?))
    }

    fn stays_on_host(&self) -> bool {
        false
    }
}

fn parse(parts: &Parts<'_>) -> Result<Box<dyn Place>, OpenError> {
    if let Some(option) = parts.options().next() {
        return Err(parts.refuse("option", option?.0, "a CAN interface takes none"));
    }
    let name = parts.place;
    let well_formed = !name.is_empty()
        && name.len() <= INTERFACE_NAME_MAX
        && name.bytes().all(|b| b.is_ascii_graphic() && b != b'/');
    if !well_formed {
        return Err(parts.refuse("interface", name, "1 to 15 printable characters, no `/`"));
    }
    Ok(Box::new(Interface(name.to_owned())))
}
