//! The late cycles of a recording, judged again as the flight recorder's were.

use std::collections::VecDeque;
use std::path::Path;

use super::late::{LateLog, Recorded};
use crate::config::Cell;
use crate::record::FlightRecord;
use crate::recording::{Item, Reader, RecordingError, stamps_of};
use crate::rt::flight::CYCLES_KEPT;
use crate::servo::Timing;

/// Returns the flight record of a recording, of all its cycles.
///
/// # Errors
/// [`RecordingError`] if it is no recording, or one in lock-step, which has no times.
pub fn late_of(path: &Path) -> Result<FlightRecord, RecordingError> {
    let mut reader = Reader::open(path)?;
    let mut of: Option<(Cell, String, LateLog)> = None;
    let mut cycles = VecDeque::with_capacity(CYCLES_KEPT);
    let mut timing = Timing::default();
    let (mut run, mut reason, mut has_stopped) = (0, None, false);
    while let Some(item) = reader.next_item()? {
        match item {
            Item::Loop(parts) => {
                let (setup, cell) = *parts;
                of = Some((cell.clone(), setup.campaign, LateLog::new(&cell)));
            }
            Item::Cycle(_, cycle) => run = cycle.run,
            Item::Timing(message) => {
                let stamps = stamps_of(&message);
                timing.wake_late.record(stamps.woke.since(stamps.due));
                timing.execution.record(stamps.ended.since(stamps.woke));
                timing.stages.record(&stamps);
                if let Some((_, _, log)) = &mut of {
                    // The event of a late cycle was published then.
                    let _ = log.take(stamps, run);
                }
                // Of a stop, what was before it stays.
                if !has_stopped && cycles.len() == CYCLES_KEPT {
                    cycles.pop_front();
                }
                if cycles.len() < CYCLES_KEPT {
                    cycles.push_back(stamps);
                }
                has_stopped |= stamps.stopped;
            }
            Item::Event(event) if event["event"] == "fault" => {
                reason = event["reason"].as_str().map(str::to_owned);
            }
            Item::Event(_) | Item::Axis(..) | Item::Frames(..) | Item::Table(_) => {}
        }
    }
    let refused =
        |what: &str| RecordingError::NotARecording { path: path.to_owned(), what: what.to_owned() };
    let Some((cell, campaign, log)) = of else { return Err(refused("it holds no loop")) };
    if cycles.is_empty() {
        return Err(refused("it was made in lock-step, where no cycle can be late"));
    }
    Ok(log.record(&cell, &campaign, &Recorded { cycles: cycles.into(), timing }, reason))
}
