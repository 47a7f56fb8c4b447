//! `ilc-rt enable`: the drives of a cell switched on, watched and held, until released.

use std::path::PathBuf;

use clap::Args;

use super::moving::{Moving, Request, carry_out};
use crate::campaign::Travel;

#[derive(Args)]
#[command(
    after_help = "The drives hold their positions under the watch of the servo loop, until Ctrl-C, or until the pipe at
standard input or the parent is gone; then they are switched off. No drive stays on without a controller.
Exit status: 0 after --seconds or the end of input, 2 refused (nothing moved), 3 controlled stop, 130 after Ctrl-C.

Examples:
  ilc-rt enable gantry.toml --seconds 2
  ilc-rt enable gantry.toml --reset-faults --seconds 2"
)]
pub(super) struct EnableArguments {
    /// Cell description.
    cell: PathBuf,
    /// Switch off after this time; held until released if not given.
    #[arg(long, value_name = "SECONDS", value_parser = span)]
    seconds: Option<f64>,
    #[command(flatten)]
    moving: Moving,
}

/// Switches drives on and holds; returns the exit status.
pub(super) fn enable(arguments: &EnableArguments) -> u8 {
    carry_out(&arguments.cell, &arguments.moving, |_| {
        Ok(Request {
            travel: Travel { goals: Vec::new(), speed_m_s: None, hold_s: arguments.seconds },
            hold: None,
            invitation: None,
            ends_by_release: true,
        })
    })
}

fn span(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.0..=86_400.0).contains(seconds))
        .ok_or_else(|| "allowed 0 to 86400 s".to_owned())
}
