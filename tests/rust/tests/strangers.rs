//! A second master on the bus: foreign SYNC, NMT, commands and requests are detected and named, and
//! the axes come to rest, on every transport.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::net::{TcpListener, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ilc_rt::campaign::{self, Outcome};
use ilc_rt::fieldbus::canopen::{NmtCommand, NodeId, sync};
use ilc_rt::fieldbus::cia402::{CommandRpdo1, Controlword};
use ilc_rt::fieldbus::transport::{self, Responder, ZenohBus, ZenohSettings, loopback};
use ilc_rt::fieldbus::{Bus, Frame};
use ilc_rt::record::{EndStatus, Event, StateName};
use ilc_rt::servo::{PhaseName, StopReason, Stranger};
use ilc_tests::campaign::{machine, options};
use ilc_tests::rig::{Rig, node};
use ilc_tests::{Scratch, short};

const PATIENCE: Duration = Duration::from_secs(20);

fn request(node: u16) -> Frame {
    Frame::new(0x600 + node, &[0x2B, 0x40, 0x60, 0, 0, 0, 0, 0]).unwrap()
}

fn command(to: u8) -> Frame {
    let command = CommandRpdo1 {
        controlword: Controlword::ENABLE_OPERATION,
        target_counts: 0,
        ..CommandRpdo1::default()
    };
    command.encode(node(to))
}

#[test]
fn what_only_a_master_sends_is_named_in_every_phase() {
    let cell = short("01_gantry.toml");
    let kinds = [
        (sync::frame(), Stranger::Sync),
        (Frame::new(0x80, &[7]).unwrap(), Stranger::Sync),
        (NmtCommand::Stop.frame(None), Stranger::Nmt(NmtCommand::Stop, None)),
        (
            NmtCommand::ResetNode.frame(Some(node(2))),
            Stranger::Nmt(NmtCommand::ResetNode, Some(node(2))),
        ),
        (command(2), Stranger::Command(node(2))),
        (Frame::new(0x502, &[1]).unwrap(), Stranger::Command(node(2))),
        (request(10), Stranger::Request(node(10))),
    ];
    for (frame, stranger) in kinds {
        for phase in [PhaseName::Enabling, PhaseName::Returning, PhaseName::Running] {
            for lockstep in [true, false] {
                let mut rig = if lockstep { Rig::new(&cell, 1) } else { Rig::on_clock(&cell, 1) };
                rig.tick(0);
                rig.tick_until(|rig| rig.phase.0 == phase);
                rig.tap.line().meddle(|machine, reply| {
                    // All nodes receive it: this controller and the drives.
                    reply(frame);
                    machine.receive(&frame, reply);
                });
                rig.tick_to_end();
                let reason = Some(StopReason::OtherMaster(stranger));
                assert_eq!(rig.reason, reason, "{phase:?} {lockstep}");
            }
        }
    }
}

#[test]
fn what_is_for_other_nodes_is_nobodys_business() {
    let cell = short("01_gantry.toml");
    let mut rig = Rig::new(&cell, 1);
    rig.tick_into_run(0, 100);
    rig.tap.line().meddle(|_, reply| {
        reply(request(77));
        // Reading changes nothing, also of a node of this cell.
        reply(Frame::new(0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]).unwrap());
        reply(Frame::new(0x601, &[0x60, 0, 0, 0, 0, 0, 0, 0]).unwrap());
        reply(command(77));
        reply(NmtCommand::Stop.frame(NodeId::new(77)));
        reply(Frame::new(0x1FF, &[0; 8]).unwrap());
        reply(Frame::new(0x74D, &[0]).unwrap());
        reply(Frame::new(0x100, &[0; 6]).unwrap());
        reply(Frame::new(0x7E5, &[0; 8]).unwrap());
    });
    rig.tick_to_end();
    assert_eq!(rig.reason, None);
}

/// Runs a campaign in lock-step with the machine behind `far`; the second master sends `frame` when
/// run 1 begins.
fn campaign(
    near: Box<dyn Bus>,
    mut far: Box<dyn Bus>,
    stranger: Option<Box<dyn Bus>>,
    frame: Frame,
) -> Outcome {
    let cell = short("01_gantry.toml");
    let scratch = Scratch::new();
    let over = Arc::new(AtomicBool::new(false));
    let now = Arc::new(AtomicBool::new(false));
    let mut stranger = stranger;
    std::thread::scope(|scope| {
        let (told, asked) = (Arc::clone(&over), Arc::clone(&now));
        let mut machine = machine(&cell);
        let has_own_end = stranger.is_some();
        scope.spawn(move || {
            while !told.load(Ordering::Relaxed) {
                // If the bus has two ends only, the second master sits beside the drives.
                if !has_own_end && asked.swap(false, Ordering::Relaxed) {
                    far.send(&frame).unwrap();
                }
                let Ok(Some(received)) = far.recv(Duration::from_millis(5)) else { continue };
                let mut answers = Vec::new();
                machine.receive(&received, &mut |answer| answers.push(answer));
                for answer in answers {
                    while far.send(&answer).is_err() {
                        std::thread::yield_now();
                    }
                }
            }
        });
        let options = options(scratch.file("library.db"), 40);
        let outcome = campaign::run(&cell, &options, near, None, &mut |event| {
            if matches!(event, Event::State { state: StateName::Running, iteration: 1 }) {
                match &mut stranger {
                    Some(stranger) => stranger.send(&frame).unwrap(),
                    None => now.store(true, Ordering::Relaxed),
                }
            }
        });
        over.store(true, Ordering::Relaxed);
        outcome.unwrap()
    })
}

fn check(outcome: &Outcome, seen: &str) {
    assert_eq!(outcome.status, EndStatus::Fault);
    let sentence =
        format!("another master is on the bus: {seen} seen that this controller did not send");
    assert_eq!(outcome.reason, sentence);
}

fn frames() -> [(Frame, &'static str); 3] {
    [
        (sync::frame(), "SYNC"),
        (NmtCommand::Stop.frame(None), "NMT stop of all nodes"),
        (request(1), "an SDO request to node 1"),
    ]
}

#[test]
fn on_a_pair_of_threads() {
    for (frame, seen) in frames() {
        let (near, far) = loopback::pair(1024).unwrap();
        check(&campaign(Box::new(near), Box::new(far), None, frame), seen);
    }
}

#[test]
fn on_udp() {
    let holder = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udp:239.74.163.92:{}", holder.local_addr().unwrap().port());
    for (frame, seen) in frames() {
        let open = || transport::open(&address).unwrap();
        check(&campaign(open(), open(), Some(open()), frame), seen);
    }
}

#[test]
fn on_zenoh() {
    let (frame, seen) = frames()[0];
    for _ in 0..10 {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let open = |role: &str| {
            let address = format!("zenoh:test/strangers?{role}=tcp/127.0.0.1:{port}&scouting=off");
            let settings: ZenohSettings = address.parse().unwrap();
            ZenohBus::open(&settings)
        };
        let (Ok(near), Ok(far), Ok(third)) = (open("listen"), open("connect"), open("connect"))
        else {
            continue;
        };
        assert!(far.wait_for_peer(PATIENCE) && third.wait_for_peer(PATIENCE));
        assert!(near.wait_for_peer(PATIENCE));
        let outcome = campaign(Box::new(near), Box::new(far), Some(Box::new(third)), frame);
        check(&outcome, seen);
        return;
    }
    panic!("no free port in ten attempts");
}
