//! Fuzzing of bus traffic: frames, both sides of SDO, bring-up, datagrams.

use std::collections::VecDeque;
use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::fieldbus::bring_up::{SdoClient, bring_up};
use ilc_rt::fieldbus::canopen::sdo::{SdoRequest, SdoResponse};
use ilc_rt::fieldbus::canopen::{Emergency, Heartbeat, NmtCommand, sync};
use ilc_rt::fieldbus::cia402::{CommandRpdo1, DriveMotionTpdo2, EncoderSample, StatusTpdo1};
use ilc_rt::fieldbus::transport::{InProcess, Responder, udp_codec};
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_tests::campaign::machine;
use ilc_tests::rig::node;
use ilc_tests::short;

use crate::driver::fuzz;

const CELL: &str = "01_gantry.toml";

/// Decodes bytes to frames: an identifier, a length, a payload.
fn frames(input: &[u8]) -> Vec<Frame> {
    let mut found = Vec::new();
    let mut rest = input;
    while let [low, high, length, more @ ..] = rest {
        let length = usize::from(length % 9).min(more.len());
        let id = u16::from_le_bytes([*low, high & 0x07]);
        found.push(Frame::new(id, &more[..length]).unwrap());
        rest = &more[length..];
    }
    found
}

/// Encodes frames as bytes that [`frames`] decodes.
fn bytes(frames: &[(u16, &[u8])]) -> Vec<u8> {
    let mut found = Vec::new();
    for (id, payload) in frames {
        let [low, high] = id.to_le_bytes();
        found.extend([low, high, u8::try_from(payload.len()).unwrap()]);
        found.extend_from_slice(payload);
    }
    found
}

#[test]
fn frames_are_decoded_or_passed_over() {
    let seeds = [bytes(&[
        (0x000, &[1, 0]),
        (0x080, &[]),
        (0x081, &[0x50, 0x82, 0x11, 1, 2, 3, 4, 5]),
        (0x181, &[0x37, 0x02, 8, 1, 2, 3, 4]),
        (0x281, &[1, 2, 3, 4, 5, 6, 7, 8]),
        (0x201, &[0x0F, 0x00, 1, 2, 3, 4]),
        (0x18A, &[1, 2, 3, 4, 5, 6, 7, 8]),
        (0x701, &[0x7F]),
    ])];
    fuzz("frames", &seeds, 20_000, |input| {
        for frame in frames(input) {
            let _ = NmtCommand::decode(&frame);
            let _ = sync::is_sync(&frame);
            if let Some(found) = Emergency::decode(&frame) {
                assert_eq!(found.encode(), frame);
            }
            if let Some(found) = Heartbeat::decode(&frame) {
                assert_eq!(Heartbeat::decode(&found.encode()), Some(found));
            }
            for node in [1, 2, 10, 127].map(node) {
                if let Some(found) = CommandRpdo1::decode(&frame, node) {
                    assert_eq!(CommandRpdo1::decode(&found.encode(node), node), Some(found));
                }
                if let Some(found) = StatusTpdo1::decode(&frame, node) {
                    assert_eq!(StatusTpdo1::decode(&found.encode(node), node), Some(found));
                }
                if let Some(found) = DriveMotionTpdo2::decode(&frame, node) {
                    assert_eq!(DriveMotionTpdo2::decode(&found.encode(node), node), Some(found));
                }
                if let Some(found) = EncoderSample::decode(&frame, node) {
                    assert_eq!(EncoderSample::decode(&found.encode(node), node), Some(found));
                }
            }
            if let Some(found) = SdoRequest::decode(frame.payload()) {
                assert_eq!(SdoRequest::decode(&found.encode()), Some(found));
            }
            if let Some(found) = SdoResponse::decode(frame.payload()) {
                assert_eq!(SdoResponse::decode(&found.encode()), Some(found));
            }
        }
    });
}

/// A node that answers every request with the next frame of a script.
struct Scripted(VecDeque<Frame>);

impl Bus for Scripted {
    fn send(&mut self, _frame: &Frame) -> Result<(), BusError> {
        Ok(())
    }

    fn recv(&mut self, _timeout: Duration) -> Result<Option<Frame>, BusError> {
        Ok(self.0.pop_front())
    }
}

#[test]
fn the_sdo_client_reads_writes_or_says_why_not() {
    let seeds = [
        bytes(&[(0x581, &[0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0])]),
        bytes(&[
            (0x581, &[0x41, 0x00, 0x10, 0, 9, 0, 0, 0]),
            (0x581, &[0x00, 1, 2, 3, 4, 5, 6, 7]),
            (0x581, &[0x1B, 8, 9, 0, 0, 0, 0, 0]),
        ]),
        bytes(&[(0x581, &[0x80, 0x00, 0x10, 0, 0, 0, 2, 6])]),
        bytes(&[
            (0x581, &[0x60, 0x00, 0x10, 0, 0, 0, 0, 0]),
            (0x581, &[0x20, 0, 0, 0, 0, 0, 0, 0]),
            (0x581, &[0x30, 0, 0, 0, 0, 0, 0, 0]),
        ]),
    ];
    let client = SdoClient::new(node(1), Duration::from_micros(50));
    fuzz("sdo_client", &seeds, 3_000, |input| {
        let script: VecDeque<Frame> = frames(input).into();
        if let Err(error) = client.upload(&mut Scripted(script.clone()), 0x1000, 0) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
        let long = [7; 20];
        for data in [&long[..4], &long] {
            if let Err(error) = client.download(&mut Scripted(script.clone()), 0x1000, 0, data) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    });
}

#[test]
fn the_nodes_answer_or_pass_over_whatever_comes() {
    let cell = short(CELL);
    let seeds = [
        bytes(&[
            (0x601, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
            (0x601, &[0x23, 0x7F, 0x60, 0, 1, 2, 3, 4]),
            (0x601, &[0x21, 0x08, 0x10, 0, 9, 0, 0, 0]),
            (0x601, &[0x00, 1, 2, 3, 4, 5, 6, 7]),
            (0x60A, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]),
        ]),
        bytes(&[
            (0x000, &[1, 0]),
            (0x201, &[0x06, 0, 0, 0, 0, 0]),
            (0x080, &[]),
            (0x201, &[0x0F, 0, 0, 0, 0, 0]),
            (0x080, &[]),
        ]),
        // A PDO disabled, remapped and re-enabled.
        bytes(&[
            (0x601, &[0x23, 0x00, 0x18, 1, 0x81, 1, 0, 0x80]),
            (0x601, &[0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0]),
            (0x601, &[0x23, 0x00, 0x1A, 1, 0x10, 0, 0x41, 0x60]),
            (0x601, &[0x2F, 0x00, 0x1A, 0, 1, 0, 0, 0]),
            (0x601, &[0x23, 0x00, 0x18, 1, 0x81, 1, 0, 0]),
            (0x000, &[1, 0]),
            (0x080, &[]),
        ]),
    ];
    fuzz("sdo_server", &seeds, 3_000, |input| {
        let mut machine = machine(&cell);
        for frame in frames(input) {
            let mut answers = 0;
            machine.receive(&frame, &mut |_| answers += 1);
            assert!(answers <= 32, "{answers} answers to one frame");
        }
        for axis in 0..machine.plant().n_axes() {
            assert!(machine.plant().encoder_m(axis).is_finite());
        }
    });
}

#[test]
fn a_drive_in_any_state_is_brought_up_or_refused() {
    let cell = short(CELL);
    let write = |index: u16, sub: u8, value: u32| {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        bytes(&[(0x601, &[0x23, low, high, sub, a, b, c, d])])
    };
    let seeds = [
        write(0x60B0, 0, 500_000),
        write(0x6085, 0, 1),
        write(0x1800, 1, 0x8000_0181),
        write(0x1A00, 0, 9),
        write(0x1400, 2, 255),
        write(0x60C2, 1, 0),
        write(0x607E, 0, 0x80),
        bytes(&[(0x000, &[2, 1]), (0x000, &[0x81, 0])]),
    ];
    fuzz("bring_up", &seeds, 600, |input| {
        let mut bus = InProcess::new(machine(&cell), 256);
        for frame in frames(input) {
            let _ = bus.send(&frame);
        }
        while bus.recv(Duration::ZERO).unwrap().is_some() {}
        let mut setup = drive_setup(&cell, &cell.axes[0], true).unwrap();
        setup.answer_timeout = Duration::from_millis(2);
        if let Err(error) = bring_up(&mut bus, &setup) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    });
}

#[test]
fn datagrams_are_decoded_or_passed_over() {
    let frame = Frame::new(0x181, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
    let seeds = [
        udp_codec::encode(&frame).unwrap().as_bytes().to_vec(),
        udp_codec::encode(&sync::frame()).unwrap().as_bytes().to_vec(),
    ];
    fuzz("udp_codec", &seeds, 50_000, |input| {
        if let Some(frame) = udp_codec::decode(input) {
            let again = udp_codec::encode(&frame).unwrap();
            assert_eq!(udp_codec::decode(again.as_bytes()), Some(frame));
        }
    });
}
