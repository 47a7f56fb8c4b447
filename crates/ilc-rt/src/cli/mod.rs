//! The command line of the binary `ilc-rt`: arguments in, one clear line or a table out.
//!
//! Imports everything and is imported by `main` only.

mod check;
mod completions;
mod ctl;
mod dead_man;
mod doctor;
mod drive;
mod enable;
mod figures;
mod goto;
mod home;
mod identify;
mod init;
mod input;
mod jog;
mod late;
mod latency;
mod moving;
mod option;
mod parent;
mod quantity;
mod record;
mod replay;
mod reset;
mod run;
mod runs;
mod scan;
mod schema;
mod sdo;
mod show;
mod status;
mod target;
mod why;

pub use identify::IdentifyOptions;
pub use option::{OptionSpec, described, parse};
pub use parent::when_parent_ends;

use std::process::ExitCode;

use crate::record::printable_lines;
use clap::{CommandFactory, Parser, Subcommand};
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

/// Done, but a requested file could not be written, or no model could be found.
pub const EXIT_FAILURE: u8 = 1;
/// Bad input: nothing has moved.
pub const EXIT_BAD_INPUT: u8 = 2;
/// A fault brought the axes to rest.
pub const EXIT_FAULT: u8 = 3;

#[derive(Parser)]
#[command(name = "ilc-rt", version, about = "The real-time controller that learns", long_about = None)]
#[command(after_help = "Exit status: 0 done, 1 done but --json could not be written or \
no model found, 2 bad input (nothing moved), 3 controlled stop after a \
fault, 129 after SIGHUP, 130 after Ctrl-C, 143 after SIGTERM.")]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run a cell: bring the drives up, repeat the program, learn after every run.
    Run(run::RunArguments),
    /// Excite one axis while all others hold still, and fit a model to its response.
    Identify(identify::IdentifyArguments),
    /// Command a cell that runs with --ctl: start, pause, resume, feed, stop, status.
    Ctl(ctl::CtlArguments),
    /// Export the learned input of a run to a file, for `run --frozen --input`.
    Input(input::InputArguments),
    /// Check a cell description and print what it would do; touches no bus.
    Check(check::CheckArguments),
    /// Write a cell description to begin with: every key, its meaning and its range.
    Init(init::InitArguments),
    /// Print the JSON schema of the cell description, for editors.
    Schema(schema::SchemaArguments),
    /// List the nodes on a bus: identity, state and supported modes; only reads.
    Scan(scan::ScanArguments),
    /// Read or write an object of a node.
    Sdo(sdo::SdoArguments),
    /// Describe a drive from the data sheet of its maker.
    Drive(drive::DriveArguments),
    /// Print state, position, faults and inputs of the axes; only reads.
    Status(status::StatusArguments),
    /// Name the faults of drives, and reset them.
    Reset(reset::ResetArguments),
    /// Switch the drives of a cell on, and hold their positions until released.
    Enable(enable::EnableArguments),
    /// Let the drives search their home, as [axis.homing] says.
    Home(home::HomeArguments),
    /// Move one axis by a distance, or for as long as input arrives.
    Jog(jog::JogArguments),
    /// Move axes to positions.
    Goto(goto::GotoArguments),
    /// Switch drives off.
    Disable(reset::DisableArguments),
    /// Tell what a recording holds, or export its frames.
    Record(record::RecordArguments),
    /// Run the loop of a recording again, and name the first value that differs.
    Replay(replay::ReplayArguments),
    /// Tell who was late when the loop of a cell lost a deadline, from the record of its last run.
    Why(why::WhyArguments),
    /// Tell what keeps this computer from being punctual, and the command that mends it; only reads.
    Doctor(doctor::DoctorArguments),
    /// Measure how late this machine wakes the loop's thread.
    Latency(latency::LatencyArguments),
    /// Print a script that completes this command line in a shell.
    Completions(completions::CompletionsArguments),
}

/// Runs the program's arguments and returns its exit status.
pub fn main() -> ExitCode {
    let filter = std::env::var("ILC_LOG").ok().and_then(|text| text.parse::<Targets>().ok());
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .without_time()
        // A closed standard error must not end the program: errors of logging are ignored.
        .log_internal_errors(false)
        .with_target(false)
        .with_filter(filter.unwrap_or_else(|| Targets::new().with_target("ilc_rt", Level::INFO)));
    tracing_subscriber::registry().with(lines).init();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        // The output of --help and --version arrives as an error as well.
        Err(answer) if answer.exit_code() == 0 => {
            show::say(&answer.render().to_string().trim_end());
            return ExitCode::SUCCESS;
        }
        Err(refusal) => {
            show::complain(&refusal_line(&refusal));
            return ExitCode::from(EXIT_BAD_INPUT);
        }
    };
    let status = match arguments.verb {
        Verb::Run(arguments) => run::run(&arguments),
        Verb::Identify(arguments) => identify::identify(&arguments),
        Verb::Ctl(arguments) => ctl::ctl(&arguments),
        Verb::Input(arguments) => input::input(&arguments),
        Verb::Check(arguments) => check::check(&arguments),
        Verb::Init(arguments) => init::init(&arguments),
        Verb::Schema(arguments) => schema::schema(&arguments),
        Verb::Scan(arguments) => scan::scan(&arguments),
        Verb::Sdo(arguments) => sdo::sdo(&arguments),
        Verb::Drive(arguments) => drive::drive(&arguments),
        Verb::Status(arguments) => status::status(&arguments),
        Verb::Reset(arguments) => reset::reset(&arguments),
        Verb::Enable(arguments) => enable::enable(&arguments),
        Verb::Home(arguments) => home::home(&arguments),
        Verb::Jog(arguments) => jog::jog(&arguments),
        Verb::Goto(arguments) => goto::goto(&arguments),
        Verb::Disable(arguments) => reset::disable(&arguments),
        Verb::Record(arguments) => record::record(&arguments),
        Verb::Replay(arguments) => replay::replay(&arguments),
        Verb::Why(arguments) => why::why(&arguments),
        Verb::Doctor(arguments) => doctor::doctor(&arguments),
        Verb::Latency(arguments) => latency::latency(&arguments),
        Verb::Completions(arguments) => completions::completions(&arguments, Arguments::command()),
    };
    ExitCode::from(status)
}

/// Returns the refusal of a command line as one line, with a hint to the help.
pub fn refusal_line(refusal: &clap::Error) -> String {
    format!("{}; --help tells what is allowed", refusal_text(refusal))
}

/// Returns the refusal of a command line as one line, without its usage.
fn refusal_text(refusal: &clap::Error) -> String {
    let text = refusal.render().to_string();
    let lines = text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
    let words: Vec<_> = lines
        .filter(|line| !line.is_empty() && !line.starts_with("For more information"))
        .collect();
    let line = words.join("; ").replace(":; ", ": ");
    printable_lines(line.trim_start_matches("error: "))
}
