//! Summary of a recording.

use std::path::Path;

use serde::Serialize;

use crate::recording::{Item, Reader, RecordingError};

/// Content of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the cell.
    pub cell: String,
    /// Campaign in the library.
    pub campaign: String,
    /// Version of the program that recorded.
    pub program_version: String,
    /// Names of the axes.
    pub axes: Vec<String>,
    /// True in lock-step.
    pub lockstep: bool,
    /// Cycles.
    pub cycles: u64,
    /// Cycles that began after missed ones.
    pub after_missed: u64,
    /// Time from the first cycle to the last.
    pub duration_s: f64,
    /// Runs that ended.
    pub runs: u64,
    /// Input tables.
    pub tables: u64,
    /// Frames received.
    pub received: u64,
    /// Frames sent.
    pub sent: u64,
    /// Events.
    pub events: u64,
    /// Late cycles.
    pub late: u64,
    /// Reason of a stop.
    pub stopped: Option<String>,
    /// Records lost.
    pub lost: u64,
    /// True if the end of the file is cut off.
    pub cut: bool,
}

/// Reads a recording through.
///
/// # Errors
/// [`RecordingError`] if it is not a recording.
pub fn summarize(path: &Path) -> Result<Summary, RecordingError> {
    let mut reader = Reader::open(path)?;
    let mut summary = Summary::default();
    let mut span = None;
    while let Some(item) = reader.next_item()? {
        match item {
            Item::Loop(parts) => {
                let (setup, cell) = *parts;
                summary.cell = cell.cell.name;
                summary.campaign = setup.campaign;
                summary.program_version = setup.program_version;
                summary.axes = setup.axes;
                summary.lockstep = setup.lockstep;
            }
            Item::Table(_) => summary.tables += 1,
            Item::Frames(_, frames) => {
                summary.received += frames.received.len() as u64;
                summary.sent += frames.sent.len() as u64;
            }
            Item::Cycle(at, cycle) => {
                summary.cycles += 1;
                summary.after_missed += u64::from(cycle.missed > 0);
                summary.lost = cycle.lost;
                let (first, _) = span.unwrap_or((at, at));
                span = Some((first, at));
                if !cycle.stopping.is_empty() {
                    summary.stopped = Some(cycle.stopping);
                }
            }
            Item::Axis(..) => {}
            Item::Timing(timing) => summary.late += u64::from(timing.late),
            Item::Event(event) => {
                summary.events += 1;
                summary.runs += u64::from(event["event"] == "iteration");
            }
        }
    }
    summary.duration_s = span.map_or(0.0, |(first, last)| last.saturating_sub(first) as f64 * 1e-9);
    summary.lost = reader.n_lost().unwrap_or(summary.lost);
    summary.cut = reader.was_cut();
    Ok(summary)
}
