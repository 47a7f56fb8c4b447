//! Whole campaigns: the course, the loop, the law and the library, on simulated drives.

use std::path::PathBuf;

use ilc_rt::campaign::{self, Options, Outcome};
use ilc_rt::cli::parse;
use ilc_rt::config::{Cell, Measure};
use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::library::Library;
use ilc_rt::record::Figures;
use ilc_sim::{ClockMode, Machine};

use crate::Scratch;

/// Frames that the machine's answers to one frame may be.
const ANSWERS: usize = 256;

/// The simulated machine of a cell, in lock-step.
///
/// # Panics
/// If the cell was not validated.
pub fn machine(cell: &Cell) -> Machine {
    Machine::from_cell(cell, ClockMode::LockStep).expect("a validated cell")
}

/// The simulated machine in the caller's own thread.
pub fn in_process(cell: &Cell) -> Box<dyn Bus> {
    Box::new(InProcess::new(machine(cell), ANSWERS))
}

/// A campaign in lock-step, without telemetry.
pub fn options(library: PathBuf, iterations: u32) -> Options {
    let mut options: Options = parse(&["--lockstep".into(), "--no-telemetry".into()]).unwrap();
    (options.iterations, options.session.library) = (iterations, library);
    options
}

/// What a campaign left behind.
#[derive(Clone, Debug)]
pub struct Kept {
    /// What the campaign ended with.
    pub outcome: Outcome,
    /// Digest of each run, as the library has it and as its arrays give it.
    pub digests: Vec<String>,
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

    /// By how much the contour error has fallen from the first run to run `index`, as a share.
    pub fn contour_fall(&self, index: usize) -> f64 {
        let contour_m = self.contour_m();
        1.0 - contour_m[index] / contour_m[0]
    }
}

/// Runs a campaign with the cell's own law and reads back what the library has of it.
///
/// # Panics
/// If the campaign or the library refuses.
pub fn run_on(cell: &Cell, bus: Box<dyn Bus>, iterations: u32, measure: Option<Measure>) -> Kept {
    let scratch = Scratch::new();
    let library = scratch.file("library.db");
    let mut options = options(library.clone(), iterations);
    options.session.measure = measure;
    let outcome =
        campaign::run(cell, &options, bus, None, &mut |_| {}).expect("the campaign begins");
    let library = Library::open(&library).expect("the library opens");
    let rows = library.list(Some(&outcome.campaign)).expect("the library lists");
    // Loading checks each array against its digest.
    let digests =
        rows.iter().map(|row| library.load(row.id).expect("a whole row").digest).collect();
    Kept { outcome, digests }
}

/// Runs a campaign on the machine in the caller's thread.
///
/// # Panics
/// If the campaign or the library refuses.
pub fn run(cell: &Cell, iterations: u32, measure: Option<Measure>) -> Kept {
    run_on(cell, in_process(cell), iterations, measure)
}
