//! `ilc-rt run`: a campaign on a bus.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use clap::Args;
use signal_hook::consts::{SIGHUP, SIGINT, SIGPIPE, SIGTERM};

use super::figures::FiguresFile;
use super::runs::Runs;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, EXIT_FAULT, show, when_parent_ends};
use crate::campaign::control::STOPPED_BY_COMMAND;
use crate::campaign::{self, CampaignError, Options, Outcome};
use crate::config::Cell;
use crate::fieldbus::Bus;
use crate::fieldbus::transport::{self, GroupSide};
use crate::record::{EndStatus, Event};

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt run gantry.toml --iterations 10
  ilc-rt run gantry.toml --bus can:can0 --library /var/lib/ilc/gantry.db --resume
  ilc-rt run gantry.toml --bus udp:239.74.163.2 --measure encoder --json figures.json
  ilc-rt run gantry.toml --frozen --from best --relearn-above 2")]
pub(super) struct RunArguments {
    /// Cell description.
    cell: PathBuf,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    output: Output,
}

/// Options of this program alone: its output, and its end.
#[derive(Args)]
pub(super) struct Output {
    /// Write the figures to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Print one JSON object a line, for a program that evaluates them.
    #[arg(long)]
    pub(super) events: bool,
    /// Stop the axes and end when standard input closes, as it does when the program that started this one
    /// ends.
    #[arg(long)]
    pub(super) with_parent: bool,
}

/// Runs a campaign; returns the exit status.
pub(super) fn run(arguments: &RunArguments) -> u8 {
    let figures_file = match &arguments.output.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, arguments.output.events) {
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
    let mut options = arguments.options.clone();
    options.session.stop = stop_on_signals(arguments.output.with_parent);
    let (cell, bus) = open(&arguments.cell, options.session.bus.as_deref())?;
    let mut runs = Runs::default();
    let mut observe = |event: &Event| {
        if arguments.output.events {
            say_event(event, &options.session.stop);
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
        // The reader of the events is gone, so trouble would go unnoticed.
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
    let opened = campaign::open_buses(&cell, GroupSide::Controller).map_err(|(key, source)| {
        let place = if bus.is_some() && cell.extra_buses.is_empty() { place } else { key };
        CampaignError::Bus { place, source }
    });
    let bus = opened?;
    Ok((cell, bus))
}

/// Returns a number that signal handlers set: the loop reads it and brings the axes to rest. The
/// end of a parent counts as a signal.
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

/// Returns true if a signal is ignored, e.g. SIGHUP under `nohup`: it then stays ignored.
fn is_ignored(signal: i32) -> bool {
    #[expect(unsafe_code, reason = "neither the standard library nor signal-hook can ask")]
    // SAFETY: zeros are a valid sigaction; with no new action the call only writes the current one.
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
            "axis_units": outcome.axis_units,
            "iterations": iterations,
        });
        written = file.write(&text);
    }
    exit_status(outcome, written)
}

/// Returns the exit status of a campaign; prints an error if a fault ended it.
pub(super) fn exit_status(outcome: &Outcome, written: bool) -> u8 {
    match outcome.status {
        EndStatus::Completed if written => 0,
        EndStatus::Completed => EXIT_FAILURE,
        // The regular end of runs without a number.
        EndStatus::Interrupted if outcome.signal == STOPPED_BY_COMMAND => 0,
        EndStatus::Interrupted => u8::try_from(128 + outcome.signal).unwrap_or(EXIT_FAULT),
        EndStatus::Fault => {
            show::complain(&format!("controlled stop: {}", outcome.reason));
            EXIT_FAULT
        }
    }
}
