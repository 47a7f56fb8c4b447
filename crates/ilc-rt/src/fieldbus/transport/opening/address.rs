//! Bus addresses in a cell description or on a command line.

use std::str::FromStr;

use super::SCHEMES;
use super::error::OpenError;
use super::format::Format;
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

    /// Returns the format of its frames.
    pub fn format(&self) -> Format {
        self.place.format()
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

/// Returns the format of the frames at an address; that of classical CAN for one that cannot be opened.
pub fn format_of(address: &str) -> Format {
    address.parse().map_or_else(|_| Format::default(), |address: Address| address.format())
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
        assert!(!syntaxes(false).contains("loopback:") && syntaxes(true).contains("or loopback:"));
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
            ("can:vcan0?ttl=1", "option `ttl` is not allowed: `fd` and `data_bitrate` are"),
            ("can:vcan0?fd=yes", "fd `yes` is not allowed: `1` for CAN FD"),
            ("can:vcan0?fd=1&data_bitrate=9000000", "data_bitrate `9000000` is not allowed: 10000"),
            ("can:vcan0?data_bitrate=5000000", "with `fd=1` only"),
            ("udp:239.1.1.1?fd=2", "fd `2` is not allowed"),
            ("zenoh:a?fd=2", "fd `2` is not allowed"),
            ("loopback:?bitrate=2000000", "bitrate `2000000` is not allowed: 10000 to 1000000"),
            (
                "loopback:?rate=1",
                "option `rate` is not allowed: `bitrate`, `fd` and `data_bitrate`",
            ),
            ("loopback:here", "place `here` is not allowed: nothing"),
            ("udp:192.168.0.1", "group `192.168.0.1` is not allowed: 224.0.0.0"),
            ("udp:239.1.1.1:0", "port `0` is not allowed: 1 to 65535"),
            ("udp:239.1.1.1:65536", "port `65536`"),
            ("udp:239.1.1.1?ttl=256", "ttl `256`"),
            ("udp:239.1.1.1?hops=2", "option `hops` is not allowed: `ttl`, `fd` and"),
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
    fn the_format_of_the_frames_is_part_of_the_address() {
        assert_eq!(format_of("can:can0"), Format::default());
        assert_eq!(format_of("no bus"), Format::default());
        for address in
            ["can:can0?fd=1&data_bitrate=5000000", "udp:239.1.1.1?fd=1&data_bitrate=5000000"]
        {
            let format = format_of(address);
            assert_eq!(
                (format.payload_max(), format.data_bit_s),
                (64, Some(5_000_000)),
                "{address}"
            );
        }
        assert_eq!(format_of("zenoh:a?fd=1").payload_max(), 64);
        let kept = format_of("loopback:?bitrate=500000");
        assert_eq!((kept.kept_bit_s, kept.payload_max()), (Some(500_000), 8));
    }

    #[test]
    fn loopback_by_address_is_refused_with_the_reason() {
        let line = Address::from_str("loopback:").unwrap().open().err().unwrap().to_string();
        assert!(line.contains("same process"), "{line}");
    }
}
