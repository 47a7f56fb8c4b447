//! Reach of a Zenoh session, and limits on foreign traffic: the settings common to all sessions of
//! this program. Cold.
//!
//! By default nothing leaves the host: a session listens on the host's own address, and discovers
//! others by multicast on the loopback interface. No session tells its peers of other peers
//! (gossip), unless its endpoints are all given: knowledge about this host must not be carried off
//! it by another session.

use serde_json::Value;

/// The default address of a session: a free port that only this host reaches.
const HOST_ONLY: &str = "tcp/127.0.0.1:0";
/// The interface on which sessions of this host discover each other.
const HOST_INTERFACE: &str = "127.0.0.1";
/// Longest message accepted from a peer, in bytes: a frame of a bus has ten, and a query of a
/// monitor none.
const MESSAGE_MAX: usize = 1 << 16;
/// Largest number of peers at a time.
const SESSIONS_MAX: usize = 64;
/// Largest number of connections that are not yet identified.
const PENDING_MAX: usize = 16;
/// Longest time of such a connection.
const ACCEPT_MAX_MS: u64 = 2_000;
/// Time that a peer that does not read may block reliable data before it is dropped.
const BLOCK_MAX_US: u64 = 1_000_000;

/// Reach of a session.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach<'a> {
    /// Endpoints to listen on; if empty, a free port of the host's own address.
    pub(crate) listen: &'a [String],
    /// Endpoints to connect to.
    pub(crate) connect: &'a [String],
    /// True to discover others by multicast.
    pub(crate) scouting: bool,
    /// True if multicast may leave the host where endpoints are named.
    pub(crate) scouting_off_host: bool,
    /// Multicast group; `None` for that of all Zenoh programs.
    pub(crate) group: Option<&'a str>,
}

impl Reach<'_> {
    /// Returns the configuration of the session.
    ///
    /// # Errors
    /// Zenoh's, for a text that is not an endpoint.
    pub(crate) fn configuration(&self) -> zenoh::Result<zenoh::Config> {
        let is_named = !(self.listen.is_empty() && self.connect.is_empty());
        let mut config = zenoh::Config::default();
        let mut set = |key: &str, value: Value| config.insert_json5(key, &value.to_string());
        set("mode", "peer".into())?;
        let own = [HOST_ONLY.to_owned()];
        let listen = if self.listen.is_empty() { &own[..] } else { self.listen };
        set("listen/endpoints", listen.into())?;
        set("connect/endpoints", self.connect.into())?;
        set("scouting/multicast/enabled", self.scouting.into())?;
        if !(is_named && self.scouting_off_host) {
            set("scouting/multicast/interface", HOST_INTERFACE.into())?;
            set("scouting/multicast/ttl", 0.into())?;
        }
        if let Some(group) = self.group {
            set("scouting/multicast/address", group.into())?;
        }
        set("scouting/gossip/enabled", false.into())?;
        set("transport/link/rx/max_message_size", MESSAGE_MAX.into())?;
        set("transport/unicast/max_sessions", SESSIONS_MAX.into())?;
        set("transport/unicast/accept_pending", PENDING_MAX.into())?;
        set("transport/unicast/accept_timeout", ACCEPT_MAX_MS.into())?;
        set(
            "transport/link/tx/queue/congestion_control/block/wait_before_close",
            BLOCK_MAX_US.into(),
        )?;
        Ok(config)
    }
}

/// Returns whether only programs of this host can reach an endpoint.
pub(crate) fn stays_on_host(endpoint: &str) -> bool {
    let (protocol, rest) = endpoint.split_once('/').unwrap_or(("", endpoint));
    if protocol.starts_with("unix") {
        return true;
    }
    let place = rest.split(['?', '#']).next().unwrap_or(rest);
    let host = place.rsplit_once(':').map_or(place, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost"
        || host.parse::<std::net::IpAddr>().is_ok_and(|address| match address {
            std::net::IpAddr::V4(address) => address.is_loopback(),
            std::net::IpAddr::V6(address) => {
                address.is_loopback()
                    || address.to_ipv4_mapped().is_some_and(|mapped| mapped.is_loopback())
            }
        })
}

/// Returns Zenoh's message without its source locations.
pub(crate) fn reason(error: &zenoh::Error) -> String {
    without_places(&error.to_string())
}

/// Removes every ` at FILE.rs:LINE.` and line end from a text.
fn without_places(text: &str) -> String {
    let mut words = Vec::new();
    for word in text.split_whitespace() {
        let is_place = word.rsplit_once(':').is_some_and(|(file, line)| {
            let line = line.trim_end_matches([')', ',', '.']);
            let is_source = file.rsplit_once('.').is_some_and(|(_, kind)| kind == "rs");
            is_source && !line.is_empty() && line.bytes().all(|b| b.is_ascii_digit())
        });
        if !is_place {
            words.push(word);
        } else if words.last() == Some(&"at") {
            words.pop();
        }
    }
    words.join(" ").trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_hosts_own_addresses_stay_on_it() {
        for own in [
            "tcp/127.0.0.1:7447",
            "tcp/127.8.0.1:0",
            "tcp/[::1]:7447",
            "tcp/[::ffff:127.0.0.1]:7447",
            "udp/localhost:7447",
            "unixsock-stream//tmp/bus",
            "tcp/127.0.0.1:7447#iface=lo",
        ] {
            assert!(stays_on_host(own), "{own}");
        }
        for far in [
            "tcp/0.0.0.0:7447",
            "tcp/[::]:7447",
            "tcp/10.0.0.1:7447",
            "tls/192.168.1.5:7447",
            "tcp/machine.local:7447",
            "tcp/localhost.example.org:7447",
            "tcp/127.0.0.1.example.org:7447",
            "nonsense",
        ] {
            assert!(!stays_on_host(far), "{far}");
        }
    }

    #[test]
    fn what_zenoh_says_is_told_without_its_source() {
        let text = "Empty chunk at /somewhere/registry/src/key_expr.rs:123. - Caused by no \
                    value at /somewhere/else.rs:7.";
        assert_eq!(without_places(text), "Empty chunk - Caused by no value");
        assert_eq!(without_places("Address in use (os error 98)"), "Address in use (os error 98)");
    }

    #[test]
    fn a_session_without_endpoints_is_configured_to_stay() {
        let reach = Reach {
            listen: &[],
            connect: &[],
            scouting: true,
            scouting_off_host: true,
            group: None,
        };
        let config = reach.configuration().unwrap();
        let get = |key| config.get_json(key).unwrap();
        assert!(get("listen/endpoints").contains("tcp/127.0.0.1:0"));
        assert!(get("scouting/multicast/interface").contains("127.0.0.1"));
        assert_eq!(get("scouting/multicast/ttl"), "0");
        assert_eq!(get("scouting/gossip/enabled"), "false");
    }
}
