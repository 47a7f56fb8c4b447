//! A writer that is held, as by a disk that stands still: the loop goes on, and what is lost is counted and told.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{PipeReader, Read};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;

use ilc_rt::campaign::replay::replay;
use ilc_rt::campaign::summary::summarize;
use ilc_rt::campaign::{self, Outcome};
use ilc_rt::fieldbus::transport::loopback;
use ilc_rt::record::{EndStatus, Event};
use ilc_rt::recording::{Item, Reader};
use ilc_tests::campaign::{machine, options};
use ilc_tests::far_side::FarSide;
use ilc_tests::{Scratch, patient, short};

/// A recording into a pipe that is read late, or not at all while the loop runs.
struct Pipe {
    end: Option<PipeReader>,
    reading: Option<JoinHandle<Vec<u8>>>,
}

impl Pipe {
    /// Reads from now on: the writer is held no longer.
    fn release(&mut self) {
        if let Some(mut end) = self.end.take() {
            self.reading = Some(std::thread::spawn(move || {
                let mut bytes = Vec::new();
                end.read_to_end(&mut bytes).unwrap();
                bytes
            }));
        }
    }
}

/// A campaign in real time that was recorded by a held writer.
struct Held {
    path: PathBuf,
    outcome: Outcome,
    /// Number of lost records in each report.
    told: Vec<u64>,
    /// Runs that had ended when the writer was released.
    ended_before: usize,
}

/// Runs until two runs have ended after the release, or so many runs with a release at their end.
fn record(folder: &Scratch, runs: Option<u32>) -> Held {
    let cell = patient(short("01_gantry.toml"));
    let path = folder.file("held.mcap");
    let (end, into) = std::io::pipe().unwrap();
    let mut options = options(folder.file("library.db"), runs.unwrap_or(100));
    options.session.lockstep = false;
    options.session.simulated = true;
    options.session.record = Some(path.clone());
    options.session.record_to = Some(Arc::new(File::from(OwnedFd::from(into))));
    let stop = Arc::clone(&options.session.stop);
    let mut pipe = Pipe { end: Some(end), reading: None };
    let (mut told, mut ended, mut ended_before) = (Vec::new(), 0, 0);
    let mut observe = |event: &Event| match event {
        Event::Recording { lost, reason: Some(reason), .. } => {
            assert!(reason.contains("records are lost"), "{reason}");
            told.push(*lost);
            if runs.is_none() {
                ended_before = ended;
                pipe.release();
            }
        }
        Event::Iteration { .. } => {
            ended += 1;
            if !told.is_empty() && runs.is_none() && ended >= ended_before + 3 {
                stop.store(15, Ordering::Relaxed);
            }
        }
        // The recording ends after this.
        Event::End { .. } => pipe.release(),
        _ => {}
    };
    let (near, far) = loopback::pair(1024).unwrap();
    let far_side = FarSide::serve(Box::new(far), machine(&cell));
    let outcome = campaign::run(&cell, &options, Box::new(near), None, &mut observe).unwrap();
    drop(far_side);
    // The last end to write into.
    drop(options);
    let bytes = pipe.reading.unwrap().join().unwrap();
    std::fs::write(&path, bytes).unwrap();
    Held { path, outcome, told, ended_before }
}

/// Returns the numbers of the recorded cycles, and the losses that the events of the recording tell.
fn content(path: &Path) -> (Vec<u64>, Vec<u64>) {
    let mut reader = Reader::open(path).unwrap();
    let (mut cycles, mut told) = (Vec::new(), Vec::new());
    while let Some(item) = reader.next_item().unwrap() {
        match item {
            Item::Cycle(_, cycle) => cycles.push(cycle.cycle),
            Item::Event(event) if event["event"] == "recording" => {
                told.extend(event["lost"].as_u64().filter(|lost| *lost > 0));
            }
            _ => {}
        }
    }
    (cycles, told)
}

#[test]
fn a_held_writer_loses_records_and_never_holds_the_loop() {
    let folder = Scratch::new();
    let held = record(&folder, None);
    assert_eq!(held.outcome.status, EndStatus::Interrupted, "{}", held.outcome.reason);
    // Told while the writer was held, and in the recording.
    assert_eq!(held.told.len(), 1, "{:?}", held.told);
    assert!(held.told[0] > 0);
    let (cycles, told) = content(&held.path);
    assert_eq!(told, held.told);
    // The loop went on: cycles are missing, and those behind them are there.
    let gaps: Vec<[u64; 2]> =
        cycles.windows(2).filter(|two| two[1] != two[0] + 1).map(|two| [two[0], two[1]]).collect();
    assert!(!gaps.is_empty() && gaps.iter().all(|[before, after]| after > before), "{gaps:?}");
    assert_eq!(cycles.iter().collect::<BTreeSet<_>>().len(), cycles.len());
    let summary = summarize(&held.path).unwrap();
    assert!(summary.lost >= held.told[0] && !summary.cut, "{summary:?}");
    // Runs ended after it, and were recorded.
    assert!(summary.runs >= held.ended_before as u64 + 2, "{summary:?}");
    let replayed = replay(&held.path).unwrap();
    let lost_at = replayed.lost_at.expect("a replay that knows of the loss");
    // Their frames may have been lost earlier.
    assert!(lost_at > 500 && lost_at <= gaps[0][0] + 1, "{lost_at} {gaps:?}");
    assert_eq!((replayed.cycles, replayed.difference), (lost_at, None));
}

#[test]
fn a_loss_up_to_the_end_is_known_as_well() {
    let folder = Scratch::new();
    let held = record(&folder, Some(6));
    assert_eq!(held.outcome.status, EndStatus::Completed, "{}", held.outcome.reason);
    assert_eq!(held.outcome.runs.len(), 6);
    let (cycles, told) = content(&held.path);
    assert_eq!((told.len(), &told), (1, &held.told));
    // All that was lost is missing at the end: the recorded cycles have no gap.
    let last = *cycles.last().unwrap();
    assert_eq!(cycles.len() as u64, last + 1);
    let summary = summarize(&held.path).unwrap();
    assert!(summary.lost > held.told[0] && !summary.cut, "{summary:?}");
    let replayed = replay(&held.path).unwrap();
    assert_eq!((replayed.lost_at, replayed.cycles), (Some(last + 1), last + 1));
    assert_eq!(replayed.difference, None);
}
