//! `ilc-rt run`: a campaign on a bus.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use clap::{Args, ValueEnum};
use signal_hook::consts::{SIGHUP, SIGINT, SIGPIPE, SIGTERM};

use super::figures::FiguresFile;
use super::runs::Runs;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, EXIT_FAULT, show, when_parent_ends};
use crate::campaign::{self, CampaignError, Disturbance, Options, Outcome};
use crate::config::{Cell, LawName, Measure};
use crate::fieldbus::{Bus, transport};
use crate::record::{EndStatus, Event};

#[derive(Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
#[command(after_help = "Examples:
  ilc-rt run gantry.toml --iterations 10
  ilc-rt run gantry.toml --bus can:can0 --library /var/lib/ilc/gantry.db --resume
  ilc-rt run gantry.toml --bus udp:239.74.163.2 --measure encoder --json figures.json")]
pub(super) struct RunArguments {
    /// Cell description.
    cell: PathBuf,
    #[arg(long, value_name = "ADDRESS", help = bus_help())]
    bus: Option<String>,
    /// Runs in all; the first one is without learning.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,
    /// Measurement to learn from instead of the cell's.
    #[arg(long, value_enum)]
    measure: Option<MeasureName>,
    /// Pace the loop by the drives' answers instead of the clock: exact repetition, no wall clock.
    #[arg(long)]
    lockstep: bool,
    /// The drives are simulated on this computer: forgive stalls of up to a second, which stall both.
    #[arg(long)]
    simulated_drives: bool,
    /// Stop the axes and end when standard input closes, as it does when the program that started this
    /// one ends.
    #[arg(long)]
    with_parent: bool,
    /// Repeat the program without learning, whatever the cell says.
    #[arg(long)]
    no_learning: bool,
    /// Where every run is kept.
    #[arg(long, value_name = "FILE", default_value = "ilc-library.db")]
    library: PathBuf,
    /// Go on with the newest campaign of this cell, program, measurement and law.
    #[arg(long)]
    resume: bool,
    /// Write the figures of all runs to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Print one JSON object a line instead of a table.
    #[arg(long)]
    events: bool,
    /// Start also if the analysis says that learning will not converge.
    #[arg(long)]
    allow_divergent: bool,
    /// Do not publish on Zenoh.
    #[arg(long)]
    no_telemetry: bool,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum MeasureName {
    Encoder,
    Tcp,
}

impl From<MeasureName> for Measure {
    fn from(name: MeasureName) -> Self {
        match name {
            MeasureName::Encoder => Self::Encoder,
            MeasureName::Tcp => Self::Tcp,
        }
    }
}

/// Runs a campaign; returns the exit status.
pub(super) fn run(arguments: &RunArguments) -> u8 {
    let figures_file = match &arguments.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, arguments.events) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    match campaign(arguments) {
        Ok(outcome) => finish(figures_file.as_ref(), &outcome),
        Err(error) => {
            if let Some(file) = figures_file {
                file.give_up();
            }
            show::complain(&error);
            EXIT_BAD_INPUT
        }
    }
}

fn campaign(arguments: &RunArguments) -> Result<Outcome, CampaignError> {
    let (mut cell, bus) = open(&arguments.cell, arguments.bus.as_deref())?;
    cell.learning.allow_divergent |= arguments.allow_divergent;
    if arguments.no_learning {
        cell.learning.law = LawName::None;
    }
    let options = Options {
        iterations: arguments.iterations,
        measure: arguments.measure.map(Measure::from),
        lockstep: arguments.lockstep,
        simulated: arguments.simulated_drives,
        resume: arguments.resume,
        library: arguments.library.clone(),
        disturbance: Disturbance::default(),
        telemetry: !arguments.no_telemetry,
        stop: stop_on_signals(arguments.with_parent),
    };
    let mut runs = Runs::default();
    let mut observe = |event: &Event| {
        if arguments.events {
            say_event(event, &options.stop);
        } else if let Some(text) = show::sentence(event, &mut runs) {
            show::say(&text);
        }
    };
    campaign::run(&cell, &options, bus, None, &mut observe)
}

/// Prints an event as one line of JSON.
pub(super) fn say_event(event: &Event, stop: &AtomicI32) {
    if let Ok(text) = serde_json::to_string(event)
        && !show::say_json(&text)
    {
        // Whoever asked for the events is gone, and with it whoever would notice trouble.
        stop.store(SIGPIPE, Ordering::Relaxed);
    }
}

/// Reads a cell description and opens its bus, or the one of the command line.
pub(super) fn open(file: &Path, bus: Option<&str>) -> Result<(Cell, Box<dyn Bus>), CampaignError> {
    let mut cell = Cell::load(file)?;
    if let Some(address) = bus {
        address.clone_into(&mut cell.bus.address);
    }
    let place = match bus {
        Some(_) => "--bus".to_owned(),
        None => format!("{}: [bus] address", cell.file.display()),
    };
    let address = &cell.bus.address;
    if transport::scheme_of(address).is_some_and(|scheme| scheme.in_process) {
        return Err(CampaignError::NoDrivesInside { place, address: address.clone() });
    }
    let bus = transport::open(address).map_err(|source| CampaignError::Bus { place, source })?;
    Ok((cell, bus))
}

/// The help text of `--bus`.
pub(super) fn bus_help() -> String {
    format!("Bus instead of the cell's: {}", transport::syntaxes(false))
}

/// A number that becomes a signal's when it comes: the loop reads it and brings the axes to rest.
/// With a parent, its end is such a signal as well.
pub(super) fn stop_on_signals(with_parent: bool) -> Arc<AtomicI32> {
    let stop = Arc::new(AtomicI32::new(0));
    if with_parent {
        let stop = Arc::clone(&stop);
        let watched = when_parent_ends(move || stop.store(SIGPIPE, Ordering::Relaxed));
        if let Err(error) = watched {
            tracing::warn!(
                "the end of the program that started this one will go unnoticed: {error}"
            );
        }
    }
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if signal == SIGHUP && is_ignored(signal) {
            continue;
        }
        let stop = Arc::clone(&stop);
        #[expect(
            unsafe_code,
            reason = "a signal handler; signal-hook has no safe form for a value"
        )]
        // SAFETY: the handler stores to an atomic, which is async-signal-safe, and nothing else.
        let registered = unsafe {
            signal_hook::low_level::register(signal, move || stop.store(signal, Ordering::Relaxed))
        };
        if let Err(error) = registered {
            tracing::warn!(
                "signal {signal} will kill this program instead of stopping the axes: {error}"
            );
        }
    }
    stop
}

/// Whether a signal is ignored, as SIGHUP is by what `nohup` starts: then it stays so.
fn is_ignored(signal: i32) -> bool {
    #[expect(unsafe_code, reason = "neither the standard library nor signal-hook can ask")]
    // SAFETY: zeros are a valid sigaction; with no new action the call only writes the present one.
    unsafe {
        let mut present: libc::sigaction = std::mem::zeroed();
        libc::sigaction(signal, std::ptr::null(), &raw mut present) == 0
            && present.sa_sigaction == libc::SIG_IGN
    }
}

fn finish(figures_file: Option<&FiguresFile>, outcome: &Outcome) -> u8 {
    let mut written = true;
    if let Some(file) = figures_file {
        let iterations: Vec<_> = outcome
            .runs
            .iter()
            .map(|(index, figures)| {
                let mut entry = serde_json::to_value(figures).unwrap_or_default();
                entry["index"] = (*index).into();
                entry
            })
            .collect();
        let text = serde_json::json!({
            "campaign": outcome.campaign,
            "status": outcome.status,
            "reason": outcome.reason,
            "iterations": iterations,
        });
        written = file.write(&text);
    }
    exit_status(outcome, written)
}

/// The exit status of a campaign; complains if a fault ended it.
pub(super) fn exit_status(outcome: &Outcome, written: bool) -> u8 {
    match outcome.status {
        EndStatus::Completed if written => 0,
        EndStatus::Completed => EXIT_FAILURE,
        EndStatus::Interrupted => u8::try_from(128 + outcome.signal).unwrap_or(EXIT_FAULT),
        EndStatus::Fault => {
            show::complain(&format!("controlled stop: {}", outcome.reason));
            EXIT_FAULT
        }
    }
}
