//! Homing: every method finds its home, axes end inside their limits, and whatever goes wrong ends at rest.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::atomic::Ordering;
use std::time::Duration;

use ilc_rt::campaign::{self, Homed, Options, homing_axes};
use ilc_rt::config::{Cell, Input, InputUse, Level};
use ilc_rt::fieldbus::bring_up::SdoClient;
use ilc_rt::fieldbus::cia402::State;
use ilc_rt::record::{EndStatus, Event, FaultKind, StateName};
use ilc_tests::campaign::options;
use ilc_tests::rig::{Tap, node};
use ilc_tests::{Scratch, example_text};

/// The limit switches of the gantry lie a twentieth of its travel beyond the limits.
const SWITCHES_M: [f64; 2] = [-0.026, 0.106];
/// Place of x at power-on.
const START_M: f64 = 0.0437;

/// Returns a gantry with two short moves, and a homing of each axis.
fn cell(x: &str, y: &str) -> Cell {
    // Between two index pulses.
    let text = example_text("01_gantry.toml")
        .replace("position_start_m = 0.04", "position_start_m = 0.0437")
        .replace("position_start_m = 0.02", "position_start_m = 0.0237");
    let program = text.find("[[program.segment]]").unwrap();
    let learning = text.find("[learning]").unwrap();
    let (axes, rest) = text[..program].split_once("[tcp_encoder]").unwrap();
    let (first, second) = axes.rsplit_once("[[axis]]").unwrap();
    let moves = "[[program.segment]]\nto_m = [0.08, 0.02]\n";
    let text = format!(
        "{first}\n{x}\n[[axis]]{second}\n{y}\n[tcp_encoder]{rest}{moves}{}",
        &text[learning..]
    );
    Cell::parse(&text, "cell.toml").unwrap()
}

/// Returns the homing of an axis whose home lies at a place.
fn method(method: i8, offset_m: f64, more: &str) -> String {
    let speeds = match method {
        1 | 2 | 17 | 18 => "speed_switch_m_s = 0.05\nspeed_zero_m_s = 0.005",
        33 | 34 => "speed_zero_m_s = 0.01",
        _ => "",
    };
    format!(
        "[axis.homing]\nkind = \"drive\"\nmethod = {method}\noffset_m = {offset_m}\n{speeds}\n{more}"
    )
}

/// Homes all axes of a cell.
fn home(cell: &Cell, tap: &Tap) -> Homed {
    watched(cell, tap, false, &mut |_| None)
}

fn watched(
    cell: &Cell,
    tap: &Tap,
    again: bool,
    report: &mut dyn FnMut(Option<&str>) -> Option<String>,
) -> Homed {
    let session = options(std::path::PathBuf::new(), 1).session;
    let bus = Box::new(tap.clone());
    campaign::home(cell, &homing_axes(cell), again, &session, bus, report).unwrap()
}

fn plant_m(tap: &Tap, axis: usize) -> f64 {
    tap.line().machine().plant().encoder_m(axis)
}

/// Both drives are off, and the axes at rest.
fn is_at_rest(tap: &Tap) {
    let line = tap.line();
    let machine = line.machine();
    for axis in 0..2 {
        let velocity_m_s = machine.plant().encoder_velocity_m_s(axis);
        assert!(velocity_m_s.abs() < 1e-3, "axis {axis}: {velocity_m_s}");
    }
    assert!(!machine.is_energised());
}

/// Runs the program once; returns status and reason of its end.
fn run(
    cell: &Cell,
    tap: &Tap,
    change: impl Fn(&mut Options),
) -> Result<(EndStatus, String), String> {
    let scratch = Scratch::new();
    let mut options = options(scratch.file("library.db"), 1);
    change(&mut options);
    let bus = Box::new(tap.clone());
    let outcome = campaign::run(cell, &options, bus, None, &mut |_| {});
    outcome.map(|end| (end.status, end.reason)).map_err(|error| error.to_string())
}

#[test]
fn every_method_homes_an_axis_that_then_runs() {
    let [low_m, high_m] = SWITCHES_M;
    for (number, reversed, home_m) in [
        (1, false, -0.02),
        (2, false, 0.10),
        (17, false, low_m),
        (18, false, high_m),
        (33, false, 0.04),
        (34, false, 0.05),
        (35, false, START_M),
        (37, false, START_M),
        // The negative direction of the drive is the positive one of the axis.
        (1, true, 0.10),
        (2, true, -0.02),
        (17, true, high_m),
        (18, true, low_m),
        (33, true, 0.05),
        (34, true, 0.04),
        (35, true, START_M),
    ] {
        for polarity in [0, 192] {
            let mut cell = cell(&method(number, home_m, ""), "");
            (cell.axes[0].reversed, cell.axes[0].drive.polarity) = (reversed, polarity);
            let tap = Tap::new(&cell);
            let case = format!("method {number}, reversed {reversed}, polarity {polarity}");
            let line = run(&cell, &tap, |_| {}).unwrap_err();
            assert!(line.contains("axis x (node 1) is not homed"), "{case}: {line}");
            let homed = home(&cell, &tap);
            assert_eq!(homed.status, EndStatus::Completed, "{case}: {}", homed.reason);
            is_at_rest(&tap);
            let axis = &homed.axes[0];
            assert!(axis.homed && !axis.was_homed && axis.error.is_none(), "{case}: {axis:?}");
            let shown_m = axis.position_m.unwrap();
            assert!((shown_m - plant_m(&tap, 0)).abs() < 5e-6, "{case}: {shown_m}");
            assert!((-0.02..=0.10).contains(&shown_m), "{case}: {shown_m}");
            let again = home(&cell, &tap);
            assert!(again.axes[0].was_homed, "{case}");
            assert_eq!(
                run(&cell, &tap, |_| {}).map(|end| end.0),
                Ok(EndStatus::Completed),
                "{case}"
            );
        }
    }
}

#[test]
fn an_axis_on_its_switch_is_brought_inside_slowly() {
    let cell = cell(&method(17, SWITCHES_M[0], ""), "");
    let tap = Tap::new(&cell);
    let homed = home(&cell, &tap);
    assert_eq!(homed.status, EndStatus::Completed, "{}", homed.reason);
    // A hundredth of the travel inside.
    // Friction leaves it some micrometres short of that.
    assert!((plant_m(&tap, 0) - (-0.02 + 0.0012)).abs() < 1e-4, "{}", plant_m(&tap, 0));
    let path_m = tap.line().plant_m(0);
    let lowest = path_m.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    let (dt_s, limits) = (cell.cycle_s(), &cell.axes[0].limits);
    for three in path_m[lowest..].windows(3) {
        let velocity_m_s = (three[1] - three[0]) / dt_s;
        let acceleration_m_s2 = (three[2] - 2.0 * three[1] + three[0]) / (dt_s * dt_s);
        assert!(velocity_m_s < 1.1 * cell.jog_velocity_m_s(0), "{velocity_m_s}");
        assert!(
            acceleration_m_s2.abs() < 1.5 * limits.acceleration_max_m_s2,
            "{acceleration_m_s2}"
        );
    }
    // The drive has the limits of the cell again, not those of the way inside.
    let client = SdoClient::new(node(1), Duration::from_secs(2));
    let low = client.upload_u32(&mut tap.clone(), 0x607D, 1).unwrap().cast_signed();
    assert!((f64::from(low) / 1e8 - (-0.02 - SWITCHES_M[0])).abs() < 1e-7, "{low}");
}

#[test]
fn a_way_inside_that_is_broken_off_is_made_later() {
    let cell = cell(&method(17, SWITCHES_M[0], ""), "");
    let tap = Tap::new(&cell);
    let homed = watched(&cell, &tap, false, &mut |line| {
        let is_on_its_way = line.is_some_and(|line| line.starts_with("bringing inside"));
        is_on_its_way.then(|| "released".to_owned())
    });
    assert_eq!(homed.status, EndStatus::Interrupted);
    assert!(
        homed.reason.starts_with("released; axis x is homed, but rests at -0.02")
            && homed.reason.ends_with("`ilc-rt home cell.toml --axis x` brings it inside"),
        "{}",
        homed.reason
    );
    is_at_rest(&tap);
    assert!(plant_m(&tap, 0) < -0.02);
    let (status, line) = run(&cell, &tap, |_| {}).unwrap();
    assert_eq!(status, EndStatus::Fault);
    assert!(line.contains("outside -0.02 to 0.1 m"), "{line}");
    let homed = home(&cell, &tap);
    assert_eq!(homed.status, EndStatus::Completed, "{}", homed.reason);
    assert!(homed.axes[0].was_homed && plant_m(&tap, 0) > -0.02);
}

#[test]
fn turns_follow_their_order_and_a_homed_axis_is_left_alone() {
    let cell = cell(&method(33, 0.04, "order = 2\n"), &method(34, 0.03, "order = 1\n"));
    let tap = Tap::new(&cell);
    let mut lines: Vec<String> = Vec::new();
    let homed = watched(&cell, &tap, false, &mut |line| {
        lines.extend(line.filter(|line| line.starts_with("searching")).map(str::to_owned));
        None
    });
    assert_eq!(homed.status, EndStatus::Completed, "{}", homed.reason);
    assert_eq!(lines, ["searching home: y by method 34", "searching home: x by method 33"]);
    let names: Vec<&str> = homed.axes.iter().map(|axis| axis.axis.as_str()).collect();
    assert_eq!(names, ["y", "x"]);
    let [x_m, y_m] = [0, 1].map(|axis| tap.line().plant_m(axis));
    let begins = |path_m: &[f64]| path_m.iter().position(|at_m| (at_m - path_m[0]).abs() > 1e-4);
    assert!(begins(&y_m) < begins(&x_m));
    let before_m = plant_m(&tap, 0);
    let again = watched(&cell, &tap, false, &mut |line| {
        assert!(line.is_none_or(|line| !line.starts_with("searching")), "{line:?}");
        None
    });
    assert!(again.axes.iter().all(|axis| axis.was_homed && axis.homed));
    assert!((plant_m(&tap, 0) - before_m).abs() < 1e-6);
    // Asked for, home is searched again: the next index pulse below.
    let again = watched(&cell, &tap, true, &mut |_| None);
    assert!(again.axes.iter().all(|axis| !axis.was_homed && axis.homed), "{again:?}");
    assert!(plant_m(&tap, 0) < before_m - 0.005);
}

#[test]
fn a_homing_that_takes_too_long_ends_at_rest() {
    let later = method(33, 0.04, "order = 2\n");
    let cell = cell(&later, &method(17, SWITCHES_M[0], "timeout_s = 0.5\n"));
    let tap = Tap::new(&cell);
    let homed = home(&cell, &tap);
    assert_eq!(homed.status, EndStatus::Fault);
    assert_eq!(homed.reason, "axis y: no home within homing.timeout_s = 0.5 s by method 17");
    assert_eq!(homed.axes[1].error.as_deref(), Some("its turn did not come"));
    is_at_rest(&tap);
    let line = run(&cell, &tap, |_| {}).unwrap_err();
    assert!(line.contains("is not homed"), "{line}");
}

#[test]
fn a_homing_error_of_the_drive_is_told() {
    let mut cell = cell(&method(33, 0.0, ""), "");
    // The next pulse lies beyond the switch.
    cell.axes[0].simulation.index_pitch_m = 1.0;
    cell.axes[0].simulation.position_start_m = -0.015;
    let tap = Tap::new(&cell);
    let homed = home(&cell, &tap);
    assert_eq!(homed.status, EndStatus::Fault);
    let reason = "axis x: homing error: the drive found no home by method 33 (statusword 0x2";
    assert!(homed.reason.starts_with(reason), "{}", homed.reason);
    assert!(!homed.axes[0].homed);
    is_at_rest(&tap);
}

#[test]
fn a_request_to_stop_brings_every_axis_to_rest() {
    let both = cell(&method(17, SWITCHES_M[0], ""), &method(17, SWITCHES_M[0], ""));
    let released = |line: Option<&str>| {
        let moves = line.is_some_and(|line| line.starts_with("homing: "));
        moves.then(|| "standard input was closed".to_owned())
    };
    let tap = Tap::new(&both);
    let homed = watched(&both, &tap, false, &mut |line| released(line));
    assert_eq!((homed.status, homed.signal), (EndStatus::Interrupted, 0));
    assert_eq!(homed.reason, "standard input was closed");
    is_at_rest(&tap);
    assert!((-0.02..0.0427).contains(&plant_m(&tap, 0)), "it moved, and stopped before its switch");
    assert!(homed.axes.iter().all(|axis| axis.error.as_deref() == Some("broken off")));

    let tap = Tap::new(&both);
    let session = options(std::path::PathBuf::new(), 1).session;
    let mut report = |line: Option<&str>| {
        if line.is_some_and(|line| line.starts_with("homing: ")) {
            session.stop.store(2, Ordering::Relaxed);
        }
        None
    };
    let bus = Box::new(tap.clone());
    let homed = campaign::home(&both, &[0, 1], false, &session, bus, &mut report).unwrap();
    assert_eq!((homed.status, homed.signal), (EndStatus::Interrupted, 2));
    assert_eq!(homed.reason, "stopped by Ctrl-C");
    is_at_rest(&tap);
}

#[test]
fn a_drive_that_is_lost_or_faults_stops_the_other() {
    let both = cell(&method(17, SWITCHES_M[0], ""), &method(17, SWITCHES_M[0], ""));
    for (faults, reason) in [
        (false, "axis x: the drive does not answer any more"),
        (true, "axis x: drive in fault: 0x3210"),
    ] {
        let tap = Tap::new(&both);
        let homed = watched(&both, &tap, false, &mut |line| {
            if line.is_some_and(|line| line.starts_with("homing: ")) {
                if faults {
                    let client = SdoClient::new(node(1), Duration::from_secs(2));
                    let code = 0x3210_u16.to_le_bytes();
                    let _ = client.download(&mut tap.clone(), 0x2002, 0, &code);
                } else {
                    tap.line().meddle(|machine, _| assert!(machine.mute(node(1))));
                }
            }
            None
        });
        assert_eq!(homed.status, EndStatus::Fault);
        assert!(homed.reason.starts_with(reason), "{}", homed.reason);
        assert_eq!(homed.axes[1].error.as_deref(), Some("broken off"));
        let line = tap.line();
        assert_eq!(line.machine().drive_state(node(2)), Some(State::SwitchOnDisabled));
        assert!(!line.machine().is_energised());
    }
}

#[test]
fn a_home_offset_of_the_drive_shifts_its_zero() {
    // The zero lies 2 000 000 counts, or 20 mm, above the home.
    let homing = method(35, START_M + 0.02, "") + "[axis.drive]\nhome_offset = 2_000_000\n";
    let cell = cell(&homing, "");
    let tap = Tap::new(&cell);
    let homed = home(&cell, &tap);
    assert_eq!(homed.status, EndStatus::Completed, "{}", homed.reason);
    let shown_m = homed.axes[0].position_m.unwrap();
    assert!((shown_m - START_M).abs() < 1e-6, "{shown_m}");
    assert_eq!(run(&cell, &tap, |_| {}).map(|end| end.0), Ok(EndStatus::Completed));
}

#[test]
fn a_run_homes_first_where_that_is_asked_for() {
    let needed = cell(&method(17, SWITCHES_M[0], ""), &method(33, 0.02, "order = 2\n"));
    let (tap, scratch) = (Tap::new(&needed), Scratch::new());
    let mut options = options(scratch.file("library.db"), 1);
    options.session.home = true;
    let mut states = Vec::new();
    let outcome =
        campaign::run(&needed, &options, Box::new(tap.clone()), None, &mut |event: &Event| {
            if let Event::State { state, .. } = event {
                states.push(*state);
            }
        })
        .unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    assert_eq!(outcome.runs.len(), 1);
    assert_eq!(states[..3], [StateName::BringingUp, StateName::Homing, StateName::Enabling]);
}

#[test]
fn a_run_whose_homing_fails_ends_before_it_begins() {
    let needed = cell(&method(17, SWITCHES_M[0], "timeout_s = 0.2\n"), "");
    let (tap, scratch) = (Tap::new(&needed), Scratch::new());
    let mut options = options(scratch.file("library.db"), 1);
    options.session.home = true;
    let (mut faults, mut ends) = (Vec::new(), Vec::new());
    let outcome =
        campaign::run(&needed, &options, Box::new(tap.clone()), None, &mut |event| match event {
            Event::Fault { fault, .. } => faults.push((fault.kind, fault.axis.clone())),
            Event::End { status, reason, iterations } => {
                ends.push((*status, reason.clone(), *iterations));
            }
            _ => {}
        })
        .unwrap();
    assert_eq!(outcome.status, EndStatus::Fault);
    assert_eq!(outcome.reason, "axis x: no home within homing.timeout_s = 0.2 s by method 17");
    assert!(outcome.runs.is_empty());
    assert_eq!(faults, [(FaultKind::NotHomed, Some("x".to_owned()))]);
    assert_eq!(ends, [(EndStatus::Fault, outcome.reason, 0)]);
    is_at_rest(&tap);
}

/// Returns an input of the drive of y.
fn input_of_y(name: &str, bit: u8, active: Level, purpose: InputUse) -> Input {
    let (name, axis) = (name.to_owned(), "y".to_owned());
    Input { name, axis, bit, active, purpose, direction: None, debounce_cycles: 5 }
}

#[test]
fn a_guard_that_opens_ends_a_homing_also_on_another_drive() {
    let mut guarded = cell(&method(17, SWITCHES_M[0], ""), "");
    guarded.inputs = vec![
        input_of_y("door", 16, Level::High, InputUse::Guard),
        input_of_y("halt", 18, Level::Low, InputUse::Stop),
    ];
    guarded.axes[1].simulation.digital_inputs = 0x0005_0000;
    for (opened, name) in [(0x0004_0000, "door"), (0x0001_0000, "halt")] {
        for moment in ["homing: ", "bringing inside"] {
            let tap = Tap::new(&guarded);
            let mut is_open = false;
            let homed = watched(&guarded, &tap, false, &mut |line| {
                // The first line of the way inside comes before the drives are on.
                if line.is_some_and(|line| line.starts_with(moment) && line.contains(" m")) {
                    tap.line().meddle(|machine, _| assert!(machine.set_inputs(node(2), opened)));
                    is_open = true;
                }
                None
            });
            assert!(is_open, "{moment}");
            assert_ne!(homed.status, EndStatus::Completed, "{moment} {name}");
            assert!(homed.reason.contains(name), "{}", homed.reason);
            is_at_rest(&tap);
            let session = options(std::path::PathBuf::new(), 1).session;
            let bus = Box::new(tap.clone());
            let refused = campaign::home(&guarded, &[0], true, &session, bus, &mut |_| None);
            assert!(refused.unwrap_err().to_string().contains(name));
            tap.line().meddle(|machine, _| assert!(machine.set_inputs(node(2), 0x0005_0000)));
            let homed = home(&guarded, &tap);
            assert_eq!(homed.status, EndStatus::Completed, "{}", homed.reason);
        }
    }
}
