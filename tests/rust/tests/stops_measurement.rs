//! Stops while the measurement of an axis is wrong: frozen, lost, late, or false. No stop may trust
//! it, so every axis comes to rest within the braking distance of its last command.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::VecDeque;

use ilc_rt::config::{Cell, InputKind};
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::cia402::{DriveMotionTpdo2, StatusTpdo1};
use ilc_rt::servo::{PhaseName, StopReason, TickStatus};
use ilc_tests::rig::{Distort, Rig, node};
use ilc_tests::{MODES, short};

/// Ticks after which the test requests a stop if the loop has not found a reason for one.
const PATIENCE: u32 = 150;

/// A fault of one axis's measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lie {
    /// The status is frozen.
    Frozen,
    /// The status is lost.
    StatusLost,
    /// The second TPDO is lost.
    ExtraLost,
    /// Both are lost.
    BothLost,
    /// Both are late by a number of cycles.
    Late(usize),
    /// The position has an offset, in counts.
    Offset(i32),
    /// The position is multiplied.
    Scaled(i32),
    /// The position drifts per cycle, in counts.
    Drifting(i32),
}

const LIES: [Lie; 12] = [
    Lie::Frozen,
    Lie::StatusLost,
    Lie::ExtraLost,
    Lie::BothLost,
    Lie::Late(3),
    Lie::Late(30),
    Lie::Offset(150_000),
    Lie::Offset(-2_000_000),
    Lie::Scaled(-1),
    Lie::Scaled(2),
    Lie::Drifting(20_000),
    Lie::Drifting(-20_000),
];

fn distort(lie: Lie, axis_node: u8) -> Distort {
    let number = node(axis_node);
    let mut frozen: Option<Frame> = None;
    let mut waiting: VecDeque<(usize, Frame)> = VecDeque::new();
    let mut drift = 0_i32;
    Box::new(move |n_syncs, frame, out| {
        while waiting.front().is_some_and(|(due, _)| *due <= n_syncs) {
            out.push_back(waiting.pop_front().unwrap().1);
        }
        let status = StatusTpdo1::decode(&frame, number);
        let extra = DriveMotionTpdo2::decode(&frame, number).is_some();
        let moved = |status: StatusTpdo1, position_counts: i32| {
            StatusTpdo1 { position_counts, ..status }.encode(number)
        };
        match (lie, status) {
            (Lie::Frozen, Some(_)) => out.push_back(*frozen.get_or_insert(frame)),
            (Lie::StatusLost | Lie::BothLost, Some(_)) => {}
            (Lie::ExtraLost | Lie::BothLost, None) if extra => {}
            (Lie::Late(cycles), _) if status.is_some() || extra => {
                waiting.push_back((n_syncs + cycles, frame));
            }
            (Lie::Offset(counts), Some(status)) => {
                out.push_back(moved(status, status.position_counts.saturating_add(counts)));
            }
            (Lie::Scaled(times), Some(status)) => {
                out.push_back(moved(status, status.position_counts.saturating_mul(times)));
            }
            (Lie::Drifting(counts), Some(status)) => {
                drift = drift.saturating_add(counts);
                out.push_back(moved(status, status.position_counts.saturating_add(drift)));
            }
            _ => out.push_back(frame),
        }
    })
}

/// Checks, from the tick in which the stop began, that no command steps and that every axis is at
/// rest within its braking distance.
fn check_stop(cell: &Cell, rig: &Rig, what: &str) {
    let dt_s = cell.cycle_s();
    let Some(began) = rig.stopping_at else { panic!("{what}: no stop") };
    let line = rig.tap.line();
    let rows: Vec<_> = line.rows().collect();
    for (axis, spec) in cell.axes.iter().enumerate() {
        let limits = &spec.limits;
        let (a_max, jerk) = (limits.acceleration_max_m_s2, limits.jerk_max_m_s3);
        let target: Vec<f64> =
            rows.iter().map(|row| f64::from(row.target_counts[axis]) / spec.counts_per_m).collect();
        let velocity_m_s: Vec<f64> = match spec.interface.targeted() {
            InputKind::Position => std::iter::once(0.0)
                .chain(target.windows(2).map(|pair| (pair[1] - pair[0]) / dt_s))
                .collect(),
            InputKind::Velocity => target,
            // The plant itself: a force is no motion.
            InputKind::Torque => std::iter::once(0.0)
                .chain(line.plant_m(axis).windows(2).map(|pair| (pair[1] - pair[0]) / dt_s))
                .collect(),
        };
        let rounding = 4.0 / spec.counts_per_m / (dt_s * dt_s);
        // While drives are only told to disable, the target is meaningless.
        let held = |k: usize| rows[k].controlword[axis] == 0x0F;
        for k in began.max(1)..rows.len() {
            if held(k) && held(k - 1) && !spec.interface.targets_torque() {
                let a = (velocity_m_s[k] - velocity_m_s[k - 1]) / dt_s;
                assert!(a.abs() <= a_max * 1.001 + rounding, "{what}: axis {axis}: {a} at {k}");
            }
        }
        let plant_m = line.plant_m(axis);
        // Not even before the failure was noticed.
        if !spec.interface.targets_torque() {
            let asked_m_s = (1..rows.len())
                .filter(|k| held(*k) && held(k - 1))
                .map(|k| velocity_m_s[k].abs())
                .fold(0.0, f64::max);
            let most_m_s = limits.velocity_max_m_s + 1.01 / spec.counts_per_m / dt_s;
            assert!(asked_m_s <= most_m_s, "{what}: axis {axis}: {asked_m_s} m/s asked for");
        }
        // The command is within the limit; the PI velocity loop of a drive overshoots it by a few per
        // cent if it gets there as fast as the gate allows, as with a frozen encoder.
        let overshoot = if spec.interface.targets_position() { 1.01 } else { 1.1 };
        let top_m_s = plant_m.windows(2).map(|w| ((w[1] - w[0]) / dt_s).abs()).fold(0.0, f64::max);
        assert!(
            top_m_s <= limits.velocity_max_m_s * overshoot,
            "{what}: axis {axis}: {top_m_s} m/s"
        );
        let v = velocity_m_s[began - 1].abs();
        let a_0 = ((velocity_m_s[began - 1] - velocity_m_s[began - 2]) / dt_s).abs().min(a_max);
        // The length of a jerk-limited ramp, plus a cycle or two.
        let w = v + a_0 * a_0 / (2.0 * jerk);
        let braking_m = w * w / (2.0 * a_max) + w * (a_max + a_0) / jerk + 3.0 * v * dt_s;
        // A drive that closes the position loop (CSP) catches up with its command.
        let lag_m = match spec.interface.targeted() {
            InputKind::Position => {
                let at = f64::from(rows[began - 1].target_counts[axis]) / spec.counts_per_m;
                (at - plant_m[began - 1]).abs()
            }
            // One that closes the velocity loop (CSV) lags by its time constant. In torque mode it hears
            // of its quick stop a cycle later, and its velocity loop overshoots.
            InputKind::Velocity | InputKind::Torque => 0.02 * v,
        };
        let way_m = (plant_m[plant_m.len() - 1] - plant_m[began - 1]).abs();
        assert!(
            way_m <= braking_m + lag_m + 3e-4,
            "{what}: axis {axis} went on for {way_m} m, {braking_m} + {lag_m} m from {v} m/s; {:?}",
            rig.reason
        );
        let speed = (plant_m[plant_m.len() - 1] - plant_m[plant_m.len() - 2]) / dt_s;
        assert!(speed.abs() < 1e-3, "{what}: axis {axis} still moves at {speed} m/s");
    }
}

fn rig_in(cell: &Cell, phase: PhaseName, lockstep: bool) -> Rig {
    let mut rig = if lockstep { Rig::new(cell, 3) } else { Rig::on_clock(cell, 3) };
    match phase {
        PhaseName::Running => rig.tick_into_run(1, 150),
        PhaseName::Returning => {
            rig.tick_until(|rig| rig.ended.len() == 1 && rig.phase.0 == PhaseName::Returning);
            for _ in 0..40 {
                rig.tick(0);
            }
        }
        PhaseName::Stopping => {
            rig.tick_into_run(1, 150);
            rig.ask_to_stop(2);
            for _ in 0..4 {
                rig.tick(0);
            }
        }
        phase => {
            rig.tick(0);
            rig.tick_until(|rig| rig.phase.0 == phase);
            for _ in 0..3 {
                rig.tick(0);
            }
        }
    }
    rig
}

#[test]
fn no_stop_trusts_a_measurement_that_lies() {
    for name in MODES {
        let cell = short(name);
        for lockstep in [false, true] {
            for phase in [
                PhaseName::Enabling,
                PhaseName::Returning,
                PhaseName::Settling,
                PhaseName::Running,
                PhaseName::Stopping,
            ] {
                for lie in LIES {
                    for axis in 0..2 {
                        let what = format!("{name} {phase:?} {lie:?} {axis} {lockstep}");
                        let mut rig = rig_in(&cell, phase, lockstep);
                        rig.tap.line().distort(distort(lie, cell.axes[axis].node));
                        for _ in 0..PATIENCE {
                            if rig.tick(0) == TickStatus::Stopped {
                                break;
                            }
                        }
                        rig.ask_to_stop(2);
                        rig.tick_to_end();
                        check_stop(&cell, &rig, &what);
                    }
                }
            }
        }
    }
}

#[test]
fn a_frozen_velocity_axis_is_not_driven_on() {
    let cell = short(MODES[1]);
    let mut rig = rig_in(&cell, PhaseName::Running, false);
    rig.tap.line().distort(distort(Lie::Frozen, 1));
    rig.tick_to_end();
    assert!(matches!(rig.reason, Some(StopReason::FollowingError { axis: 0, .. })), "{rig:?}");
    check_stop(&cell, &rig, "frozen");
    // The drive with the failed encoder is commanded to stop by itself, not to coast.
    let line = rig.tap.line();
    let last: Vec<u16> = line.rows().map(|row| row.controlword[0]).collect();
    assert!(last.iter().rev().take(3).any(|word| *word == 0x02), "{last:x?}");
}

#[test]
fn a_position_that_jumps_is_not_believed() {
    for name in MODES {
        let cell = short(name);
        let mut rig = rig_in(&cell, PhaseName::Running, false);
        rig.tap.line().distort(distort(Lie::Offset(500_000), 1));
        rig.tick_to_end();
        let Some(StopReason::Jump { axis: 0, step_m }) = rig.reason else {
            panic!("{name}: {:?}", rig.reason);
        };
        assert!((step_m - 0.005).abs() < 1e-3, "{step_m}");
        check_stop(&cell, &rig, name);
    }
}
