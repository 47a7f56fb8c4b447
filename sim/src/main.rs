//! Simulated drives as a separate process.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, Subcommand};
use ilc_rt::campaign::open_buses;
use ilc_rt::cli::refusal_line;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::canopen::NodeId;
use ilc_rt::fieldbus::transport::{self, GroupSide};
use ilc_rt::record::printable_lines;
use ilc_sim::{ClockMode, Machine, eds};

mod drive_clock;
mod presence;
mod press;
mod run;

use run::{Habits, Mute};

/// Simulated CiA 402 drives that speak the real protocol.
#[derive(Debug, Parser)]
#[command(name = "ilc-sim", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

const EXAMPLES: &str = "\
Examples:
  ilc-sim run examples/01_gantry.toml
  ilc-sim run examples/01_gantry.toml --bus can:vcan0
  ilc-sim run examples/01_gantry.toml --mute 1@5
  ilc-sim eds examples/01_gantry.toml --node 1 > drive.eds";

const INPUT_EXAMPLES: &str = "\
A running controller lets it happen with --simulated-drives; a real drive has no such object.

Examples:
  ilc-sim input gantry.toml door off
  ilc-sim input gantry.toml go on";

#[derive(Debug, Subcommand)]
enum Verb {
    /// Runs the drives of a cell until interrupted.
    #[command(after_help = EXAMPLES)]
    Run {
        /// Cell description: nodes, counts, limits and physics.
        cell: PathBuf,
        #[arg(long, value_name = "ADDRESS", help = bus_help())]
        bus: Option<String>,
        /// Let time pass by SYNC only, one cycle each, instead of by the wall clock.
        #[arg(long)]
        lockstep: bool,
        /// Take the power from a node some seconds after the first SYNC, in the plant's time; may be given
        /// more than once.
        #[arg(long, value_name = "NODE@SECONDS")]
        mute: Vec<Mute>,
        /// Silence on the bus, in seconds, after which SYNC counts as lost and the drives' time goes on
        /// by itself; until then a controller that stalls stalls the plant.
        #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = seconds)]
        sync_lost_after: Duration,
        /// End when standard input closes, as it does when the program that started this one ends: the
        /// axes come to rest first.
        #[arg(long)]
        with_parent: bool,
    },
    /// Switches an input of a cell whose drives run in another process: closes a guard, presses a button.
    #[command(after_help = INPUT_EXAMPLES)]
    Input {
        /// Cell description.
        cell: PathBuf,
        /// Name of the input.
        name: String,
        /// New state: a closed guard and a pressed button are on.
        #[arg(value_parser = ["on", "off"])]
        state: String,
        #[arg(long, value_name = "ADDRESS", help = bus_help())]
        bus: Option<String>,
    },
    /// Prints the electronic data sheet (EDS) of a node.
    Eds {
        /// Cell description.
        cell: PathBuf,
        /// Node.
        #[arg(long)]
        node: u8,
    },
}

/// Reason that the program ends early.
enum Failure {
    /// Input that cannot be used: exit status 2.
    Input(String),
    /// A failure at run time: exit status 1.
    Broken(String),
}

fn main() -> ExitCode {
    let outcome = match Arguments::try_parse() {
        Ok(arguments) => carry_out(arguments.verb),
        // The output of --help and --version arrives as an error as well.
        Err(answer) if answer.exit_code() == 0 => answer.exit(),
        Err(refusal) => Err(Failure::Input(refusal_line(&refusal))),
    };
    let (line, status) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Input(line)) => (line, 2),
        Err(Failure::Broken(line)) => (line, 1),
    };
    // No reader is left if standard error is closed.
    let _ = writeln!(std::io::stderr(), "ilc-sim: {}", printable_lines(&line));
    ExitCode::from(status)
}

fn carry_out(verb: Verb) -> Result<(), Failure> {
    match verb {
        Verb::Run { cell, bus, lockstep, mute, sync_lost_after, with_parent } => {
            run(&cell, bus, lockstep, &Habits { sync_lost_after, mutes: mute, with_parent })
        }
        Verb::Input { cell, name, state, bus } => {
            let mut cell = load(&cell)?;
            if let Some(bus) = bus {
                cell.bus.address = bus;
            }
            press::switch(&cell, &name, state == "on").map_err(Failure::Broken)
        }
        Verb::Eds { cell, node } => print_eds(&cell, node),
    }
}

fn bus_help() -> String {
    format!("Bus to be on instead of the cell's: {}", transport::syntaxes(false))
}

fn run(path: &Path, bus: Option<String>, lockstep: bool, habits: &Habits) -> Result<(), Failure> {
    let mut cell = load(path)?;
    let address = bus.unwrap_or_else(|| cell.bus.address.clone());
    if transport::scheme_of(&address).is_some_and(|scheme| scheme.in_process) {
        return Err(Failure::Input(format!(
            "{address} is for drives in the controller's own process (`ilc run`, tests): give --bus {}",
            transport::syntaxes(false)
        )));
    }
    let clock = if lockstep { ClockMode::LockStep } else { ClockMode::RealTime };
    address.clone_into(&mut cell.bus.address);
    let machine = machine(&cell, clock)?;
    for mute in &habits.mutes {
        require_node(&machine, mute.node, "--mute")?;
    }
    let bus = open_buses(&cell, GroupSide::Drives)
        .map_err(|(_, error)| Failure::Input(error.to_string()))?;
    run::run(&cell, machine, bus, &address, clock, habits).map_err(|error| match error {
        run::RunError::Taken { .. } => Failure::Input(error.to_string()),
        error => Failure::Broken(error.to_string()),
    })
}

/// Parses a span between a millisecond and a minute.
fn seconds(text: &str) -> Result<Duration, String> {
    let refused = || format!("{text}: allowed 0.001 to 60");
    let span = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let range = Duration::from_millis(1)..=Duration::from_secs(60);
    span.filter(|span| range.contains(span)).ok_or_else(refused)
}

fn print_eds(path: &Path, node: u8) -> Result<(), Failure> {
    let cell = load(path)?;
    let machine = machine(&cell, ClockMode::LockStep)?;
    let node = NodeId::new(node)
        .ok_or_else(|| Failure::Input(format!("--node {node}: allowed 1 to 127")))?;
    let dictionary = require_node(&machine, node, "--node")?;
    let is_drive = machine.drive_state(node).is_some();
    let text = eds::write(dictionary, if is_drive { "CiA 402 drive" } else { "encoder" });
    std::io::stdout().write_all(text.as_bytes()).map_err(|e| Failure::Broken(e.to_string()))
}

fn load(path: &Path) -> Result<Cell, Failure> {
    Cell::load(path).map_err(|error| Failure::Input(error.to_string()))
}

fn machine(cell: &Cell, clock: ClockMode) -> Result<Machine, Failure> {
    Machine::from_cell(cell, clock).map_err(|error| Failure::Input(error.to_string()))
}

fn require_node<'a>(
    machine: &'a Machine,
    node: NodeId,
    option: &str,
) -> Result<&'a ilc_sim::node::Dictionary, Failure> {
    machine.dictionary(node).ok_or_else(|| {
        let known: Vec<String> = machine.nodes().map(|known| known.to_string()).collect();
        Failure::Input(format!("{option} {node}: the cell has nodes {}", known.join(", ")))
    })
}
