//! Gradient ILC that measures its gradient, on the machine: what its runs are for is in the library, they
//! are never the best nor a reason to roll back, and a broken campaign goes on in the phase that it was in.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ilc_rt::campaign::{self, Options, Outcome};
use ilc_rt::config::Cell;
use ilc_rt::library::{Library, Row};
use ilc_rt::record::{EndStatus, Event, StateName};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example_text};

/// The one-axis cell of the examples, with another `[learning]`.
fn parse(learning: &str) -> Result<Cell, String> {
    let name = "07_warm_and_cold.toml";
    let text = example_text(name);
    let end = text.find("[learning]").unwrap();
    let text = format!("{}[learning]\n{learning}\n", &text[..end]);
    Cell::parse(&text, name).map_err(|error| error.to_string())
}

fn cell(learning: &str) -> Cell {
    parse(learning).unwrap()
}

fn rows(library: &Path) -> Vec<Row> {
    let library = Library::open(library).unwrap();
    let rows = library.list(None).unwrap();
    rows.iter().map(|row| library.load(row.id).unwrap()).collect()
}

fn run(cell: &Cell, options: &Options) -> Outcome {
    let outcome = campaign::run(cell, options, in_process(cell), None, &mut |_| {}).unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    outcome
}

fn phases(rows: &[Row]) -> Vec<&str> {
    rows.iter().map(|row| row.record.figures.phase.as_deref().unwrap_or("learning")).collect()
}

fn rms_m(rows: &[Row]) -> Vec<f64> {
    rows.iter().map(|row| row.record.figures.tracking_rms_m).collect()
}

/// A probe as large as the error: back and forth, the reversed error makes that of the run twice as large.
const WILD: &str = "law = \"model_free\"\nrollback_ratio = 1.2\n[learning.model_free]\nprobe = 1.0";

#[test]
fn runs_that_measure_are_marked_and_not_held_against_the_law() {
    let (cell, scratch) = (cell(WILD), Scratch::new());
    let library = scratch.file("library.db");
    let outcome = run(&cell, &options(library.clone(), 13));
    let made = rows(&library);
    let rms = rms_m(&made);
    println!("rms um {:?}", rms.iter().map(|rms| (rms * 1e6).round()).collect::<Vec<_>>());
    let three = ["learning", "probing", "searching"];
    let expected: Vec<&str> = (0..13).map(|run| three[run % 3]).collect();
    assert_eq!(phases(&made), expected);
    assert!(outcome.runs.iter().all(|(_, run)| !run.rolled_back && !run.learning_off));
    assert!(rms[1] > 1.2 * rms[0], "the probe is no harm to this law: {rms:?}");
    let learned: Vec<f64> = rms.iter().copied().step_by(3).collect();
    assert!(learned.windows(2).all(|pair| pair[1] < pair[0]), "{learned:?}");
    assert!(learned[4] < 0.3 * learned[0], "{learned:?}");
    // Within the bound of a learned input, as any other.
    let bound = cell.learning.input_max_m;
    let largest = |row: &Row| row.record.input.iter().fold(0.0_f64, |max, u| max.max(u.abs()));
    assert!(made.iter().all(|row| largest(row) <= bound * (1.0 + 1e-12)));
}

#[test]
fn the_input_used_again_is_a_learned_one() {
    let (cell, scratch) = (cell("law = \"model_free\""), Scratch::new());
    let library = scratch.file("library.db");
    // Ends with a searching run, whose error is the smallest, as it goes along the gradient.
    run(&cell, &options(library.clone(), 6));
    let made = rows(&library);
    assert_eq!(phases(&made)[5], "searching");
    let rms = rms_m(&made);
    assert!(rms[5] < rms[3] && rms[3] < rms[0], "{rms:?}");
    for source in ["best", "last"] {
        let frozen = Options {
            frozen: true,
            input_from: Some(source.parse().unwrap()),
            ..options(library.clone(), 1)
        };
        run(&cell, &frozen);
        let row = rows(&library).pop().unwrap();
        assert_eq!(row.record.input, made[3].record.input, "{source}");
        assert_eq!(row.record.figures.phase, None);
    }
}

#[test]
fn a_broken_campaign_goes_on_in_its_phase() {
    let cell = cell("law = \"model_free\"");
    let scratch = Scratch::new();
    let whole_library = scratch.file("whole.db");
    run(&cell, &options(whole_library.clone(), 8));
    let whole = rows(&whole_library);
    for broken_in in 1..=5 {
        let library = scratch.file(&format!("{broken_in}.db"));
        let first = options(library.clone(), 8);
        let stop = Arc::clone(&first.session.stop);
        campaign::run(&cell, &first, in_process(&cell), None, &mut |event| {
            if matches!(event, Event::State { state: StateName::Running, iteration } if *iteration == broken_in)
            {
                stop.store(libc::SIGTERM, Ordering::Relaxed);
            }
        })
        .unwrap();
        assert_eq!(rows(&library).len(), broken_in as usize);
        run(&cell, &Options { resume: true, ..options(library.clone(), 8) });
        let kept = rows(&library);
        assert_eq!(phases(&kept), phases(&whole), "broken in run {broken_in}");
        for index in 0..=broken_in as usize {
            let (kept, whole) = (&kept[index].record.input, &whole[index].record.input);
            assert_eq!(kept, whole, "broken in run {broken_in}: run {index}");
        }
        let rms = rms_m(&kept);
        assert!(rms[6] < rms[3] && rms[3] < rms[0], "{rms:?}");
    }
}

#[test]
fn a_gate_judges_its_learning_runs() {
    let gate = format!(
        "{}\n[learning.gate]\ngrowth = 1.0\npatience = 1",
        WILD.replace("rollback_ratio = 1.2\n", "")
    );
    let scratch = Scratch::new();
    let (gated, plain) = (scratch.file("gated.db"), scratch.file("plain.db"));
    run(&cell(&gate), &options(gated.clone(), 10));
    run(&cell(WILD), &options(plain.clone(), 10));
    let (gated, plain) = (rows(&gated), rows(&plain));
    assert_eq!(phases(&gated), phases(&plain));
    assert!(gated.iter().zip(&plain).all(|(a, b)| a.record.input == b.record.input));
    assert!(gated.iter().all(|row| !row.record.figures.rolled_back));
}

#[test]
fn no_wrapper_changes_the_inputs_that_measure() {
    for (learning, part) in [
        ("law = \"model_free\"\n[learning.ladder]\nrepeats = 2", "[learning.ladder]"),
        ("law = \"filtered\"\n[learning.filtered]\ncore = \"model_free\"", "only measure"),
        ("law = \"model_free\"\n[learning.model_free]\nprobe = 0.0", "probe"),
        ("law = \"model_free\"\n[learning.model_free]\ngain = -1.0", "gain"),
        ("law = \"model_free\"\ninput_max_m = 0.0", "input_max"),
    ] {
        let line = parse(learning).err().unwrap_or_default();
        assert!(line.contains(part) && !line.contains('\n'), "{learning}: {line}");
    }
}
