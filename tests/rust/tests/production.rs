//! Production: runs with a frozen input, from the library and from a file; drift; runs on command; pause
//! and feed override on the path.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};

use ilc_rt::campaign::control::{Command, STOPPED_BY_COMMAND, send};
use ilc_rt::campaign::input::{self, InputError, Source};
use ilc_rt::campaign::{self, CampaignError, Options, Outcome, StartOn};
use ilc_rt::config::{Cell, Keep, LawName, Measure};
use ilc_rt::design::Plan;
use ilc_rt::library::{Library, Row};
use ilc_rt::record::{EndStatus, Event, StateName};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, short};

fn run(cell: &Cell, options: &Options) -> Result<Outcome, CampaignError> {
    campaign::run(cell, options, in_process(cell), None, &mut |_| {})
}

fn rows(library: &Path) -> Vec<Row> {
    let library = Library::read(library).unwrap();
    let rows = library.list(None).unwrap();
    rows.iter().map(|row| library.load(row.id).unwrap()).collect()
}

fn frozen(library: PathBuf, iterations: u32) -> Options {
    Options { frozen: true, ..options(library, iterations) }
}

/// The gantry, whose plant is another one than it was.
fn worn(cell: &Cell) -> Cell {
    let mut worn = cell.clone();
    for axis in &mut worn.axes {
        axis.simulation.coulomb_n *= 3.0;
        axis.simulation.static_n = axis.simulation.coulomb_n.max(axis.simulation.static_n);
        axis.simulation.mass_kg *= 1.5;
    }
    worn
}

#[test]
fn the_best_input_runs_frozen_and_nothing_is_learned() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let library = scratch.file("a.db");
    run(&cell, &options(library.clone(), 6)).unwrap();
    let learned = rows(&library);
    let error = |row: &Row| row.record.figures.judged_by();
    let best = learned.iter().min_by(|a, b| error(a).total_cmp(&error(b))).unwrap();
    let mut drifts = 0;
    let mut laws = Vec::new();
    let options = frozen(library.clone(), 4);
    let outcome =
        campaign::run(&cell, &options, in_process(&cell), None, &mut |event| match event {
            Event::Drift { .. } => drifts += 1,
            Event::Start { law, .. } => laws.push(law.clone()),
            _ => {}
        })
        .unwrap();
    assert_eq!(
        (outcome.status, drifts, laws),
        (EndStatus::Completed, 0, vec!["frozen".to_owned()])
    );
    let made: Vec<Row> = rows(&library).split_off(learned.len());
    assert_eq!(made.len(), 4);
    for row in &made {
        assert_eq!(row.record.input, best.record.input, "bit for bit");
        assert_eq!(row.meta.law, "frozen");
        assert!(row.meta.law_parameters.contains(&best.digest));
        assert!(row.record.figures.frozen_ratio.unwrap() < 1.5);
        assert!(!row.record.figures.learning_off);
    }
    // A frozen campaign is neither resumed nor chosen from.
    let again = Options { resume: true, ..ilc_tests::campaign::options(library.clone(), 7) };
    assert_eq!(run(&cell, &again).unwrap().campaign, learned[0].meta.campaign);
    let last = Options { input_from: Some(Source::Last), ..frozen(library.clone(), 1) };
    run(&cell, &last).unwrap();
    let all = rows(&library);
    assert_eq!(all[all.len() - 1].record.input, all[all.len() - 2].record.input);
    assert_ne!(all[all.len() - 1].record.input, best.record.input);
}

#[test]
fn a_drift_is_told_and_starts_learning_from_the_frozen_input_on() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let library = scratch.file("a.db");
    run(&cell, &options(library.clone(), 5)).unwrap();
    let n_learned = rows(&library).len();
    let worn = worn(&cell);
    let mut drifts = Vec::new();
    let mut observe = |event: &Event| {
        if let Event::Drift { index, ratio, relearned_in, .. } = event {
            drifts.push((*index, ratio.unwrap(), relearned_in.clone()));
        }
    };
    let watched = frozen(library.clone(), 4);
    campaign::run(&worn, &watched, in_process(&worn), None, &mut observe).unwrap();
    let relearning = Options { relearn_above: Some(1.2), ..frozen(library.clone(), 7) };
    let outcome = campaign::run(&worn, &relearning, in_process(&worn), None, &mut observe).unwrap();
    assert_eq!((drifts[0].0, &drifts[0].2), (1, &None), "told once");
    assert_eq!(drifts.len(), 2);
    assert!(drifts.iter().all(|(_, ratio, _)| *ratio > 1.2), "{drifts:?}");
    assert_eq!(drifts[1].2.as_ref(), Some(&outcome.campaign));
    let made = rows(&library).split_off(n_learned + 4);
    let (frozen, learning) = made.split_at(2);
    assert!(frozen.iter().all(|row| row.meta.law == "frozen"));
    assert!(learning.iter().all(|row| row.meta.campaign == outcome.campaign));
    assert_eq!(learning[0].meta.law, "norm_optimal");
    assert_eq!(learning[0].record.index, 2);
    assert_eq!(learning[0].record.input, frozen[0].record.input, "its evidence begins with it");
    assert_ne!(learning[1].record.input, frozen[0].record.input);
    let rms = |row: &Row| row.record.figures.tracking_rms_m;
    assert!(rms(&learning[4]) < 0.8 * rms(&frozen[1]), "it learns");
    // The campaign resumes as any other.
    let on = Options { resume: true, ..options(library.clone(), 9) };
    let resumed = run(&worn, &on).unwrap();
    assert_eq!((resumed.campaign, resumed.runs.len()), (outcome.campaign, 7));
}

#[test]
fn a_frozen_run_that_cannot_be_is_refused_before_anything_moves() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let library = scratch.file("a.db");
    let refused = |cell: &Cell, options: Options| run(cell, &options).unwrap_err().to_string();
    let line = refused(&cell, frozen(library.clone(), 1));
    assert!(line.contains("no library") && !library.exists(), "{line}");
    run(&cell, &options(library.clone(), 2)).unwrap();
    let mut other = cell.clone();
    other.program.feed_m_s *= 0.9;
    let line = refused(&other, frozen(library.clone(), 1));
    assert!(line.contains("n_samples is") || line.contains("program."), "{line}");
    let line =
        refused(&other, Options { input_from: Some(Source::Id(2)), ..frozen(library.clone(), 1) });
    assert!(line.contains("run 2: "), "{line}");
    let line =
        refused(&cell, Options { input_from: Some(Source::Id(99)), ..frozen(library.clone(), 1) });
    assert!(line.contains("no iteration with id 99"), "{line}");
    let mut encoder = frozen(library.clone(), 1);
    encoder.session.measure = Some(Measure::Encoder);
    let line = refused(&cell, encoder);
    assert!(line.contains("measure is \"tcp\" there and \"encoder\" in this cell"), "{line}");
    let mut tight = cell.clone();
    tight.learning.input_max_m = 1e-6;
    let line =
        refused(&tight, Options { input_from: Some(Source::Id(2)), ..frozen(library.clone(), 1) });
    assert!(line.contains("allowed: up to 0.000001 m"), "{line}");
    let mut lawless = cell.clone();
    lawless.learning.law = LawName::None;
    let again = Options { relearn_above: Some(2.0), ..frozen(library.clone(), 1) };
    let line = refused(&lawless, again);
    assert!(line.contains("allowed: a law in [learning]"), "{line}");
    assert_eq!(rows(&library).len(), 2, "nothing was stored");
    assert_eq!(run(&lawless, &frozen(library, 1)).unwrap().runs.len(), 1, "frozen needs no law");
}

#[test]
fn an_exported_input_is_used_by_its_task_alone() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let (library, file) = (scratch.file("a.db"), scratch.file("input.json"));
    run(&cell, &options(library.clone(), 3)).unwrap();
    let plan = |cell: &Cell| Plan::new(cell, None, false).unwrap();
    let open = Library::read(&library).unwrap();
    let own = plan(&cell);
    let chosen =
        input::choose(&open, "a.db", Source::Best, (&cell, &own), |_| false).unwrap().unwrap();
    input::save(&chosen, 2, &file).unwrap();
    assert_eq!(input::load(&file, &cell, &own).unwrap(), chosen, "bit for bit");

    let other = scratch.file("b.db");
    let from_file = Options { input_file: Some(file.clone()), ..frozen(other.clone(), 2) };
    run(&cell, &from_file).unwrap();
    assert!(rows(&other).iter().all(|row| row.record.input == chosen.input));

    let differs = |change: fn(&mut Cell)| {
        let mut other = cell.clone();
        change(&mut other);
        match input::load(&file, &other, &plan(&other)).unwrap_err() {
            InputError::Different { key, .. } => key,
            error => error.to_string(),
        }
    };
    assert_eq!(differs(|cell| cell.cell.name = "other".into()), "cell");
    let key = differs(|cell| cell.axes[1].limits.jerk_max_m_s3 *= 1.1);
    assert_eq!(key, "axis[1].limits.jerk_max_m_s3");
    assert!(differs(|cell| cell.learning.input_max_m = 1e-6).contains("allowed: up to"));

    let text = std::fs::read_to_string(&file).unwrap();
    let spoiled = scratch.file("spoiled.json");
    let load = |text: &str| {
        std::fs::write(&spoiled, text).unwrap();
        input::load(&spoiled, &cell, &own).unwrap_err().to_string()
    };
    assert!(load(&text[..text.len() / 2]).contains("allowed: a file of `ilc-rt input export`"));
    assert!(load("").contains("EOF"));
    let place = text.find("\"input\":[[").unwrap() + "\"input\":[[".len();
    let end = place + text[place..].find([',', ']']).unwrap();
    let with = |number: &str| load(&format!("{}{number}{}", &text[..place], &text[end..]));
    assert!(with("0.001").contains("does not match its digest"));
    assert!(with("1e999").contains("out of range"), "{}", with("1e999"));
    assert!(with("null").contains("invalid type: null"));
    let load_path = |path: &Path| input::load(path, &cell, &own).unwrap_err().to_string();
    assert!(load_path(Path::new("/dev/zero")).contains("not a regular file"));
    assert!(load_path(&scratch.file("nothing.json")).contains("No such file"));
    let large = scratch.file("large.json");
    std::fs::File::create(&large).unwrap().set_len(1 << 30).unwrap();
    assert!(load_path(&large).contains("more than 67108864 bytes"));
    let kept = input::save(&chosen, 2, Path::new("/dev/null")).unwrap_err().to_string();
    assert!(kept.contains("not a regular file"), "{kept}");
}

#[test]
fn runs_without_learning_are_thinned_and_numbered_on() {
    let (cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    let library = scratch.file("a.db");
    run(&cell, &Options { keep: Some(Keep::Best), ..options(library.clone(), 3) }).unwrap();
    assert_eq!(rows(&library).len(), 3, "what a law learned from stays");
    run(&cell, &Options { keep: Some(Keep::Every(2)), ..frozen(library.clone(), 6) }).unwrap();
    let indices: Vec<u32> = rows(&library)[3..].iter().map(|row| row.record.index).collect();
    assert_eq!(indices, [0, 2, 4, 5]);
    let plain = scratch.file("b.db");
    let unlearned = |resume, iterations| Options {
        keep: Some(Keep::Every(10)),
        learning: false,
        resume,
        ..options(plain.clone(), iterations)
    };
    run(&cell, &unlearned(false, 4)).unwrap();
    run(&cell, &unlearned(true, 6)).unwrap();
    let indices: Vec<u32> = rows(&plain).iter().map(|row| row.record.index).collect();
    assert_eq!(indices, [0, 3, 5], "the newest of each stays until the next one is stored");
}

/// Renames a cell, so that its socket is its own.
fn named(cell: &Cell, name: &str) -> Cell {
    let mut cell = cell.clone();
    cell.cell.name = format!("{name}-{}", std::process::id());
    cell
}

#[test]
fn a_run_waits_for_its_command_and_the_cell_runs_until_stopped() {
    let (cell, scratch) = (named(&short("01_gantry.toml"), "on-command"), Scratch::new());
    let name = cell.cell.name.clone();
    let options = Options {
        forever: true,
        ctl: true,
        start: StartOn::Command,
        ..options(scratch.file("a.db"), 1)
    };
    let mut waits = 0;
    let outcome = campaign::run(&cell, &options, in_process(&cell), None, &mut |event| {
        if let Event::State { state: StateName::Waiting, iteration } = event {
            assert_eq!(*iteration, waits);
            waits += 1;
            let command = if waits <= 2 { Command::Start } else { Command::Stop };
            let reply = send(&name, command).unwrap();
            assert_eq!(reply.refused, None);
            assert_eq!((reply.status.state.as_str(), reply.status.iterations), ("waiting", None));
        }
    })
    .unwrap();
    assert_eq!((waits, outcome.runs.len()), (3, 2));
    assert_eq!((outcome.status, outcome.signal), (EndStatus::Interrupted, STOPPED_BY_COMMAND));
    assert_eq!(outcome.reason, "stopped by command");
    assert!(send(&name, Command::Status).is_err(), "its socket is gone");
}

/// Distance of a point from the lines of the shortened gantry's program.
fn from_path(cell: &Cell, point: &[f64]) -> f64 {
    let mut from = cell.program.start_m.clone();
    let mut nearest = f64::INFINITY;
    for segment in &cell.program.segments {
        let (dx, dy) = (segment.to_m[0] - from[0], segment.to_m[1] - from[1]);
        let (px, py) = (point[0] - from[0], point[1] - from[1]);
        let share = ((px * dx + py * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        nearest = nearest.min((px - share * dx).hypot(py - share * dy));
        from.clone_from(&segment.to_m);
    }
    nearest
}

#[test]
fn a_held_run_stays_on_its_path_and_is_not_learned_from() {
    let (mut cell, scratch) = (named(&short("01_gantry.toml"), "held"), Scratch::new());
    cell.program.corner = ilc_rt::config::Corner::ExactStop;
    let name = cell.cell.name.clone();
    let library = scratch.file("a.db");
    let options = Options { ctl: true, ..options(library.clone(), 4) };
    let mut states = Vec::new();
    let outcome = campaign::run(&cell, &options, in_process(&cell), None, &mut |event| {
        if let Event::State { state, iteration: 1 } = event {
            states.push(*state);
            match state {
                // In lock-step the order acts from the next tick on.
                StateName::Running if states.iter().filter(|s| **s == *state).count() == 1 => {
                    assert_eq!(send(&name, Command::Pause).unwrap().refused, None);
                }
                StateName::Paused => {
                    send(&name, Command::Feed { percent: 30 }).unwrap();
                    assert!(!send(&name, Command::Resume).unwrap().status.paused);
                }
                _ => {}
            }
        }
        if let Event::State { state: StateName::Returning, iteration: 2 } = event {
            send(&name, Command::Feed { percent: 100 }).unwrap();
        }
    })
    .unwrap();
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    assert!(states.contains(&StateName::Paused), "{states:?}");
    let made = rows(&library);
    let held = &made[1].record;
    assert!(held.figures.scaled_cycles as usize > held.reference_m.len() / 2);
    assert!(held.figures.remark.as_ref().unwrap().contains("at another feed than 100 %"));
    assert_eq!(held.reference_m.len(), made[0].record.reference_m.len());
    for point in held.reference_m.chunks_exact(2) {
        assert!(from_path(&cell, point) < 1e-12, "{point:?}");
    }
    // Its input is that of the next run, which is made at the whole feed and learned from.
    assert_eq!(
        (made[0].record.figures.scaled_cycles, made[2].record.figures.scaled_cycles),
        (0, 0)
    );
    assert!(made[2].record.figures.tracking_rms_m < 0.9 * made[0].record.figures.tracking_rms_m);
    assert_ne!(made[3].record.input, made[2].record.input);
}
