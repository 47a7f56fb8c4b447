//! `ilc-rt home`: the drives search their home.

use std::path::PathBuf;

use clap::Args;

use super::dead_man::DeadMan;
use super::moving::{Moving, axis};
use super::run::{open, stop_on_signals};
use super::target::answered;
use super::{EXIT_BAD_INPUT, EXIT_FAULT, show};
use crate::campaign::{self, Homed, homing_axes};
use crate::config::Cell;
use crate::record::EndStatus;

#[derive(Args)]
#[command(
    after_help = "Each drive searches its home by [axis.homing], those with a lower order first, those with the same order together,
and is switched off. An axis that rests outside its limits there, as on a limit switch, is then brought inside along a
jerk-limited line. One that is homed already searches nothing without --again. The axes come to rest by quick stop on
Ctrl-C, when the pipe at standard input or the parent is gone, after homing.timeout_s, and all of them when one fails.
Exit status: 0 homed, 2 refused (nothing moved), 3 not homed, 130 after Ctrl-C.

Examples:
  ilc-rt home gantry.toml
  ilc-rt home gantry.toml --axis x --again --json -"
)]
pub(super) struct HomeArguments {
    /// Cell description.
    cell: PathBuf,
    /// Axis to home; may be repeated. All that have kind = "drive" if none is given.
    #[arg(long, value_name = "NAME")]
    axis: Vec<String>,
    /// Home those again that are homed already.
    #[arg(long)]
    again: bool,
    #[command(flatten)]
    moving: Moving,
}

/// Homes axes; returns the exit status.
pub(super) fn home(arguments: &HomeArguments) -> u8 {
    answered(arguments.moving.json.as_deref(), || {
        let homed = make(arguments).map_err(|line| (line, EXIT_BAD_INPUT))?;
        let status = end(&homed);
        Ok((homed, status))
    })
}

fn make(arguments: &HomeArguments) -> Result<Homed, String> {
    let moving = &arguments.moving;
    let stop = stop_on_signals(false);
    let (cell, bus) =
        open(&arguments.cell, moving.bus.as_deref()).map_err(|error| error.to_string())?;
    let axes = chosen(&cell, &arguments.axis)?;
    if axes.is_empty() {
        let reason = "no axis has [axis.homing] kind = \"drive\": none needs homing".to_owned();
        return Ok(Homed { status: EndStatus::Completed, reason, signal: 0, axes: Vec::new() });
    }
    let man = DeadMan::new(None)?;
    let session = moving.session(stop);
    let mut heard = true;
    let mut report = |line: Option<&str>| {
        if let Some(line) = line {
            heard &= show::say(&line);
        }
        if heard { man.released() } else { Some("nobody reads the output any more".to_owned()) }
    };
    campaign::home(&cell, &axes, arguments.again, &session, bus, &mut report)
        .map_err(|error| error.to_string())
}

/// Returns the axes named, or all that a drive homes.
fn chosen(cell: &Cell, names: &[String]) -> Result<Vec<usize>, String> {
    let all = homing_axes(cell);
    if names.is_empty() {
        return Ok(all);
    }
    let mut found = Vec::new();
    for name in names {
        let index = axis(cell, name)?;
        if !all.contains(&index) {
            return Err(format!(
                "--axis {name}: its drive searches no home; allowed: an axis with [axis.homing] kind = \"drive\""
            ));
        }
        if !found.contains(&index) {
            found.push(index);
        }
    }
    Ok(found)
}

fn end(homed: &Homed) -> u8 {
    for axis in &homed.axes {
        if let Some(position_m) = axis.position_m {
            let how = if axis.was_homed { "was homed before" } else { "homed" };
            show::say(&format!("axis {}: {how}, at {position_m:.6} {}", axis.axis, axis.unit));
        }
    }
    match homed.status {
        EndStatus::Completed => {
            show::say(&homed.reason);
            0
        }
        EndStatus::Interrupted if homed.signal != 0 => {
            show::complain(&homed.reason);
            u8::try_from(128 + homed.signal).unwrap_or(EXIT_FAULT)
        }
        EndStatus::Interrupted | EndStatus::Fault => {
            show::complain(&format!("controlled stop: {}", homed.reason));
            EXIT_FAULT
        }
    }
}
