//! The first move of a run, and faults that drives have when the loop begins: slow, or told and left.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::fieldbus::cia402::State;
use ilc_rt::servo::{PhaseName, StopReason};
use ilc_tests::rig::{Rig, write_object};
use ilc_tests::short;

/// Returns the highest speed of the set points of the first axis while it moves to the start before run 0.
fn approach_m_s(rig: &mut Rig, dt_s: f64) -> f64 {
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Running);
    // Before the axis is enabled there is no set point.
    let references = rig.samples.iter().map(|sample| sample.reference_m[0]);
    let reference: Vec<f64> = references.skip_while(|at_m| at_m.abs() < 1e-9).collect();
    reference.windows(2).map(|pair| (pair[1] - pair[0]).abs() / dt_s).fold(0.0, f64::max)
}

#[test]
fn the_first_move_has_its_own_velocity_and_the_return_that_of_the_program() {
    let mut cell = short("01_gantry.toml");
    let (dt_s, feed_m_s) = (cell.cycle_s(), cell.program.feed_m_s);
    let plain_m_s = approach_m_s(&mut Rig::new(&cell, 1), dt_s);
    cell.safety.approach_velocity_m_s = Some(0.1 * feed_m_s);
    let mut rig = Rig::new(&cell, 2);
    let slow_m_s = approach_m_s(&mut rig, dt_s);
    assert!(slow_m_s <= 0.1 * feed_m_s * (1.0 + 1e-9), "{slow_m_s}");
    assert!(plain_m_s > 0.2 * feed_m_s, "{plain_m_s}: the test sees the move");
    // The return between two runs keeps the feed.
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Returning);
    let before = rig.samples.len();
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Settling);
    let reference: Vec<f64> =
        rig.samples[before..].iter().map(|sample| sample.reference_m[0]).collect();
    let back_m_s =
        reference.windows(2).map(|pair| (pair[1] - pair[0]).abs() / dt_s).fold(0.0, f64::max);
    assert!(back_m_s > 0.1 * feed_m_s * (1.0 + 1e-6), "{back_m_s}");
}

/// Returns a loop whose first drive has faulted in an earlier one.
fn faulted(resets: bool) -> Rig {
    let mut cell = short("01_gantry.toml");
    cell.safety.reset_faults = resets;
    let mut rig = Rig::new(&cell, 1);
    // The window of the following error closes on a drive that must move, and it faults.
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Running);
    rig.tap.line().meddle(|machine, _| write_object(1, 0x6065, 1)(machine));
    rig.tick_to_end();
    assert_eq!(rig.drive_states()[0], Some(State::Fault), "{:?}", rig.reason);
    rig.tap.line().meddle(|machine, _| write_object(1, 0x6065, 1_000_000)(machine));
    rig.again(&cell)
}

#[test]
fn a_fault_from_before_is_left_and_nothing_moves() {
    let mut rig = faulted(false);
    rig.tick_to_end();
    let reason = rig.reason;
    assert!(matches!(reason, Some(StopReason::DriveFault { axis: 0, .. })), "{reason:?}");
    assert_eq!(rig.drive_states()[0], Some(State::Fault));
    let line = rig.tap.line();
    assert!(line.rows().all(|row| row.controlword[0] & 0x80 == 0), "no reset was sent");
}

#[test]
fn a_fault_from_before_is_reset_where_the_cell_allows_it() {
    let mut rig = faulted(true);
    rig.tick_to_end();
    assert_eq!(rig.reason, None);
}
