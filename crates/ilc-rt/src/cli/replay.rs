//! `ilc-rt replay`: the loop of a recording again, and the first value that differs.

use std::path::PathBuf;

use clap::Args;

use super::target::answered;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::campaign::replay::{Replayed, replay as play};

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt replay gantry.mcap
  ilc-rt replay gantry.mcap --json -

Exit status: 0 the loop made the same values, 1 a value differs, 2 the recording cannot be replayed.")]
pub(super) struct ReplayArguments {
    /// Recording.
    recording: PathBuf,
    /// Write the result to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Replays a recording; returns the exit status.
pub(super) fn replay(arguments: &ReplayArguments) -> u8 {
    answered(arguments.json.as_deref(), || {
        let replayed =
            play(&arguments.recording).map_err(|error| (error.to_string(), EXIT_BAD_INPUT))?;
        for line in lines(&replayed) {
            show::say(&line);
        }
        let status = if replayed.difference.is_none() { 0 } else { EXIT_FAILURE };
        Ok((replayed, status))
    })
}

fn lines(replayed: &Replayed) -> Vec<String> {
    let mut lines = Vec::new();
    match &replayed.difference {
        None => lines.push(format!(
            "the same: {} cycles, {} frames sent, {} runs",
            replayed.cycles, replayed.frames, replayed.runs
        )),
        Some(difference) => lines.push(format!(
            "differs in cycle {}, {} {}: {} was {} and is {} in the replay",
            difference.cycle,
            if difference.axes.len() == 1 { "axis" } else { "axes" },
            difference.axes.join(", "),
            difference.field,
            difference.recorded,
            difference.replayed
        )),
    }
    lines.push(match &replayed.law_is_not_run {
        None => format!("the law made the same {} inputs again", replayed.learned),
        Some(why) => format!("the law was not run again: {why}"),
    });
    if replayed.difference.is_some() {
        lines.truncate(1);
    }
    if let Some(cycle) = replayed.lost_at {
        lines.push(format!("records are lost from cycle {cycle} on: the rest is not compared"));
    }
    if replayed.cut {
        lines.push("the end of the file is cut off: compared up to there".to_owned());
    }
    lines
}
