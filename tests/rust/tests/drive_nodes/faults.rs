//! Faults of drives: following error, reset, loss of power, loss of the controller.

use std::sync::atomic::Ordering;

use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::canopen::{Heartbeat, NmtCommand, NmtState};
use ilc_rt::fieldbus::cia402::{Controlword, Mode, State, Statusword};
use ilc_sim::{Change, ClockMode};

use crate::bench::{Bench, START_M, counts, node};

/// Returns drive 1 in fault: stuck while commanded to move.
fn faulted() -> (Bench, Vec<u16>) {
    let mut bench = Bench::enabled(Mode::Csp);
    bench.is_stuck.store(true, Ordering::Relaxed);
    let mut codes = Vec::new();
    let mut target = counts(START_M);
    for _ in 0..80 {
        target -= 200;
        codes.extend(bench.follow(target).emergencies);
    }
    (bench, codes)
}

#[test]
fn an_axis_that_does_not_follow_faults_in_time() {
    let mut bench = Bench::enabled(Mode::Csp);
    bench.is_stuck.store(true, Ordering::Relaxed);
    let mut target = counts(START_M);
    let mut n_cycles = 0;
    loop {
        target -= 200;
        n_cycles += 1;
        if bench.follow(target).emergencies.contains(&0x8611) {
            break;
        }
        assert!(n_cycles < 100);
    }
    // 5000 counts at 200 a cycle are 25 cycles, then the timeout of 10 ms, and the latency of a
    // target.
    assert!((35..=38).contains(&n_cycles), "after {n_cycles} cycles");
}

#[test]
fn the_fault_is_told_once_and_shown_everywhere() {
    let (mut bench, codes) = faulted();
    assert_eq!(codes, [0x8611]);
    let answer = bench.follow(0);
    assert_eq!(answer.state(), State::Fault);
    assert!(answer.status.unwrap().statusword.has(Statusword::FOLLOWING_ERROR));
    assert_eq!(bench.read(0x603F, 0), 0x8611);
    assert_eq!(bench.read(0x1001, 0) & 1, 1);
    assert_eq!(bench.read(0x1003, 0), 1);
    assert_eq!(bench.read(0x1003, 1), 0x8611);
}

#[test]
fn a_fault_is_left_by_a_rising_edge_only_and_then_all_is_well() {
    let (mut bench, _) = faulted();
    bench.is_stuck.store(false, Ordering::Relaxed);
    for word in [0x0F, 0x06, 0x00, 0x07] {
        assert_eq!(bench.cycle(Controlword(word), 0).state(), State::Fault);
    }
    let reset = Controlword::fault_reset_after(Controlword(0x07));
    let answer = bench.cycle(reset, 0);
    assert_eq!(answer.state(), State::SwitchOnDisabled);
    assert_eq!(answer.emergencies, [0x0000]);
    assert_eq!(bench.read(0x603F, 0), 0);
    assert_eq!(bench.read(0x1001, 0), 0);
    let here = bench.sync().position();
    bench.enable(here);
    assert_eq!(bench.follow(here).position(), here);
    assert_eq!(bench.follow(here - 100).state(), State::OperationEnabled);
}

#[test]
fn a_held_reset_bit_resets_no_second_fault() {
    let (mut bench, _) = faulted();
    assert_eq!(bench.cycle(Controlword(0x80), 0).state(), State::SwitchOnDisabled);
    let here = bench.sync().position();
    bench.enable(here);
    let mut target = here;
    for _ in 0..80 {
        target -= 200;
        bench.cycle(Controlword(0x8F), target);
    }
    assert_eq!(bench.cycle(Controlword(0x8F), target).state(), State::Fault);
}

#[test]
fn leaving_operational_under_power_is_a_fault_of_the_connection() {
    for command in [NmtCommand::PreOperational, NmtCommand::ResetCommunication] {
        let mut bench = Bench::enabled(Mode::Csp);
        bench.bus.send(&command.frame(Some(node(1)))).unwrap();
        assert_eq!(bench.collect().emergencies, [0x7500], "{command:?}");
        bench.sync();
        assert_eq!(bench.bus.responder().drive_state(node(1)), Some(State::Fault));
    }
}

#[test]
fn a_reset_node_forgets_everything() {
    let (mut bench, _) = faulted();
    bench.bus.send(&NmtCommand::ResetNode.frame(Some(node(1)))).unwrap();
    assert_eq!(bench.bus.responder().drive_state(node(1)), Some(State::SwitchOnDisabled));
    assert_eq!(bench.read(0x6061, 0), 0);
    assert_eq!(bench.read(0x1003, 0), 0);
}

#[test]
fn a_drive_without_power_says_nothing_and_its_axis_stands() {
    let mut bench = Bench::enabled(Mode::Csv);
    for _ in 0..10 {
        bench.follow(-100_000);
    }
    assert!(bench.bus.responder_mut().mute(node(1)));
    assert!(!bench.bus.responder_mut().mute(node(99)));
    let at_loss = bench.bus.responder().plant().encoder_m(0);
    for _ in 0..10 {
        let answer = bench.follow(-100_000);
        assert_eq!(answer.status, None);
    }
    assert_eq!(bench.bus.responder().plant().encoder_m(0).to_bits(), at_loss.to_bits());
}

#[test]
fn heartbeats_keep_their_period_and_tell_the_state() {
    let mut bench = Bench::started(Mode::Csp);
    bench.write(0x1017, 0, &5_u16.to_le_bytes());
    let beats: Vec<bool> = (0..20)
        .map(|_| {
            let frames = bench.sync().frames;
            let beat = Heartbeat { node: node(1), state: NmtState::Operational };
            frames.iter().any(|frame| Heartbeat::decode(frame) == Some(beat))
        })
        .collect();
    let expected: Vec<bool> = (1..=20).map(|cycle| cycle % 5 == 0).collect();
    assert_eq!(beats, expected);
}

#[test]
fn a_controller_whose_heartbeat_stops_is_missed() {
    let mut bench = Bench::enabled(Mode::Csp);
    // Node 100, 10 ms.
    bench.write(0x1016, 1, &0x0064_000A_u32.to_le_bytes());
    let beat = Heartbeat { node: node(100), state: NmtState::Operational }.encode();
    for _ in 0..5 {
        for _ in 0..8 {
            assert!(bench.follow(counts(START_M)).emergencies.is_empty());
        }
        bench.bus.send(&beat).unwrap();
    }
    let codes: Vec<u16> = (0..15).flat_map(|_| bench.follow(counts(START_M)).emergencies).collect();
    assert_eq!(codes, [0x8130]);
    assert_eq!(bench.bus.responder().drive_state(node(1)), Some(State::Fault));
}

#[test]
fn in_real_time_only_advance_moves_the_clock() {
    let mut bench = Bench::new(ClockMode::RealTime);
    bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
    for _ in 0..10 {
        bench.sync();
    }
    assert_eq!(bench.bus.responder().time_us(), 0);
    bench.bus.responder_mut().advance(8, &mut |_| {});
    assert_eq!(bench.bus.responder().time_us(), 1000);
}

#[test]
fn what_happens_is_told_in_order() {
    let (mut bench, _) = faulted();
    let machine = bench.bus.responder_mut();
    let mut changes = Vec::new();
    while let Some(event) = machine.take_event() {
        if event.node == node(1) {
            changes.push(event.change);
        }
    }
    let tail = [
        Change::Drive(State::OperationEnabled),
        Change::Emergency(0x8611),
        Change::Drive(State::FaultReactionActive),
        Change::Drive(State::Fault),
    ];
    assert!(changes.ends_with(&tail), "{changes:?}");
}
