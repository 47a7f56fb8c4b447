//! `ilc-rt jog`: one axis by a distance, or for as long as a key is held.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::moving::{Moving, Request, axis, carry_out};
use crate::campaign::{Goal, Travel};

#[derive(Args)]
#[command(
    after_help = "With --speed the axis moves while input arrives: hold the Enter key, or write to the pipe at standard
input. It comes to rest when that ends for --hold, at its limit, and when terminal, pipe or parent is gone.
All other axes of the cell hold. Speeds go up to [safety] approach_velocity_m_s.
Exit status: 0 arrived or released, 2 refused (nothing moved), 3 controlled stop, 130 after Ctrl-C.

Examples:
  ilc-rt jog gantry.toml x 0.005
  ilc-rt jog gantry.toml x -0.005 --at-speed 0.01
  yes | ilc-rt jog gantry.toml x --speed=-0.02"
)]
pub(super) struct JogArguments {
    /// Cell description.
    cell: PathBuf,
    /// Axis to move.
    axis: String,
    /// Distance in the unit of the axis.
    #[arg(allow_hyphen_values = true, required_unless_present = "speed", conflicts_with = "speed")]
    distance: Option<f64>,
    /// Velocity of the move by a distance.
    #[arg(long, value_name = "SPEED", conflicts_with = "speed")]
    at_speed: Option<f64>,
    /// Move at this velocity, with its sign, while input arrives.
    #[arg(long, value_name = "SPEED", allow_hyphen_values = true)]
    speed: Option<f64>,
    /// Time without input after which the axis comes to rest.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.8, value_parser = hold)]
    hold: f64,
    #[command(flatten)]
    moving: Moving,
}

/// Moves an axis by hand; returns the exit status.
pub(super) fn jog(arguments: &JogArguments) -> u8 {
    carry_out(&arguments.cell, &arguments.moving, |cell| {
        let index = axis(cell, &arguments.axis)?;
        let unit = cell.axes[index].unit.symbol();
        let finite = |what: &str, value: f64| {
            let refused = || format!("{what} {value}: allowed: a number other than 0, in {unit}");
            (value.is_finite() && value != 0.0).then_some(value).ok_or_else(refused)
        };
        let (goal, speed_m_s) = match (arguments.distance, arguments.speed) {
            (Some(distance_m), _) => {
                (Goal::By(finite("distance", distance_m)?), arguments.at_speed)
            }
            (None, speed) => {
                let speed = finite("--speed", speed.unwrap_or(0.0))?;
                (Goal::Limit(speed), Some(speed.abs()))
            }
        };
        let by_key = arguments.speed.is_some();
        Ok(Request {
            travel: Travel { goals: vec![(index, goal)], speed_m_s, hold_s: Some(0.0) },
            hold: by_key.then(|| Duration::from_secs_f64(arguments.hold)),
            invitation: by_key.then(|| {
                format!(
                    "hold Enter to move axis {} at {} {unit}/s; it comes to rest {} s after the last input",
                    arguments.axis,
                    arguments.speed.unwrap_or(0.0),
                    arguments.hold
                )
            }),
            ends_by_release: by_key,
        })
    })
}

fn hold(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.05..=5.0).contains(seconds))
        .ok_or_else(|| "allowed 0.05 to 5 s".to_owned())
}
