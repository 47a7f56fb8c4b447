//! The `loopback:` address.

use super::error::OpenError;
use super::scheme::{Parts, Place, Scheme};
use crate::fieldbus::Bus;

/// A bus in memory.
pub(super) static SCHEME: Scheme = Scheme {
    name: "loopback",
    syntax: "loopback:",
    example: "loopback:",
    summary: "in one process, in lock-step",
    has_bits: false,
    in_process: true,
    parse: |parts: &Parts<'_>| Ok(Box::new(Memory { address: parts.address.to_owned() })),
};

#[derive(Debug)]
struct Memory {
    address: String,
}

impl Place for Memory {
    fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        Err(OpenError::NeedsPeer { address: self.address.clone() })
    }

    fn stays_on_host(&self) -> bool {
        true
    }
}
