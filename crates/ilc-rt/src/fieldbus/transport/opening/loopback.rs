//! The `loopback:` address.

use super::error::OpenError;
use super::format::Format;
use super::scheme::{Parts, Place, Scheme};
use crate::fieldbus::Bus;

/// Range of the bit rate, in bit/s: that of a CAN bus.
const BIT_S_MIN: u32 = 10_000;
const BIT_S_MAX: u32 = 1_000_000;

/// A bus in memory.
pub(super) static SCHEME: Scheme = Scheme {
    name: "loopback",
    syntax: "loopback:[?bitrate=N][&fd=1][&data_bitrate=N]",
    example: "loopback:",
    summary: "in one process, in lock-step; with `bitrate` its frames take the time of a CAN bus",
    has_bits: false,
    in_process: true,
    parse,
};

#[derive(Debug)]
struct Memory {
    address: String,
    format: Format,
}

impl Place for Memory {
    fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        Err(OpenError::NeedsPeer { address: self.address.clone() })
    }

    fn stays_on_host(&self) -> bool {
        true
    }

    fn format(&self) -> Format {
        self.format
    }
}

fn parse(parts: &Parts<'_>) -> Result<Box<dyn Place>, OpenError> {
    if !parts.place.is_empty() {
        return Err(parts.refuse("place", parts.place, "nothing"));
    }
    let mut format = Format::default();
    for option in parts.options() {
        let option = option?;
        if option.0 == "bitrate" {
            let rate = option.1.parse().ok();
            let rate = rate.filter(|rate| (BIT_S_MIN..=BIT_S_MAX).contains(rate));
            let allowed = "10000 to 1000000 bit/s";
            let rate = rate.ok_or_else(|| parts.refuse("bitrate", option.1, allowed))?;
            format.kept_bit_s = Some(rate);
        } else if !format.take(parts, option)? {
            let allowed = "`bitrate`, `fd` and `data_bitrate` are";
            return Err(parts.refuse("option", option.0, allowed));
        }
    }
    let format = format.checked(parts)?;
    Ok(Box::new(Memory { address: parts.address.to_owned(), format }))
}
