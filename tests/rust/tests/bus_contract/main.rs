//! The contract of every transport, tested on each of them.
//!
//! The cases are written once against the `Bus` trait; each transport provides two endpoints of one
//! bus. SocketCAN needs an interface: `tests/vcan/run` provides one where the machine has none; `can` has what only
//! it does.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test may panic, and prints figures and what it skips"
)]

mod can;

use std::net::{TcpListener, UdpSocket};
use std::time::{Duration, Instant};

use ilc_rt::fieldbus::transport::{self, ZenohBus, ZenohSettings, loopback, udp_codec};
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_tests::counting::{Counting, allocations};

use can::{can_ends, can_interface};

type Ends = (Box<dyn Bus>, Box<dyn Bus>);

/// Long enough for a loaded machine; a passing test never waits this long.
const PATIENCE: Duration = Duration::from_secs(20);

/// Small enough for the smallest buffer of any transport.
const BURST: usize = 50;

/// Returns the `n`-th frame of a sequence: identifier, length and data all follow from `n`.
fn numbered(n: usize) -> Frame {
    let data = (n as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15).to_le_bytes();
    Frame::new(u16::try_from(n % 0x800).unwrap(), &data[..n % 9]).unwrap()
}

fn receive(bus: &mut dyn Bus) -> Frame {
    bus.recv(PATIENCE).unwrap().expect("a frame was sent and did not arrive")
}

fn arrives_whole_and_in_order((mut a, mut b): Ends) {
    for first in (0..1000).step_by(BURST) {
        for n in first..first + BURST {
            a.send(&numbered(n)).unwrap();
        }
        for n in first..first + BURST {
            assert_eq!(receive(&mut *b), numbered(n));
        }
    }
    assert_eq!(b.recv(Duration::ZERO).unwrap(), None, "more frames than were sent");
}

fn does_not_hear_itself((mut a, mut b): Ends) {
    for n in 0..BURST {
        a.send(&numbered(n)).unwrap();
    }
    // Once the other side has received them all, an echo would be here too.
    for n in 0..BURST {
        assert_eq!(receive(&mut *b), numbered(n));
    }
    assert_eq!(a.recv(Duration::from_millis(20)).unwrap(), None);
    // Own frames in the queue do not hide those of the other side.
    b.send(&numbered(7)).unwrap();
    assert_eq!(receive(&mut *a), numbered(7));
}

fn returns_at_once_without_a_timeout((mut a, _b): Ends) {
    // The quickest: this computer may stall, but a bus that waits does so each time.
    let look = |_| {
        let start = Instant::now();
        assert_eq!(a.recv(Duration::ZERO).unwrap(), None);
        start.elapsed()
    };
    let quickest = (0..100).map(look).min().unwrap();
    assert!(quickest < Duration::from_millis(1), "an empty look took {quickest:?}");
}

fn waits_as_long_as_asked((mut a, _b): Ends) {
    for asked in [Duration::from_micros(300), Duration::from_millis(40)] {
        let wait = |_| {
            let start = Instant::now();
            assert_eq!(a.recv(asked).unwrap(), None);
            let waited = start.elapsed();
            assert!(waited >= asked, "{waited:?}");
            waited
        };
        let shortest = (0..5).map(wait).min().unwrap();
        assert!(shortest < asked + Duration::from_millis(500), "{shortest:?}");
    }
}

fn is_woken_by_a_frame((mut a, mut b): Ends) {
    let receiver = std::thread::spawn(move || {
        let start = Instant::now();
        (receive(&mut *b), start.elapsed())
    });
    // By then the receiver sleeps, or it finds the frame at once: both must work.
    std::thread::sleep(Duration::from_millis(30));
    a.send(&numbered(8)).unwrap();
    let (frame, waited) = receiver.join().unwrap();
    assert_eq!(frame, numbered(8));
    assert!(waited < PATIENCE / 2, "slept through its frame: {waited:?}");
}

fn carries_both_directions_at_once((a, b): Ends) {
    const N: usize = 1000;
    // Two sides that each run this far ahead have at most a burst in flight between them.
    const AHEAD: usize = BURST / 2;
    fn talk(mut bus: Box<dyn Bus>) -> Box<dyn Bus> {
        let (mut n_sent, mut n_received) = (0, 0);
        while n_received < N {
            while n_sent < N && n_sent < n_received + AHEAD {
                bus.send(&numbered(n_sent)).unwrap();
                n_sent += 1;
            }
            assert_eq!(receive(&mut *bus), numbered(n_received));
            n_received += 1;
        }
        bus
    }
    let other = std::thread::spawn(move || talk(b));
    let _a = talk(a);
    let _b = other.join().unwrap();
}

fn never_blocks_the_sender((mut a, b): Ends) {
    let start = Instant::now();
    let send = |bus: &mut dyn Bus, n| match bus.send(&numbered(n)) {
        Ok(()) | Err(BusError::Full | BusError::Closed) => {}
        Err(error) => panic!("{error}"),
    };
    for n in 0..10_000 {
        send(&mut *a, n);
    }
    drop(b);
    for n in 0..1000 {
        send(&mut *a, n);
    }
    let elapsed = start.elapsed();
    assert!(elapsed < 3 * PATIENCE, "11000 frames nobody takes took {elapsed:?}");
}

fn allocates_nothing_in_the_callers_thread((mut a, mut b): Ends) {
    let mut exchange = |n| {
        a.send(&numbered(n)).unwrap();
        assert_eq!(receive(&mut *b), numbered(n));
        assert_eq!(b.recv(Duration::ZERO).unwrap(), None);
        assert_eq!(a.recv(Duration::from_micros(50)).unwrap(), None);
    };
    exchange(0);
    let before = allocations();
    for n in 0..500 {
        exchange(n);
    }
    assert_eq!(allocations() - before, 0);
    drop(std::hint::black_box(Box::new(numbered(1))));
    assert_ne!(allocations() - before, 0, "the count counts");
}

/// Frames of every length that CAN FD has.
fn carries_long_frames((mut a, mut b): Ends) {
    let bytes: [u8; 64] = std::array::from_fn(|n| u8::try_from(n * 3 + 1).unwrap());
    let lengths = (0..=8).chain([12, 16, 20, 24, 32, 48, 64]);
    let frames: Vec<Frame> = lengths.map(|n| Frame::fd(0x181, &bytes[..n]).unwrap()).collect();
    for _ in 0..20 {
        for frame in &frames {
            a.send(frame).unwrap();
        }
        for frame in &frames {
            assert_eq!(receive(&mut *b), *frame);
        }
    }
    let before = allocations();
    for frame in &frames {
        b.send(frame).unwrap();
        assert_eq!(receive(&mut *a), *frame);
    }
    assert_eq!(allocations() - before, 0);
}

fn refuses_long_frames((mut a, mut b): Ends) {
    assert_eq!(a.send(&Frame::fd(0x181, &[0; 12]).unwrap()), Err(BusError::TooLong));
    a.send(&numbered(8)).unwrap();
    assert_eq!(receive(&mut *b), numbered(8));
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

macro_rules! contract {
    ($transport:ident, $make:expr, [$($case:ident),* $(,)?]) => {
        mod $transport {
            $(#[test]
            fn $case() {
                if let Some(ends) = $make {
                    super::$case(ends);
                }
            })*
        }
    };
    ($transport:ident, $make:expr) => {
        contract!($transport, $make, [
            arrives_whole_and_in_order,
            does_not_hear_itself,
            returns_at_once_without_a_timeout,
            waits_as_long_as_asked,
            is_woken_by_a_frame,
            carries_both_directions_at_once,
            never_blocks_the_sender,
            allocates_nothing_in_the_callers_thread,
        ]);
    };
}

contract!(over_loopback, Some(super::loopback_ends()));
contract!(over_udp, Some(super::udp_ends(&super::udp_address())));
contract!(over_zenoh, Some(super::boxed(super::zenoh_ends())));
contract!(over_can, super::can_interface().map(|name| super::can_ends(&name, "")));
contract!(over_udp_fd, Some(super::udp_ends(&format!("{}?fd=1", super::udp_address()))));
contract!(over_can_fd, super::can_interface().map(|name| super::can_ends(&name, "?fd=1")));

contract!(long_over_loopback, Some(super::loopback_ends()), [carries_long_frames]);
contract!(
    long_over_udp,
    Some(super::udp_ends(&format!("{}?fd=1", super::udp_address()))),
    [carries_long_frames]
);
contract!(
    long_over_zenoh,
    Some(super::boxed(super::zenoh_ends_with("&fd=1"))),
    [carries_long_frames]
);
contract!(
    long_over_can,
    super::can_interface().map(|name| super::can_ends(&name, "?fd=1")),
    [carries_long_frames]
);
contract!(short_over_udp, Some(super::udp_ends(&super::udp_address())), [refuses_long_frames]);
contract!(short_over_zenoh, Some(super::boxed(super::zenoh_ends())), [refuses_long_frames]);
contract!(
    short_over_can,
    super::can_interface().map(|name| super::can_ends(&name, "")),
    [refuses_long_frames]
);

fn loopback_ends() -> Ends {
    let (a, b) = loopback::pair(64).unwrap();
    (Box::new(a), Box::new(b))
}

/// Returns a multicast address with a unique port: it stays reserved on the host's own address.
fn udp_address() -> String {
    let holder = UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = holder.local_addr().unwrap().port();
    std::mem::forget(holder);
    format!("udp:239.74.163.77:{port}")
}

fn udp_ends(address: &str) -> Ends {
    (transport::open(address).unwrap(), transport::open(address).unwrap())
}

fn zenoh_ends() -> (ZenohBus, ZenohBus) {
    zenoh_ends_with("")
}

fn zenoh_ends_with(options: &str) -> (ZenohBus, ZenohBus) {
    for _ in 0..10 {
        // Free when queried; if another process takes it before Zenoh does, the next one will do.
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let open = |role: &str| {
            let address =
                format!("zenoh:test/bus?{role}=tcp/127.0.0.1:{port}&scouting=off{options}");
            let settings: ZenohSettings = address.parse().unwrap();
            ZenohBus::open(&settings)
        };
        let Ok(a) = open("listen") else { continue };
        let b = open("connect").unwrap();
        assert!(a.wait_for_peer(PATIENCE) && b.wait_for_peer(PATIENCE), "no match on port {port}");
        return (a, b);
    }
    panic!("no free port in ten attempts");
}

fn boxed((a, b): (ZenohBus, ZenohBus)) -> Ends {
    (Box::new(a), Box::new(b))
}

#[test]
fn udp_skips_what_is_no_frame_of_ours() {
    let address = udp_address();
    let (mut a, mut b) = udp_ends(&address);
    let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
    stranger.connect(address.strip_prefix("udp:").unwrap()).unwrap();
    let good = udp_codec::encode(&numbered(5)).unwrap();
    let flagged = |name: &str| {
        let mut bytes = good.as_bytes().to_vec();
        let at = bytes.windows(name.len()).position(|window| window == name.as_bytes()).unwrap();
        assert_eq!(bytes[at + name.len()], 0xC2, "a msgpack false");
        bytes[at + name.len()] = 0xC3;
        bytes
    };
    let foreign: [&[u8]; 9] = [
        b"",
        b"hello",
        &[0xFF; 2000],
        &good.as_bytes()[..100],
        &[good.as_bytes(), b"more"].concat(),
        &flagged("is_extended_id"),
        &flagged("is_remote_frame"),
        &flagged("is_error_frame"),
        &flagged("is_fd"),
    ];
    for datagram in foreign {
        stranger.send(datagram).unwrap();
    }
    // A well-formed frame from any sender is accepted; it arrives behind all the others.
    stranger.send(good.as_bytes()).unwrap();
    for bus in [&mut a, &mut b] {
        assert_eq!(receive(&mut **bus), numbered(5));
        assert_eq!(bus.recv(Duration::ZERO).unwrap(), None);
    }
}

#[test]
fn udp_groups_on_one_port_are_different_buses() {
    let address = udp_address();
    let (mut a, mut b) = udp_ends(&address);
    let mut elsewhere = transport::open(&address.replace("163.77", "163.78")).unwrap();
    elsewhere.send(&numbered(1)).unwrap();
    a.send(&numbered(2)).unwrap();
    assert_eq!(receive(&mut *b), numbered(2));
    assert_eq!(a.recv(Duration::from_millis(20)).unwrap(), None);
    assert_eq!(elsewhere.recv(Duration::ZERO).unwrap(), None);
}

#[test]
fn zenoh_skips_what_is_no_frame() {
    use zenoh::Wait;

    let (mut a, b) = zenoh_ends();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let address = format!("zenoh:test/strangers?listen=tcp/127.0.0.1:{port}&scouting=off");
    let settings: ZenohSettings = address.parse().unwrap();
    let mut bus = ZenohBus::open(&settings).unwrap();
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("listen/endpoints", "[]".to_owned()),
        ("connect/endpoints", format!("[\"tcp/127.0.0.1:{port}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    let session = zenoh::open(config).wait().unwrap();
    let stranger = session.declare_publisher("test/strangers/someone").wait().unwrap();
    let end = Instant::now() + PATIENCE;
    while !stranger.matching_status().wait().unwrap().matching() {
        assert!(Instant::now() < end, "the stranger found nobody");
        std::thread::sleep(Duration::from_millis(1));
    }
    let garbage: [&[u8]; 5] = [&[], &[1], &[0, 8], &[0xFF; 10], &[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]];
    for payload in garbage {
        stranger.put(payload).wait().unwrap();
    }
    stranger.put(&[0x81_u8, 0x01, 9, 8][..]).wait().unwrap();
    assert_eq!(receive(&mut bus), Frame::new(0x181, &[9, 8]).unwrap());
    assert_eq!(bus.recv(Duration::ZERO).unwrap(), None);
    // Another key is another bus.
    assert_eq!(a.recv(Duration::ZERO).unwrap(), None);
    drop((a, b));
}

#[test]
fn a_loopback_whose_other_end_is_gone_is_closed() {
    let (mut a, mut b) = loopback::pair(4).unwrap();
    a.send(&numbered(3)).unwrap();
    drop(a);
    assert_eq!(b.recv(Duration::ZERO), Ok(Some(numbered(3))), "the last frame is still there");
    assert_eq!(b.recv(Duration::ZERO), Err(BusError::Closed));
    assert_eq!(b.recv(PATIENCE), Err(BusError::Closed));
    assert_eq!(b.send(&numbered(3)), Err(BusError::Closed));
}

#[test]
fn a_receiver_asleep_wakes_when_the_other_end_goes() {
    let (a, mut b) = loopback::pair(4).unwrap();
    let receiver = std::thread::spawn(move || b.recv(PATIENCE));
    std::thread::sleep(Duration::from_millis(30));
    let start = Instant::now();
    drop(a);
    assert_eq!(receiver.join().unwrap(), Err(BusError::Closed));
    assert!(start.elapsed() < PATIENCE / 2);
}

/// Prints the round-trip time of a frame; run it by name with `--run-ignored all`.
#[test]
#[ignore = "prints figures, asserts nothing about them"]
fn round_trip_times() {
    let mut ends: Vec<(&str, Ends)> = vec![
        ("loopback pair", loopback_ends()),
        ("udp multicast", udp_ends(&udp_address())),
        ("zenoh", boxed(zenoh_ends())),
    ];
    if let Some(interface) = can_interface() {
        ends.push(("socketcan", can_ends(&interface, "")));
    }
    for (name, (mut a, mut b)) in ends {
        let echo = std::thread::spawn(move || {
            loop {
                let frame = receive(&mut *b);
                b.send(&frame).unwrap();
                if frame.id() == 0x7FF {
                    return b;
                }
            }
        });
        let mut round_trip = |id| {
            let start = Instant::now();
            a.send(&Frame::new(id, &[0; 8]).unwrap()).unwrap();
            receive(&mut *a);
            start.elapsed()
        };
        let mut times: Vec<Duration> = (0..3000).map(|_| round_trip(1)).skip(500).collect();
        round_trip(0x7FF);
        drop(echo.join().unwrap());
        times.sort_unstable();
        let at = |share: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
            times[((times.len() - 1) as f64 * share) as usize]
        };
        println!("{name}: median {:?}, p99 {:?}, max {:?}", at(0.5), at(0.99), at(1.0));
    }
}
