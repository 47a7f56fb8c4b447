//! `can:` addresses.

use super::error::OpenError;
use super::format::Format;
use super::scheme::{Parts, Place, Scheme};
use crate::fieldbus::Bus;
use crate::fieldbus::transport::SocketCan;

/// Longest name of a network interface in Linux (`IFNAMSIZ` without the terminating zero).
const INTERFACE_NAME_MAX: usize = 15;

/// A CAN interface of Linux.
pub(super) static SCHEME: Scheme = Scheme {
    name: "can",
    syntax: "can:INTERFACE[?fd=1][&data_bitrate=N]",
    example: "can:can0",
    summary: "SocketCAN; CAN FD with `fd=1`, if every node takes it",
    has_bits: true,
    in_process: false,
    parse,
};

#[derive(Debug)]
struct Interface(String, Format);

impl Place for Interface {
    fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        Ok(Box::new(SocketCan::open(&self.0, self.1)?))
    }

    fn stays_on_host(&self) -> bool {
        false
    }

    fn format(&self) -> Format {
        self.1
    }
}

fn parse(parts: &Parts<'_>) -> Result<Box<dyn Place>, OpenError> {
    let mut format = Format::default();
    for option in parts.options() {
        let option = option?;
        if !format.take(parts, option)? {
            return Err(parts.refuse("option", option.0, "`fd` and `data_bitrate` are"));
        }
    }
    let name = parts.place;
    let well_formed = !name.is_empty()
        && name.len() <= INTERFACE_NAME_MAX
        && name.bytes().all(|b| b.is_ascii_graphic() && b != b'/');
    if !well_formed {
        return Err(parts.refuse("interface", name, "1 to 15 printable characters, no `/`"));
    }
    Ok(Box::new(Interface(name.to_owned(), format.checked(parts)?)))
}
