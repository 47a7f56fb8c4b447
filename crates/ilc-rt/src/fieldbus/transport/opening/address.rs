//! Bus addresses in a cell description or on a command line.

use std::str::FromStr;

use super::SCHEMES;
use super::error::OpenError;
use super::scheme::{Parts, Place, Scheme};
use crate::fieldbus::Bus;

/// A parsed and checked bus address.
#[derive(Debug)]
pub struct Address {
    scheme: &'static Scheme,
    place: Box<dyn Place>,
}

impl Address {
    /// Returns the kind of bus.
    pub fn scheme(&self) -> &'static Scheme {
        self.scheme
    }

    /// Returns whether no frame leaves this host.
    pub fn stays_on_host(&self) -> bool {
        self.place.stays_on_host()
    }

    /// Opens the bus.
    ///
    /// # Errors
    /// [`OpenError`]: one line with the address, what is wrong with it and what is allowed. A bus with
    /// both ends are in one process, so the address alone is not enough.
    pub fn open(&self) -> Result<Box<dyn Bus>, OpenError> {
        self.place.open()
    }
}

impl FromStr for Address {
    type Err = OpenError;

    fn from_str(address: &str) -> Result<Self, OpenError> {
        let scheme =
            scheme_of(address).ok_or_else(|| OpenError::Scheme { address: address.to_owned() })?;
        let rest = address.split_once(':').map_or("", |(_, rest)| rest);
        Ok(Self { scheme, place: (scheme.parse)(&Parts::new(address, rest))? })
    }
}

/// Returns the kind of bus in front of an address's colon, if it exists.
pub fn scheme_of(address: &str) -> Option<&'static Scheme> {
    let (name, _) = address.split_once(':')?;
    SCHEMES.into_iter().find(|scheme| scheme.name == name)
}

/// Returns the syntax of the allowed addresses, as a sentence lists them; without in-process buses
/// for a program without drives.
pub fn syntaxes(with_in_process: bool) -> String {
    let known = SCHEMES.iter().filter(|scheme| with_in_process || !scheme.in_process);
    let known: Vec<&str> = known.map(|scheme| scheme.syntax).collect();
    match known.split_last() {
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::ZenohSettings;
    use super::*;

    fn refused(address: &str) -> String {
        address.parse::<Address>().unwrap_err().to_string()
    }

    #[test]
    fn every_kind_of_bus_takes_its_own_example() {
        for scheme in SCHEMES {
            let address: Address = scheme.example.parse().unwrap();
            assert_eq!(address.scheme().name, scheme.name);
            assert!(scheme.syntax.starts_with(scheme.name), "{scheme:?}");
            assert_eq!(address.stays_on_host(), !scheme.has_bits, "{scheme:?}");
            assert_eq!(
                matches!(address.open(), Err(OpenError::NeedsPeer { .. })),
                scheme.in_process
            );
        }
        assert!(!"udp:239.1.1.1?ttl=1".parse::<Address>().unwrap().stays_on_host());
        assert!(!syntaxes(false).contains("loopback:") && syntaxes(true).ends_with("or loopback:"));
    }

    #[test]
    fn a_zenoh_address_names_its_endpoints() {
        let zenoh: ZenohSettings =
            "zenoh:cell/bus?listen=tcp/127.0.0.1:7000&connect=tcp/10.0.0.1:7000#iface=eth0&scouting=off&insecure=1"
                .parse()
                .unwrap();
        assert_eq!(zenoh.key, "cell/bus");
        assert_eq!(zenoh.listen, ["tcp/127.0.0.1:7000"]);
        assert_eq!(zenoh.connect, ["tcp/10.0.0.1:7000#iface=eth0"]);
        assert!(!zenoh.scouting);
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
        let line = Address::from_str("loopback:").unwrap().open().err().unwrap().to_string();
        assert!(line.contains("same process"), "{line}");
    }
}
