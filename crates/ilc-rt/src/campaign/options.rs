//! Options of a campaign: the one description of their names, ranges, defaults and help.
//!
//! `ilc-rt` parses its command line with it, `ilc` and the Python class `Campaign` read it through
//! [`crate::cli::described`] and hand their options over as such a command line. A field of this file is an
//! option everywhere.

use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, AtomicU32};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args, Command, FromArgMatches};

use super::disturbance::Disturbance;
use super::input::Source;
use crate::config::{Cell, Keep, LawName, Measure};
use crate::fieldbus::transport::syntaxes;
use crate::record::{EndStatus, Figures};

/// Time for which a stall of controller and simulated drives is forgiven, as it stalls both.
pub(super) const SIMULATED_PATIENCE_S: f64 = 1.0;

/// Largest ratio of errors at which learning starts again.
const RELEARN_RATIO_MAX: f64 = 1e6;

/// Options of everything that moves axes: a campaign or an experiment.
#[derive(Clone, Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub struct Session {
    /// Bus address in place of the cell's.
    #[arg(long, value_name = "ADDRESS", help = bus_help())]
    pub bus: Option<String>,
    /// Measurement to use in place of the cell's.
    #[arg(long, value_parser = PossibleValuesParser::new(["encoder", "tcp"]).map(measure))]
    pub measure: Option<Measure>,
    /// Pace the loop by the drives' answers, without a wall clock: campaigns repeat bit for bit.
    #[arg(long)]
    pub lockstep: bool,
    /// The drives are simulated on this computer: forgive a stall of up to 1 s, which stalls them as well.
    #[arg(long = "simulated-drives")]
    pub simulated: bool,
    /// Refuse to move anything unless the loop's thread gets its priority, locked memory and, if the cell names one, its
    /// processor.
    #[arg(long, conflicts_with = "lockstep")]
    pub require_rt: bool,
    /// Reset faults that the drives have when the program starts, in place of a refusal that names them.
    #[arg(long)]
    pub reset_faults: bool,
    /// Home the axes that are not homed before anything else, in place of a refusal that names them.
    #[arg(long)]
    pub home: bool,
    /// Library file that every run is stored in.
    #[arg(long, value_name = "FILE", default_value = "ilc-library.db")]
    pub library: PathBuf,
    /// Record every tick, all frames and events into a new file, or into a folder under a name of its own; `ilc-rt replay`
    /// repeats it.
    #[arg(long, value_name = "FILE|DIR")]
    pub record: Option<PathBuf>,
    /// Open file that is recorded into, e.g. a pipe to another program; `record` then names it only.
    #[arg(skip)]
    pub record_to: Option<Arc<File>>,
    /// Do not publish on Zenoh.
    #[arg(long = "no-telemetry", action = ArgAction::SetFalse)]
    pub telemetry: bool,
    /// Recordings made so far: an identification makes several experiments.
    #[arg(skip)]
    pub recordings: Arc<AtomicU32>,
    /// Number of a signal, set to bring the axes to rest.
    #[arg(skip)]
    pub stop: Arc<AtomicI32>,
}

impl Session {
    /// Returns whether stalls are forgiven: in lock-step there is no clock that could show one.
    pub(super) fn forgives_stalls(&self) -> bool {
        self.simulated && !self.lockstep
    }
}

/// Options of a campaign.
#[derive(Clone, Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "switches of a command line")]
pub struct Options {
    /// Bus, measurement, pace and library.
    #[command(flatten)]
    pub session: Session,
    /// Runs in the whole campaign, resumed ones included; the first is without learning.
    #[arg(long, short = 'n', value_name = "N", default_value_t = 10, value_parser = iterations)]
    pub iterations: u32,
    /// Repeat the program without learning.
    #[arg(long = "no-learning", action = ArgAction::SetFalse)]
    pub learning: bool,
    /// Resume the newest campaign of this cell, program, measurement and law.
    #[arg(long)]
    pub resume: bool,
    /// Start the law even if the analysis predicts divergence.
    #[arg(long)]
    pub allow_divergent: bool,
    /// Run with a learned input and learn nothing; the best input of the library, unless --from or --input
    /// names another.
    #[arg(long, conflicts_with = "resume")]
    pub frozen: bool,
    /// Run of the library that a frozen input is taken from.
    #[arg(
        long = "from",
        value_name = "ID|best|last",
        requires = "frozen",
        conflicts_with = "input_file"
    )]
    pub input_from: Option<Source>,
    /// File that a frozen input is loaded from.
    #[arg(long = "input", value_name = "FILE", requires = "frozen")]
    pub input_file: Option<PathBuf>,
    /// Run of the library, of any program of this cell, whose parameters the law begins with: for laws with
    /// parameters that hold on every program.
    #[arg(long, value_name = "ID|best|last", conflicts_with_all = ["resume", "frozen"])]
    pub parameters_from: Option<Source>,
    /// Learn again, in a new campaign, when the error of a frozen input is above this many times its
    /// reference.
    #[arg(long, value_name = "RATIO", requires = "frozen", value_parser = relearn_ratio)]
    pub relearn_above: Option<f64>,
    /// Run until stopped, in place of a number of runs.
    #[arg(long, conflicts_with = "iterations")]
    pub forever: bool,
    /// Runs that stay in the library when nothing is learned from them, in place of the cell's; the newest always
    /// does.
    #[arg(long, value_name = "all|N|best")]
    pub keep: Option<Keep>,
    /// Accept commands of `ilc-rt ctl` on a socket of this user.
    #[arg(long)]
    pub ctl: bool,
    /// Start each run at once, when `ilc-rt ctl CELL start` asks for it, or at a press of the button of an `[[input]]`
    /// with use = "start".
    #[arg(
        long,
        value_parser = PossibleValuesParser::new(["at-once", "command", "input"]).map(start_on),
        default_value = "at-once",
        requires_if("command", "ctl")
    )]
    pub start: StartOn,
    /// Measured disturbance before each run: stored with the run, and given to the law.
    #[arg(skip)]
    pub disturbance: Disturbance,
}

/// Cause of the start of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartOn {
    /// The axes have settled.
    #[default]
    AtOnce,
    /// A command, after the axes have settled.
    Command,
    /// A press of a button of the cell, after the axes have settled.
    Input,
}

impl Default for Options {
    /// Returns the options of a command line without any.
    fn default() -> Self {
        let matches = Self::augment_args(Command::new("")).get_matches_from([""]);
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }
}

impl Options {
    /// Returns the options of a campaign that counts its runs in any case.
    pub(super) fn counted(&self) -> Self {
        let iterations = if self.forever { u32::MAX } else { self.iterations };
        Self { iterations, ..self.clone() }
    }

    /// Returns the cell with what the options put in the place of its own keys.
    pub fn apply(&self, mut cell: Cell) -> Cell {
        cell.learning.allow_divergent |= self.allow_divergent;
        if !self.learning {
            cell.learning.law = LawName::None;
        }
        if self.frozen && self.relearn_above.is_none() {
            cell.learning.law = LawName::None;
            // They wrap a law.
            (cell.learning.ladder, cell.learning.gate) = (None, None);
        }
        cell.library.keep = self.keep.unwrap_or(cell.library.keep);
        if let Some(address) = &self.session.bus {
            address.clone_into(&mut cell.bus.address);
        }
        cell
    }
}

/// Returns the help text of `--bus`.
fn bus_help() -> String {
    format!("Bus address in place of the cell's: {}", syntaxes(false))
}

#[expect(clippy::needless_pass_by_value, reason = "as the parser of arguments hands it on")]
fn measure(name: String) -> Measure {
    if name == "tcp" { Measure::Tcp } else { Measure::Encoder }
}

#[expect(clippy::needless_pass_by_value, reason = "as the parser of arguments hands it on")]
fn start_on(name: String) -> StartOn {
    match name.as_str() {
        "command" => StartOn::Command,
        "input" => StartOn::Input,
        _ => StartOn::AtOnce,
    }
}

/// Parses a ratio of two errors.
fn relearn_ratio(text: &str) -> Result<f64, String> {
    let allowed = |ratio: &f64| (1.0..=RELEARN_RATIO_MAX).contains(ratio);
    text.parse().ok().filter(allowed).ok_or_else(|| format!("allowed 1 to {RELEARN_RATIO_MAX}"))
}

/// Parses the number of runs, which are counted in 32 bits.
fn iterations(text: &str) -> Result<u32, String> {
    text.parse().ok().filter(|n| *n > 0).ok_or_else(|| format!("allowed 1 to {}", u32::MAX))
}

/// End of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Completed, interrupted or stopped by a fault.
    pub status: EndStatus,
    /// Reason, one sentence.
    pub reason: String,
    /// Signal that asked to stop, or 0.
    pub signal: i32,
    /// Name of the campaign in the library.
    pub campaign: String,
    /// Units of the axes, in their order.
    pub axis_units: Vec<&'static str>,
    /// Number and figures of every run of the campaign, resumed ones included; with `forever` of the newest 200.
    pub runs: Vec<(u32, Figures)>,
}
