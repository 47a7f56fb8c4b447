//! Drives that lack sub-indices which CiA 301 makes optional: they run, and one that cannot watch its commands watches
//! the heartbeat of the controller instead.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::config::{Cell, Measure, Quirks};
use ilc_rt::design::Plan;
use ilc_rt::fieldbus::bring_up::{BringUpError, DriveSetup, bring_up};
use ilc_rt::fieldbus::canopen::{NmtCommand, sync};
use ilc_rt::fieldbus::cia402::{CommandRpdo1, PdoMap, State, Supervision, next_command};
use ilc_rt::fieldbus::network::Arrival;
use ilc_rt::fieldbus::transport::Responder;
use ilc_rt::fieldbus::{AxisNetwork, Bus};
use ilc_rt::record::EndStatus;
use ilc_tests::campaign::run;
use ilc_tests::rig::{Tap, node};
use ilc_tests::short;

/// Time after which a drive stops without commands: 20 cycles of 2 ms.
const DEADLINE_MS: u16 = 40;

/// The gantry without its tool, whose drives have some habits.
fn cell(quirks: Quirks) -> Cell {
    let mut cell = short("01_gantry.toml");
    cell.tcp_encoder = None;
    cell.learning.measure = Measure::Encoder;
    for axis in &mut cell.axes {
        axis.simulation.quirks = quirks;
    }
    cell
}

/// Brings the drives up as by the clock, and starts them.
fn bring_all_up(tap: &mut Tap, cell: &Cell) -> Result<Vec<PdoMap>, BringUpError> {
    let mut maps = Vec::new();
    for axis in &cell.axes {
        let setup =
            DriveSetup { rpdo_deadline_ms: DEADLINE_MS, ..drive_setup(cell, axis, true).unwrap() };
        maps.push(bring_up(tap, &setup)?.map);
    }
    tap.send(&NmtCommand::Start.frame(None)).unwrap();
    Ok(maps)
}

/// Lets cycles pass without the controller.
fn pass(tap: &Tap, n_cycles: u32) {
    for _ in 0..n_cycles {
        tap.line().meddle(|machine, _| machine.receive(&sync::frame(), &mut |_| {}));
    }
}

/// Commands the drives to be enabled and to hold their positions.
fn hold(network: &mut dyn AxisNetwork, n_cycles: u32) {
    let mut commands = [CommandRpdo1::default(); 2];
    for _ in 0..n_cycles {
        for (axis, command) in commands.iter().enumerate() {
            network.write(axis, command).unwrap();
        }
        network.exchange().unwrap();
        while let Some(arrival) = network.next(Duration::ZERO).unwrap() {
            let Arrival::Answer { axis, reading, .. } = arrival else { continue };
            if let (Some(word), Some(counts)) = (reading.statusword, reading.position_counts) {
                commands[axis].controlword =
                    word.state().map_or_else(Default::default, next_command);
                commands[axis].target_counts = counts;
            }
        }
    }
}

fn object(tap: &Tap, number: u8, index: u16, sub: u8) -> i64 {
    let line = tap.line();
    let entries = line.machine().dictionary(node(number)).unwrap().entries();
    let entry = entries.iter().find(|e| (e.address.index, e.address.sub) == (index, sub));
    entry.unwrap().value().number()
}

#[test]
fn a_drive_without_a_timeout_of_commands_watches_the_heartbeat() {
    let cell = cell(Quirks { lacks_command_timeout: true, ..Quirks::default() });
    let mut tap = Tap::new(&cell);
    let maps = bring_all_up(&mut tap, &cell).unwrap();
    assert!(maps.iter().all(|map| map.supervision == Supervision::Heartbeat));
    assert_eq!(object(&tap, 1, 0x1016, 1), 127 << 16 | i64::from(DEADLINE_MS));
    let plan = Plan::new(&cell, None, true).unwrap();
    let mut network = plan.network(Box::new(tap.clone()), &maps);
    hold(network.as_mut(), 200);
    let states = |tap: &Tap| [1, 2].map(|number| tap.line().machine().drive_state(node(number)));
    assert_eq!(states(&tap), [Some(State::OperationEnabled); 2]);
    // The controller is gone.
    pass(&tap, 200);
    assert_eq!(states(&tap), [Some(State::Fault); 2]);
}

#[test]
fn the_end_of_the_loop_ends_the_watch() {
    let cell = cell(Quirks { lacks_command_timeout: true, ..Quirks::default() });
    let mut tap = Tap::new(&cell);
    let maps = bring_all_up(&mut tap, &cell).unwrap();
    let plan = Plan::new(&cell, None, true).unwrap();
    let mut network = plan.network(Box::new(tap.clone()), &maps);
    hold(network.as_mut(), 20);
    for axis in 0..2 {
        network.write(axis, &CommandRpdo1::default()).unwrap();
    }
    network.exchange().unwrap();
    network.release().unwrap();
    pass(&tap, 200);
    for number in [1, 2] {
        assert_eq!(tap.line().machine().drive_state(node(number)), Some(State::SwitchOnDisabled));
        assert_eq!(object(&tap, number, 0x1016, 1), 0);
    }
}

#[test]
fn a_drive_that_can_watch_neither_is_refused() {
    let quirks =
        Quirks { lacks_command_timeout: true, lacks_consumer_heartbeat: true, ..Quirks::default() };
    let cell = cell(quirks);
    let line = bring_all_up(&mut Tap::new(&cell), &cell).unwrap_err().to_string();
    for part in ["node 1: object 0x1016:01", "to stop when commands stop coming", "0x1400:05"] {
        assert!(line.contains(part), "{line}");
    }
}

#[test]
fn a_drive_with_the_timeout_sends_for_no_heartbeat() {
    let cell = cell(Quirks { lacks_consumer_heartbeat: true, ..Quirks::default() });
    let mut tap = Tap::new(&cell);
    let maps = bring_all_up(&mut tap, &cell).unwrap();
    assert!(maps.iter().all(|map| map.supervision == Supervision::Commands));
    assert_eq!(object(&tap, 1, 0x1400, 5), i64::from(DEADLINE_MS));
}

#[test]
fn drives_without_the_optional_sub_indices_give_the_same_records() {
    let quirks = Quirks {
        lacks_command_timeout: true,
        lacks_consumer_heartbeat: true,
        lacks_status_times: true,
        ..Quirks::default()
    };
    let kept = run(&cell(quirks), 2, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    assert_eq!(kept.digests, run(&cell(Quirks::default()), 2, None).digests);
}
