//! Digital inputs of the drives: guards, start and stop buttons, limit switches, and the emergency stop.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::campaign::control::STOPPED_BY_COMMAND;
use ilc_rt::campaign::{self, Goal, Options, Outcome, StartOn, Travel};
use ilc_rt::config::{Cell, Direction, Input, InputUse, Level, SimulationChange};
use ilc_rt::fieldbus::cia402::State;
use ilc_rt::record::{EndStatus, Event, FaultKind, InputState, StateName};
use ilc_rt::servo::{PhaseName, StopReason};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::rig::{Rig, node};
use ilc_tests::{Scratch, short};

/// A position-commanded cell and a velocity-commanded one.
const CELLS: [&str; 2] = ["01_gantry.toml", "02_parallel.toml"];
/// Node of the drive that the inputs are wired to.
const X: u8 = 1;
/// Bits of the inputs.
const GUARD: u32 = 1 << 16;
const START: u32 = 1 << 17;
/// The stop button opens its contact.
const NOT_STOPPED: u32 = 1 << 18;
const SAFE: u32 = GUARD | NOT_STOPPED;
/// Cycles for which buttons and guards bounce, and more.
const DEBOUNCE: u32 = 5;

fn input(name: &str, bit: u8, active: Level, purpose: InputUse) -> Input {
    let name = name.to_owned();
    let (axis, debounce_cycles) = ("x".to_owned(), DEBOUNCE);
    Input { name, axis, bit, active, purpose, direction: None, debounce_cycles }
}

/// A cell with a guard and two buttons on the drive of its first axis, safe at power-on.
fn cell(name: &str) -> Cell {
    let mut cell = short(name);
    cell.inputs = vec![
        input("door", 16, Level::High, InputUse::Guard),
        input("go", 17, Level::High, InputUse::Start),
        input("halt", 18, Level::Low, InputUse::Stop),
    ];
    cell.axes[0].simulation.digital_inputs = SAFE;
    cell
}

fn set(rig: &Rig, inputs: u32) {
    rig.tap.line().meddle(|machine, _| assert!(machine.set_inputs(node(X), inputs)));
}

fn tick(rig: &mut Rig, n: u32) {
    for _ in 0..n {
        rig.tick(0);
    }
}

/// Ticks to the end; the axes came to rest before their drives were switched off.
fn finish(rig: &mut Rig) -> StopReason {
    rig.tick_to_end();
    assert_eq!(rig.drive_states(), [Some(State::SwitchOnDisabled); 2]);
    assert!(rig.rest_m_s.iter().all(|m_s| m_s.abs() < 0.002), "{:?}", rig.rest_m_s);
    rig.reason.unwrap()
}

fn change(after_s: f64) -> SimulationChange {
    SimulationChange {
        after_s,
        over_s: 0.0,
        axis: None,
        temperature_k: None,
        payload_kg: None,
        force_n: None,
        digital_inputs: None,
        torque_off: None,
    }
}

fn run(cell: &Cell, options: &Options, events: &mut Vec<Event>) -> Result<Outcome, String> {
    let mut observe = |event: &Event| events.push(event.clone());
    campaign::run(cell, options, in_process(cell), None, &mut observe)
        .map_err(|refusal| refusal.to_string())
}

#[test]
fn an_open_guard_stops_the_axes_in_every_phase() {
    for name in CELLS {
        let cell = cell(name);
        for phase in
            [PhaseName::Enabling, PhaseName::Returning, PhaseName::Settling, PhaseName::Running]
        {
            let mut rig = Rig::new(&cell, 2);
            tick(&mut rig, 1);
            rig.tick_until(|rig| rig.phase.0 == phase);
            if phase == PhaseName::Running {
                rig.tick_into_run(0, 150);
            }
            set(&rig, NOT_STOPPED);
            let before = rig.tap.line().n_syncs();
            let reason = finish(&mut rig);
            assert_eq!(reason, StopReason::GuardOpen { input: 0 }, "{name} {phase:?}");
            // The next answer shows it.
            assert!(rig.stopping_at.unwrap() - before <= 2, "{name} {phase:?}");
        }
    }
}

#[test]
fn drives_are_switched_on_only_when_a_guard_has_been_closed_for_a_while() {
    let cell = cell(CELLS[0]);
    let mut rig = Rig::new(&cell, 1);
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Returning);
    let enabled = |rig: &Rig| rig.tap.line().rows().position(|row| row.controlword[0] == 0x0F);
    let plain = {
        let mut rig = Rig::new(&short(CELLS[0]), 1);
        rig.tick_until(|rig| rig.phase.0 == PhaseName::Returning);
        enabled(&rig).unwrap()
    };
    let late = enabled(&rig).unwrap() - plain;
    assert!(late + 1 >= DEBOUNCE as usize - 1, "only {late} cycles later");
}

#[test]
fn a_stop_button_stops_the_axes() {
    for name in CELLS {
        let cell = cell(name);
        let mut rig = Rig::new(&cell, 2);
        rig.tick_into_run(0, 150);
        set(&rig, GUARD);
        assert_eq!(finish(&mut rig), StopReason::StopButton { input: 2 }, "{name}");
    }
}

#[test]
fn every_run_waits_for_a_press_of_its_own() {
    for name in CELLS {
        let cell = cell(name);
        let mut rig = Rig::waiting(&cell, 3);
        let waits = |rig: &Rig| rig.phase.0 == PhaseName::Waiting;
        // Held down from the start: no press.
        set(&rig, SAFE | START);
        rig.tick_until(waits);
        tick(&mut rig, 200);
        assert!(rig.started.is_empty(), "{name}: held down is no press");
        assert_eq!(rig.inputs.on, 0b011);
        // Released and pressed again, with bounce.
        for inputs in [SAFE, SAFE | START, SAFE, SAFE | START, SAFE] {
            set(&rig, inputs);
            tick(&mut rig, 2);
        }
        tick(&mut rig, 20);
        assert!(rig.started.is_empty(), "{name}: bounce is no press");
        set(&rig, SAFE | START);
        tick(&mut rig, DEBOUNCE + 3);
        assert_eq!(rig.started, [(0, 0)], "{name}");
        // Held down, and pressed again in the run: neither starts the next one.
        rig.tick_into_run(0, 50);
        for inputs in [SAFE, SAFE | START] {
            set(&rig, inputs);
            tick(&mut rig, 2 * DEBOUNCE);
        }
        rig.tick_until(|rig| rig.ended.len() == 1 && waits(rig));
        tick(&mut rig, 200);
        assert_eq!(rig.started.len(), 1, "{name}: a press in the run is not one for the next");
        for inputs in [SAFE, SAFE | START] {
            set(&rig, inputs);
            tick(&mut rig, 2 * DEBOUNCE);
        }
        assert_eq!(rig.started, [(0, 0), (1, 0)], "{name}");
        // An open guard while a run waits: it is not the press that decides.
        rig.tick_until(|rig| rig.ended.len() == 2 && waits(rig));
        set(&rig, NOT_STOPPED);
        tick(&mut rig, 1);
        set(&rig, NOT_STOPPED | START);
        assert_eq!(finish(&mut rig), StopReason::GuardOpen { input: 0 });
        assert_eq!(rig.started.len(), 2);
    }
}

#[test]
fn a_press_while_the_inputs_are_silent_starts_nothing() {
    let cell = cell(CELLS[0]);
    let mut rig = Rig::waiting(&cell, 1);
    rig.tick_until(|rig| rig.phase.0 == PhaseName::Waiting);
    tick(&mut rig, 20);
    // TPDO2, which has the inputs.
    rig.tap.line().distort(Box::new(|_, frame, queue| {
        if frame.id() != 0x280 + u16::from(X) {
            queue.push_back(frame);
        }
    }));
    set(&rig, SAFE | START);
    assert_eq!(finish(&mut rig), StopReason::SilentPdo { axis: 0, pdo: 2, cycles: 1 });
    assert!(rig.started.is_empty());
}

#[test]
fn motion_towards_a_limit_switch_stops_and_motion_away_does_not() {
    for name in CELLS {
        // In the run, y moves in positive direction only, and back before the next.
        for (direction, stops_in_run) in [(Direction::Positive, true), (Direction::Negative, false)]
        {
            let mut cell = cell(name);
            let mut limit = input("end of y", 20, Level::High, InputUse::Limit);
            (limit.axis, limit.direction) = ("y".to_owned(), Some(direction));
            cell.inputs.push(limit);
            let mut rig = Rig::new(&cell, 2);
            rig.tick_into_run(0, 100);
            rig.tap.line().meddle(|machine, _| assert!(machine.set_inputs(node(2), 1 << 20)));
            let reason = finish(&mut rig);
            let stopped_at = rig.ended.len();
            assert_eq!(reason, StopReason::LimitSwitch { input: 3, axis: 1 }, "{name}");
            assert_eq!(stopped_at, usize::from(!stops_in_run), "{name} {direction:?}");
        }
    }
}

#[test]
fn bits_of_the_profile_have_their_direction() {
    let mut cell = cell(CELLS[0]);
    let limit = input("low end", 0, Level::High, InputUse::Limit);
    assert_eq!(limit.direction_of(&cell.axes[0]), Some(Direction::Negative));
    cell.axes[0].reversed = true;
    assert_eq!(limit.direction_of(&cell.axes[0]), Some(Direction::Positive));
}

#[test]
fn what_the_inputs_do_not_permit_is_refused_before_anything_moves() {
    let scratch = Scratch::new();
    let cases = [
        (
            NOT_STOPPED,
            "guard door (bit 16 of 0x60FD of axis x, node 1) is open: close it, then start again",
        ),
        (GUARD, "stop button halt (bit 18 of 0x60FD of axis x, node 1) is pressed: release it"),
    ];
    for (inputs, sentence) in cases {
        let mut cell = cell(CELLS[0]);
        cell.axes[0].simulation.digital_inputs = inputs;
        let mut events = Vec::new();
        let refusal = run(&cell, &options(scratch.file("a.db"), 1), &mut events).unwrap_err();
        assert!(refusal.contains(sentence) && refusal.ends_with("nothing has moved"), "{refusal}");
    }
    let mut without = cell(CELLS[0]);
    without.inputs.retain(|input| input.purpose != InputUse::Start);
    let waiting = Options { start: StartOn::Input, ..options(scratch.file("a.db"), 1) };
    let refusal = run(&without, &waiting, &mut Vec::new()).unwrap_err();
    assert!(
        refusal.starts_with("--start input: allowed for a cell with an [[input]]"),
        "{refusal}"
    );
}

#[test]
fn a_campaign_names_the_guard_and_ends_for_a_person_to_start_again() {
    let (mut cell, scratch) = (cell(CELLS[0]), Scratch::new());
    let open = SimulationChange { digital_inputs: Some(NOT_STOPPED), ..change(2.0) };
    // Closed again while the axes come to rest: nothing goes on by itself.
    let closed = SimulationChange { digital_inputs: Some(SAFE), ..change(2.05) };
    cell.simulation.changes =
        [open, closed].map(|c| SimulationChange { axis: Some("x".into()), ..c }).into();
    for forever in [false, true] {
        let mut events = Vec::new();
        let options = Options { forever, ..options(scratch.file("a.db"), 9) };
        let outcome = run(&cell, &options, &mut events).unwrap();
        assert_eq!(outcome.status, EndStatus::Fault);
        let fault = events.iter().find_map(|event| match event {
            Event::Fault { fault, reason } => Some((fault, reason)),
            _ => None,
        });
        let (fault, reason) = fault.unwrap();
        assert_eq!((fault.kind, fault.code), (FaultKind::GuardOpen, Some(16)));
        assert_eq!((fault.axis.as_deref(), fault.node), (Some("x"), Some(1)));
        assert_eq!(fault.input.as_deref(), Some("door"));
        assert!(reason.contains("guard door") && reason.contains("close it, then start again"));
        let door = |on| InputState { name: "door".into(), purpose: "guard".into(), on: Some(on) };
        let told: Vec<&InputState> = events
            .iter()
            .filter_map(|event| match event {
                Event::Inputs { inputs } => Some(&inputs[0]),
                _ => None,
            })
            .collect();
        assert_eq!(told.last(), Some(&&door(true)), "closed again");
        assert!(told.contains(&&door(false)) && told[0] == &door(true));
        let stopped = events
            .iter()
            .position(|event| matches!(event, Event::State { state: StateName::Stopping, .. }));
        let later = &events[stopped.unwrap()..];
        let goes_on = |event: &Event| {
            matches!(
                event,
                Event::State {
                    state: StateName::Enabling | StateName::Returning | StateName::Running,
                    ..
                }
            )
        };
        assert!(!later.iter().any(goes_on));
    }
}

#[test]
fn a_stop_button_is_the_regular_end() {
    let (mut cell, scratch) = (cell(CELLS[0]), Scratch::new());
    let pressed = SimulationChange { digital_inputs: Some(GUARD), ..change(2.0) };
    cell.simulation.changes = vec![SimulationChange { axis: Some("x".into()), ..pressed }];
    let options = Options { forever: true, ..options(scratch.file("a.db"), 1) };
    let outcome = run(&cell, &options, &mut Vec::new()).unwrap();
    assert_eq!((outcome.status, outcome.signal), (EndStatus::Interrupted, STOPPED_BY_COMMAND));
    assert!(outcome.reason.starts_with("stopped by the button halt"), "{}", outcome.reason);
}

#[test]
fn an_emergency_stop_is_rearmed_by_a_person_only() {
    for name in CELLS {
        let (mut cell, scratch) = (short(name), Scratch::new());
        let pressed = SimulationChange { torque_off: Some(true), ..change(3.0) };
        let released = SimulationChange { torque_off: Some(false), ..change(3.02) };
        cell.simulation.changes = vec![pressed, released];
        let library = scratch.file("a.db");
        let forever = Options { forever: true, ..options(library.clone(), 1) };
        let mut events = Vec::new();
        let outcome = run(&cell, &forever, &mut events).unwrap();
        assert_eq!(outcome.status, EndStatus::Fault, "{name}");
        assert!(outcome.reason.contains("emergency stop (STO)"), "{}", outcome.reason);
        let stopped = events.iter().position(|event| matches!(event, Event::Fault { .. })).unwrap();
        let goes_on = |event: &Event| {
            matches!(event, Event::State { state: StateName::Enabling | StateName::Running, .. })
        };
        assert!(!events[stopped..].iter().any(goes_on), "{name}");
        // Resumed by a person: while torque is off, the drives do not switch on, and nothing moves.
        let made = u32::try_from(outcome.runs.len()).unwrap();
        assert!(made > 0);
        cell.simulation.changes = vec![SimulationChange { torque_off: Some(true), ..change(0.0) }];
        let resumed = Options { resume: true, ..options(library.clone(), made + 2) };
        let mut events = Vec::new();
        let outcome = run(&cell, &resumed, &mut events).unwrap();
        assert_eq!((outcome.status, outcome.runs.len()), (EndStatus::Fault, made as usize));
        let moves = |event: &Event| {
            matches!(event, Event::State { state: StateName::Returning | StateName::Running, .. })
        };
        assert!(!events.iter().any(moves), "{name}");
        // And with torque again the campaign goes on.
        cell.simulation.changes.clear();
        let outcome = run(&cell, &resumed, &mut Vec::new()).unwrap();
        assert_eq!((outcome.status, outcome.runs.len()), (EndStatus::Completed, made as usize + 2));
    }
}

#[test]
fn by_hand_an_axis_leaves_its_limit_switch_but_does_not_go_on() {
    let mut cell = cell(CELLS[0]);
    // Closed from there upwards, and not known to the drive itself, which would not reach it.
    let far_end = input("far end", 2, Level::High, InputUse::Limit);
    cell.inputs.push(Input { direction: Some(Direction::Positive), ..far_end });
    cell.axes[0].simulation.switch_home_m = Some(0.03);
    cell.axes[0].simulation.position_start_m = 0.035;
    let session = options(Scratch::new().file("a.db"), 1).session;
    let go = |distance_m: f64| {
        let travel =
            Travel { goals: vec![(0, Goal::By(distance_m))], speed_m_s: None, hold_s: Some(0.0) };
        campaign::travel(&cell, &travel, &session, in_process(&cell), &mut |_| None)
            .map_err(|refusal| refusal.to_string())
    };
    let refusal = go(0.01).unwrap_err();
    assert!(
        refusal
            .contains("allowed away from limit switch far end (bit 2 of 0x60FD of axis x, node 1)"),
        "{refusal}"
    );
    assert_eq!(go(-0.02).unwrap().status, EndStatus::Completed);
    // From where it is free, onto the switch: a controlled stop that names it.
    cell.axes[0].simulation.position_start_m = 0.02;
    let arrival = {
        let travel =
            Travel { goals: vec![(0, Goal::By(0.05))], speed_m_s: None, hold_s: Some(0.0) };
        campaign::travel(&cell, &travel, &session, in_process(&cell), &mut |_| None).unwrap()
    };
    assert_eq!(arrival.fault.as_ref().unwrap().kind, FaultKind::LimitSwitch);
    assert_eq!(arrival.fault.unwrap().input.as_deref(), Some("far end"));
    assert!(arrival.reason.contains("is reached in positive direction"), "{}", arrival.reason);
    assert!((0.03..0.035).contains(&arrival.position_m[0]), "{:?}", arrival.position_m);
}

#[test]
fn inputs_that_cannot_be_read_or_told_apart_are_refused() {
    let refused = |change: &dyn Fn(&mut Cell), says: &str| {
        let mut cell = cell(CELLS[0]);
        change(&mut cell);
        let refusal = ilc_rt::config::check(&cell).unwrap_err().to_string();
        assert!(refusal.contains(says), "{refusal}");
    };
    refused(&|cell| cell.inputs[0].axis = "z".into(), "door: axis = z: the name of an axis: x, y");
    refused(&|cell| cell.inputs[0].bit = 7, "door: bit = 7: 0 to 3, or 16 to 31");
    refused(&|cell| cell.inputs[1].bit = 16, "go: bit = 16: a bit of its own; door has it already");
    refused(&|cell| cell.inputs[1].name = "door".into(), "[[input]] name = door: 1 to 64");
    refused(
        &|cell| cell.inputs[0].purpose = InputUse::Limit,
        "door: direction = missing: negative or positive",
    );
    refused(
        &|cell| cell.inputs[0].direction = Some(Direction::Negative),
        "direction = negative: for use = \"limit\" only",
    );
    refused(&|cell| cell.inputs[0].debounce_cycles = 0, "debounce_cycles");
    refused(&|cell| cell.inputs = vec![cell.inputs[0].clone(); 17], "[[input]] count = 17");
    refused(
        &|cell| cell.axes[0].drive.pdo.motion = Some(vec!["0x60F4".parse().unwrap()]),
        "drive.pdo = without 0x60FD: 0x60FD in status or motion: input door",
    );
    // Stated with it, they can.
    let mut stated = cell(CELLS[0]);
    stated.axes[0].drive.pdo.motion = Some(vec!["0x60FD".parse().unwrap()]);
    ilc_rt::config::check(&stated).unwrap();
    let mut rig = Rig::new(&stated, 1);
    rig.tick_into_run(0, 10);
    assert_eq!((rig.inputs.known, rig.inputs.on), (0b111, 0b001));
}

#[test]
fn a_cell_without_inputs_exchanges_what_it_did() {
    use ilc_rt::fieldbus::cia402::objects;
    for name in CELLS {
        let (plain, wired) = (short(name), cell(name));
        let map = |cell: &Cell, axis: usize| ilc_rt::design::pdo_map(cell, &cell.axes[axis]);
        assert!(!map(&plain, 0).carries(objects::DIGITAL_INPUTS));
        assert_eq!(map(&plain, 1), map(&wired, 1), "the drive of y has no inputs");
        assert!(map(&wired, 0).carries(objects::DIGITAL_INPUTS));
        assert!(map(&wired, 0).frame_bytes().all(|n_bytes| n_bytes <= 8));
    }
}
