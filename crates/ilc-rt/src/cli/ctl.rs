//! `ilc-rt ctl`: commands to a cell that runs.

use std::path::PathBuf;

use clap::Args;

use super::figures::FiguresFile;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::campaign::control::{Command, Reply, Status, send};
use crate::config::Cell;

#[derive(Args)]
#[command(
    after_help = "Exit status: 0 done, 1 refused by the controller, 2 no controller can be commanded."
)]
pub(super) struct CtlArguments {
    /// Cell description.
    cell: PathBuf,
    #[command(subcommand)]
    verb: Command,
    /// Write the state after the command to a file; - for standard output.
    #[arg(long, value_name = "FILE", global = true)]
    json: Option<PathBuf>,
}

/// Sends a command; returns the exit status.
pub(super) fn ctl(arguments: &CtlArguments) -> u8 {
    let file = match &arguments.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, false) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    let replied = Cell::load(&arguments.cell)
        .map_err(|error| error.to_string())
        .and_then(|cell| send(&cell.cell.name, arguments.verb).map_err(|error| error.to_string()));
    let Reply { refused, status } = match replied {
        Ok(reply) => reply,
        Err(line) => {
            if let Some(file) = file {
                file.give_up();
            }
            show::complain(&line);
            return EXIT_BAD_INPUT;
        }
    };
    let written = match &file {
        Some(file) => file.write(&serde_json::to_value(&status).unwrap_or_default()),
        None => true,
    };
    if let Some(reason) = refused {
        show::complain(&reason);
        return EXIT_FAILURE;
    }
    if file.is_none() {
        show::say(&sentence(&status));
    }
    if written { 0 } else { EXIT_FAILURE }
}

fn sentence(status: &Status) -> String {
    let of = status.iterations.map_or_else(String::new, |n| format!(" of {n}"));
    let paused = if status.paused { ", paused" } else { "" };
    let inputs: Vec<String> = status
        .inputs
        .iter()
        .map(|input| format!("; {} {} {}", input.purpose, input.name, input.in_words()))
        .collect();
    let inputs = inputs.concat();
    format!(
        "cell {}: {}, run {}{of}, feed {} %{paused}; law {}, campaign {}{inputs}",
        status.cell,
        status.state,
        status.iteration,
        status.feed_percent,
        status.law,
        status.campaign
    )
}
