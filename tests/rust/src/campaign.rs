//! Whole campaigns on simulated drives: trajectory, loop, law and library.

use std::path::PathBuf;

use ilc_rt::campaign::{self, Options, Outcome};
use ilc_rt::cli::parse;
use ilc_rt::config::{Cell, Measure};
use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::transport;
use ilc_rt::library::Library;
use ilc_rt::record::{Event, Figures};
use ilc_sim::{ClockMode, Machine};

use crate::Scratch;

/// Largest number of the machine's answers to one frame.
const ANSWERS: usize = 256;

/// The simulated machine of a cell, in lock-step.
///
/// # Panics
/// If the cell is invalid.
pub fn machine(cell: &Cell) -> Machine {
    Machine::from_cell(cell, ClockMode::LockStep).expect("a validated cell")
}

/// The simulated machine in the caller's own thread.
pub fn in_process(cell: &Cell) -> Box<dyn Bus> {
    transport::in_process(&cell.bus.address, machine(cell), cell.cell.cycle_us, ANSWERS)
}

/// Options of a campaign in lock-step, without telemetry.
///
/// # Panics
/// If the options are not those of `ilc-rt run`.
pub fn options(library: PathBuf, iterations: u32) -> Options {
    let mut options: Options =
        parse(&["--lockstep".into(), "--no-telemetry".into()]).expect("options of ilc-rt run");
    (options.iterations, options.session.library) = (iterations, library);
    options
}

/// The result of a campaign.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Outcome of the campaign.
    pub outcome: Outcome,
    /// Digest of each run, as stored in the library and verified against its arrays.
    pub digests: Vec<String>,
    /// Its states and stored runs, in the order of its events.
    pub course: Vec<String>,
}

impl Kept {
    /// Largest contour error of each run.
    ///
    /// # Panics
    /// If the path has no contour.
    pub fn contour_m(&self) -> Vec<f64> {
        let of = |figures: &Figures| figures.contour_inf_m.expect("a path with a contour");
        self.outcome.runs.iter().map(|(_, figures)| of(figures)).collect()
    }

    /// Reduction of the contour error from the first run to run `index`, as a share.
    pub fn contour_fall(&self, index: usize) -> f64 {
        let contour_m = self.contour_m();
        1.0 - contour_m[index] / contour_m[0]
    }
}

/// Runs a campaign with the cell's own law and reads the library back.
///
/// # Panics
/// If the campaign or the library fails.
pub fn run_on(cell: &Cell, bus: Box<dyn Bus>, iterations: u32, measure: Option<Measure>) -> Kept {
    let scratch = Scratch::new();
    let library = scratch.file("library.db");
    let mut options = options(library.clone(), iterations);
    options.session.measure = measure;
    let mut course = Vec::new();
    let mut note = |event: &Event| match event {
        Event::State { state, iteration } => course.push(format!("{state:?} {iteration}")),
        Event::Iteration { index, .. } => course.push(format!("kept {index}")),
        _ => {}
    };
    let outcome = campaign::run(cell, &options, bus, None, &mut note).expect("the campaign begins");
    let library = Library::open(&library).expect("the library opens");
    let rows = library.list(Some(&outcome.campaign)).expect("the library lists");
    // Loading checks each array against its digest.
    let digests =
        rows.iter().map(|row| library.load(row.id).expect("a whole row").digest).collect();
    Kept { outcome, digests, course }
}

/// Runs a campaign on the machine in the caller's thread.
///
/// # Panics
/// If the campaign or the library fails.
pub fn run(cell: &Cell, iterations: u32, measure: Option<Measure>) -> Kept {
    run_on(cell, in_process(cell), iterations, measure)
}
