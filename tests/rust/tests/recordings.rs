//! Recordings replay: every value of the loop again, from lock-step and from real time, in every mode; what was changed
//! in one is found and named; one that is cut off opens.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};

use ilc_rt::campaign::replay::{Replayed, replay};
use ilc_rt::campaign::summary::summarize;
use ilc_rt::campaign::{self, Options, Outcome};
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::transport::loopback;
use ilc_rt::record::EndStatus;
use ilc_rt::recording::{Item, Reader};
use ilc_tests::campaign::{in_process, machine, options};
use ilc_tests::far_side::FarSide;
use ilc_tests::{Scratch, example, example_path, short};

/// Cells of every mode and architecture: positions, velocities, torque, offsets, a tool, two arms, a delta mechanism.
const CELLS: [&str; 8] = [
    "01_gantry.toml",
    "02_parallel.toml",
    "08_inputs.toml",
    "09_delta.toml",
    "10_cst.toml",
    "11_csp_torque.toml",
    "12_csp_velocity.toml",
    "13_csv_torque.toml",
];

/// Records a campaign in lock-step.
fn record(cell: &Cell, runs: u32, folder: &Scratch, name: &str) -> (PathBuf, Outcome) {
    let path = folder.file(name);
    let mut options = options(folder.file(&format!("{name}.db")), runs);
    options.session.record = Some(path.clone());
    let outcome = campaign::run(cell, &options, in_process(cell), None, &mut |_| {}).unwrap();
    (path, outcome)
}

fn the_same(path: &Path) -> Replayed {
    let replayed = replay(path).unwrap();
    assert_eq!(replayed.difference, None, "{replayed:?}");
    assert_eq!((replayed.lost_at, replayed.cut), (None, false));
    replayed
}

/// Returns the messages of the loop, as text, in their order.
fn loop_of(path: &Path) -> Vec<String> {
    let mut reader = Reader::open(path).unwrap();
    let mut all = Vec::new();
    while let Some(item) = reader.next_item().unwrap() {
        match item {
            Item::Cycle(at, cycle) => all.push(format!("{at} {cycle:?}")),
            Item::Axis(name, axis) => all.push(format!("{name} {axis:?}")),
            Item::Frames(at, frames) => all.push(format!("{at} {frames:?}")),
            Item::Table(table) => all.push(format!("{table:?}")),
            Item::Loop(_) | Item::Timing(_) | Item::Event(_) => {}
        }
    }
    all
}

#[test]
fn two_recordings_of_a_campaign_in_lock_step_are_the_same_and_so_is_their_replay() {
    for name in CELLS {
        let cell = example(name);
        let folder = Scratch::new();
        let (first, outcome) = record(&cell, 2, &folder, "first.mcap");
        assert_eq!(outcome.status, EndStatus::Completed, "{name}: {}", outcome.reason);
        let replayed = the_same(&first);
        assert_eq!(replayed.runs, 2, "{name}");
        assert!(replayed.cycles > 100 && replayed.frames > replayed.cycles, "{name} {replayed:?}");
        if replayed.law_is_not_run.is_none() {
            assert!(replayed.learned >= 1, "{name}: {replayed:?}");
        }
        let (second, _) = record(&cell, 2, &folder, "second.mcap");
        assert!(loop_of(&first) == loop_of(&second), "{name}");
    }
}

#[test]
fn a_part_program_is_carried_along() {
    let folder = Scratch::new();
    let cell = Cell::load(&example_path("04_gcode.toml")).unwrap();
    let (path, outcome) = record(&cell, 1, &folder, "gcode.mcap");
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    assert_eq!(the_same(&path).runs, 1);
}

#[test]
fn a_recording_in_real_time_replays() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let path = folder.file("realtime.mcap");
    let mut options = Options { iterations: 3, ..options(folder.file("library.db"), 3) };
    options.session.lockstep = false;
    options.session.simulated = true;
    options.session.record = Some(path.clone());
    let (near, far) = loopback::pair(1024).unwrap();
    let far_side = FarSide::serve(Box::new(far), machine(&cell));
    let outcome = campaign::run(&cell, &options, Box::new(near), None, &mut |_| {}).unwrap();
    drop(far_side);
    let replayed = the_same(&path);
    assert!(replayed.cycles > 100, "{replayed:?} {}", outcome.reason);
    let summary = summarize(&path).unwrap();
    assert_eq!((summary.lost, summary.cut, summary.lockstep), (0, false, false));
    assert_eq!(summary.cycles, replayed.cycles);
}
