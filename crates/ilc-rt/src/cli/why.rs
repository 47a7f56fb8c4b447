//! `ilc-rt why`: who was late, from the record of the flight recorder beside a library.

use std::path::{Path, PathBuf};

use clap::Args;

use super::late::{counts, node_in_words, sentence, stage_row, stages_table};
use super::target::answered;
use super::{EXIT_BAD_INPUT, show};
use crate::campaign::late_of;
use crate::config::{Cell, read_file};
use crate::record::{FLIGHT_SUFFIX, FlightRecord, LateCase, TEXT_MAX, printable};
use crate::recording::SUFFIX;

/// Longest record that is read.
const BYTES_MAX: u64 = 1 << 24;

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt why gantry.toml
  ilc-rt why /var/lib/ilc/gantry.db --json late.json
  ilc-rt why gantry.mcap")]
pub(super) struct WhyArguments {
    /// Cell description, library, a record beside one (NAME.CELL.late.json), or a recording (NAME.mcap).
    #[arg(value_name = "FILE|CELL")]
    target: PathBuf,
    /// Library that the runs of the cell are stored in.
    #[arg(long, value_name = "FILE", default_value = "ilc-library.db")]
    library: PathBuf,
    /// Write the record to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Prints the worst cycles; returns the exit status.
pub(super) fn why(arguments: &WhyArguments) -> u8 {
    answered(arguments.json.as_deref(), || {
        let is_recording = arguments.target.to_string_lossy().ends_with(SUFFIX);
        let record = if is_recording {
            late_of(&arguments.target).map_err(|error| error.to_string())
        } else {
            find(arguments).and_then(|path| read(&path))
        };
        let record = record.map_err(|refusal| (refusal, EXIT_BAD_INPUT))?;
        for line in lines(&record) {
            show::say(&line);
        }
        Ok((record, 0))
    })
}

/// Returns the record that is meant.
fn find(arguments: &WhyArguments) -> Result<PathBuf, String> {
    let target = &arguments.target;
    let is = |suffix: &str| target.to_string_lossy().ends_with(suffix);
    if is(".json") {
        return Ok(target.clone());
    }
    if is(".toml") {
        let cell = Cell::load(target).map_err(|error| error.to_string())?;
        let path = FlightRecord::path(&arguments.library, &cell.cell.name);
        if path.exists() {
            return Ok(path);
        }
        return Err(missing(&path));
    }
    let mut beside = beside(target);
    match beside.len() {
        0 => Err(missing(&FlightRecord::path(target, "CELL"))),
        1 => Ok(beside.remove(0)),
        _ => {
            let names: Vec<_> = beside.iter().map(|path| path.display().to_string()).collect();
            Err(format!(
                "{}: the library has the records of several cells; allowed: one of {}",
                target.display(),
                names.join(", ")
            ))
        }
    }
}

fn missing(path: &Path) -> String {
    format!(
        "{}: there is no flight record; a run in real time writes one beside its library",
        path.display()
    )
}

/// Returns the records beside a library, by name.
fn beside(library: &Path) -> Vec<PathBuf> {
    let folder = match library.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let stem = library.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let is_record = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let cell = name
            .strip_prefix(&format!("{stem}."))
            .and_then(|rest| rest.strip_suffix(FLIGHT_SUFFIX));
        cell.is_some_and(|cell| !cell.contains('.'))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries.map(|entry| entry.path()).filter(is_record).collect();
    found.sort();
    found
}

fn read(path: &Path) -> Result<FlightRecord, String> {
    let refused = |reason: String| format!("{}: {}", path.display(), printable(&reason, TEXT_MAX));
    let bytes = read_file(path, BYTES_MAX).map_err(&refused)?;
    serde_json::from_slice(&bytes).map_err(|error| refused(format!("not a flight record: {error}")))
}

/// Returns the record as text.
fn lines(record: &FlightRecord) -> Vec<String> {
    let mut lines = vec![
        format!(
            "cell {}, campaign {}: {} us cycle, late after {:.0} % of it",
            record.cell,
            record.campaign,
            record.cycle_us,
            100.0 * record.late_share
        ),
        stages_table(record.stages_us.named()),
    ];
    for times in &record.answers {
        let name = format!("answer, {}", node_in_words(times.node, times.axis.as_deref()));
        lines.push(stage_row(&name, [times.p50_us, times.p99_us, times.max_us]));
    }
    lines.push(counts(&record.late, record.stages_us.wake.count));
    if !record.worst.is_empty() {
        lines.push(format!(
            "{:>9}{:>6}{:>9}{:>9}{:>9}{:>9}  who was late",
            "tick", "run", "wake", "receive", "control", "send"
        ));
    }
    lines.extend(record.worst.iter().map(row));
    if let Some(fault) = &record.fault {
        lines.push(format!("controlled stop: {}", fault.reason));
        lines.push(match &fault.late {
            Some(cycle) => format!("before it, in tick {}: {}", cycle.tick, sentence(cycle)),
            None => "nothing was late before it".to_owned(),
        });
    }
    lines
}

fn row(case: &LateCase) -> String {
    let stages = case.cycle.stages.named().map(|(_, span_us)| format!("{span_us:>9.0}")).concat();
    format!("{:>9}{:>6}{stages}  {}", case.cycle.tick, case.iteration, sentence(&case.cycle))
}
