//! A bus that takes no frames: commands are missed for a while, then the axes stop with the cause.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::servo::StopReason;
use ilc_tests::rig::Rig;
use ilc_tests::short;

/// Frames of a cycle: two commands and SYNC.
const FRAMES: u32 = 3;

#[test]
fn some_cycles_without_a_frame_are_counted_and_survived() {
    let cell = short("01_gantry.toml");
    let mut rig = Rig::on_clock(&cell, 1);
    rig.tick_into_run(0, 100);
    rig.tap.line().refuse(5 * FRAMES);
    rig.tick_to_end();
    assert_eq!(rig.reason, None);
    let missing = rig.samples.iter().filter(|sample| sample.at.is_some() && sample.missing);
    assert!((1..=20).contains(&missing.count()), "the cycles without SYNC have no measurement");
}

#[test]
fn a_bus_that_stays_full_stops_the_axes_after_a_bound() {
    let mut cell = short("01_gantry.toml");
    // Its other causes come later.
    cell.safety.silent_cycles_max = 8;
    let mut rig = Rig::on_clock(&cell, 1);
    rig.tick_into_run(0, 100);
    let before = rig.tap.line().n_syncs();
    // Commands are lost, and each SYNC gets through.
    for _ in 0..9 {
        rig.tap.line().refuse(1);
        rig.tick(0);
    }
    assert_eq!(rig.reason, Some(StopReason::Congested { cycles: 9 }));
    assert_eq!(rig.tap.line().n_syncs(), before + 9);
    rig.tick_to_end();
    for velocity_m_s in &rig.rest_m_s {
        assert!(velocity_m_s.abs() < 0.02, "{velocity_m_s} m/s when the drives were disabled");
    }
}
