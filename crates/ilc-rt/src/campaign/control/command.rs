//! Commands, their execution, and their replies: one line of JSON each.

use serde::{Deserialize, Serialize};

use super::STOPPED_BY_COMMAND;
use super::shared::{Shared, Status};
use crate::servo::FEED_WHOLE;

/// A command of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::Subcommand)]
#[serde(tag = "command", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Let the waiting run start.
    Start,
    /// Hold the path where it is, and every start.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Bring the axes to rest and end.
    Stop,
    /// Print the state.
    Status,
    /// Set the feed override.
    Feed {
        /// 1 to 100 percent.
        percent: u32,
    },
}

/// Reply to a command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// Reason that the command was refused; absent if it was accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// State after the command.
    pub status: Status,
}

/// Executes one line of a client.
pub(super) fn execute(shared: &Shared, line: &[u8]) -> Reply {
    let refused = match serde_json::from_slice::<Command>(line) {
        Ok(command) => order(shared, command).err(),
        Err(error) => Some(format!("not a command: {error}")),
    };
    Reply { refused, status: shared.status() }
}

fn order(shared: &Shared, command: Command) -> Result<(), String> {
    let orders = &shared.orders;
    let status = shared.status();
    match command {
        Command::Start
            if status.state == "waiting" && !status.paused && shared.starts_by_command =>
        {
            orders.release(shared.waiting_run());
        }
        Command::Start if status.state == "waiting" && !shared.starts_by_command => {
            return Err("start: the cell waits for its start button (--start input)".to_owned());
        }
        Command::Start => {
            let paused = if status.paused { ", paused: resume it first" } else { "" };
            return Err(format!(
                "start: the cell is {}{paused}; allowed while it is waiting",
                status.state
            ));
        }
        Command::Pause => orders.pause(true),
        Command::Resume => orders.pause(false),
        Command::Stop => shared.stop(STOPPED_BY_COMMAND),
        Command::Status => {}
        Command::Feed { percent } if (1..=FEED_WHOLE).contains(&percent) => {
            orders.set_feed(percent);
        }
        Command::Feed { percent } => {
            return Err(format!("feed {percent}: allowed 1 to {FEED_WHOLE} percent"));
        }
    }
    Ok(())
}
