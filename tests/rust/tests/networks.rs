//! Process data and buses beside the usual ones: small maps, drives without the optional objects, two buses
//! in one SYNC, and a real UDP bus with faults.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::VecDeque;
use std::net::UdpSocket;

use ilc_rt::campaign::{self, drive_setup};
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::bring_up::bring_up;
use ilc_rt::fieldbus::canopen::sdo::SdoRequest;
use ilc_rt::fieldbus::canopen::{AbortCode, ObjectAddress};
use ilc_rt::fieldbus::cia402::{PdoMap, StatusTpdo1};
use ilc_rt::fieldbus::transport::{
    self, Group, GroupSide, InProcess, Responder, UdpMulticast, loopback,
};
use ilc_rt::fieldbus::{Bus, Frame};
use ilc_rt::record::EndStatus;
use ilc_rt::servo::{PhaseName, StopReason};
use ilc_sim::Machine;
use ilc_tests::campaign::{in_process, machine, options, run, run_on};
use ilc_tests::far_side::FarSide;
use ilc_tests::faulty::{Faults, FaultyBus, Way};
use ilc_tests::rig::{Rig, node};
use ilc_tests::{Scratch, patient, short};

const CELLS: [&str; 2] = ["01_gantry.toml", "02_parallel.toml"];
const RUNS: u32 = 3;

/// A cell on a CAN bus that has time for the small maps only.
fn on_a_slow_bus(name: &str) -> Cell {
    let mut cell = short(name);
    "can:can0".clone_into(&mut cell.bus.address);
    cell.bus.bitrate_bit_s = if cell.cell.cycle_us == 1000 { 1_000_000 } else { 500_000 };
    cell
}

#[test]
fn small_maps_give_the_records_of_the_full_ones() {
    for name in CELLS {
        let cell = on_a_slow_bus(name);
        let setup = drive_setup(&cell, &cell.axes[0], true).unwrap();
        assert_eq!(setup.map, PdoMap::small(cell.axes[0].interface));
        let small = run_on(&cell, in_process(&cell), RUNS, None);
        assert_eq!(small.outcome.status, EndStatus::Completed, "{}", small.outcome.reason);
        assert_eq!(small.digests, run(&short(name), RUNS, None).digests, "{name}");
    }
}

/// A machine whose drives lack some objects: an SDO request for one is aborted.
struct Lacking {
    machine: Machine,
    lacks: Vec<u16>,
}

impl Responder for Lacking {
    fn receive(&mut self, frame: &Frame, reply: &mut dyn FnMut(Frame)) {
        let payload = frame.payload();
        let is_request = frame.id() & 0x780 == 0x600 && SdoRequest::decode(payload).is_some();
        let index = payload.get(1..3).map_or(0, |word| u16::from_le_bytes([word[0], word[1]]));
        if is_request && self.lacks.contains(&index) {
            let mut answer = [0x80, payload[1], payload[2], payload[3], 0, 0, 0, 0];
            answer[4..].copy_from_slice(&AbortCode::NoObject.code().to_le_bytes());
            reply(Frame::new(frame.id() - 0x80, &answer).unwrap());
        } else {
            self.machine.receive(frame, reply);
        }
    }
}

fn lacking(cell: &Cell, lacks: &[u16]) -> InProcess<Lacking> {
    InProcess::new(Lacking { machine: machine(cell), lacks: lacks.to_vec() }, 256)
}

#[test]
fn drives_without_the_optional_objects_run_alike() {
    for name in CELLS {
        let cell = short(name);
        let expected = run(&cell, RUNS, None).digests;
        for lacks in [
            &[0x60B2, 0x6077, 0x606C, 0x60F4, 0x6066][..],
            &[0x60B2],
            &[0x6077],
            &[0x606C, 0x60F4],
            &[0x60F4],
        ] {
            let mut bus = lacking(&cell, lacks);
            let mapped = bring_up(&mut bus, &drive_setup(&cell, &cell.axes[0], true).unwrap());
            let map = mapped.unwrap().map;
            assert!(lacks.iter().all(|&index| !map.carries(index)), "{lacks:X?}");
            let kept = run_on(&cell, Box::new(lacking(&cell, lacks)), RUNS, None);
            assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
            assert_eq!(kept.digests, expected, "{name} without {lacks:X?}");
        }
        // Without 0x60C2 too the drive interpolates over a period of its own, and so moves otherwise.
        let bus = lacking(&cell, &[0x60B2, 0x6077, 0x606C, 0x60F4, 0x60C2, 0x6066]);
        let kept = run_on(&cell, Box::new(bus), RUNS, None);
        assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    }
}

#[test]
fn an_object_on_which_a_loop_depends_still_refuses() {
    let cell = short(CELLS[0]);
    for needed in [0x6041, 0x6064, 0x607A] {
        let mut bus = lacking(&cell, &[needed]);
        let setup = drive_setup(&cell, &cell.axes[0], true).unwrap();
        // Mapped without being read; the drive itself refuses what it cannot map.
        let index = ObjectAddress::new(needed, 0);
        let map = setup.map;
        match bring_up(&mut bus, &setup) {
            Ok(identity) => assert_eq!(identity.map, map, "{index} was left out"),
            Err(error) => assert!(error.to_string().contains("node 1"), "{error}"),
        }
    }
}

#[test]
fn a_silent_drive_with_one_answer_is_named() {
    let mut cell = on_a_slow_bus(CELLS[0]);
    cell.safety.silent_cycles_max = 5;
    let mut rig = Rig::on_clock(&cell, 1);
    rig.tick_into_run(0, 20);
    rig.tap.line().distort(Box::new(|_, frame, out: &mut VecDeque<Frame>| {
        if frame.id() != 0x181 {
            out.push_back(frame);
        }
    }));
    rig.tick_to_end();
    assert!(matches!(rig.reason, Some(StopReason::SilentAxis { axis: 0, .. })), "{:?}", rig.reason);
}

#[test]
fn a_drive_killed_between_its_answers_is_silent() {
    for (phase, axis, number) in
        [(PhaseName::Running, 0, 1), (PhaseName::Running, 1, 2), (PhaseName::Enabling, 0, 1)]
    {
        let cell = short(CELLS[0]);
        let mut rig = Rig::new(&cell, 2);
        rig.tick_until(|rig| rig.phase.0 == phase && rig.tap.line().n_syncs() > 2);
        let mut is_dead = false;
        rig.tap.line().distort(Box::new(move |_, frame, out: &mut VecDeque<Frame>| {
            let is_its_own = [0x180, 0x280].contains(&(frame.id() - u16::from(number)));
            if !(is_dead && is_its_own) {
                out.push_back(frame);
            }
            is_dead |= StatusTpdo1::decode(&frame, node(number)).is_some();
        }));
        rig.tick_to_end();
        assert!(
            matches!(rig.reason, Some(StopReason::SilentAxis { axis: found, .. }) if found == axis),
            "{phase:?}: {:?}",
            rig.reason
        );
    }
}

#[test]
fn of_drives_that_die_together_the_one_that_answered_in_part_is_silent() {
    let cell = short(CELLS[0]);
    for (last, axis) in [(1, 0), (2, 1)] {
        for phase in [PhaseName::Enabling, PhaseName::Settling, PhaseName::Running] {
            let mut rig = Rig::new(&cell, 2);
            rig.tick_until(|rig| rig.phase.0 == phase && rig.tap.line().n_syncs() > 2);
            let mut are_dead = false;
            rig.tap.line().distort(Box::new(move |_, frame, out: &mut VecDeque<Frame>| {
                if !are_dead {
                    out.push_back(frame);
                }
                are_dead |= StatusTpdo1::decode(&frame, node(last)).is_some();
            }));
            rig.tick_to_end();
            let silent = Some(StopReason::SilentAxis { axis, cycles: 1 });
            assert_eq!(rig.reason, silent, "{phase:?} {last}");
        }
    }
}

/// Two buses between controller and machine: the first drive and the tool on one, the second drive on the
/// other.
fn two_buses(mut ends: impl FnMut() -> (Box<dyn Bus>, Box<dyn Bus>)) -> (Group, Group) {
    let (near, far): (Vec<_>, Vec<_>) = (0..2).map(|_| ends()).unzip();
    let nodes = [(1, 0), (2, 1), (10, 0)];
    (Group::new(near, nodes, GroupSide::Controller), Group::new(far, nodes, GroupSide::Drives))
}

fn same_on_two_buses(ends: impl FnMut() -> (Box<dyn Bus>, Box<dyn Bus>)) {
    let cell = short(CELLS[0]);
    let (near, far) = two_buses(ends);
    let far_side = FarSide::serve(Box::new(far), machine(&cell));
    let kept = run_on(&cell, Box::new(near), RUNS, None);
    drop(far_side);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    assert_eq!(kept.digests, run(&cell, RUNS, None).digests);
}

#[test]
fn two_buses_in_one_sync_give_the_records_of_one() {
    same_on_two_buses(|| {
        let (near, far) = loopback::pair(1024).unwrap();
        (Box::new(near), Box::new(far))
    });
}

#[test]
fn two_udp_buses_in_one_sync_give_the_records_of_one() {
    let mut held = Vec::new();
    same_on_two_buses(|| {
        let address = free_address(&mut held, 94);
        (transport::open(&address).unwrap(), transport::open(&address).unwrap())
    });
}

/// Returns the address of a UDP bus on a port that stays reserved for this test.
fn free_address(held: &mut Vec<UdpSocket>, group: u8) -> String {
    let holder = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udp:239.74.163.{group}:{}", holder.local_addr().unwrap().port());
    held.push(holder);
    address
}

fn kinds(probability: f64) -> [(&'static str, Faults); 6] {
    let none = Faults::default();
    [
        ("loss", Faults { loss: probability, ..none }),
        ("delay", Faults { delay: probability, delay_syncs_max: 5, ..none }),
        ("duplication", Faults { duplication: probability, ..none }),
        ("reordering", Faults { reordering: probability, ..none }),
        ("corruption", Faults { corruption: probability, ..none }),
        ("foreign frames", Faults { foreign: (50.0 * probability).min(1.0), ..none }),
    ]
}

/// Parts of the sentences of a stop that a kind of fault may cause, beside those of a busy computer.
fn sentences(kind: &str) -> &'static [&'static str] {
    match kind {
        "corruption" => &[
            "is silent",
            "bytes, 8 are needed",
            "jumped by",
            "following error",
            "is not enabled",
            "faulted",
            "outside",
        ],
        _ => &["is silent", "following error", "faulted"],
    }
}

#[test]
fn a_real_udp_bus_with_faults_counts_them_or_stops_with_the_right_sentence() {
    let mut held = Vec::new();
    for (kind, faults) in kinds(0.005) {
        // Simulated time advances with SYNC: a busy computer only pauses the motion.
        let mut cell = patient(short(CELLS[0]));
        cell.safety.answer_timeout_s = 20.0;
        let address = free_address(&mut held, 95);
        let far = UdpMulticast::open(
            "239.74.163.95".parse().unwrap(),
            held.last().unwrap().local_addr().unwrap().port(),
            transport::udp_multicast::DEFAULT_TTL,
        );
        let far_side = FarSide::serve(Box::new(far.unwrap()), machine(&cell));
        let near = transport::open(&address).unwrap();
        let bus = FaultyBus::new(near, faults, Way::ToController, 100..u32::MAX, 5);
        let scratch = Scratch::new();
        let mut options = options(scratch.file("library.db"), 2);
        (options.session.lockstep, options.session.simulated) = (false, true);
        let end = campaign::run(&cell, &options, Box::new(bus), None, &mut |_| {}).unwrap();
        drop(far_side);
        let said = &end.reason;
        if end.status == EndStatus::Completed {
            assert_eq!(end.runs.len(), 2, "{kind}: {said}");
            let missing: usize = end.runs.iter().map(|(_, run)| run.missing_samples as usize).sum();
            // Late and reordered answers are put in their places; lost ones are counted.
            assert!(
                missing > 0 || !["loss", "duplication"].contains(&kind),
                "{kind} was not counted"
            );
        } else {
            let known = sentences(kind).iter().chain(&["this computer stalled"]);
            assert!(known.into_iter().any(|part| said.contains(part)), "{kind}: {said}");
        }
    }
}
