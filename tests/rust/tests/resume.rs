//! An interrupted campaign resumes where it was, or gives the reason why it cannot; a law that
//! makes the error grow is stopped.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ilc_rt::campaign::{self, CampaignError, Options, Outcome};
use ilc_rt::config::{Cell, LawName, Measure};
use ilc_rt::learning::{Law, LearningError};
use ilc_rt::library::{Library, Row};
use ilc_rt::record::{EndStatus, Event, StateName};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example, short};

fn run(cell: &Cell, options: &Options) -> Result<Outcome, CampaignError> {
    campaign::run(cell, options, in_process(cell), None, &mut |_| {})
}

fn rows(library: &Path) -> Vec<Row> {
    let library = Library::open(library).unwrap();
    let rows = library.list(None).unwrap();
    rows.iter().map(|row| library.load(row.id).unwrap()).collect()
}

#[test]
fn an_interrupted_campaign_goes_on_where_it_was() {
    for name in ["01_gantry.toml", "02_parallel.toml"] {
        let (cell, scratch) = (short(name), Scratch::new());
        let (library, other) = (scratch.file("a.db"), scratch.file("b.db"));
        let broken = options(library.clone(), 6);
        let stop = Arc::clone(&broken.session.stop);
        let outcome = campaign::run(&cell, &broken, in_process(&cell), None, &mut |event| {
            if matches!(event, Event::State { state: StateName::Running, iteration: 3 }) {
                stop.store(libc::SIGTERM, Ordering::Relaxed);
            }
        })
        .unwrap();
        assert_eq!((outcome.status, outcome.runs.len()), (EndStatus::Interrupted, 3));

        let resumed = run(&cell, &Options { resume: true, ..options(library.clone(), 6) }).unwrap();
        assert_eq!(resumed.status, EndStatus::Completed, "{}", resumed.reason);
        assert_eq!(resumed.campaign, outcome.campaign);
        let indices: Vec<u32> = resumed.runs.iter().map(|(index, _)| *index).collect();
        assert_eq!(indices, [0, 1, 2, 3, 4, 5]);
        assert_eq!(resumed.runs[..3], outcome.runs);

        let kept = rows(&library);
        assert!(kept.iter().all(|row| row.meta.campaign == outcome.campaign));
        assert_eq!(kept.iter().map(|row| row.record.index).collect::<Vec<_>>(), indices);

        // The next input is bit-identical to that of an uninterrupted campaign.
        run(&cell, &options(other.clone(), 6)).unwrap();
        let whole = rows(&other);
        for index in 0..=3 {
            assert_eq!(kept[index].record.input, whole[index].record.input, "{name} run {index}");
        }
        let error_m = |row: &Row| row.record.figures.tracking_rms_m;
        assert!(error_m(&kept[5]) < 0.1 * error_m(&kept[0]), "{name} still learns");
    }
}

#[test]
fn another_law_measurement_or_program_cannot_go_on() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let library = scratch.file("library.db");
    run(&cell, &options(library.clone(), 2)).unwrap();
    let change = |change: fn(&mut Cell)| {
        let mut other = cell.clone();
        change(&mut other);
        other
    };
    let resume = |iterations| Options { resume: true, ..options(library.clone(), iterations) };
    let changed: [(&str, Cell, Options); 6] = [
        ("law", change(|cell| cell.learning.law = LawName::Pd), resume(4)),
        ("weight", change(|cell| cell.learning.norm_optimal.rate = 7.0), resume(4)),
        ("measure", cell.clone(), {
            let mut options = resume(4);
            options.session.measure = Some(Measure::Encoder);
            options
        }),
        ("program", example("01_gantry.toml"), resume(4)),
        ("feed", change(|cell| cell.program.feed_m_s = 0.09), resume(4)),
        ("limits", change(|cell| cell.axes[0].limits.acceleration_max_m_s2 = 7.9), resume(4)),
    ];
    for (what, cell, options) in changed {
        let refused = run(&cell, &options).unwrap_err();
        assert!(matches!(refused, CampaignError::Resume(_)), "{what}: {refused:?}");
        let line = refused.to_string();
        assert!(line.starts_with("--resume: ") && line.contains("no campaign of this"), "{line}");
        assert!(!line.contains('\n'), "{line}");
    }
    let refused = run(&cell, &resume(2)).unwrap_err().to_string();
    assert!(refused.contains("2 of 2 runs") && refused.contains("--iterations"), "{refused}");
    assert_eq!(rows(&library).len(), 2, "what was refused left nothing behind");
    assert_eq!(run(&cell, &resume(3)).unwrap().runs.len(), 3, "and nothing broken");
}

#[test]
fn a_library_that_is_not_there_cannot_be_gone_on_with() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let library = scratch.file("mistyped.db");
    let refused = run(&cell, &Options { resume: true, ..options(library.clone(), 4) });
    assert!(refused.unwrap_err().to_string().contains("mistyped.db"));
    assert!(!library.exists());
}

/// Drives that were switched off start from a different position than the last run left them in:
/// their first run is not held against a converged law.
#[test]
fn a_converged_campaign_goes_on_where_it_was() {
    let (cell, scratch) = (example("01_gantry.toml"), Scratch::new());
    let (library, other) = (scratch.file("library.db"), scratch.file("other.db"));
    run(&cell, &options(library.clone(), 14)).unwrap();
    let resumed = run(&cell, &Options { resume: true, ..options(library, 20) }).unwrap();
    let whole = run(&cell, &options(other, 20)).unwrap();
    assert_eq!(resumed.status, EndStatus::Completed, "{}", resumed.reason);
    let rms = |outcome: &Outcome| -> Vec<f64> {
        outcome.runs.iter().map(|(_, figures)| figures.tracking_rms_m).collect()
    };
    let (resumed_m, whole_m) = (rms(&resumed), rms(&whole));
    assert_eq!(resumed_m.len(), 20);
    assert_eq!(resumed_m[..14], whole_m[..14]);
    assert!(resumed.runs.iter().all(|(_, figures)| !figures.rolled_back), "{resumed_m:?}");
    for index in 14..20 {
        assert!(resumed_m[index] < 1.3 * whole_m[13], "run {index}: {resumed_m:?} {whole_m:?}");
    }
}

/// `u + g e`, with a gain that changes sign after some updates.
struct Fickle {
    n_good: u32,
    n_updates: u32,
    bad_gain: f64,
}

impl Law for Fickle {
    fn update(
        &mut self,
        input: &[f64],
        error: &[f64],
        next: &mut [f64],
    ) -> Result<(), LearningError> {
        let gain = if self.n_updates < self.n_good { 0.5 } else { self.bad_gain };
        self.n_updates += 1;
        for (next, (u, e)) in next.iter_mut().zip(input.iter().zip(error)) {
            *next = u + gain * e;
        }
        Ok(())
    }

    fn reset(&mut self) {
        self.n_updates = 0;
    }

    fn describe(&self) -> String {
        format!("{{\"bad_gain\":{}}}", self.bad_gain)
    }
}

fn fickle(n_good: u32, bad_gain: f64) -> Box<dyn Law> {
    Box::new(Fickle { n_good, n_updates: 0, bad_gain })
}

#[test]
fn what_grows_is_rolled_back_twice_and_then_learning_is_off() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let options = options(scratch.file("library.db"), 9);
    let law = Some(fickle(2, -4.0));
    let outcome = campaign::run(&cell, &options, in_process(&cell), law, &mut |_| {}).unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    let rms: Vec<f64> = outcome.runs.iter().map(|(_, figures)| figures.tracking_rms_m).collect();
    let rolled_back: Vec<u32> =
        outcome.runs.iter().filter(|(_, f)| f.rolled_back).map(|(index, _)| *index).collect();
    // Runs 0 to 2 learn, 3 and 5 are spoiled, 4 and all from 6 on repeat the best.
    assert_eq!(rolled_back, [3, 5], "{rms:?}");
    assert!(rms[2] < rms[1] && rms[1] < rms[0], "{rms:?}");
    assert!(rms[3] > 1.5 * rms[2] && rms[5] > 1.5 * rms[2], "{rms:?}");
    for index in [4, 6, 7, 8] {
        assert!(rms[index] < 1.05 * rms[2], "run {index}: {rms:?}");
    }
    let rows = rows(&options.session.library);
    for index in [4, 6, 7, 8] {
        assert_eq!(rows[index].record.input, rows[2].record.input, "run {index}");
    }
}

#[test]
fn a_law_that_answers_nonsense_stops_the_axes() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let options = options(scratch.file("library.db"), 9);
    let law = Some(fickle(1, f64::NAN));
    let outcome = campaign::run(&cell, &options, in_process(&cell), law, &mut |_| {}).unwrap();
    assert_eq!(outcome.status, EndStatus::Fault);
    assert!(outcome.reason.contains("not a finite number"), "{}", outcome.reason);
    assert_eq!(rows(&options.session.library).len(), 2, "the runs before are kept");
}
