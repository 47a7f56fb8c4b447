//! `ilc-rt record`: what a recording holds, and its frames for other tools.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::target::answered;
use super::{EXIT_BAD_INPUT, show};
use crate::campaign::summary::{Summary, summarize};
use crate::campaign::traffic::{self, TrafficFormat};

#[derive(Args)]
pub(super) struct RecordArguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Tell what a recording holds, also one that was cut off.
    Info(InfoArguments),
    /// Write the frames that the loop received and sent in a format of CAN tools.
    Export(ExportArguments),
}

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt record info gantry.mcap
  ilc-rt record info gantry.mcap --json -")]
struct InfoArguments {
    /// Recording.
    recording: PathBuf,
    /// Write the figures to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt record export gantry.mcap --format candump -o gantry.log
  ilc-rt record export gantry.mcap --format asc -o gantry.asc")]
struct ExportArguments {
    /// Recording.
    recording: PathBuf,
    /// Format: a table, the log of candump, or that of Vector tools.
    #[arg(long, value_enum, default_value_t = Format::Candump)]
    format: Format,
    /// File to write.
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Csv,
    Candump,
    Asc,
}

/// Runs a verb on recordings; returns the exit status.
pub(super) fn record(arguments: &RecordArguments) -> u8 {
    match &arguments.verb {
        Verb::Info(arguments) => info(arguments),
        Verb::Export(arguments) => export(arguments),
    }
}

fn info(arguments: &InfoArguments) -> u8 {
    answered(arguments.json.as_deref(), || {
        let summary =
            summarize(&arguments.recording).map_err(|error| (error.to_string(), EXIT_BAD_INPUT))?;
        for line in lines(&summary) {
            show::say(&line);
        }
        Ok((summary, 0))
    })
}

fn lines(summary: &Summary) -> Vec<String> {
    let mode = if summary.lockstep { "lock-step" } else { "real time" };
    let mut lines = vec![
        format!(
            "cell {}, campaign {}, axes {}, {mode}, recorded by ilc-rt {}",
            summary.cell,
            summary.campaign,
            summary.axes.join(", "),
            summary.program_version
        ),
        format!(
            "{} cycles in {:.3} s, {} of them after missed ones; {} runs ended, {} input tables",
            summary.cycles, summary.duration_s, summary.after_missed, summary.runs, summary.tables
        ),
        format!(
            "{} frames received, {} sent; {} events, {} late cycles",
            summary.received, summary.sent, summary.events, summary.late
        ),
    ];
    if let Some(reason) = &summary.stopped {
        lines.push(format!("the axes were stopped: {reason}"));
    }
    if summary.lost > 0 {
        lines.push(format!("{} records are lost", summary.lost));
    }
    if summary.cut {
        lines.push("the end of the file is cut off: what is before it is whole".to_owned());
    }
    lines
}

fn export(arguments: &ExportArguments) -> u8 {
    let format = match arguments.format {
        Format::Csv => TrafficFormat::Csv,
        Format::Candump => TrafficFormat::Candump,
        Format::Asc => TrafficFormat::Asc,
    };
    match traffic::export(&arguments.recording, format, &arguments.output) {
        Ok(n_frames) => {
            show::say(&format!("{}: {n_frames} frames", arguments.output.display()));
            0
        }
        Err(error) => {
            show::complain(&error);
            EXIT_BAD_INPUT
        }
    }
}
