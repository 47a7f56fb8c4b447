//! Bring-up against the simulated nodes: findings, refusals, robustness.

use std::time::Duration;

use ilc_rt::fieldbus::bring_up::{
    BringUpError, DriveSetup, SdoClient, SdoError, bring_up, bring_up_encoder,
};
use ilc_rt::fieldbus::canopen::{AbortCode, Heartbeat, NmtState, NodeId, ObjectAddress};
use ilc_rt::fieldbus::cia402::{EncoderSample, Mode, pdo_map};
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_sim::{ClockMode, Machine};

use crate::bench::{ANSWER, Bench, COUNTS_PER_M, START_M, node, setup};

#[test]
fn a_drive_says_who_it_is_and_is_configured() {
    for mode in [Mode::Csp, Mode::Csv] {
        let mut bench = Bench::new(ClockMode::LockStep);
        let identity = bring_up(&mut bench.bus, &setup(mode)).unwrap();
        assert_eq!(identity.device_type & 0xFFFF, 402);
        // Profile position and velocity, homing, and what the controller commands.
        let cyclic = Mode::ALL.iter().fold(0, |bits, mode| bits | mode.supported_bit());
        assert_eq!(identity.supported_modes, 0x25 | cyclic);
        assert_eq!(identity.identity, [0, 402, 1, 1]);
        assert_eq!(bench.read(0x6061, 0), u32::from(mode.code().cast_unsigned()));
        assert_eq!(bench.read(0x60C2, 1), 1);
        assert_eq!(bench.read(0x60C2, 2).to_le_bytes()[0].cast_signed(), -3);
        assert_eq!(bench.read(0x6065, 0), 5000);
        for (sub, object) in (1..).zip(pdo_map::command_map(mode)) {
            assert_eq!(bench.read(0x1600, sub), object.entry());
        }
        assert_eq!(bench.read(0x1400, 1), 0x4000_0201);
        assert_ne!(bench.read(0x1802, 1) & 0x8000_0000, 0, "unused PDOs are off");
    }
}

#[test]
fn the_encoder_sends_both_coordinates_at_sync() {
    let mut bench = Bench::started(Mode::Csp);
    let identity = bring_up_encoder(&mut bench.bus, node(10), ANSWER).unwrap();
    assert_eq!(identity.device_type & 0xFFFF, 406);
    bench.bus.send(&ilc_rt::fieldbus::canopen::NmtCommand::Start.frame(None)).unwrap();
    let answer = bench.sync();
    let samples: Vec<_> =
        answer.frames.iter().filter_map(|f| EncoderSample::decode(f, node(10))).collect();
    #[expect(clippy::cast_possible_truncation, reason = "a small count")]
    let expected = ((START_M + 0.001) * COUNTS_PER_M).round() as i32;
    assert_eq!(samples, [EncoderSample { x_counts: expected, y_counts: expected }]);
}

#[test]
fn a_missing_node_is_named_with_the_question_to_ask() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let missing = DriveSetup { node: node(5), ..setup(Mode::Csp) };
    let error = bring_up(&mut bench.bus, &missing).unwrap_err();
    assert_eq!(
        error.to_string(),
        "node 5: no boot-up within 2s after reset; is it powered, on this bus and set to this number?"
    );
}

#[test]
fn a_node_of_another_kind_is_refused() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let encoder = DriveSetup { node: node(10), ..setup(Mode::Csp) };
    let error = bring_up(&mut bench.bus, &encoder).unwrap_err();
    assert!(matches!(error, BringUpError::Profile { expected: 402, found: 406, .. }), "{error}");
    let error = bring_up_encoder(&mut bench.bus, node(1), ANSWER).unwrap_err();
    assert!(matches!(error, BringUpError::Profile { expected: 406, found: 402, .. }), "{error}");
}

#[test]
fn a_cycle_that_no_drive_can_hold_is_refused_before_anything_is_sent() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let odd = DriveSetup { cycle_us: 1001, ..setup(Mode::Csp) };
    let error = bring_up(&mut bench.bus, &odd).unwrap_err();
    assert!(error.to_string().starts_with("node 1: interpolation period: a cycle of 1001 us"));
    assert!(bench.collect().frames.is_empty());
}

#[test]
fn a_refusal_names_node_object_and_reason() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let client = SdoClient::new(node(1), ANSWER);
    let error = client.download(&mut bench.bus, 0x6041, 0, &[0, 0]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "node 1: object 0x6041:00: refused with abort code 0x06010002 (object is read-only)"
    );
    let absent = client.upload(&mut bench.bus, 0x5FFF, 0).unwrap_err();
    let address = ObjectAddress::new(0x5FFF, 0);
    let code = AbortCode::NoObject;
    assert_eq!(absent, SdoError::Aborted { node: node(1), address, code });
}

#[test]
fn texts_go_both_ways_in_segments() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let client = SdoClient::new(node(1), ANSWER);
    let name = client.upload(&mut bench.bus, 0x1008, 0).unwrap();
    assert_eq!(name, b"ilc-sim CiA 402 drive");
    for label in
        ["", "x", "four", "exactly 7", "twenty-one characters", "a label of thirty-two characters"]
    {
        client.download(&mut bench.bus, 0x2000, 0, label.as_bytes()).unwrap();
        assert_eq!(client.upload(&mut bench.bus, 0x2000, 0).unwrap(), label.as_bytes());
    }
}

/// A bus with constant traffic of other nodes.
struct Crowded {
    inner: InProcess<Machine>,
    foreign: Vec<Frame>,
}

impl Bus for Crowded {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let other = node(77);
        let heartbeat = Heartbeat { node: other, state: NmtState::BootUp }.encode();
        let answer = Frame::new(0x580 + 77, &[0x60, 0x40, 0x60, 0, 0, 0, 0, 0]).unwrap();
        let status = Frame::new(0x180 + 77, &[0; 8]).unwrap();
        self.foreign.extend([heartbeat, answer, status]);
        self.inner.send(frame)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        match self.foreign.pop() {
            Some(frame) => Ok(Some(frame)),
            None => self.inner.recv(timeout),
        }
    }
}

#[test]
fn foreign_traffic_is_ignored() {
    let bench = Bench::new(ClockMode::LockStep);
    let mut bus = Crowded { inner: bench.bus, foreign: Vec::new() };
    bring_up(&mut bus, &setup(Mode::Csp)).unwrap();
}

/// A bus that loses every n-th frame towards the nodes.
struct Lossy {
    inner: InProcess<Machine>,
    every: usize,
    n_sent: usize,
}

impl Bus for Lossy {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.n_sent += 1;
        if self.n_sent.is_multiple_of(self.every) { Ok(()) } else { self.inner.send(frame) }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.inner.recv(timeout)
    }
}

#[test]
fn single_lost_requests_are_asked_again() {
    let bench = Bench::new(ClockMode::LockStep);
    let mut bus = Lossy { inner: bench.bus, every: 5, n_sent: 0 };
    bring_up(&mut bus, &setup(Mode::Csp)).unwrap();
    assert!(bus.n_sent > 40);
}

#[test]
fn a_silent_server_is_reported_with_its_object() {
    let mut bench = Bench::new(ClockMode::LockStep);
    bench.bus.responder_mut().mute(node(1));
    let short = Duration::from_millis(5);
    let error = SdoClient::new(node(1), short).upload(&mut bench.bus, 0x1000, 0).unwrap_err();
    assert_eq!(error.to_string(), "node 1: object 0x1000:00: no answer within 5ms, tried 2 times");
}

#[test]
fn node_numbers_are_1_to_127() {
    assert_eq!(NodeId::new(0), None);
    assert_eq!(NodeId::new(128), None);
    assert_eq!(NodeId::new(127).map(NodeId::get), Some(127));
}

/// A bus on which stray frames on the node's answer channel precede each true answer.
struct Disturbed {
    inner: InProcess<Machine>,
    strays: Vec<[u8; 8]>,
    pending: Vec<Frame>,
}

impl Bus for Disturbed {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if frame.id() == 0x601 {
            self.pending =
                self.strays.iter().rev().map(|b| Frame::new(0x581, b).unwrap()).collect();
        }
        self.inner.send(frame)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        match self.pending.pop() {
            Some(frame) => Ok(Some(frame)),
            None => self.inner.recv(timeout),
        }
    }
}

/// Answers that match no request of the client: of other objects, other requests, other transfers.
const STRAYS: [[u8; 8]; 9] = [
    // 0x2030 read, and written; 0x6502:01, of which only the index matches.
    [0x43, 0x30, 0x20, 0x01, 0x11, 0x22, 0x33, 0x44],
    [0x60, 0x30, 0x20, 0x01, 0, 0, 0, 0],
    [0x43, 0x02, 0x65, 0x01, 0xFF, 0xFF, 0xFF, 0xFF],
    // Aborts of other transfers.
    [0x80, 0x30, 0x20, 0x01, 0x00, 0x00, 0x02, 0x06],
    [0x80, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x08],
    // The start of a segmented read of another object.
    [0x41, 0x08, 0x10, 0x05, 0xFF, 0, 0, 0],
    // A segment acknowledgement with the wrong toggle bit for a first one.
    [0x30, 0, 0, 0, 0, 0, 0, 0],
    // Not an SDO message, and a block transfer.
    [0xFF, 1, 2, 3, 4, 5, 6, 7],
    [0xC2, 0x08, 0x10, 0, 0, 0, 0, 0],
];

#[test]
fn answers_to_other_questions_change_nothing() {
    for strays in STRAYS.iter().map(|one| vec![*one]).chain([STRAYS.to_vec()]) {
        let bench = Bench::new(ClockMode::LockStep);
        let mut bus = Disturbed { inner: bench.bus, strays: strays.clone(), pending: Vec::new() };
        let identity = bring_up(&mut bus, &setup(Mode::Csp)).unwrap();
        assert_eq!(identity.identity, [0, 402, 1, 1], "{strays:02X?}");
        let client = SdoClient::new(node(1), ANSWER);
        let text = b"a label of some length";
        client.download(&mut bus, 0x2000, 0, text).unwrap();
        assert_eq!(client.upload(&mut bus, 0x2000, 0).unwrap(), text, "{strays:02X?}");
        let absent = client.upload(&mut bus, 0x5FFF, 0).unwrap_err();
        assert!(matches!(absent, SdoError::Aborted { code: AbortCode::NoObject, .. }), "{absent}");
    }
}

#[test]
fn a_node_that_answers_other_questions_only_is_silent() {
    for (stray, words) in [
        (STRAYS[0], "an answer for object 0x2030:01"),
        (STRAYS[3], "an answer for object 0x2030:01"),
        ([0x60, 0x02, 0x65, 0, 0, 0, 0, 0], "an answer to another request"),
        ([0x30, 0, 0, 0, 0, 0, 0, 0], "a segment out of turn"),
        ([0xFF; 8], "a frame that is no SDO answer"),
    ] {
        let mut bench = Bench::new(ClockMode::LockStep);
        bench.bus.responder_mut().mute(node(1));
        let mut bus = Disturbed { inner: bench.bus, strays: vec![stray], pending: Vec::new() };
        let client = SdoClient::new(node(1), Duration::from_millis(5));
        let line = client.upload(&mut bus, 0x6502, 0).unwrap_err().to_string();
        assert_eq!(
            line,
            format!(
                "node 1: object 0x6502:00: no answer within 5ms, tried 2 times; what came instead: {words}"
            )
        );
    }
}

#[test]
fn a_segment_that_comes_twice_is_taken_once() {
    /// Duplicates each answer of the node.
    struct Twice(InProcess<Machine>, Option<Frame>);

    impl Bus for Twice {
        fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
            self.0.send(frame)
        }

        fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
            if let Some(again) = self.1.take() {
                return Ok(Some(again));
            }
            self.1 = self.0.recv(timeout)?;
            Ok(self.1)
        }
    }

    let mut bus = Twice(Bench::new(ClockMode::LockStep).bus, None);
    // To the bring-up, a node whose answers all come twice is two nodes.
    let line = bring_up(&mut bus, &setup(Mode::Csv)).unwrap_err().to_string();
    assert!(line.starts_with("two nodes answer as node 1: "), "{line}");
    let client = SdoClient::new(node(1), ANSWER);
    let text = b"thirty-two characters, all of it";
    client.download(&mut bus, 0x2000, 0, text).unwrap();
    assert_eq!(client.upload(&mut bus, 0x2000, 0).unwrap(), text);
}

/// A drive that reports some objects as missing.
struct Without {
    inner: InProcess<Machine>,
    absent: Vec<u16>,
    code: AbortCode,
    answers: Vec<Frame>,
}

impl Bus for Without {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if let (0x601, &[command, low, high, sub, ..]) = (frame.id(), frame.payload())
            && self.absent.contains(&u16::from_le_bytes([low, high]))
            && command >> 5 != 4
        {
            let [a, b, c, d] = self.code.code().to_le_bytes();
            let abort = Frame::new(0x581, &[0x80, low, high, sub, a, b, c, d]).unwrap();
            self.answers.push(abort);
            return Ok(());
        }
        self.inner.send(frame)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        match self.answers.pop() {
            Some(frame) => Ok(Some(frame)),
            None => self.inner.recv(timeout),
        }
    }
}

fn without(absent: &[u16], code: AbortCode, deadline_ms: u16) -> Result<(), BringUpError> {
    let inner = Bench::new(ClockMode::LockStep).bus;
    let mut bus = Without { inner, absent: absent.to_vec(), code, answers: Vec::new() };
    let setup = DriveSetup { rpdo_deadline_ms: deadline_ms, ..setup(Mode::Csp) };
    bring_up(&mut bus, &setup).map(|_| ())
}

#[test]
fn a_drive_need_not_have_what_it_can_do_without() {
    let optional = [
        0x1006, 0x1007, 0x1014, 0x1016, 0x1019, 0x1029, 0x6007, 0x605A, 0x605B, 0x605C, 0x605D,
        0x605E, 0x6065, 0x6066, 0x6072, 0x6073, 0x607B, 0x607C, 0x607D, 0x607E, 0x607F, 0x6080,
        0x6083, 0x6084, 0x6085, 0x608F, 0x6090, 0x6091, 0x6092, 0x6096, 0x6097, 0x60A8, 0x60A9,
        0x60B0, 0x60B1, 0x60B2, 0x60C2, 0x60C5, 0x60C6, 0x60E0, 0x60E1,
    ];
    for code in [AbortCode::NoObject, AbortCode::NoSubIndex] {
        for index in optional {
            assert_eq!(without(&[index], code, 20), Ok(()), "0x{index:04X}");
        }
        assert_eq!(without(&optional, code, 20), Ok(()), "all of them");
    }
}

#[test]
fn a_drive_must_have_what_makes_it_stop() {
    let line = without(&[0x1400], AbortCode::NoSubIndex, 20).unwrap_err().to_string();
    assert_eq!(
        line,
        "node 1: object 0x1400:02 (RPDO communication parameter): the node has none, and needs it to \
         be read at every SYNC"
    );
    let refused = without(&[0x6085], AbortCode::DeviceState, 20).unwrap_err().to_string();
    assert!(refused.contains("object 0x6085:00: refused with abort code 0x08000022"), "{refused}");
}
