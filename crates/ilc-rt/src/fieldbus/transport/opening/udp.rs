//! `udp:` addresses.

use std::net::Ipv4Addr;

use super::error::OpenError;
use super::format::Format;
use super::scheme::{Parts, Place, Scheme};
use crate::fieldbus::Bus;
use crate::fieldbus::transport::UdpMulticast;
use crate::fieldbus::transport::udp_multicast::{DEFAULT_PORT, DEFAULT_TTL};

/// A UDP multicast group.
pub(super) static SCHEME: Scheme = Scheme {
    name: "udp",
    syntax: "udp:GROUP[:PORT][?ttl=N][&fd=1][&data_bitrate=N]",
    example: "udp:239.74.163.2",
    summary: "CAN over UDP multicast in python-can's format; stays on this host unless `ttl` says otherwise",
    has_bits: false,
    in_process: false,
    parse,
};

#[derive(Debug, PartialEq, Eq)]
struct Multicast {
    group: Ipv4Addr,
    port: u16,
    /// Time-to-live: network hops of the frames; 0 keeps them on this host.
    ttl: u8,
    format: Format,
}

impl Place for Multicast {
    fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        let bus = UdpMulticast::open(self.group, self.port, self.ttl)?;
        Ok(Box::new(bus.with_format(self.format)))
    }

    fn stays_on_host(&self) -> bool {
        self.ttl == 0
    }

    fn format(&self) -> Format {
        self.format
    }
}

fn parse(parts: &Parts<'_>) -> Result<Box<dyn Place>, OpenError> {
    Ok(Box::new(read(parts)?))
}

fn read(parts: &Parts<'_>) -> Result<Multicast, OpenError> {
    let place = parts.place;
    // With or without brackets, with or without a port: only IPv6 has two colons.
    if place.starts_with('[') || place.matches(':').count() > 1 {
        return Err(parts.refuse("group", place, "an IPv4 group, 224.0.0.0 to 239.255.255.255"));
    }
    let (group, port) = match place.split_once(':') {
        None => (place, DEFAULT_PORT),
        Some((group, port)) => match port.parse() {
            Ok(number) if number != 0 => (group, number),
            _ => return Err(parts.refuse("port", port, "1 to 65535")),
        },
    };
    let group = group
        .parse()
        .ok()
        .filter(Ipv4Addr::is_multicast)
        .ok_or_else(|| parts.refuse("group", group, "224.0.0.0 to 239.255.255.255"))?;
    let mut ttl = DEFAULT_TTL;
    let mut format = Format::default();
    for option in parts.options() {
        let (name, value) = option?;
        if format.take(parts, (name, value))? {
            continue;
        }
        if name != "ttl" {
            return Err(parts.refuse("option", name, "`ttl`, `fd` and `data_bitrate` are"));
        }
        let allowed = "0 (this host only) to 255, 1 for the local network";
        ttl = value.parse().map_err(|_| parts.refuse("ttl", value, allowed))?;
    }
    Ok(Multicast { group, port, ttl, format: format.checked(parts)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn port_and_ttl_have_defaults() {
        let group = Ipv4Addr::new(239, 74, 163, 2);
        let format = Format::default();
        let of = |rest: &str| read(&Parts::new(rest, rest)).unwrap();
        assert_eq!(of("239.74.163.2"), Multicast { group, port: 43113, ttl: 0, format });
        assert_eq!(of("239.74.163.2:5000?ttl=1"), Multicast { group, port: 5000, ttl: 1, format });
    }
}
