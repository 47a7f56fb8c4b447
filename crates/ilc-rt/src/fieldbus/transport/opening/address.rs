//! Bus addresses as they stand in a cell description or on a command line.

use std::net::Ipv4Addr;
use std::str::FromStr;

use super::error::OpenError;
use super::zenoh_link::Settings;
use super::zenoh_reach::stays_on_host;
use crate::fieldbus::transport::udp_multicast::{DEFAULT_PORT, DEFAULT_TTL};

/// Longest name of a network interface in Linux (`IFNAMSIZ` without its zero).
const INTERFACE_NAME_MAX: usize = 15;

/// A bus address, taken apart and checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// `can:INTERFACE`.
    Can {
        /// Name of the network interface.
        interface: String,
    },
    /// `udp:GROUP[:PORT][?ttl=N]`.
    Udp {
        /// Multicast group.
        group: Ipv4Addr,
        /// UDP port.
        port: u16,
        /// Routers the frames may cross, plus one; 0 keeps them on this host.
        ttl: u8,
    },
    /// `zenoh:KEY[?listen=ENDPOINT][&connect=ENDPOINT][&scouting=off][&insecure=1]`.
    Zenoh(Settings),
    /// `loopback:`.
    Loopback,
}

impl FromStr for Address {
    type Err = OpenError;

    #[allow(clippy::too_many_lines, reason = "one arm a carrier, each by itself")]
    fn from_str(address: &str) -> Result<Self, OpenError> {
        let unknown = || OpenError::Scheme { address: address.to_owned() };
        let (scheme, rest) = address.split_once(':').ok_or_else(unknown)?;
        let (place, options) = rest.split_once('?').unwrap_or((rest, ""));
        let part = |part, value: &str, allowed| OpenError::Part {
            address: address.to_owned(),
            part,
            value: value.to_owned(),
            allowed,
        };
        // An endpoint may itself contain `=`, so only the first one separates.
        let options = options.split('&').filter(|option| !option.is_empty()).map(|option| {
            option.split_once('=').ok_or_else(|| part("option", option, "write NAME=VALUE"))
        });
        match scheme {
            "can" => {
                if let Some(option) = options.into_iter().next() {
                    return Err(part("option", option?.0, "a CAN interface takes none"));
                }
                let well_formed = !place.is_empty()
                    && place.len() <= INTERFACE_NAME_MAX
                    && place.bytes().all(|b| b.is_ascii_graphic() && b != b'/');
                if !well_formed {
                    return Err(part("interface", place, "1 to 15 printable characters, no `/`"));
                }
                Ok(Self::Can { interface: place.to_owned() })
            }
            "udp" => {
                // In brackets or without, with a port or without: only IPv6 has two colons.
                if place.starts_with('[') || place.matches(':').count() > 1 {
                    return Err(part(
                        "group",
                        place,
                        "an IPv4 group, 224.0.0.0 to 239.255.255.255",
                    ));
                }
                let (group, port) = match place.split_once(':') {
                    None => (place, DEFAULT_PORT),
                    Some((group, port)) => match port.parse() {
                        Ok(number) if number != 0 => (group, number),
                        _ => return Err(part("port", port, "1 to 65535")),
                    },
                };
                let group = group
                    .parse()
                    .ok()
                    .filter(Ipv4Addr::is_multicast)
                    .ok_or_else(|| part("group", group, "224.0.0.0 to 239.255.255.255"))?;
                let mut ttl = DEFAULT_TTL;
                for option in options {
                    let (name, value) = option?;
                    if name != "ttl" {
                        return Err(part("option", name, "`ttl` is"));
                    }
                    ttl = value.parse().map_err(|_| {
                        part("ttl", value, "0 (this host only) to 255, 1 for the local network")
                    })?;
                }
                Ok(Self::Udp { group, port, ttl })
            }
            "zenoh" => {
                let mut settings = Settings::new(place);
                if !is_key(place) {
                    return Err(part(
                        "key",
                        place,
                        "one key without wildcards and without empty parts, such as `cell1/bus`",
                    ));
                }
                let mut insecure = false;
                for option in options {
                    match option? {
                        ("listen", endpoint) => settings.listen.push(endpoint.to_owned()),
                        ("connect", endpoint) => settings.connect.push(endpoint.to_owned()),
                        ("scouting", "off") => settings.scouting = false,
                        ("scouting", "on") => settings.scouting = true,
                        ("scouting", value) => {
                            return Err(part("scouting", value, "`on` and `off` are"));
                        }
                        ("insecure", "1") => insecure = true,
                        ("insecure", value) => return Err(part("insecure", value, "`1` is")),
                        (name, _) => {
                            return Err(part(
                                "option",
                                name,
                                "`listen`, `connect`, `scouting` and `insecure` are",
                            ));
                        }
                    }
                }
                let mut endpoints = settings.listen.iter().chain(&settings.connect);
                if let Some(far) = endpoints.find(|endpoint| !stays_on_host(endpoint))
                    && !insecure
                {
                    return Err(part(
                        "endpoint",
                        far,
                        "one of this host, as tcp/127.0.0.1:7447; whoever reaches another one can \
                         move the axes: `insecure=1` allows it on a network of your own",
                    ));
                }
                Ok(Self::Zenoh(settings))
            }
            "loopback" => Ok(Self::Loopback),
            _ => Err(unknown()),
        }
    }
}

/// Whether Zenoh takes a text for one key, and `KEY/*` for the keys under it.
fn is_key(text: &str) -> bool {
    let is_part = |part: &str| {
        !part.is_empty()
            && part.chars().all(|c| !c.is_control() && !c.is_whitespace() && !"*$#?".contains(c))
    };
    text.split('/').all(is_part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(address: &str) -> String {
        address.parse::<Address>().unwrap_err().to_string()
    }

    #[test]
    fn takes_every_carrier_apart() {
        assert_eq!(
            "can:vcan0".parse::<Address>().unwrap(),
            Address::Can { interface: "vcan0".to_owned() }
        );
        let group = Ipv4Addr::new(239, 74, 163, 2);
        assert_eq!(
            "udp:239.74.163.2".parse::<Address>().unwrap(),
            Address::Udp { group, port: 43113, ttl: 0 }
        );
        assert_eq!(
            "udp:239.74.163.2:5000?ttl=1".parse::<Address>().unwrap(),
            Address::Udp { group, port: 5000, ttl: 1 }
        );
        let Address::Zenoh(zenoh) =
            "zenoh:cell/bus?listen=tcp/127.0.0.1:7000&connect=tcp/10.0.0.1:7000#iface=eth0&scouting=off&insecure=1"
                .parse()
                .unwrap()
        else {
            panic!("not a zenoh address");
        };
        assert_eq!(zenoh.key, "cell/bus");
        assert_eq!(zenoh.listen, ["tcp/127.0.0.1:7000"]);
        assert_eq!(zenoh.connect, ["tcp/10.0.0.1:7000#iface=eth0"]);
        assert!(!zenoh.scouting);
        assert_eq!("loopback:".parse::<Address>().unwrap(), Address::Loopback);
    }

    #[test]
    fn says_what_is_wrong_and_what_is_allowed() {
        for (address, expected) in [
            ("vcan0", "`vcan0` is not a bus address"),
            ("tcp:1.2.3.4", "is not a bus address"),
            ("can:", "1 to 15 printable characters"),
            ("can:a/b", "interface `a/b`"),
            ("can:vcan0?ttl=1", "a CAN interface takes none"),
            ("udp:192.168.0.1", "group `192.168.0.1` is not allowed: 224.0.0.0"),
            ("udp:239.1.1.1:0", "port `0` is not allowed: 1 to 65535"),
            ("udp:239.1.1.1:65536", "port `65536`"),
            ("udp:239.1.1.1?ttl=256", "ttl `256`"),
            ("udp:239.1.1.1?hops=2", "option `hops` is not allowed: `ttl` is"),
            ("zenoh:", "one key without wildcards"),
            ("zenoh:a/*", "one key without wildcards"),
            (
                "zenoh:a//b",
                "key `a//b` is not allowed: one key without wildcards and without empty",
            ),
            ("zenoh:/a", "key `/a`"),
            ("zenoh:a/", "key `a/`"),
            ("zenoh:/", "key `/`"),
            ("zenoh://", "key `//`"),
            ("zenoh:a b", "key `a b`"),
            ("zenoh:a$*", "key `a$*`"),
            ("zenoh:a?listen=tcp/0.0.0.0:7447", "endpoint `tcp/0.0.0.0:7447` is not allowed"),
            ("zenoh:a?connect=tcp/10.0.0.1:7447", "`insecure=1` allows it"),
            ("zenoh:a?insecure=yes", "insecure `yes` is not allowed: `1` is"),
            ("udp:ff15:7079:7468:6f6e:6465:6d6f:6d63:6173", "an IPv4 group"),
            ("udp:[ff15::1]", "group `[ff15::1]` is not allowed: an IPv4 group"),
            ("udp:[ff15::1]:5000", "an IPv4 group"),
            ("udp:ff15::1?ttl=1", "an IPv4 group"),
            ("zenoh:a?scouting=maybe", "scouting `maybe`"),
            ("zenoh:a?listen", "write NAME=VALUE"),
        ] {
            let line = refused(address);
            assert!(line.contains(expected) && line.contains(address), "{address}: {line}");
            assert!(!line.contains('\n'), "{line}");
        }
    }

    #[test]
    fn loopback_by_address_is_refused_with_the_reason() {
        let line = crate::fieldbus::transport::open("loopback:").err().unwrap().to_string();
        assert!(line.contains("same process"), "{line}");
    }
}
