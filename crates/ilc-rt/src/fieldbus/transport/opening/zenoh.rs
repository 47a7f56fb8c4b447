//! `zenoh:` addresses.

use std::str::FromStr;

use super::error::OpenError;
use super::format::Format;
use super::scheme::{Parts, Place, Scheme};
use super::zenoh_reach::stays_on_host;
use crate::fieldbus::Bus;
use crate::fieldbus::transport::ZenohBus;

/// A key expression of Zenoh.
pub(super) static SCHEME: Scheme = Scheme {
    name: "zenoh",
    syntax: "zenoh:KEY[?listen=ENDPOINT][&connect=ENDPOINT][&scouting=off][&insecure=1][&fd=1][&data_bitrate=N]",
    example: "zenoh:ilc/bus/gantry",
    summary: "CAN over Zenoh; stays on this host, an endpoint off it needs `insecure=1`",
    has_bits: false,
    in_process: false,
    parse: |parts| Ok(Box::new(ZenohSettings::read(parts)?)),
};

/// A parsed `zenoh:` address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ZenohSettings {
    /// Key expression of the bus, without wildcards.
    pub key: String,
    /// Zenoh endpoints to listen on, e.g. `tcp/127.0.0.1:7447`; if empty, a free port of the host's
    /// own address.
    pub listen: Vec<String>,
    /// Zenoh endpoints to connect to.
    pub connect: Vec<String>,
    /// True to discover other endpoints on this host by multicast.
    pub scouting: bool,
    /// Format of the frames.
    pub format: Format,
}

impl Place for ZenohSettings {
    fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        Ok(Box::new(ZenohBus::open(self)?))
    }

    fn stays_on_host(&self) -> bool {
        self.listen.iter().chain(&self.connect).all(|endpoint| stays_on_host(endpoint))
    }

    fn format(&self) -> Format {
        self.format
    }
}

impl FromStr for ZenohSettings {
    type Err = OpenError;

    fn from_str(address: &str) -> Result<Self, OpenError> {
        let rest = address.strip_prefix("zenoh:");
        let rest = rest.ok_or_else(|| OpenError::Scheme { address: address.to_owned() })?;
        Self::read(&Parts::new(address, rest))
    }
}

impl ZenohSettings {
    fn read(parts: &Parts<'_>) -> Result<Self, OpenError> {
        if !is_key(parts.place) {
            return Err(parts.refuse(
                "key",
                parts.place,
                "one key without wildcards and without empty parts, such as `cell1/bus`",
            ));
        }
        let key = parts.place.to_owned();
        let format = Format::default();
        let mut settings =
            Self { key, listen: Vec::new(), connect: Vec::new(), scouting: true, format };
        let mut insecure = false;
        for option in parts.options() {
            let option = option?;
            if settings.format.take(parts, option)? {
                continue;
            }
            match option {
                ("listen", endpoint) => settings.listen.push(endpoint.to_owned()),
                ("connect", endpoint) => settings.connect.push(endpoint.to_owned()),
                ("scouting", "off") => settings.scouting = false,
                ("scouting", "on") => settings.scouting = true,
                ("scouting", value) => {
                    return Err(parts.refuse("scouting", value, "`on` and `off` are"));
                }
                ("insecure", "1") => insecure = true,
                ("insecure", value) => return Err(parts.refuse("insecure", value, "`1` is")),
                (name, _) => {
                    let allowed =
                        "`listen`, `connect`, `scouting`, `insecure`, `fd` and `data_bitrate` are";
                    return Err(parts.refuse("option", name, allowed));
                }
            }
        }
        settings.format = settings.format.checked(parts)?;
        let mut endpoints = settings.listen.iter().chain(&settings.connect);
        if let Some(far) = endpoints.find(|endpoint| !stays_on_host(endpoint))
            && !insecure
        {
            return Err(parts.refuse(
                "endpoint",
                far,
                "one of this host, as tcp/127.0.0.1:7447; whoever reaches another one can \
                 move the axes: `insecure=1` allows it on a network of your own",
            ));
        }
        Ok(settings)
    }
}

/// Returns true if Zenoh accepts a text as one key, and `KEY/*` as the keys below it.
fn is_key(text: &str) -> bool {
    let is_part = |part: &str| {
        !part.is_empty()
            && part.chars().all(|c| !c.is_control() && !c.is_whitespace() && !"*$#?".contains(c))
    };
    text.split('/').all(is_part)
}
