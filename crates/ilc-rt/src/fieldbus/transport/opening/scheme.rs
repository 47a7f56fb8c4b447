//! The description of a kind of bus, for help texts, errors, documents and Python.

use std::fmt;

use super::error::OpenError;
use super::format::Format;
use crate::fieldbus::Bus;

/// One kind of bus.
pub struct Scheme {
    /// Name before the colon of an address.
    pub name: &'static str,
    /// Syntax of an address, its parts in capitals.
    pub syntax: &'static str,
    /// A valid address.
    pub example: &'static str,
    /// Carrier of the frames, as short Markdown.
    pub summary: &'static str,
    /// True if the bus has a bit rate: its load is checked, and its drives are assumed to be real.
    pub has_bits: bool,
    /// True if both ends are in one process, so that an address alone opens nothing.
    pub in_process: bool,
    /// Parses an address of this kind.
    pub(super) parse: fn(&Parts<'_>) -> Result<Box<dyn Place>, OpenError>,
}

impl fmt::Debug for Scheme {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scheme").field("name", &self.name).finish_non_exhaustive()
    }
}

/// A checked place of an address.
pub(super) trait Place: fmt::Debug {
    /// Opens the bus.
    fn open(&self) -> Result<Box<dyn Bus>, OpenError>;

    /// Returns whether no frame leaves this host.
    fn stays_on_host(&self) -> bool;

    /// Returns the format of its frames.
    fn format(&self) -> Format;
}

/// An address in its parts: `SCHEME:PLACE?OPTION=VALUE&…`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts<'a> {
    pub(super) address: &'a str,
    pub(super) place: &'a str,
    options: &'a str,
}

impl<'a> Parts<'a> {
    /// Splits the part after the colon of an address.
    pub(super) fn new(address: &'a str, rest: &'a str) -> Self {
        let (place, options) = rest.split_once('?').unwrap_or((rest, ""));
        Self { address, place, options }
    }

    /// Returns the options; an endpoint may itself contain `=`, so only the first one separates.
    pub(super) fn options(self) -> impl Iterator<Item = Result<(&'a str, &'a str), OpenError>> {
        self.options.split('&').filter(|option| !option.is_empty()).map(move |option| {
            option.split_once('=').ok_or_else(|| self.refuse("option", option, "write NAME=VALUE"))
        })
    }

    /// Returns the error for a part with an invalid value.
    pub(super) fn refuse(
        &self,
        part: &'static str,
        value: &str,
        allowed: &'static str,
    ) -> OpenError {
        let (address, value) = (self.address.to_owned(), value.to_owned());
        OpenError::Part { address, part, value, allowed }
    }
}
