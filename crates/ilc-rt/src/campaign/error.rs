//! Refusals of a campaign; nothing has moved when one of these is returned.

use std::path::PathBuf;

use super::control::ControlError;
use super::disturbance::DisturbanceError;
use super::input::InputError;
use crate::config::ConfigError;
use crate::design::DesignError;
use crate::fieldbus::bring_up::BringUpError;
use crate::fieldbus::transport::{OpenError, syntaxes};
use crate::identification::IdentificationError;
use crate::learning::LearningError;
use crate::library::LibraryError;
use crate::recording::RecordingError;
use crate::rt::Refused;

/// A refusal, in one line.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The cell description cannot be used.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The experiment is refused.
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    /// The disturbance of the first run is unavailable.
    #[error(transparent)]
    Disturbance(#[from] DisturbanceError),
    /// The bus does not open.
    #[error("{place}: {source}")]
    Bus {
        /// Origin of the address: file and key, or an option of the command line.
        place: String,
        /// Reason.
        source: OpenError,
    },
    /// A node does not answer, or differs from the cell description.
    #[error("{file}: {key} on {address}: {source}")]
    BringUp {
        /// Cell description.
        file: String,
        /// The node, as `[[axis]] x node = 1`.
        key: String,
        /// Bus address.
        address: String,
        /// Reason.
        source: Box<BringUpError>,
    },
    /// Another master commands the bus.
    #[error(
        "{file}: [bus] address = {address}: another master is at work on this bus ({heard} heard); \
         nothing was sent; stop it, or choose another address"
    )]
    Occupied {
        /// Cell description.
        file: String,
        /// Bus address.
        address: String,
        /// Its command.
        heard: crate::fieldbus::bring_up::listen::Command,
    },
    /// A drive is in fault, and a person has to see that first.
    #[error(
        "{file}: axis {axis} (node {node}) is in fault: {fault}; nothing has moved; `ilc-rt reset` names and resets \
         it, or allow it by --reset-faults or [safety] reset_faults = true"
    )]
    Faulted {
        /// Cell description.
        file: String,
        /// Name of the axis.
        axis: String,
        /// Its node.
        node: u8,
        /// Codes in words.
        fault: String,
    },
    /// An input that does not permit a start.
    #[error("{file}: {what}; nothing has moved")]
    Interlock {
        /// Cell description.
        file: String,
        /// The input, and what to do.
        what: String,
    },
    /// There is no button to wait for.
    #[error(
        "--start input: allowed for a cell with an [[input]] of use = \"start\"; {file} has none"
    )]
    NoStartInput {
        /// Cell description.
        file: String,
    },
    /// A drive that has to find its home first.
    #[error(
        "{file}: axis {axis} (node {node}) is not homed: {why}; nothing has moved; `ilc-rt home {file} \
         --axis {axis}` homes it, or --home before the first run"
    )]
    NotHomed {
        /// Cell description.
        file: String,
        /// Name of the axis.
        axis: String,
        /// Its node.
        node: u8,
        /// Evidence.
        why: String,
    },
    /// A drive does not tell its faults or its position.
    #[error("{file}: axis {axis}: {source}")]
    Commissioning {
        /// Cell description.
        file: String,
        /// Name of the axis.
        axis: String,
        /// Reason.
        source: Box<crate::commissioning::CommissioningError>,
    },
    /// A move that the limits do not allow.
    #[error("axis {axis}: {what}: allowed {allowed}; nothing has moved")]
    Travel {
        /// Name of the axis.
        axis: String,
        /// The quantity and its value.
        what: String,
        /// Values allowed.
        allowed: String,
    },
    /// The bus failed while the nodes were started.
    #[error("{file}: [bus] address = {address}: {source}")]
    Start {
        /// Cell description.
        file: String,
        /// Bus address.
        address: String,
        /// Reason.
        source: crate::fieldbus::BusError,
    },
    /// The library.
    #[error("{0}")]
    Library(#[from] LibraryError),
    /// The frozen input.
    #[error("{0}")]
    Input(#[from] InputError),
    /// The cell cannot be commanded.
    #[error("--ctl: {0}")]
    Control(#[from] ControlError),
    /// There is no law to learn with again.
    #[error("--relearn-above {ratio}: law \"none\" learns nothing; allowed: a law in [learning]")]
    NothingToRelearn {
        /// Ratio of errors.
        ratio: f64,
    },
    /// There is no campaign to resume.
    #[error("--resume: {0}")]
    Resume(#[from] ResumeError),
    /// An in-process bus in a program without drives.
    #[error(
        "{place}: `{address}` has no drives in this program; allowed: {} (`ilc run` in Python runs \
         it with simulated drives)",
        syntaxes(false)
    )]
    NoDrivesInside {
        /// Origin of the address: file and key, or an option of the command line.
        place: String,
        /// The address.
        address: String,
    },
    /// Simulated drives could not be created from the cell.
    #[error("{file}: [simulation]: {reason}")]
    Simulation {
        /// Cell description.
        file: String,
        /// Reason.
        reason: String,
    },
    /// Real-time settings that were required and not granted.
    #[error("--require-rt: {}; nothing has moved", all(refused))]
    NotRealtime {
        /// Refused settings.
        refused: Vec<Refused>,
    },
    /// A recording could not be begun.
    #[error("{0}; nothing has moved")]
    Recording(#[from] RecordingError),
    /// The cell description as it is applied has no text.
    #[error("{file}: the recording cannot hold this cell description: {reason}; nothing has moved")]
    NotDescribed {
        /// Cell description.
        file: String,
        /// Reason.
        reason: String,
    },
    /// A thread could not be started.
    #[error("the {what} thread could not be started: {source}")]
    Thread {
        /// Name of the thread.
        what: &'static str,
        /// Reason given by the system.
        source: std::io::Error,
    },
}

impl From<ConfigError> for CampaignError {
    fn from(source: ConfigError) -> Self {
        Self::Design(source.into())
    }
}

/// Reason that a campaign is not resumed, or not begun beside another one.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// The library does not exist; opening it would leave an empty file where a name was mistyped.
    #[error("there is no library {} to go on with", path.display())]
    NoLibrary {
        /// Its file.
        path: PathBuf,
    },
    /// No campaign is like this one.
    #[error("the library has no campaign of this cell, program, measurement and law")]
    NoCampaign,
    /// All runs are made.
    #[error(
        "campaign {campaign} has {made} of {iterations} runs already; ask for more with --iterations"
    )]
    Complete {
        /// The campaign.
        campaign: String,
        /// Runs made.
        made: u32,
        /// Runs asked for.
        iterations: u32,
    },
    /// Another program holds the campaign.
    #[error("campaign {campaign} of {} is going on in another program", library.display())]
    Claimed {
        /// The campaign.
        campaign: String,
        /// Its library.
        library: PathBuf,
    },
    /// The law refused a run of the campaign.
    #[error("the law refused a run: {0}")]
    Refused(LearningError),
}

/// Returns every refusal, in one line.
fn all(refused: &[Refused]) -> String {
    let each: Vec<String> = refused.iter().map(Refused::to_string).collect();
    each.join("; ")
}
