//! `ilc-rt goto`: axes to positions, on a straight line.

use std::path::PathBuf;

use clap::Args;

use super::moving::{Moving, Request, axis, carry_out};
use crate::campaign::{Goal, Travel};
use crate::record::{TEXT_MAX, printable};

#[derive(Args)]
#[command(
    after_help = "All axes named arrive together; the others hold. Positions are within the limits, speeds up to
[safety] approach_velocity_m_s. The axes come to rest when the pipe at standard input or the parent is gone.
Exit status: 0 arrived, 2 refused (nothing moved), 3 controlled stop, 130 after Ctrl-C.

Examples:
  ilc-rt goto gantry.toml x=0.05
  ilc-rt goto gantry.toml x=0.05 y=0.03 --speed 0.02 --json -"
)]
pub(super) struct GotoArguments {
    /// Cell description.
    cell: PathBuf,
    /// Axis and its position.
    #[arg(value_name = "AXIS=POSITION", required = true)]
    goals: Vec<String>,
    /// Velocity along the line.
    #[arg(long, value_name = "SPEED")]
    speed: Option<f64>,
    #[command(flatten)]
    moving: Moving,
}

/// Moves axes to positions; returns the exit status.
pub(super) fn goto(arguments: &GotoArguments) -> u8 {
    carry_out(&arguments.cell, &arguments.moving, |cell| {
        let mut goals: Vec<(usize, Goal)> = Vec::new();
        for text in &arguments.goals {
            let refused = || {
                let text = printable(text, TEXT_MAX);
                format!("{text}: allowed AXIS=POSITION, as {}=0.01", cell.axes[0].name)
            };
            // A name may have an equals sign.
            let (name, value) = text.rsplit_once('=').ok_or_else(refused)?;
            let position_m: f64 = value.parse().map_err(|_| refused())?;
            let index = axis(cell, name)?;
            if !position_m.is_finite() {
                return Err(refused());
            }
            if goals.iter().any(|(other, _)| *other == index) {
                return Err(format!("axis {name} has two positions: allowed one"));
            }
            goals.push((index, Goal::At(position_m)));
        }
        Ok(Request {
            travel: Travel { goals, speed_m_s: arguments.speed, hold_s: Some(0.0) },
            hold: None,
            invitation: None,
            ends_by_release: false,
        })
    })
}
