//! Parameters that were learned on one program serve the first run of another one.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]

use std::path::Path;

use ilc_rt::campaign::input::{Source, take_over};
use ilc_rt::campaign::{self, CampaignError, Options, Outcome};
use ilc_rt::config::{Cell, LawName};
use ilc_rt::design::Plan;
use ilc_rt::learning::{Law, LearningError};
use ilc_rt::library::Library;
use ilc_rt::record::EndStatus;
use ilc_tests::campaign::{in_process, options};
use ilc_tests::{Scratch, example_text};

/// Another path than that of the example, slower and with other corners.
const OTHER: &str = r#"[program]
start_m = [0.02, 0.01]
feed_m_s = 0.07
corner = "blend"
blend_s = 0.04
segment = [{ to_m = [0.05, 0.05] }, { to_m = [0.07, 0.02] }, { to_m = [0.02, 0.01] }]

"#;

/// Returns the gantry with a law, on its own program or on the other one.
fn gantry(learning: &str, is_other: bool) -> Cell {
    let text = example_text("01_gantry.toml");
    let (head, program) = text.split_once("[program]").unwrap();
    let program = program.split("[learning]").next().unwrap();
    let program = if is_other { OTHER.to_owned() } else { format!("[program]{program}") };
    let text = format!("{head}{program}[learning]\n{learning}\n");
    Cell::parse(&text, "01_gantry.toml").unwrap()
}

/// The same with a cogging force along x, of half the following error or so.
fn cogging(learning: &str, is_other: bool) -> Cell {
    let mut cell = gantry(learning, is_other);
    cell.learning.measure = ilc_rt::config::Measure::Encoder;
    for axis in &mut cell.axes {
        (axis.simulation.coulomb_n, axis.simulation.static_n) = (0.0, 0.0);
        axis.simulation.mode_mass_kg = 0.0;
    }
    let x = &mut cell.axes[0].simulation;
    (x.cogging_n, x.cogging_pitch_m) = (250.0, 0.02);
    cell
}

fn run(cell: &Cell, options: &Options) -> Result<Outcome, CampaignError> {
    let outcome = campaign::run(cell, options, in_process(cell), None, &mut |_| {})?;
    assert_eq!(outcome.status, EndStatus::Completed, "{}", outcome.reason);
    Ok(outcome)
}

fn rms_m(outcome: &Outcome) -> Vec<f64> {
    outcome.runs.iter().map(|(_, figures)| figures.tracking_rms_m).collect()
}

fn from(library: &Path, source: Source, iterations: u32) -> Options {
    Options { parameters_from: Some(source), ..options(library.to_owned(), iterations) }
}

/// Learns on the program of the example, and returns the errors of the other one: without learning, and with the
/// parameters of the first program in its first run.
fn carried(cell: impl Fn(bool) -> Cell, runs: u32) -> (Vec<f64>, f64, f64) {
    let scratch = Scratch::new();
    let library = scratch.file("a.db");
    let learned = rms_m(&run(&cell(false), &options(library.clone(), runs)).unwrap());
    let other = cell(true);
    let plain = Options { learning: false, ..options(scratch.file("b.db"), 1) };
    let plain = rms_m(&run(&other, &plain).unwrap())[0];
    let with = run(&other, &from(&library, Source::Best, 2)).unwrap();
    let remark = Library::open(&library).unwrap().list(Some(&with.campaign)).unwrap();
    let remark = remark[0].record.figures.remark.clone().unwrap();
    assert!(remark.starts_with("parameters: velocity[0] = "), "{remark}");
    (learned, plain, rms_m(&with)[0])
}

const BASIS: &str = "law = \"basis_functions\"\n[learning.basis_functions]\n\
                     functions = [\"velocity\", \"acceleration\", \"jerk\", \"coulomb\"]";

#[test]
fn the_first_run_of_another_program_has_at_most_three_tenths_of_the_error() {
    let (learned, plain, first) = carried(|is_other| gantry(BASIS, is_other), 6);
    println!("learned {learned:?}, other program {plain:.2e} -> {first:.2e}");
    assert!(learned[5] < 0.3 * learned[0] && first < 0.3 * plain);
}

#[test]
fn a_table_over_the_position_compensates_cogging_on_another_program() {
    let motion = "functions = [\"velocity\", \"acceleration\"]";
    let table = format!(
        "law = \"position_domain\"\n[learning.position_domain]\nspacing_m = 0.0025\naxes = [\"x\"]\n{motion}"
    );
    let basis = format!("law = \"basis_functions\"\n[learning.basis_functions]\n{motion}");
    let (with, plain, first) = carried(|is_other| cogging(&table, is_other), 6);
    let (without, _, motion_alone) = carried(|is_other| cogging(&basis, is_other), 6);
    println!("table {with:?}: {plain:.2e} -> {first:.2e}");
    println!("motion alone {without:?}: {plain:.2e} -> {motion_alone:.2e}");
    assert!(with[5] < 0.5 * without[5], "on the program itself");
    assert!(first < 0.8 * motion_alone && first < 0.2 * plain, "on the other one");
}

#[test]
fn parameters_of_the_cell_description_count_from_the_first_run_on_and_learning_may_be_off() {
    let learn = |text: &str| format!("{BASIS}\n{text}");
    let scratch = Scratch::new();
    let first = options(scratch.file("a.db"), 1);
    let zero = rms_m(&run(&gantry(&learn(""), false), &first).unwrap())[0];
    // By the model of each axis: 2 d / w, 1 / w^2 and the delay.
    let given = "parameters = [[0.0275, 3e-4, 0.0, 0.0], [0.019, 2.5e-4, 0.0, 0.0]]\nlearn = false";
    let cell = gantry(&learn(given), false);
    let fixed = rms_m(&run(&cell, &options(scratch.file("b.db"), 3)).unwrap());
    println!("zero {zero:.2e}, given {fixed:?}");
    assert!(fixed[0] < 0.3 * zero);
    let rows = Library::open(&scratch.file("b.db")).unwrap();
    let input = |id: i64| rows.load(id).unwrap().record.input;
    assert_eq!((input(1), input(1)), (input(2), input(3)), "nothing is learned");

    // An input beyond its bound is refused before anything moves.
    let mut tight = cell.clone();
    tight.learning.input_max_m = 1e-4;
    let line = run(&tight, &options(scratch.file("c.db"), 1)).unwrap_err().to_string();
    assert!(
        line.contains("the parameters of the law") && line.contains("allowed: up to"),
        "{line}"
    );
}

/// A law that refuses what another run shows: at once, or when it has to begin with it.
struct Refusing {
    at_once: bool,
}

impl Refusing {
    fn refusal<T>() -> Result<T, LearningError> {
        Err(LearningError::Empty { what: "basis" })
    }
}

impl Law for Refusing {
    fn update(&mut self, _: &[f64], _: &[f64], _: &mut [f64]) -> Result<(), LearningError> {
        Self::refusal()
    }

    fn take_over(&mut self, _: &[f64], _: &[f64]) -> Result<bool, LearningError> {
        if self.at_once { Self::refusal() } else { Ok(true) }
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>, LearningError> {
        Self::refusal()
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        "{}".to_owned()
    }
}

#[test]
fn a_law_that_refuses_the_parameters_of_a_run_says_why_and_does_not_begin_with_zero() {
    let scratch = Scratch::new();
    let path = scratch.file("a.db");
    run(&gantry(BASIS, false), &options(path.clone(), 1)).unwrap();
    let library = Library::open(&path).unwrap();
    let other = gantry(BASIS, true);
    let mut plan = Plan::new(&other, None, true).unwrap();
    plan.meta.law = "basis_functions".to_owned();
    for at_once in [true, false] {
        let mut law = Refusing { at_once };
        let taken =
            take_over(&library, "a.db", Source::Last, (&other, &plan), Some(&mut law), |_| false);
        let line = taken.unwrap().unwrap_err().to_string();
        let reason = LearningError::Empty { what: "basis" }.to_string();
        assert!(line.starts_with("library a.db: run 1 has no parameters for the law"), "{line}");
        assert!(line.ends_with(&reason), "{line}");
    }
}

#[test]
fn a_resumed_campaign_goes_on_with_the_input_that_would_have_followed() {
    let scratch = Scratch::new();
    let library = scratch.file("a.db");
    run(&gantry(BASIS, false), &options(library.clone(), 3)).unwrap();
    let other = gantry(BASIS, true);
    std::fs::copy(&library, scratch.file("b.db")).unwrap();
    run(&other, &from(&library, Source::Last, 3)).unwrap();
    let broken = scratch.file("b.db");
    run(&other, &from(&broken, Source::Last, 2)).unwrap();
    let again = Options { resume: true, ..options(broken.clone(), 3) };
    run(&other, &again).unwrap();
    let last = |path: &Path| {
        let library = Library::open(path).unwrap();
        let id = library.list(None).unwrap().last().unwrap().id;
        library.load(id).unwrap().record.input
    };
    assert_eq!(last(&library), last(&broken));
}

#[test]
fn what_has_no_such_parameters_is_refused_in_one_line() {
    let scratch = Scratch::new();
    let library = scratch.file("a.db");
    let refused = |cell: &Cell, options: &Options| {
        campaign::run(cell, options, in_process(cell), None, &mut |_| {}).unwrap_err().to_string()
    };
    let cell = gantry(BASIS, false);
    let line = refused(&cell, &from(&library, Source::Last, 1));
    assert!(line.contains("there is no library"), "{line}");
    run(&gantry("law = \"pd\"", false), &options(library.clone(), 1)).unwrap();
    let line = refused(&cell, &from(&library, Source::Best, 1));
    assert!(
        line.contains("no undisturbed run of this cell with law \"basis_functions\""),
        "{line}"
    );
    let line = refused(&gantry("law = \"pd\"", false), &from(&library, Source::Last, 1));
    assert!(line.contains("law \"pd\" has no parameters"), "{line}");
    let mut none = gantry(BASIS, false);
    none.learning.law = LawName::None;
    let line = refused(&none, &from(&library, Source::Last, 1));
    assert!(line.contains("law \"none\" has no parameters"), "{line}");

    run(&cell, &options(library.clone(), 2)).unwrap();
    let mut named = cell.clone();
    named.axes[1].name = "z".to_owned();
    let line = refused(&named, &from(&library, Source::Last, 1));
    assert!(line.contains("axis[1][0] is \"y\" there and \"z\""), "{line}");
    let mut tight = gantry(BASIS, true);
    tight.learning.input_max_m = 1e-4;
    let line = refused(&tight, &from(&library, Source::Id(3), 1));
    assert!(
        line.contains("parameters of library") && line.contains("allowed: up to 0.0001"),
        "{line}"
    );
}
