//! Every law of the cell description learns on the simulated machine in lock-step, also inside a
//! ladder or a gate, and continues after an interruption as if there had been none.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ilc_rt::campaign::{self, Disturbance, Options, Outcome};
use ilc_rt::config::{Cell, LawName, Learning};
use ilc_rt::learning::law::LawTables;
use ilc_rt::library::{Library, Row};
use ilc_rt::record::{EndStatus, Event, StateName};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example_text};

const SERIES: &str = "01_gantry.toml";
const PARALLEL: &str = "02_parallel.toml";

/// Returns an example with a different `[learning]`.
fn cell(example: &str, learning: &str) -> Cell {
    let text = example_text(example);
    let end = text.find("[learning]").unwrap();
    let text = format!("{}[learning]\n{learning}\n", &text[..end]);
    Cell::parse(&text, example).unwrap()
}

/// Same, with two short moves.
fn short(example: &str, learning: &str) -> Cell {
    let mut cell = cell(example, learning);
    let mut segments = cell.program.segments[..2].to_vec();
    segments[0].to_m = vec![0.08, 0.02];
    segments[1].to_m = vec![0.06, 0.04];
    cell.program.segments = segments;
    cell
}

fn rows(library: &Path) -> Vec<Row> {
    let library = Library::open(library).unwrap();
    let rows = library.list(None).unwrap();
    rows.iter().map(|row| library.load(row.id).unwrap()).collect()
}

/// Runs a campaign and reads the library back.
fn run(cell: &Cell, iterations: u32) -> (Outcome, Vec<Row>) {
    let scratch = Scratch::new();
    let options = surrounded(scratch.file("library.db"), iterations);
    let outcome = campaign::run(cell, &options, in_process(cell), None, &mut |_| {}).unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    let rows = rows(&options.session.library);
    (outcome, rows)
}

fn rms_m(rows: &[Row]) -> Vec<f64> {
    rows.iter().map(|row| row.record.figures.tracking_rms_m).collect()
}

fn microns(rms_m: &[f64]) -> String {
    rms_m.iter().map(|rms| format!("{:.1}", rms * 1e6)).collect::<Vec<_>>().join(" ")
}

/// Returns the options of a campaign with a constant disturbance, like the simulated machine's; only
/// relevance-weighted laws use it.
fn surrounded(library: PathBuf, iterations: u32) -> Options {
    Options {
        disturbance: Disturbance::measured(|_| Ok(vec![20.0])),
        ..options(library, iterations)
    }
}

/// The examples of all laws: cell and learning.
fn examples() -> Vec<(&'static str, &'static str)> {
    let tables = Learning::default();
    let of = |law: &LawName| tables.parameters(*law).unwrap().examples();
    let file = |is_parallel| if is_parallel { PARALLEL } else { SERIES };
    LawName::ALL
        .iter()
        .flat_map(of)
        .map(|found| (file(found.is_parallel), found.learning))
        .collect()
}

#[test]
fn every_law_that_a_cell_can_name_learns_on_the_gantry() {
    let tables = Learning::default();
    let mut wrong = Vec::new();
    for law in LawName::ALL {
        let examples = tables.parameters(*law).unwrap().examples();
        assert!(!examples.is_empty(), "{law:?} has no example");
        for example in examples {
            let cell_file = if example.is_parallel { PARALLEL } else { SERIES };
            let (outcome, rows) = run(&cell(cell_file, example.learning), 6);
            let rms_m = rms_m(&rows);
            assert_eq!(rows[0].meta.law, law.as_str());
            println!("{cell_file} {law:?}: rms um {}", microns(&rms_m));
            let rolled_back = outcome.runs.iter().any(|(_, run)| run.rolled_back);
            // Runs that only measure do not count.
            let learned = rows.iter().rposition(|row| row.record.figures.phase.is_none());
            if rms_m[learned.unwrap()] >= example.error_left * rms_m[0] || rolled_back {
                wrong.push(format!("{cell_file} {law:?}: {}", microns(&rms_m)));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn point_to_point_removes_the_error_at_its_instant() {
    let learning = "law = \"point_to_point\"\n[learning.point_to_point]\npoints_s = [0.5]\n\
                    gain = 0.7\nr = 0.01";
    let (_, rows) = run(&cell(SERIES, learning), 8);
    let at: Vec<f64> = rows
        .iter()
        .map(|row| row.record.error_m[2 * 250].hypot(row.record.error_m[2 * 250 + 1]))
        .collect();
    println!("at 0.5 s: um {}", microns(&at));
    assert!(at[7] < 0.1 * at[0], "{}", microns(&at));
}

#[test]
fn relevance_goes_on_from_the_runs_of_the_library_under_the_disturbance_of_a_file() {
    let scratch = Scratch::new();
    let (library, told) = (scratch.file("library.db"), scratch.file("temperature.txt"));
    let learning = |file: &str| {
        format!(
            "law = \"relevance\"\n{file}\n[learning.relevance]\nerror = 1.0\nerror_rate = 0.0\n\
             epsilon = 1e-9\n[learning.norm_optimal]\nrate = 6.0"
        )
    };
    let start = |cell: &Cell, iterations| {
        let options = options(library.clone(), iterations);
        campaign::run(cell, &options, in_process(cell), None, &mut |_| {})
    };
    let line = start(&cell(SERIES, &learning("")), 2).unwrap_err().to_string();
    assert!(line.contains("0 numbers; 1 needed"), "{line}");

    let cell = cell(SERIES, &learning(&format!("disturbance_file = {:?}", told.to_str().unwrap())));
    let line = start(&cell, 2).unwrap_err().to_string();
    assert!(line.contains("run 0") && line.contains("temperature.txt"), "{line}");
    std::fs::write(&told, "warm").unwrap();
    let line = start(&cell, 2).unwrap_err().to_string();
    assert!(line.contains("\"warm\" is not a number"), "{line}");
    std::fs::write(&told, "20.5\n").unwrap();
    let rms_m = |outcome: &Outcome, run: usize| outcome.runs[run].1.tracking_rms_m;
    let first = start(&cell, 4).unwrap();
    let second = start(&cell, 2).unwrap();
    // The second campaign begins with what the first one learned.
    assert!(rms_m(&second, 0) < 0.1 * rms_m(&first, 0), "{first:?} {second:?}");
    assert!(rms_m(&second, 1) < 0.5 * rms_m(&first, 1), "{first:?} {second:?}");
    assert!(rows(&library).iter().all(|row| row.record.disturbance == [20.5]));
}

const CO_ILC: &str = "law = \"norm_optimal\"\n[learning.norm_optimal]\nrate = 6.0";
/// A law that converges on the model, but diverges on the real axes after two runs: it learns at
/// the frequency of a mode that the model omits.
const GROWING: &str = "law = \"pd\"\n[learning.pd]\nkp = 1.5\nlead_samples = 8\ncutoff_hz = 25.0";

#[test]
fn the_constrained_law_keeps_the_bounds_that_the_plain_one_would_exceed() {
    let bounds = "input_max_m = 0.0015\n[learning.constrained]\nrate = 6.0\n\
                  velocity_max_m_s = 0.104\nacceleration_max_m_s2 = 3.0\nchange_max_m = 0.001\n\
                  step_max_m = 2e-5";
    let bounded = cell(SERIES, &format!("law = \"constrained\"\n{bounds}"));
    let plain = cell(SERIES, CO_ILC);
    let extremes = |cell: &Cell| {
        let (_, rows) = run(cell, 4);
        let dt_s = cell.cycle_s();
        let mut most = [0.0_f64; 5];
        for pair in rows.windows(2) {
            let (before, now) = (&pair[0].record, &pair[1].record);
            let set_point: Vec<f64> =
                now.reference_m.iter().zip(&now.input).map(|(r, u)| r + u).collect();
            for k in 4..now.input.len() {
                let step_m = now.input[k] - now.input[k - 2];
                let speed = |k: usize| (set_point[k] - set_point[k - 2]) / dt_s;
                let found = [
                    now.input[k],
                    now.input[k] - before.input[k],
                    step_m,
                    speed(k),
                    (speed(k) - speed(k - 2)) / dt_s,
                ];
                for (most, found) in most.iter_mut().zip(found) {
                    *most = most.max(found.abs());
                }
            }
        }
        (most, rms_m(&rows))
    };
    let allowed = [0.0015, 0.001, 2e-5, 0.104, 3.0];
    let ((within, rms), (beyond, _)) = (extremes(&bounded), extremes(&plain));
    println!("bounded {within:?}, plain {beyond:?}, rms um {}", microns(&rms));
    for (found, allowed) in within.iter().zip(allowed) {
        assert!(*found <= allowed * (1.0 + 1e-6), "{within:?}");
    }
    for (found, allowed) in beyond.iter().zip(allowed) {
        assert!(*found > allowed, "{beyond:?}");
    }
    assert!(rms[3] < 0.8 * rms[0], "{}", microns(&rms));
}

#[test]
fn a_gate_keeps_the_input_from_the_run_on_that_is_good_enough() {
    let free = rms_m(&run(&short(SERIES, CO_ILC), 6).1);
    let tolerance_m = 1.02 * free[3];
    assert!(tolerance_m < free[2], "{}", microns(&free));
    let gate = format!("{CO_ILC}\n[learning.gate]\ntolerance_m = {tolerance_m}");
    let (outcome, rows) = run(&short(SERIES, &gate), 7);
    println!("free {}; gated {}", microns(&free), microns(&rms_m(&rows)));
    assert!(outcome.runs.iter().all(|(_, run)| !run.rolled_back));
    // The first run whose RMS error in the record is within the tolerance, and no other one.
    for index in 1..=3 {
        assert_ne!(rows[index].record.input, rows[index - 1].record.input, "run {index} learns");
    }
    for row in &rows[4..] {
        assert_eq!(row.record.input, rows[3].record.input, "run {} rests", row.record.index);
    }
}

#[test]
fn a_ladder_learns_from_the_mean_of_runs_with_the_same_input() {
    let ladder = format!("{CO_ILC}\n[learning.ladder]\nrepeats = 3");
    let mut noisy = short(SERIES, &ladder);
    noisy.simulation.encoder_noise_m = 2e-6;
    let (_, rows) = run(&noisy, 9);
    let rms = rms_m(&rows);
    println!("ladder {}", microns(&rms));
    for (index, row) in rows.iter().enumerate() {
        let begin = index / 3 * 3;
        assert_eq!(row.record.input, rows[begin].record.input, "run {index}");
        let noise_differs = index == begin || row.record.error_m != rows[begin].record.error_m;
        assert!(noise_differs, "run {index}");
    }
    assert!(rows[3].record.input != rows[0].record.input && rms[3] < 0.5 * rms[0]);
    assert!(rows[6].record.input != rows[3].record.input && rms[6] < 0.5 * rms[3]);
}

/// Returns the number of the best run, and the runs that were rolled back.
fn best_and_taken_back(outcome: &Outcome, rms: &[f64]) -> (usize, Vec<usize>) {
    let best = (0..rms.len()).min_by(|a, b| rms[*a].total_cmp(&rms[*b])).unwrap();
    let taken_back = outcome.runs.iter().filter(|(_, run)| run.rolled_back);
    (best, taken_back.map(|(index, _)| *index as usize).collect())
}

#[test]
fn with_a_gate_the_gate_alone_decides_when_the_error_grows() {
    // The controller would roll back the first run that is 1.5 times worse than the best one.
    let (outcome, rows) = run(&short(SERIES, GROWING), 9);
    let rms = rms_m(&rows);
    let (_, taken_back) = best_and_taken_back(&outcome, &rms);
    println!("alone {}, taken back {taken_back:?}", microns(&rms));
    assert_eq!(taken_back.len(), 2, "{}", microns(&rms));

    let gate = format!("{GROWING}\n[learning.gate]\ngrowth = 1.5\npatience = 2");
    let (outcome, rows) = run(&short(SERIES, &gate), 9);
    let rms = rms_m(&rows);
    println!("gated {}", microns(&rms));
    let grown = (1..9).find(|i| {
        let best = rms[..*i].iter().copied().fold(f64::INFINITY, f64::min);
        rms[*i] > 1.5 * best
    });
    let grown = grown.unwrap();
    let (best, taken_back) = best_and_taken_back(&outcome, &rms[..grown]);
    assert_eq!(taken_back, [grown + 1], "by the gate, where the controller would at once");
    assert!(rms[grown + 1] > 1.5 * rms[best], "the gate is patient for a second run");
    for row in &rows[grown + 2..] {
        assert_eq!(row.record.input, rows[best].record.input, "run {}", row.record.index);
    }
}

#[test]
fn what_the_controller_takes_back_halves_the_steps_of_a_ladder() {
    let ladder = format!("{GROWING}\n[learning.ladder]\nrepeats = 1\nincrease = 1.0");
    let (outcome, rows) = run(&short(SERIES, &ladder), 7);
    let rms = rms_m(&rows);
    let (best, taken_back) = best_and_taken_back(&outcome, &rms);
    println!("ladder {}, taken back {taken_back:?}", microns(&rms));
    let spoiled = taken_back[0];
    assert_eq!(rows[spoiled + 1].record.input, rows[spoiled - 1].record.input);
    let step = |index: usize| -> f64 {
        let base = &rows[spoiled - 1].record.input;
        let apart = rows[index].record.input.iter().zip(base).map(|(a, b)| (a - b) * (a - b));
        apart.sum::<f64>().sqrt()
    };
    let ratio = step(spoiled + 2) / step(spoiled);
    assert!((0.45..0.55).contains(&ratio), "{ratio} {best}");
}

/// Interrupts a campaign in run `broken`, resumes it, and returns its rows and those of an
/// uninterrupted one.
fn broken_and_whole(cell: &Cell, broken: u32, iterations: u32) -> (Vec<Row>, Vec<Row>) {
    let scratch = Scratch::new();
    let first = surrounded(scratch.file("library.db"), iterations);
    let stop = Arc::clone(&first.session.stop);
    let outcome = campaign::run(cell, &first, in_process(cell), None, &mut |event| {
        if matches!(event, Event::State { state: StateName::Running, iteration } if *iteration == broken)
        {
            stop.store(libc::SIGTERM, Ordering::Relaxed);
        }
    })
    .unwrap();
    assert_eq!((outcome.status, outcome.runs.len()), (EndStatus::Interrupted, broken as usize));
    let again = Options { resume: true, ..surrounded(first.session.library.clone(), iterations) };
    let outcome = campaign::run(cell, &again, in_process(cell), None, &mut |_| {}).unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    (rows(&first.session.library), run(cell, iterations).1)
}

#[test]
fn every_law_goes_on_after_a_break_with_the_input_that_would_have_followed() {
    for (example, learning) in examples() {
        let (kept, whole) = broken_and_whole(&short(example, learning), 2, 3);
        let law = &whole[0].meta.law;
        for index in 0..3 {
            assert_eq!(kept[index].record.input, whole[index].record.input, "{law} run {index}");
        }
    }
}

#[test]
fn ladder_and_gate_go_on_in_the_middle_of_what_they_did() {
    // Interrupted in the second of three runs with the same input: two more belong to the step.
    let ladder = format!("{CO_ILC}\n[learning.ladder]\nrepeats = 3");
    let (kept, whole) = broken_and_whole(&short(SERIES, &ladder), 4, 7);
    for index in 0..=5 {
        assert_eq!(kept[index].record.input, whole[index].record.input, "run {index}");
    }
    assert_ne!(
        kept[6].record.input, kept[5].record.input,
        "the step comes when it would have come"
    );

    // Interrupted while the gate is paused.
    let tolerance_m = 1.1 * rms_m(&run(&short(SERIES, CO_ILC), 3).1)[2];
    let gate = format!("{CO_ILC}\n[learning.gate]\ntolerance_m = {tolerance_m}");
    let (kept, whole) = broken_and_whole(&short(SERIES, &gate), 4, 6);
    for index in 0..6 {
        assert_eq!(kept[index].record.input, whole[index].record.input, "run {index}");
    }
    assert_eq!(kept[5].record.input, kept[2].record.input);

    // Interrupted after a rollback: it stays there.
    let gate = format!("{GROWING}\n[learning.gate]\ngrowth = 1.5\npatience = 1");
    let whole = run(&short(SERIES, &gate), 8).1;
    let back = (2..8)
        .find(|i| (0..i - 1).any(|k| whole[k].record.input == whole[*i].record.input))
        .unwrap();
    let (kept, _) = broken_and_whole(&short(SERIES, &gate), u32::try_from(back).unwrap() + 1, 8);
    for row in &kept[back..] {
        assert_eq!(row.record.input, whole[back].record.input, "run {}", row.record.index);
    }
}

#[test]
fn another_gate_ladder_or_weight_along_the_run_is_another_campaign() {
    let phase = |q: f64| {
        format!("{CO_ILC}\n[[learning.norm_optimal.phase]]\nfrom_s = 0.2\nto_s = 0.4\nq = {q}")
    };
    let around = |table: &str| format!("{CO_ILC}\n{table}");
    for (one, other) in [
        (phase(2.0), phase(3.0)),
        (around("contour = { weight = 2.0 }"), around("contour = { weight = 3.0 }")),
        (
            around("[learning.gate]\ntolerance_m = 1e-6"),
            around("[learning.gate]\ntolerance_m = 2e-6"),
        ),
        (around("[learning.ladder]\nrepeats = 2"), around("[learning.ladder]\nrepeats = 3")),
        (around(""), around("[learning.ladder]\nrepeats = 1")),
    ] {
        let scratch = Scratch::new();
        let first = surrounded(scratch.file("library.db"), 2);
        let cell = short(SERIES, &one);
        campaign::run(&cell, &first, in_process(&cell), None, &mut |_| {}).unwrap();
        let again = Options { resume: true, ..options(first.session.library.clone(), 3) };
        let changed = short(SERIES, &other);
        let refused = campaign::run(&changed, &again, in_process(&changed), None, &mut |_| {});
        let line = refused.unwrap_err().to_string();
        assert!(line.starts_with("--resume: ") && line.contains("no campaign of this"), "{line}");
        assert!(campaign::run(&cell, &again, in_process(&cell), None, &mut |_| {}).is_ok());
    }
}
