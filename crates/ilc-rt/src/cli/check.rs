//! `ilc-rt check`: what a cell description would do, without touching a bus.

use std::path::PathBuf;

use clap::Args;

use super::{EXIT_BAD_INPUT, show};
use crate::config::Cell;
use crate::supervisor::{Plan, SupervisorError};

#[derive(Args)]
#[command(after_help = "Example:
  ilc-rt check gantry.toml")]
pub(super) struct CheckArguments {
    /// Cell description.
    cell: PathBuf,
}

/// Checks a cell description; returns the exit status.
pub(super) fn check(arguments: &CheckArguments) -> u8 {
    match describe(arguments) {
        Ok(()) => 0,
        Err(error) => {
            show::complain(&error);
            EXIT_BAD_INPUT
        }
    }
}

fn describe(arguments: &CheckArguments) -> Result<(), SupervisorError> {
    let cell = Cell::load(&arguments.cell)?;
    let plan = Plan::new(&cell, None, false)?;
    let law = plan.law(&cell)?;
    show::say(&format!(
        "cell {}: {} axes on {}, {} us cycle; a classical CAN bus at {} bit/s would be {:.0} % loaded",
        cell.cell.name,
        cell.n_axes(),
        cell.bus.address,
        cell.cell.cycle_us,
        cell.bus.bitrate_bit_s,
        plan.bus_load * 100.0
    ));
    for (i, axis) in cell.axes.iter().enumerate() {
        let column = || plan.reference_m.iter().skip(i).step_by(cell.n_axes());
        let low = column().copied().fold(f64::INFINITY, f64::min);
        let high = column().copied().fold(f64::NEG_INFINITY, f64::max);
        show::say(&format!(
            "  axis {} (node {}): {:.3} to {:.3} m of {:.3} to {:.3} m",
            axis.name, axis.node, low, high, axis.limits.position_min_m, axis.limits.position_max_m
        ));
    }
    show::say(&format!(
        "  a run: {} samples, {:.3} s; then {:.3} s rest in which {}",
        plan.n_samples(),
        plan.n_samples() as f64 * cell.cycle_s(),
        cell.program.settle_s,
        law.map_or_else(
            || "nothing is learned".to_owned(),
            |law| format!("is learned: {}", law.describe())
        )
    ));
    Ok(())
}
