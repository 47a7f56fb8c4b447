//! Lost, late, duplicated and unreadable answers: validity of samples, the report of a drive that
//! falls silent in part, and no learning from a disturbed run.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::VecDeque;

use ilc_rt::campaign::{self, Outcome};
use ilc_rt::config::{AxisUnit, Cell};
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{Emergency, Heartbeat, NmtState, NodeId, emcy};
use ilc_rt::fieldbus::cia402::{Controlword, DriveMotionTpdo2, EncoderSample, State, StatusTpdo1};
use ilc_rt::library::Library;
use ilc_rt::record::{EndStatus, IterationRecord};
use ilc_rt::servo::{PhaseName, Sample, StopReason};
use ilc_tests::campaign::options;
use ilc_tests::rig::{Distort, Rig, Tap, node, write_object};
use ilc_tests::{Scratch, patient, short};

const CELLS: [&str; 2] = ["01_gantry.toml", "02_parallel.toml"];
const X: u8 = 1;
const TOOL: u8 = 10;

/// Selects the frames affected by a fault.
type Which = fn(&Frame) -> bool;

const PDOS: [(&str, Which); 3] = [
    ("TPDO1", |frame| StatusTpdo1::decode(frame, node(X)).is_some()),
    ("TPDO2", |frame| DriveMotionTpdo2::decode(frame, node(X)).is_some()),
    ("tool", |frame| EncoderSample::decode(frame, node(TOOL)).is_some()),
];

/// Loses some frames, counted from the first one that `which` matches.
fn lose(which: Which, lost: std::ops::Range<u32>) -> Distort {
    let mut n = 0;
    Box::new(move |_, frame, out| {
        if which(&frame) {
            n += 1;
            if lost.contains(&(n - 1)) {
                return;
            }
        }
        out.push_back(frame);
    })
}

/// Checks every valid sample against the position of the plant at its SYNC; returns the number of
/// invalid ones.
fn missing(cell: &Cell, rig: &Rig) -> usize {
    let line = rig.tap.line();
    let counts = rig.samples.iter().filter(|sample| sample.at.is_some());
    let mut n_missing = 0;
    for axis in 0..cell.axes.len() {
        let plant_m = line.plant_m(axis);
        let first = plant_m.len() - line.n_syncs();
        for sample in counts.clone() {
            if sample.missing {
                n_missing += usize::from(axis == 0);
                continue;
            }
            let at = first + usize::try_from(sample.sync).unwrap();
            let error_m = (sample.encoder_m[axis] - plant_m[at]).abs();
            assert!(error_m <= 1.0 / cell.axes[axis].counts_per_m, "{error_m} at {}", sample.sync);
        }
    }
    n_missing
}

#[test]
fn what_is_lost_of_an_answer_is_missing_and_nothing_else() {
    for name in CELLS {
        let cell = short(name);
        for (what, which) in PDOS {
            for n_lost in [1, 10, 19] {
                let mut rig = Rig::on_clock(&cell, 1);
                rig.tick_into_run(0, 100);
                rig.tap.line().distort(lose(which, 0..n_lost));
                rig.tick_to_end();
                assert_eq!(rig.reason, None, "{name} {what} {n_lost}");
                let n = missing(&cell, &rig);
                // A velocity computed from a stale position disturbs a few cycles more.
                assert!(n >= n_lost as usize && n <= n_lost as usize + 10, "{name} {what}: {n}");
            }
        }
    }
}

#[test]
fn what_is_late_is_in_its_own_cycle() {
    let cell = short(CELLS[0]);
    for n_late in [1, 5, 15] {
        let mut rig = Rig::on_clock(&cell, 1);
        rig.tick_into_run(0, 100);
        let mut waiting = VecDeque::new();
        let mut from = None;
        rig.tap.line().distort(Box::new(move |n_syncs, frame, out| {
            let from = *from.get_or_insert(n_syncs);
            if n_syncs < from + n_late {
                waiting.push_back(frame);
            } else {
                out.extend(waiting.drain(..));
                out.push_back(frame);
            }
        }));
        rig.tick_to_end();
        assert_eq!(rig.reason, None);
        assert_eq!(missing(&cell, &rig), 0, "{n_late}: late is not lost");
    }
}

#[test]
fn what_comes_twice_is_not_believed() {
    for name in CELLS {
        let cell = short(name);
        let mut rig = Rig::on_clock(&cell, 1);
        rig.tick_into_run(0, 100);
        let mut n = 0;
        rig.tap.line().distort(Box::new(move |_, frame, out| {
            if PDOS[0].1(&frame) {
                n += 1;
                if (20..25).contains(&n) {
                    out.push_back(frame);
                }
            }
            out.push_back(frame);
        }));
        rig.tick_to_end();
        let n = missing(&cell, &rig);
        assert!((5..=7).contains(&n), "{name}: {n}");
    }
}

#[test]
fn a_part_that_falls_silent_is_named() {
    for name in CELLS {
        let cell = short(name);
        for (what, which) in PDOS {
            for lockstep in [true, false] {
                for phase in [PhaseName::Enabling, PhaseName::Settling, PhaseName::Running] {
                    let mut rig =
                        if lockstep { Rig::new(&cell, 2) } else { Rig::on_clock(&cell, 2) };
                    if phase != PhaseName::Enabling {
                        rig.tick_until(|rig| rig.phase.0 == phase);
                    }
                    rig.tap.line().distort(lose(which, 0..u32::MAX));
                    rig.tick_to_end();
                    let cycles = if lockstep { 1 } else { cell.safety.silent_cycles_max + 1 };
                    let right = match (what, rig.reason) {
                        ("TPDO1", Some(StopReason::SilentPdo { axis: 0, pdo: 1, cycles: n }))
                        | ("TPDO2", Some(StopReason::SilentPdo { axis: 0, pdo: 2, cycles: n }))
                        | ("tool", Some(StopReason::SilentTool { cycles: n })) => n == cycles,
                        _ => false,
                    };
                    assert!(right, "{name} {what} {lockstep} {phase:?}: {:?}", rig.reason);
                }
            }
        }
    }
}

/// Runs a campaign in lock-step on a line with distorted answers.
fn campaign_with(cell: &Cell, distort: Distort) -> Outcome {
    let scratch = Scratch::new();
    let tap = Tap::new(cell);
    tap.line().distort(distort);
    let options = options(scratch.file("library.db"), 2);
    campaign::run(cell, &options, Box::new(tap.clone()), None, &mut |_| {}).unwrap()
}

#[test]
fn a_pdo_of_another_length_is_named() {
    let cell = short(CELLS[0]);
    for (id, n_bytes, sentence) in [
        (0x181, 6, "no status of node 1: its TPDO1 has 6 bytes, 8 are needed"),
        (0x182, 0, "no status of node 2: its TPDO1 has 0 bytes, 8 are needed"),
        (0x281, 4, "no following error of node 1: its TPDO2 has 4 bytes, 8 are needed"),
        (0x18A, 4, "no position of node 10: its TPDO1 has 4 bytes, 8 are needed"),
    ] {
        let shorten = move |_, frame: Frame, out: &mut VecDeque<Frame>| {
            out.push_back(if frame.id() == id {
                Frame::new(id, &frame.payload()[..n_bytes]).unwrap()
            } else {
                frame
            });
        };
        let outcome = campaign_with(&cell, Box::new(shorten));
        assert_eq!((outcome.status, outcome.reason.as_str()), (EndStatus::Fault, sentence));
        // In real time the same, after the longest silence allowed.
        let mut rig = Rig::on_clock(&cell, 1);
        rig.tap.line().distort(Box::new(shorten));
        rig.tick_to_end();
        let right = matches!(rig.reason, Some(StopReason::WrongLength { n_bytes: n, .. })
            if usize::from(n) == n_bytes);
        assert!(right, "{:?}", rig.reason);
    }
}

#[test]
fn a_status_that_never_came_is_not_reported() {
    for lockstep in [true, false] {
        let cell = short(CELLS[0]);
        let mut rig = if lockstep { Rig::new(&cell, 1) } else { Rig::on_clock(&cell, 1) };
        rig.tap.line().distort(lose(PDOS[0].1, 0..u32::MAX));
        rig.tick_to_end();
        assert!(matches!(rig.reason, Some(StopReason::SilentPdo { axis: 0, pdo: 1, .. })));
        // Nor was any drive enabled while the state of one was unknown.
        for row in rig.tap.line().rows() {
            assert!(row.controlword.iter().all(|word| *word & 0x0D == 0), "{row:?}");
        }
    }
}

#[test]
fn a_fault_is_named_with_and_without_its_emergency_message() {
    let cell = short(CELLS[0]);
    // Without the message the drive is asked for its error code (0x603F).
    for kept in [true, false] {
        let scratch = Scratch::new();
        let tap = Tap::new(&cell);
        // Received before the drive is enabled: not the cause of later events.
        let old = Emergency { node: node(X), code: 0x3210, register: 0, vendor: [0; 5] };
        let mut told = false;
        tap.line().distort(Box::new(move |_, frame, out| {
            if !told && StatusTpdo1::decode(&frame, node(X)).is_some() {
                told = true;
                out.push_back(old.encode());
            }
            if kept || Emergency::decode(&frame).is_none() {
                out.push_back(frame);
            }
        }));
        tap.line().meddle_after(900, Box::new(|machine, _| write_object(X, 0x6065, 1000)(machine)));
        let options = options(scratch.file("library.db"), 3);
        let outcome =
            campaign::run(&cell, &options, Box::new(tap.clone()), None, &mut |_| {}).unwrap();
        assert_eq!(outcome.status, EndStatus::Fault);
        assert!(outcome.reason.contains("0x8611 following error"), "{}", outcome.reason);
        assert!(!outcome.reason.contains("0x0000") && !outcome.reason.contains("3210"));
    }
    assert_eq!(emcy::meaning(emcy::CODE_FOLLOWING_ERROR), "following error");
}

#[test]
fn a_node_that_says_that_it_was_stopped_is_told_as_that() {
    let said = |state, node: u8| Heartbeat { node: NodeId::new(node).unwrap(), state }.encode();
    for (frame, reason) in [
        (said(NmtState::BootUp, X), StopReason::NodeLeft { node: X }),
        (said(NmtState::Stopped, X), StopReason::NodeStopped { node: X, state: NmtState::Stopped }),
        (
            said(NmtState::PreOperational, TOOL),
            StopReason::NodeStopped { node: TOOL, state: NmtState::PreOperational },
        ),
    ] {
        let cell = short(CELLS[0]);
        let mut rig = Rig::on_clock(&cell, 2);
        rig.tick_into_run(0, 100);
        rig.tap.line().meddle(|_, reply| reply(frame));
        rig.tick_to_end();
        assert_eq!(rig.reason, Some(reason));
        // Silent first, then it sends the reason: the stop is reported with that reason.
        let mut rig = Rig::on_clock(&cell, 2);
        rig.tick_into_run(0, 100);
        rig.tap.line().meddle(|machine, _| {
            machine.mute(node(X));
            machine.mute(node(TOOL));
        });
        rig.tick_until(|rig| rig.reason.is_some());
        assert!(matches!(rig.reason, Some(StopReason::SilentAxis { axis: 0, .. })));
        rig.tap.line().meddle(|_, reply| reply(frame));
        rig.tick_to_end();
        let about_x = frame.id() == 0x701;
        assert_eq!(rig.reason == Some(reason), about_x, "{:?}", rig.reason);
    }
}

#[test]
fn a_heartbeat_from_before_the_start_is_no_stop() {
    let before =
        Heartbeat { node: NodeId::new(X).unwrap(), state: NmtState::PreOperational }.encode();
    let mut rig = Rig::on_clock(&short(CELLS[0]), 2);
    rig.tap.line().meddle(move |_, reply| reply(before));
    rig.tick_into_run(0, 100);
    assert_eq!(rig.reason, None);
}

#[test]
fn a_drive_that_switched_itself_off_is_not_switched_on_again_by_a_stop() {
    for name in CELLS {
        let cell = short(name);
        let mut rig = Rig::on_clock(&cell, 2);
        rig.tick_into_run(0, 100);
        rig.ask_to_stop(2);
        rig.tick(0);
        // The drive loses power in the middle of the stop.
        rig.tap.line().meddle(|machine, _| {
            let off = Controlword::DISABLE_VOLTAGE.0.into();
            write_object(X, 0x6040, off)(machine);
        });
        rig.tick_to_end();
        let words: Vec<u16> = rig.tap.line().rows().map(|row| row.controlword[0]).collect();
        let last_on = words.iter().rposition(|word| *word == 0x0F).unwrap();
        let n = words[last_on + 1..].iter().filter(|word| **word == 0x06).count();
        assert!(n < 3, "{name}: {words:x?}");
        assert_eq!(rig.drive_states()[0], Some(State::SwitchOnDisabled));
        // Told when they changed, and only then.
        let told: Vec<_> = rig.told_states.iter().map(|states| [states[0], states[1]]).collect();
        let (on, off) = (Some(State::OperationEnabled), Some(State::SwitchOnDisabled));
        assert!(told.contains(&[on, on]), "{name}: {told:?}");
        assert_eq!(told.last(), Some(&[off, off]), "{name}: {told:?}");
        assert!(told.windows(2).all(|pair| pair[0] != pair[1]) && told.len() < 20);
    }
}

/// Runs of a real-time campaign on a line disturbed by `distort` in run 0.
fn disturbed(name: &str, distort: Distort) -> Vec<IterationRecord> {
    let cell = patient(short(name));
    let scratch = Scratch::new();
    let tap = Tap::new(&cell);
    tap.line().distort(distort);
    let library = scratch.file("library.db");
    let mut options = options(library.clone(), 3);
    options.session.lockstep = false;
    let outcome = campaign::run(&cell, &options, Box::new(tap.clone()), None, &mut |_| {}).unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    let library = Library::open(&library).unwrap();
    let rows = library.list(None).unwrap();
    rows.iter().map(|row| library.load(row.id).unwrap().record).collect()
}

#[test]
fn a_disturbed_run_is_repeated_the_first_one_too() {
    // By the clock each takes seconds, in which it waits: all at the same time.
    std::thread::scope(|scope| {
        for name in CELLS {
            for (n, kind) in [(19, 0), (1, 0), (3, 1), (400, 2)] {
                scope.spawn(move || assert_repeated(name, n, kind));
            }
        }
    });
}

/// Disturbs `n` statuses of run 0: lost (kind 0), doubled (1), or followed by a flood of foreign frames (2).
fn assert_repeated(name: &'static str, n: u32, kind: u8) {
    // In the middle of run 0: enabling, return and settling take about a second.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1300")]
    let first = (1.3 / short(name).cycle_s()) as u32;
    let mut count = 0;
    let distort: Distort = Box::new(move |_, frame, out| {
        let is_status = PDOS[0].1(&frame);
        count += u32::from(is_status);
        let on = (first..first + n).contains(&count);
        match kind {
            0 if on && is_status => return,
            1 if on && is_status => out.push_back(frame),
            2 if count == first && is_status => {
                for id in 0..300_u16 {
                    out.push_back(Frame::new(0x6E0, &id.to_le_bytes()).unwrap());
                }
            }
            _ => {}
        }
        out.push_back(frame);
    });
    let runs = disturbed(name, distort);
    assert_eq!(runs.len(), 3);
    assert!(runs[0].figures.missing_samples > 0, "{name} {kind}: {:?}", runs[0].figures);
    for pair in runs.windows(2) {
        let figures = &pair[0].figures;
        let is_disturbed = figures.missing_samples > 0 || figures.overruns > 0;
        if is_disturbed {
            assert_eq!(pair[0].input, pair[1].input, "{name} {kind}: repeated");
        }
    }
}

/// Without disturbance no sample is missing.
#[test]
fn samples_of_a_quiet_bus_are_all_there() {
    for name in CELLS {
        let mut cell = short(name);
        cell.axes[0].unit = AxisUnit::M;
        let mut rig = Rig::on_clock(&cell, 2);
        rig.tick_to_end();
        assert_eq!((rig.reason, missing(&cell, &rig)), (None, 0));
        let in_runs: Vec<&Sample> = rig.samples.iter().filter(|s| s.at.is_some()).collect();
        assert_eq!(in_runs.len(), 2 * rig.n_samples);
    }
}
