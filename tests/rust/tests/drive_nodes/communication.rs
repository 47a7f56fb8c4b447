//! Communication beyond what the controller needs: counters, delays, verification, emergencies.

use std::time::Duration;

use ilc_rt::fieldbus::bring_up::SdoClient;
use ilc_rt::fieldbus::canopen::NmtCommand;
use ilc_rt::fieldbus::cia402::{Controlword, Mode, State};
use ilc_rt::fieldbus::{Bus, Frame};
use ilc_sim::ClockMode;

use crate::bench::{Bench, START_M, counts, node};

fn sync_with(bench: &mut Bench, counter: u8) -> Vec<Frame> {
    bench.bus.send(&Frame::new(0x80, &[counter]).unwrap()).unwrap();
    bench.collect().frames
}

#[test]
fn a_tpdo_begins_at_its_sync_and_counts_from_there() {
    let mut bench = Bench::started(Mode::Csp);
    bench.bus.send(&NmtCommand::PreOperational.frame(None)).unwrap();
    bench.write(0x1019, 0, &[10]);
    bench.write(0x1801, 1, &0xC000_0281_u32.to_le_bytes());
    bench.write(0x1801, 2, &[2]);
    bench.write(0x1801, 6, &[4]);
    bench.write(0x1801, 1, &0x4000_0281_u32.to_le_bytes());
    bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
    bench.collect();
    let sent: Vec<u8> = (1..=10)
        .filter(|counter| sync_with(&mut bench, *counter).iter().any(|f| f.id() == 0x281))
        .collect();
    assert_eq!(sent, [4, 6, 8, 10]);
    assert_eq!(bench.sync().emergencies, [0x8240], "a SYNC without its counter");
}

#[test]
fn a_drive_that_produces_sync_counts_it() {
    let mut bench = Bench::new(ClockMode::RealTime);
    bench.write(0x1019, 0, &[3]);
    bench.write(0x1006, 0, &1000_u32.to_le_bytes());
    bench.write(0x1005, 0, &0x4000_0080_u32.to_le_bytes());
    let mut counters = Vec::new();
    bench.bus.responder_mut().advance(40, &mut |frame| {
        if frame.id() == 0x80 {
            counters.extend_from_slice(frame.payload());
        }
    });
    assert_eq!(counters, [1, 2, 3, 1, 2]);
}

#[test]
fn emergencies_keep_their_distance() {
    let mut bench = Bench::started(Mode::Csp);
    bench.write(0x1015, 0, &50_u16.to_le_bytes());
    let short = Frame::new(0x201, &[0]).unwrap();
    let mut at = Vec::new();
    for cycle in 0..20 {
        if cycle < 3 {
            bench.bus.send(&short).unwrap();
        }
        if !bench.sync().emergencies.is_empty() {
            at.push(cycle);
        }
    }
    // At once, and the newest of the others 5 ms later.
    assert_eq!(at.len(), 2, "{at:?}");
    assert_eq!(at[0], 0);
    assert!((4..=5).contains(&at[1]), "{at:?}");
    assert_eq!(bench.read(0x1003, 0), 3);
}

#[test]
fn a_verified_configuration_is_no_longer_verified_once_it_is_changed() {
    let mut bench = Bench::new(ClockMode::LockStep);
    bench.write(0x1020, 1, &7_u32.to_le_bytes());
    bench.write(0x1020, 2, &8_u32.to_le_bytes());
    bench.write(0x6040, 0, &[0, 0]);
    assert_eq!((bench.read(0x1020, 1), bench.read(0x1020, 2)), (7, 8), "a command changes nothing");
    bench.write(0x1010, 1, b"save");
    bench.bus.send(&NmtCommand::ResetNode.frame(None)).unwrap();
    assert_eq!((bench.read(0x1020, 1), bench.read(0x1020, 2)), (7, 8), "stored");
    bench.write(0x6065, 0, &[1, 0, 0, 0]);
    assert_eq!((bench.read(0x1020, 1), bench.read(0x1020, 2)), (0, 0));
}

#[test]
fn stored_values_survive_and_restored_ones_return_after_a_reset() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let factory = bench.read(0x6081, 0);
    bench.write(0x6081, 0, &77_u32.to_le_bytes());
    bench.bus.send(&NmtCommand::ResetNode.frame(None)).unwrap();
    assert_eq!(bench.read(0x6081, 0), factory);
    bench.write(0x6081, 0, &77_u32.to_le_bytes());
    bench.write(0x1010, 1, b"save");
    bench.bus.send(&NmtCommand::ResetNode.frame(None)).unwrap();
    assert_eq!(bench.read(0x6081, 0), 77);
    bench.write(0x1011, 1, b"load");
    assert_eq!(bench.read(0x6081, 0), 77);
    bench.bus.send(&NmtCommand::ResetNode.frame(None)).unwrap();
    assert_eq!(bench.read(0x6081, 0), factory);
}

#[test]
fn a_fault_on_demand_is_a_fault_in_every_state() {
    for enabled in [false, true] {
        let mut bench = if enabled { Bench::enabled(Mode::Csp) } else { Bench::started(Mode::Csp) };
        bench.write(0x2002, 0, &0x4310_u16.to_le_bytes());
        let mut answers: Vec<_> = (0..400).map(|_| bench.sync()).collect();
        let codes: Vec<u16> = answers.iter().flat_map(|a| a.emergencies.clone()).collect();
        assert_eq!(codes, [0x4310]);
        assert_eq!(answers.pop().unwrap().state(), State::Fault);
        assert_eq!((bench.read(0x603F, 0), bench.read(0x1003, 1)), (0x4310, 0x4310));
        assert_eq!(bench.cycle(Controlword::FAULT_RESET, 0).state(), State::SwitchOnDisabled);
        assert_eq!(bench.read(0x1001, 0), 0);
    }
}

#[test]
fn a_brake_that_the_controller_applies_holds_the_axis() {
    let mut bench = Bench::enabled(Mode::Csv);
    for _ in 0..3 {
        bench.follow(-100_000);
    }
    bench.write(0x60FE, 2, &1_u32.to_le_bytes());
    bench.write(0x60FE, 1, &1_u32.to_le_bytes());
    let held = bench.follow(-100_000).position();
    assert!(held < counts(START_M), "it moved before");
    assert_eq!(bench.follow(-100_000).position(), held);
    bench.write(0x60FE, 1, &0_u32.to_le_bytes());
    assert!(bench.follow(-100_000).position() < held);
}

#[test]
fn a_block_transfer_is_refused_at_once() {
    let mut bench = Bench::new(ClockMode::LockStep);
    for request in [[0xC2, 0x08, 0x10, 0, 1, 0, 0, 0], [0xA4, 0x08, 0x10, 0, 127, 0, 0, 0]] {
        bench.bus.send(&Frame::new(0x601, &request).unwrap()).unwrap();
        let answer = loop {
            let frame = bench.bus.recv(Duration::ZERO).unwrap().expect("an answer");
            if frame.id() == 0x581 {
                break frame;
            }
        };
        assert_eq!(answer.payload(), [0x80, 0x08, 0x10, 0, 0x01, 0, 0x04, 0x05]);
    }
    // The server is ready for the next one.
    let name = SdoClient::new(node(1), Duration::from_secs(1)).upload(&mut bench.bus, 0x1008, 0);
    assert_eq!(name.unwrap(), b"ilc-sim CiA 402 drive");
}
