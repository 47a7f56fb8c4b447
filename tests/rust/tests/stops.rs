//! All causes of an early stop: the reported reason, and the commands on the bus meanwhile.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use ilc_rt::campaign::{self, Outcome};
use ilc_rt::config::{Cell, InputKind};
use ilc_rt::fieldbus::canopen::{NmtCommand, emcy};
use ilc_rt::fieldbus::cia402::State;
use ilc_rt::fieldbus::transport::{Responder, loopback};
use ilc_rt::record::{EndStatus, Event, FaultKind, StateName};
use ilc_rt::servo::{PhaseName, StopReason, TickStatus};
use ilc_tests::campaign::{machine, options};
use ilc_tests::far_side::FarSide;
use ilc_tests::rig::{Rig, Tap, node, write_object};
use ilc_tests::{INPUTS, Scratch, short};

/// Node of the axis that fails, and of the tool's encoder.
const X: u8 = 1;
const TOOL: u8 = 10;
/// Sample of run 1 at which events happen: in full motion.
const MIDDLE: u32 = 150;

/// A table that moves both axes smoothly and well within bounds.
fn smooth_table(n_samples: usize, size: f64) -> Box<[f64]> {
    (0..2 * n_samples)
        .map(|i| {
            let turn = (i / 2) as f64 / n_samples as f64 * std::f64::consts::TAU;
            size * (1.0 - turn.cos()) * if i % 2 == 0 { 0.5 } else { -0.5 }
        })
        .collect()
}

fn size(cell: &Cell) -> f64 {
    match cell.axes[0].input_kind() {
        InputKind::Position => 0.001,
        InputKind::Velocity => 0.02,
        InputKind::Torque => 40.0,
    }
}

/// A rig in the middle of run 1, with an active learned input.
fn in_motion(cell: &Cell) -> Rig {
    let mut rig = Rig::new(cell, 3);
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Running);
    rig.mail.send_table(1, smooth_table(rig.n_samples, size(cell))).unwrap();
    rig.tick_into_run(1, MIDDLE);
    assert_eq!(rig.started, [(0, 0), (1, 1)]);
    assert!(rig.samples.last().unwrap().input[0].abs() > 0.1 * size(cell));
    rig
}

/// Checks the commands on the bus from enabling to the end: no step is larger than the limits
/// allow, and from the stop on, every axis in `axes` decelerates within its limits and comes to
/// rest.
fn check_commands(cell: &Cell, rig: &Rig, axes: &[usize]) {
    let dt_s = cell.cycle_s();
    let line = rig.tap.line();
    let rows: Vec<_> = line.rows().collect();
    let stop_at = rig.stopping_at.unwrap();
    for &axis in axes {
        let spec = &cell.axes[axis];
        let scale = spec.counts_per_m;
        let target: Vec<f64> =
            rows.iter().map(|row| f64::from(row.target_counts[axis]) / scale).collect();
        let enabled = rows.iter().position(|row| row.controlword[axis] == 0x0F);
        let enabled = enabled.map_or(rows.len(), |row| row + 3);
        let (v_max, a_max) = (spec.limits.velocity_max_m_s, spec.limits.acceleration_max_m_s2);
        match spec.interface.targeted() {
            InputKind::Position => {
                // Half a count of rounding at either end of a step.
                let step_max = v_max * dt_s + 1.01 / scale;
                for k in enabled..rows.len() {
                    let step = (target[k] - target[k - 1]).abs();
                    assert!(step <= step_max, "axis {axis} stepped {step} m at SYNC {k}");
                }
                let tolerance = 2.01 / scale / (dt_s * dt_s) + 1e-6 * a_max;
                for k in stop_at.max(enabled)..rows.len() {
                    let a = (target[k] - 2.0 * target[k - 1] + target[k - 2]) / (dt_s * dt_s);
                    assert!(
                        a.abs() <= a_max + tolerance,
                        "axis {axis}: {a} m/s2 at SYNC {k}, {} after the stop",
                        k - stop_at
                    );
                }
                let rest = target.last().unwrap();
                let tail = target.len().saturating_sub(20).max(stop_at);
                assert!(target[tail..].iter().all(|p| p.to_bits() == rest.to_bits()));
                // The braking distance from this velocity with this jerk is short; the stop must
                // not travel farther.
                let journey = (rest - target[stop_at - 1]).abs();
                assert!(journey < 0.01, "axis {axis} went on for {journey} m");
            }
            InputKind::Velocity => {
                // The velocity follows from a measured position, so it may be slightly higher than
                // the reference's, but never a jump.
                for k in stop_at.max(enabled)..rows.len() {
                    let a = (target[k] - target[k - 1]).abs() / dt_s;
                    assert!(a <= 1.5 * a_max, "axis {axis}: {a} m/s2 at SYNC {k}");
                }
                assert!(target.iter().all(|v| v.abs() <= v_max + 1.0 / scale));
            }
            // A force is no motion: the plant shows how the drive brakes.
            InputKind::Torque => {
                let plant_m = line.plant_m(axis);
                let journey = (plant_m[plant_m.len() - 1] - plant_m[stop_at - 1]).abs();
                assert!(journey < 0.01, "axis {axis} went on for {journey} m");
                for row in &rows[stop_at..] {
                    assert_eq!(row.torque[axis], 0, "axis {axis}");
                    assert_ne!(row.controlword[axis], 0x0F, "axis {axis}: quick stop");
                }
            }
        }
        // Neither does an offset step, nor stay.
        let torque = rows.iter().map(|row| f64::from(row.torque[axis])).collect::<Vec<_>>();
        if let (Some(force), true) = (spec.force, !spec.interface.targets_torque()) {
            let step_max_n = 4.0 * force.mass_kg * spec.limits.jerk_max_m_s3 * dt_s;
            for k in stop_at.max(1)..torque.len() {
                let step_n = (torque[k] - torque[k - 1]).abs() * 1e-3 * force.rated_n;
                assert!(
                    step_n <= step_max_n + 1e-3 * force.rated_n,
                    "axis {axis}: {step_n} N at {k}"
                );
            }
            assert!(torque[torque.len() - 1].abs() <= 0.0, "axis {axis} keeps its offset");
        }
        // The machine is at rest before its drive is disabled.
        let rest_m_s = rig.rest_m_s[axis];
        assert!(
            rest_m_s.abs() < 0.002,
            "{}: axis {axis} still moves at {rest_m_s} m/s",
            cell.cell.name
        );
    }
}

/// Ticks to the end and checks that the drives of `axes` are disabled and were stopped gently.
fn finish(cell: &Cell, rig: &mut Rig, axes: &[usize]) {
    rig.tick_to_end();
    let states = rig.drive_states();
    for &axis in axes {
        assert_eq!(states[axis], Some(State::SwitchOnDisabled), "axis {axis}");
    }
    check_commands(cell, rig, axes);
}

#[test]
fn asked_to_stop() {
    for name in INPUTS {
        let cell = short(name);
        let mut rig = in_motion(&cell);
        rig.ask_to_stop(15);
        finish(&cell, &mut rig, &[0, 1]);
        assert_eq!(rig.reason, Some(StopReason::Asked(15)), "{name}");
        assert_eq!(rig.ended.len(), 1, "the broken run did not count");
    }
}

#[test]
fn asked_to_stop_in_every_phase() {
    for name in INPUTS {
        let cell = short(name);
        for phase in
            [PhaseName::Enabling, PhaseName::Returning, PhaseName::Settling, PhaseName::Running]
        {
            for ticks in [1, 7, 60] {
                let mut rig = Rig::new(&cell, 3);
                rig.tick(0);
                rig.tick_until(|rig| rig.phase.0 == phase);
                for _ in 0..ticks {
                    rig.tick(0);
                }
                rig.ask_to_stop(2);
                rig.tick_to_end();
                assert_eq!(rig.reason, Some(StopReason::Asked(2)), "{name} {phase:?}");
                let off = Some(State::SwitchOnDisabled);
                assert_eq!(rig.drive_states(), [off, off], "{name} {phase:?}");
                check_commands(&cell, &rig, &[0, 1]);
            }
        }
    }
}

#[test]
fn a_drive_that_falls_silent_stops_the_other() {
    for name in INPUTS {
        let cell = short(name);
        let mut rig = in_motion(&cell);
        rig.tap.line().meddle(|machine, _| assert!(machine.mute(node(X))));
        finish(&cell, &mut rig, &[1]);
        assert!(
            matches!(rig.reason, Some(StopReason::SilentAxis { axis: 0, cycles: 1 })),
            "{rig:?}"
        );
        // The lost drive is commanded to stop for as long as the loop sends commands.
        let line = rig.tap.line();
        let last = line.rows().last().unwrap();
        assert_eq!(last.controlword[0], 0x02);
    }
}

#[test]
fn a_tool_that_falls_silent_stops_both() {
    for name in INPUTS {
        let cell = short(name);
        let mut rig = in_motion(&cell);
        rig.tap.line().meddle(|machine, _| assert!(machine.mute(node(TOOL))));
        finish(&cell, &mut rig, &[0, 1]);
        assert_eq!(rig.reason, Some(StopReason::SilentTool { cycles: 1 }));
    }
}

#[test]
fn a_drive_with_a_following_error_stops_the_other() {
    let cell = short(INPUTS[0]);
    let mut rig = in_motion(&cell);
    // A window of 10 um: the drive detects a following error, as with a worn brake.
    rig.tap.line().meddle(|machine, _| write_object(X, 0x6065, 1000)(machine));
    finish(&cell, &mut rig, &[1]);
    let Some(StopReason::DriveFault { axis: 0, code, following_error_m }) = rig.reason else {
        panic!("{:?}", rig.reason);
    };
    assert_eq!(code, emcy::CODE_FOLLOWING_ERROR);
    assert!(following_error_m.abs() > 10e-6, "{following_error_m}");
    assert_eq!(rig.drive_states()[0], Some(State::Fault));
}

#[test]
fn an_axis_that_cannot_follow_stops_both() {
    for name in INPUTS {
        let mut cell = short(name);
        // The motor of x is too weak to overcome its friction.
        let simulation = &mut cell.axes[0].simulation;
        simulation.force_max_n = 60.0;
        (simulation.coulomb_n, simulation.static_n) = (60.0, 60.0);
        let mut rig = Rig::new(&cell, 1);
        rig.tick_to_end();
        assert!(
            matches!(rig.reason, Some(StopReason::FollowingError { axis: 0, error_m })
                if error_m.abs() > cell.axes[0].limits.following_error_max_m)
                || matches!(rig.reason, Some(StopReason::NoMotion { axis: 0, .. })),
            "{name} {:?}",
            rig.reason
        );
        assert_eq!(rig.drive_states()[1], Some(State::SwitchOnDisabled));
    }
}

#[test]
fn a_table_with_what_is_no_number_stops_before_it_is_used() {
    for name in INPUTS {
        let cell = short(name);
        for bad in [f64::NAN, f64::INFINITY] {
            let mut rig = Rig::new(&cell, 3);
            let mut table = smooth_table(rig.n_samples, size(&cell));
            table[2 * MIDDLE as usize + 1] = bad;
            rig.mail.send_table(1, table).unwrap();
            finish(&cell, &mut rig, &[0, 1]);
            assert_eq!(rig.reason, Some(StopReason::NotFinite { axis: 1 }), "{name}");
            let last = rig.samples.iter().filter_map(|sample| sample.at).next_back();
            assert_eq!(last, Some((0, MIDDLE - 1)), "{name}");
        }
    }
}

#[test]
fn overruns_are_counted_and_many_in_a_row_stop() {
    let mut cell = short(INPUTS[0]);
    cell.safety.overrun_cycles_max = 5;
    let mut rig = Rig::new(&cell, 3);
    rig.tick_into_run(0, MIDDLE);
    for missed in [1, 4, 0, 5, 0] {
        assert_eq!(rig.tick(missed), TickStatus::Running);
    }
    rig.tick_until(|rig| !rig.ended.is_empty());
    assert_eq!((rig.ended[0], rig.reason), ((0, 10), None), "counted, and no reason to stop");
    rig.tick_into_run(1, MIDDLE);
    for missed in [2, 2, 2] {
        rig.tick(missed);
    }
    assert_eq!(rig.reason, Some(StopReason::Overrun { cycles: 6 }));
    finish(&cell, &mut rig, &[0, 1]);
}

#[test]
fn a_node_that_restarts_stops_the_others() {
    for name in INPUTS {
        let cell = short(name);
        for (number, rest) in [(X, &[1][..]), (TOOL, &[0, 1][..])] {
            let mut rig = in_motion(&cell);
            rig.tap.line().meddle(|machine, reply| {
                machine.receive(&NmtCommand::ResetNode.frame(Some(node(number))), reply);
            });
            finish(&cell, &mut rig, rest);
            assert_eq!(rig.reason, Some(StopReason::NodeLeft { node: number }), "{name}");
        }
    }
}

/// Runs a campaign in which `meddle` happens in the middle of run 1.
fn campaign_with(
    cell: &Cell,
    meddle: impl FnOnce(&mut ilc_sim::Machine, &mut dyn FnMut(ilc_rt::fieldbus::Frame)) + Send + 'static,
) -> (Outcome, Vec<Event>) {
    let scratch = Scratch::new();
    let tap = Tap::new(cell);
    let mut meddle: Option<ilc_tests::rig::Meddle> = Some(Box::new(meddle));
    let mut events = Vec::new();
    let outcome = campaign::run(
        cell,
        &options(scratch.file("library.db"), 3),
        Box::new(tap.clone()),
        None,
        &mut |event| {
            if matches!(event, Event::State { state: StateName::Running, iteration: 1 }) {
                tap.line().meddle_after(MIDDLE, meddle.take().unwrap());
            }
            events.push(event.clone());
        },
    );
    (outcome.unwrap(), events)
}

#[test]
fn the_reason_is_told_in_one_sentence() {
    let cell = short(INPUTS[0]);
    let fault = |meddle: fn(&mut ilc_sim::Machine, &mut dyn FnMut(ilc_rt::fieldbus::Frame)),
                 kind: FaultKind,
                 parts: &[&str]| {
        let (outcome, events) = campaign_with(&cell, meddle);
        assert_eq!(outcome.status, EndStatus::Fault);
        assert_eq!(outcome.runs.len(), 1, "the run before is kept");
        for part in parts {
            assert!(outcome.reason.contains(part), "{part:?} in {:?}", outcome.reason);
        }
        assert!(!outcome.reason.contains('\n'));
        let mut faults = events.iter().filter_map(|event| match event {
            Event::Fault { reason, fault } if *reason == outcome.reason => Some(fault),
            _ => None,
        });
        let fault = faults.next().expect("a fault in fields");
        assert!(faults.next().is_none());
        assert_eq!(fault.kind, kind);
        assert!(fault.node.is_some_and(|node| outcome.reason.contains(&format!("node {node}"))));
        assert_eq!(fault.cycles.encoder_m.len(), 32);
        assert!(fault.cycles.reference_m.iter().all(|row| row.len() == cell.n_axes()));
        // The last positions before the stop are those of a run under way.
        assert!(fault.cycles.encoder_m[0] != fault.cycles.encoder_m[31]);
        assert!(matches!(events.last(), Some(Event::End { status: EndStatus::Fault, .. })));
    };
    fault(
        |machine, _| write_object(X, 0x6065, 1000)(machine),
        FaultKind::DriveFault,
        &["axis x (node 1)", "0x8611", emcy::meaning(emcy::CODE_FOLLOWING_ERROR), "mm"],
    );
    fault(
        |machine, _| assert!(machine.mute(node(2))),
        FaultKind::SilentDrive,
        &["axis y (node 2)", "silent", "no answer in 2 s"],
    );
    fault(
        |machine, _| assert!(machine.mute(node(TOOL))),
        FaultKind::SilentTool,
        &["node 10", "silent"],
    );
    fault(
        |machine, reply| machine.receive(&NmtCommand::ResetNode.frame(Some(node(X))), reply),
        FaultKind::NodeRestarted,
        &["node 1 restarted"],
    );
}

#[test]
fn a_signal_interrupts_and_is_no_fault() {
    let cell = short(INPUTS[0]);
    let scratch = Scratch::new();
    let options = options(scratch.file("library.db"), 5);
    let stop = Arc::clone(&options.session.stop);
    let bus = Box::new(Tap::new(&cell));
    let outcome = campaign::run(&cell, &options, bus, None, &mut |event| {
        if matches!(event, Event::State { state: StateName::Running, iteration: 2 }) {
            stop.store(libc::SIGINT, Ordering::Relaxed);
        }
    })
    .unwrap();
    assert_eq!((outcome.status, outcome.signal), (EndStatus::Interrupted, libc::SIGINT));
    assert_eq!((outcome.runs.len(), outcome.reason.as_str()), (2, "stopped by Ctrl-C"));
}

#[test]
fn a_silent_drive_on_a_real_bus_is_waited_for_once() {
    let mut cell = short(INPUTS[0]);
    cell.safety.answer_timeout_s = 1.0;
    let scratch = Scratch::new();
    let (near, far) = loopback::pair(1024).unwrap();
    // The far end uses the wall clock only to fall silent; everything before is lock-step.
    let (quiet, heard) = std::sync::mpsc::channel();
    let far_side = FarSide::serve_with(Box::new(far), machine(&cell), move |machine| {
        if heard.try_recv().is_ok() {
            machine.mute(node(X));
        }
    });
    let began = Instant::now();
    let outcome = campaign::run(
        &cell,
        &options(scratch.file("library.db"), 3),
        Box::new(near),
        None,
        &mut |event| {
            if matches!(event, Event::State { state: StateName::Running, iteration: 1 }) {
                quiet.send(()).unwrap();
            }
        },
    )
    .unwrap();
    drop(far_side);
    assert!(outcome.reason.contains("silent"), "{}", outcome.reason);
    // One second of timeout for the first missing answer, and not again for each cycle of the stop.
    assert!(began.elapsed() < Duration::from_secs(30), "{:?}", began.elapsed());
}
