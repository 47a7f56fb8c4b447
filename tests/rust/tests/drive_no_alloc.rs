//! Simulated drives do not allocate after set-up: in lock-step they run inside the controller's
//! tick.

use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::bring_up::{DriveSetup, bring_up};
use ilc_rt::fieldbus::canopen::{NmtCommand, NodeId, sync};
use ilc_rt::fieldbus::cia402::{CommandRpdo1, Controlword, State};
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::fieldbus::{Bus, Frame};
use ilc_sim::{ClockMode, Machine};
use ilc_tests::counting::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn cycles_faults_and_questions_allocate_nothing() {
    let path = ilc_tests::example_path("01_gantry.toml");
    let cell = Cell::load(&path).unwrap();
    let node = NodeId::new(1).unwrap();
    let mut bus = InProcess::new(Machine::from_cell(&cell, ClockMode::LockStep).unwrap(), 256);
    let setup = DriveSetup {
        following_error_max_counts: 1_000_000,
        heartbeat_ms: 10,
        rpdo_deadline_ms: 50,
        ..drive_setup(&cell, &cell.axes[0], true).unwrap()
    };
    bring_up(&mut bus, &setup).unwrap();
    bus.send(&NmtCommand::Start.frame(None)).unwrap();
    let question = Frame::new(0x601, &[0x40, 0x08, 0x10, 0, 0, 0, 0, 0]).unwrap();
    let start_counts = 4_000_000;

    let before = allocations();
    for cycle in 0..500 {
        let controlword = match cycle {
            0..5 => Controlword::SHUTDOWN,
            5..10 => Controlword::SWITCH_ON,
            _ => Controlword::ENABLE_OPERATION,
        };
        // From cycle 300 on the controller is silent: deadline, emergency, ramp, fault.
        if cycle < 300 {
            let target_counts = start_counts + 1000 * (cycle - 20).max(0);
            let command = CommandRpdo1 { controlword, target_counts, ..CommandRpdo1::default() };
            bus.send(&command.encode(node)).unwrap();
        }
        bus.send(&question).unwrap();
        bus.send(&sync::frame()).unwrap();
        while bus.recv(Duration::ZERO).unwrap().is_some() {}
    }
    let after = allocations();

    assert_eq!(bus.responder().drive_state(node), Some(State::Fault));
    assert_eq!(after - before, 0);
}
