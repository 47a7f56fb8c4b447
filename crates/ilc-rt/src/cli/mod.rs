//! The command line of the binary `ilc-rt`: arguments in, one clear line or a table out.
//!
//! Imports everything and is imported by `main` only.

mod check;
mod latency;
mod run;
mod show;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

/// Bad input: nothing has moved.
pub const EXIT_BAD_INPUT: u8 = 2;
/// A fault brought the axes to rest.
pub const EXIT_FAULT: u8 = 3;

#[derive(Parser)]
#[command(name = "ilc-rt", version, about = "The real-time controller that learns", long_about = None)]
#[command(
    after_help = "Exit status: 0 done, 2 bad input (nothing moved), 3 controlled stop after a \
fault, 130 after Ctrl-C, 143 after SIGTERM."
)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run a cell: bring the drives up, repeat the program, learn after every run.
    Run(run::RunArguments),
    /// Read a cell description and tell what it would do; touches no bus.
    Check(check::CheckArguments),
    /// Measure how late this machine wakes the loop's thread.
    Latency(latency::LatencyArguments),
}

/// Runs the program's arguments and returns its exit status.
pub fn main() -> ExitCode {
    let filter = std::env::var("ILC_LOG").ok().and_then(|text| text.parse::<Targets>().ok());
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .with_filter(filter.unwrap_or_else(|| Targets::new().with_target("ilc_rt", Level::INFO)));
    tracing_subscriber::registry().with(lines).init();
    let status = match Arguments::parse().verb {
        Verb::Run(arguments) => run::run(&arguments),
        Verb::Check(arguments) => check::check(&arguments),
        Verb::Latency(arguments) => latency::latency(&arguments),
    };
    ExitCode::from(status)
}
