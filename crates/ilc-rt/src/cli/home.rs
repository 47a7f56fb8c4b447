//! `ilc-rt home`: the drives search their home.

use std::path::PathBuf;

use clap::Args;

use super::dead_man::DeadMan;
use super::moving::{Moving, axis};
use super::run::{open, stop_on_signals};
use super::target::answered;
use super::{EXIT_BAD_INPUT, EXIT_FAULT, show};
use crate::campaign::{self, Homed};
use crate::config::{Cell, HomingKind};
use crate::record::EndStatus;

#[derive(Args)]
#[command(
    after_help = "Each drive searches its home by [axis.homing], those with a lower order first, those with the same order together,
and is switched off. The axes come to rest by quick stop when the pipe at standard input or the parent is gone, after
homing.timeout_s, and all of them when one fails.
Exit status: 0 homed, 2 refused (nothing moved), 3 not homed, 130 after Ctrl-C.

Examples:
  ilc-rt home gantry.toml
  ilc-rt home gantry.toml x --json -"
)]
pub(super) struct HomeArguments {
    /// Cell description.
    cell: PathBuf,
    /// Axes to home; all that have kind = \"drive\" if none is given.
    axis: Vec<String>,
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
        let reason = "no axis has [axis.homing] kind = \"drive\"; none needs homing".to_owned();
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
    campaign::home(&cell, &axes, &session, bus, &mut report).map_err(|error| error.to_string())
}

/// Returns the axes named, or all that a drive homes.
fn chosen(cell: &Cell, names: &[String]) -> Result<Vec<usize>, String> {
    let is_homed = |index: usize| cell.axes[index].homing.kind == HomingKind::Drive;
    if names.is_empty() {
        return Ok((0..cell.n_axes()).filter(|index| is_homed(*index)).collect());
    }
    let mut found = Vec::new();
    for name in names {
        let index = axis(cell, name)?;
        if !is_homed(index) {
            return Err(format!(
                "axis {name}: its drive searches no home: allowed with [axis.homing] kind = \"drive\""
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
            show::say(&format!("axis {}: homed, at {position_m:.6}", axis.axis));
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
