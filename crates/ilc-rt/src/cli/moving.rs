//! Shared part of the verbs that move axes by hand: options, the cell and its axes, reports, exit status.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::Duration;

use clap::Args;
use serde_json::json;

use super::dead_man::DeadMan;
use super::figures::FiguresFile;
use super::run::{open, stop_on_signals};
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, EXIT_FAULT, show};
use crate::campaign::{self, Arrival, Session, Travel, Traveling};
use crate::config::Cell;
use crate::record::{EndStatus, TEXT_MAX, printable};
use crate::servo::PhaseName;

/// Options of a move by hand.
#[derive(Args, Clone)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct Moving {
    /// Bus address in place of the cell's.
    #[arg(long, value_name = "ADDRESS")]
    pub(super) bus: Option<String>,
    /// Pace the loop by the drives' answers, without a wall clock.
    #[arg(long)]
    lockstep: bool,
    /// The drives are simulated on this computer: forgive a stall of up to 1 s.
    #[arg(long = "simulated-drives")]
    simulated: bool,
    /// Refuse to move anything unless the loop's thread gets its priority, locked memory and processor.
    #[arg(long, conflicts_with = "lockstep")]
    require_rt: bool,
    /// Reset faults that the drives have, in place of a refusal that names them.
    #[arg(long)]
    reset_faults: bool,
    /// Write the end and the positions to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

impl Moving {
    /// Returns the options of everything that moves axes.
    pub(super) fn session(&self, stop: Arc<AtomicI32>) -> Session {
        Session {
            bus: self.bus.clone(),
            measure: None,
            lockstep: self.lockstep,
            simulated: self.simulated,
            require_rt: self.require_rt,
            reset_faults: self.reset_faults,
            home: false,
            library: PathBuf::new(),
            record: None,
            record_to: None,
            recordings: Arc::default(),
            telemetry: false,
            stop,
        }
    }
}

/// Request of a verb: the move, and its dead man's switch.
pub(super) struct Request {
    pub(super) travel: Travel,
    /// Longest time without input.
    pub(super) hold: Option<Duration>,
    /// Line that tells a person what to do before anything moves.
    pub(super) invitation: Option<String>,
    /// True if a release is the ordinary end.
    pub(super) ends_by_release: bool,
}

/// Makes a move of a cell; returns the exit status.
pub(super) fn carry_out(
    cell: &std::path::Path,
    moving: &Moving,
    request: impl FnOnce(&Cell) -> Result<Request, String>,
) -> u8 {
    let file = match &moving.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, false) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    match make(cell, moving, request) {
        Ok(Some((cell, arrival, ends_by_release))) => {
            let text = json!({
                "status": arrival.status, "reason": arrival.reason, "released": arrival.released,
                "fault": arrival.fault, "position_m": positions(&cell, &arrival.position_m),
            });
            let written = file.is_none_or(|file| file.write(&text));
            end(&arrival, ends_by_release, written)
        }
        Ok(None) => {
            file.iter().for_each(FiguresFile::give_up);
            show::say(&"released before anything moved");
            0
        }
        Err(line) => {
            file.iter().for_each(FiguresFile::give_up);
            show::complain(&line);
            EXIT_BAD_INPUT
        }
    }
}

type Made = Option<(Cell, Arrival, bool)>;

fn make(
    file: &std::path::Path,
    moving: &Moving,
    request: impl FnOnce(&Cell) -> Result<Request, String>,
) -> Result<Made, String> {
    let stop = stop_on_signals(false);
    let (cell, bus) = open(file, moving.bus.as_deref()).map_err(|error| error.to_string())?;
    let request = request(&cell)?;
    let man = DeadMan::new(request.hold)?;
    if let Some(invitation) = &request.invitation {
        show::say(invitation);
    }
    if !man.wait_for_first(|| stop.load(Ordering::Relaxed) != 0) {
        return Ok(None);
    }
    let session = moving.session(stop);
    let mut heard = true;
    let mut report = |now: Option<&Traveling>| {
        if let Some(now) = now {
            heard &= show::say(&described(&cell, now));
        }
        if heard { man.released() } else { Some("nobody reads the output any more".to_owned()) }
    };
    let arrival = campaign::travel(&cell, &request.travel, &session, bus, &mut report)
        .map_err(|error| error.to_string())?;
    Ok(Some((cell, arrival, request.ends_by_release)))
}

/// Returns the index of an axis.
///
/// # Errors
/// One line with the names that are allowed.
pub(super) fn axis(cell: &Cell, name: &str) -> Result<usize, String> {
    cell.axes.iter().position(|axis| axis.name == name).ok_or_else(|| {
        let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
        format!("axis {}: allowed: {}", printable(name, TEXT_MAX), names.join(", "))
    })
}

fn positions(cell: &Cell, position_m: &[f64]) -> serde_json::Value {
    let named = cell.axes.iter().zip(position_m);
    named
        .map(|(axis, at_m)| (axis.name.clone(), json!(at_m)))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

fn described(cell: &Cell, now: &Traveling) -> String {
    let what = match now.phase {
        PhaseName::Enabling => "switching on",
        PhaseName::Returning => "moving",
        PhaseName::Settling | PhaseName::Waiting | PhaseName::Running | PhaseName::Paused => {
            "holding"
        }
        PhaseName::Stopping => "coming to rest",
        PhaseName::Disabling => "switching off",
        PhaseName::Stopped => "off",
    };
    let named = cell.axes.iter().zip(&now.position_m);
    let at: Vec<String> = named
        .map(|(axis, at_m)| format!("{} {at_m:.6} {}", axis.name, axis.unit.symbol()))
        .collect();
    if at.is_empty() { what.to_owned() } else { format!("{what}: {}", at.join(", ")) }
}

fn end(arrival: &Arrival, ends_by_release: bool, written: bool) -> u8 {
    match arrival.status {
        EndStatus::Interrupted if arrival.signal != 0 => {
            show::complain(&arrival.reason);
            u8::try_from(128 + arrival.signal).unwrap_or(EXIT_FAULT)
        }
        EndStatus::Interrupted if ends_by_release => done(arrival, written),
        EndStatus::Completed => done(arrival, written),
        EndStatus::Fault | EndStatus::Interrupted => {
            show::complain(&format!("controlled stop: {}", arrival.reason));
            EXIT_FAULT
        }
    }
}

fn done(arrival: &Arrival, written: bool) -> u8 {
    show::say(&arrival.reason);
    if written { 0 } else { EXIT_FAILURE }
}
