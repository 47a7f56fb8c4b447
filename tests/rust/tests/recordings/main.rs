//! Recordings replay: every value of the loop again, from lock-step and from real time, in every mode; what was changed
//! in one is found and named; one that is cut off opens.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may panic")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ilc_rt::campaign::replay::{Replayed, replay};
use ilc_rt::campaign::summary::summarize;
use ilc_rt::campaign::{self, Disturbance, Outcome};
use ilc_rt::cli::{IdentifyOptions, parse};
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::transport::loopback;
use ilc_rt::record::{EndStatus, Event};
use ilc_rt::recording::{Item, Reader};
use ilc_tests::campaign::{in_process, machine, options};
use ilc_tests::catalogue::every_cell;
use ilc_tests::far_side::FarSide;
use ilc_tests::{INPUTS, Scratch, example, example_path, patient, short};

mod changed;
mod held;

/// Cells of other architectures than those of every mode and input: a tool, two arms, a delta mechanism.
const CELLS: [&str; 2] = ["08_inputs.toml", "09_delta.toml"];

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
    for name in INPUTS.into_iter().chain(CELLS) {
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
    let cell = patient(short("01_gantry.toml"));
    let folder = Scratch::new();
    let path = folder.file("realtime.mcap");
    let mut options = options(folder.file("library.db"), 3);
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

#[test]
fn a_recording_of_a_stop_in_real_time_replays() {
    let cell = patient(short("01_gantry.toml"));
    let folder = Scratch::new();
    let path = folder.file("stopped.mcap");
    let mut options = options(folder.file("library.db"), 100);
    options.session.lockstep = false;
    options.session.simulated = true;
    options.session.record = Some(path.clone());
    let stop = Arc::clone(&options.session.stop);
    let (near, far) = loopback::pair(1024).unwrap();
    let far_side = FarSide::serve(Box::new(far), machine(&cell));
    let mut observe = |event: &Event| {
        if matches!(event, Event::Progress { iteration: 1, .. }) {
            stop.store(15, Ordering::Relaxed);
        }
    };
    let outcome = campaign::run(&cell, &options, Box::new(near), None, &mut observe).unwrap();
    drop(far_side);
    assert_eq!(outcome.status, EndStatus::Interrupted, "{}", outcome.reason);
    assert_eq!(the_same(&path).runs, 1);
    assert_eq!(summarize(&path).unwrap().stopped.as_deref(), Some("Asked(15)"));
}

#[test]
fn an_experiment_replays() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let words =
        ["--axis", "y", "--periods", "2", "--period-s", "0.5", "--from-hz", "10", "--to-hz", "20"];
    let mut asked: IdentifyOptions = parse(&words.map(str::to_owned)).unwrap();
    asked.session = options(folder.file("library.db"), 1).session;
    asked.session.record = Some(folder.file("experiment.mcap"));
    let experiment = asked.experiment.experiment(&cell, None).unwrap();
    for _ in 0..2 {
        let bus = in_process(&cell);
        campaign::identify(&cell, &experiment, &asked.session, bus, &mut |_| {}).unwrap();
    }
    // The second experiment of a session has a file of its own.
    for name in ["experiment.mcap", "experiment-2.mcap"] {
        let replayed = the_same(&folder.file(name));
        assert_eq!(replayed.runs, 1, "{name}");
        assert_eq!(replayed.law_is_not_run.as_deref(), Some("there is no law"));
    }
}

#[test]
fn a_recording_that_is_cut_off_opens_up_to_there() {
    let cell = short("01_gantry.toml");
    let folder = Scratch::new();
    let (path, _) = record(&cell, 2, &folder, "whole.mcap");
    let bytes = std::fs::read(&path).unwrap();
    let whole = the_same(&path);
    let mut last = 0;
    for share in [0.6, 0.8, 0.9, 0.99] {
        let cut = folder.file("cut.mcap");
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share")]
        let n_bytes = (bytes.len() as f64 * share) as usize;
        std::fs::write(&cut, &bytes[..n_bytes]).unwrap();
        let replayed = replay(&cut).unwrap();
        assert_eq!(replayed.difference, None, "{share}");
        assert!(replayed.cut && replayed.cycles >= last && replayed.cycles <= whole.cycles);
        last = replayed.cycles;
        assert!(summarize(&cut).unwrap().cut);
    }
    assert!(last > whole.cycles / 2, "{last} of {}", whole.cycles);
}

#[test]
fn the_oldest_recordings_of_a_cell_are_deleted_and_none_that_is_written() {
    let folder = Scratch::new();
    let place = folder.file("recordings");
    std::fs::create_dir(&place).unwrap();
    let mut cell = short("01_gantry.toml");
    cell.recording.folder = Some(place.clone());
    cell.recording.keep = 2;
    let other = place.join("press@1.mcap");
    std::fs::write(&other, "of another cell").unwrap();
    let held = place.join("gantry@0.mcap");
    let writer = std::fs::File::create(&held).unwrap();
    writer.lock().unwrap();
    let mut made = Vec::new();
    for run in 0..3 {
        let mut options = options(folder.file(&format!("{run}.db")), 1);
        options.session.record = None;
        let mut observe = |event: &Event| {
            if let Event::Recording { file, .. } = event {
                made.push(PathBuf::from(file));
            }
        };
        campaign::run(&cell, &options, in_process(&cell), None, &mut observe).unwrap();
    }
    assert_eq!(made.len(), 3);
    let left: Vec<bool> = made.iter().map(|path| path.exists()).collect();
    assert!(other.exists() && held.exists());
    // With the one that is being written they are two.
    assert_eq!(left, [false, false, true], "{made:?}");
    the_same(&made[2]);
}

#[test]
fn a_recording_does_not_replace_a_file() {
    let cell = example("01_gantry.toml");
    let folder = Scratch::new();
    let path = folder.file("mine.mcap");
    std::fs::write(&path, "mine").unwrap();
    let mut options = options(folder.file("library.db"), 1);
    options.session.record = Some(path.clone());
    let refusal = campaign::run(&cell, &options, in_process(&cell), None, &mut |_| {}).unwrap_err();
    assert!(refusal.to_string().contains("nothing has moved"), "{refusal}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
}

#[test]
fn a_recording_that_grows_too_large_ends_and_the_runs_go_on() {
    let folder = Scratch::new();
    let place = folder.file("recordings");
    let mut cell = short("01_gantry.toml");
    (cell.recording.folder, cell.recording.keep_mb) = (Some(place), Some(1));
    let mut told = Vec::new();
    let mut observe = |event: &Event| {
        if let Event::Recording { file, reason, .. } = event {
            told.push((PathBuf::from(file), reason.clone()));
        }
    };
    let options = options(folder.file("library.db"), 6);
    let outcome = campaign::run(&cell, &options, in_process(&cell), None, &mut observe).unwrap();
    assert_eq!((outcome.status, outcome.runs.len()), (EndStatus::Completed, 6));
    let reason = told[1].1.as_deref().unwrap();
    assert!(reason.contains("ends early") && reason.contains("1000000"), "{told:?}");
    let size = std::fs::metadata(&told[0].0).unwrap().len();
    assert!((1_000_000..2_500_000).contains(&size), "{size}");
    assert!(the_same(&told[0].0).cycles > 200);
}

#[test]
fn the_late_cycles_of_a_recording_are_those_of_the_flight_recorder() {
    let cell = patient(short("01_gantry.toml"));
    let folder = Scratch::new();
    let path = folder.file("realtime.mcap");
    let mut options = options(folder.file("library.db"), 1);
    options.session.lockstep = false;
    options.session.simulated = true;
    options.session.record = Some(path.clone());
    let (near, far) = loopback::pair(1024).unwrap();
    let far_side = FarSide::serve(Box::new(far), machine(&cell));
    let mut told = None;
    let mut observe = |event: &Event| {
        if let Event::Latency { late, wake_late_us, .. } = event {
            told = Some((*late, wake_late_us.count));
        }
    };
    campaign::run(&cell, &options, Box::new(near), None, &mut observe).unwrap();
    drop(far_side);
    let record = campaign::late_of(&path).unwrap();
    assert_eq!((record.late, record.stages_us.wake.count), told.unwrap());
    assert_eq!(record.cell, "gantry");
    let (lockstep, _) = crate::record(&cell, 1, &folder, "lockstep.mcap");
    assert!(campaign::late_of(&lockstep).unwrap_err().to_string().contains("lock-step"));
}

#[test]
fn every_law_makes_the_same_inputs_again() {
    let mut without = Vec::new();
    for (learning, cell) in every_cell() {
        let folder = Scratch::new();
        let mut options = options(folder.file("library.db"), 3);
        options.session.record = Some(folder.file("law.mcap"));
        options.allow_divergent = true;
        options.disturbance = Disturbance::measured(|_| Ok(vec![20.0]));
        campaign::run(&cell, &options, in_process(&cell), None, &mut |_| {}).unwrap();
        let replayed = the_same(&folder.file("law.mcap"));
        assert_eq!(replayed.runs, 3, "{learning}");
        match replayed.law_is_not_run {
            None => assert!(replayed.learned >= 2, "{learning}: {replayed:?}"),
            Some(why) => without.push((learning.split('"').nth(1).unwrap(), why)),
        }
    }
    let names: BTreeSet<&str> = without.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, BTreeSet::from(["flexible", "relevance"]), "{without:?}");
}
