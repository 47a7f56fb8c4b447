//! The record of the flight recorder: a JSON file beside the library, written when the loop is over.
//!
//! The campaign writes it, `ilc-rt why` reads it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::late::{AnswerTimes, LateCounts, LateCycle, StageSpans};
use crate::rt::LatencyFigures;

/// End of the name of such a file.
pub const FLIGHT_SUFFIX: &str = ".late.json";

/// Timing of the loop of one campaign, with its worst cycles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightRecord {
    /// Name of the cell.
    pub cell: String,
    /// Campaign in the library.
    pub campaign: String,
    /// Servo cycle.
    pub cycle_us: u32,
    /// Share of it after which a cycle is late.
    pub late_share: f64,
    /// Stages of all cycles.
    pub stages_us: StageFigures,
    /// Answers of each node.
    pub answers: Vec<AnswerTimes>,
    /// Late cycles.
    pub late: LateCounts,
    /// The worst of them, worst first.
    pub worst: Vec<LateCase>,
    /// Stages of a cycle in the middle of those that were not late.
    pub good: Option<StageSpans>,
    /// The fault that stopped the axes, if one did.
    pub fault: Option<StopCase>,
}

/// Quantiles of each stage, in microseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageFigures {
    /// Lateness on the grid.
    pub wake: LatencyFigures,
    /// Taking the messages that had arrived.
    pub receive: LatencyFigures,
    /// Computing the commands.
    pub control: LatencyFigures,
    /// Passing the commands and SYNC to the bus.
    pub send: LatencyFigures,
}

impl StageFigures {
    /// Returns the stages with their names, in order.
    pub const fn named(&self) -> [(&'static str, &LatencyFigures); 4] {
        [
            ("wake", &self.wake),
            ("receive", &self.receive),
            ("control", &self.control),
            ("send", &self.send),
        ]
    }
}

/// A late cycle with those before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LateCase {
    /// The run it belongs to.
    pub iteration: u32,
    /// The cycle.
    #[serde(flatten)]
    pub cycle: LateCycle,
    /// It and the cycles before it, oldest first.
    pub before: Vec<CycleRow>,
}

/// The stop for a fault, with the cycles before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopCase {
    /// One sentence.
    pub reason: String,
    /// Cycle that was late before it; absent if none was.
    pub late: Option<LateCycle>,
    /// The cycle in which the stop began and those before it, oldest first.
    pub before: Vec<CycleRow>,
}

/// A recorded cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CycleRow {
    /// Number of the tick since the loop began.
    pub tick: u64,
    /// Its stages.
    #[serde(flatten)]
    pub stages: StageSpans,
    /// Cycles that were skipped before it.
    pub missed: u32,
    /// True if it lost its deadline.
    pub late: bool,
}

impl FlightRecord {
    /// Returns its file beside a library: one for each cell, so that the newest campaign replaces the one before.
    pub fn path(library: &Path, cell: &str) -> PathBuf {
        let stem = library.file_stem().unwrap_or_default().to_string_lossy();
        library.with_file_name(format!("{stem}.{cell}{FLIGHT_SUFFIX}"))
    }

    /// Writes it, in place of an earlier one, which stays whole if that fails.
    ///
    /// # Errors
    /// That of the system.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        let beside = path.with_extension("json.part");
        std::fs::write(&beside, text + "\n")?;
        std::fs::rename(&beside, path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_beside_the_library_and_names_the_cell() {
        let of = |library: &str| FlightRecord::path(Path::new(library), "mill");
        assert_eq!(of("/var/lib/a.b.db"), Path::new("/var/lib/a.b.mill.late.json"));
        assert_eq!(of("ilc-library.db"), Path::new("ilc-library.mill.late.json"));
    }
}
