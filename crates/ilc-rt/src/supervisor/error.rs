//! Why a campaign could not begin; nothing has moved when one of these is returned.

use crate::config::ConfigError;
use crate::fieldbus::bring_up::BringUpError;
use crate::fieldbus::bring_up::load::LoadError;
use crate::fieldbus::transport::OpenError;
use crate::learning::LearningError;
use crate::library::LibraryError;
use crate::model::ModelError;
use crate::trajectory::program::{GcodeError, TableError};
use crate::trajectory::{AxisUnit, TrajectoryError};

/// A refusal, in one line.
#[derive(Debug, thiserror::Error)]
pub enum SupervisorError {
    /// The disturbance of the first run could not be had.
    #[error("{0}")]
    Disturbance(String),
    /// The cell description.
    #[error("{0}")]
    Config(#[from] ConfigError),
    /// The bus does not open.
    #[error("{place}: {source}")]
    Bus {
        /// Where the address stands: file and key, or an option of the command line.
        place: String,
        /// Why.
        source: OpenError,
    },
    /// The bus cannot carry the traffic.
    #[error("{file}: [bus] load_max: {source}")]
    Load {
        /// Cell description.
        file: String,
        /// Why.
        source: LoadError,
    },
    /// A node does not answer, or is not what the cell says.
    #[error("{file}: {key} on {address}: {source}")]
    BringUp {
        /// Cell description.
        file: String,
        /// Which node, as `[[axis]] x node = 1`.
        key: String,
        /// Bus address.
        address: String,
        /// Why.
        source: Box<BringUpError>,
    },
    /// Somebody else commands the bus.
    #[error(
        "{file}: [bus] address = {address}: another master is at work on this bus ({heard} heard); \
         nothing was sent; stop it, or choose another address"
    )]
    Occupied {
        /// Cell description.
        file: String,
        /// Bus address.
        address: String,
        /// What was heard of it.
        heard: crate::fieldbus::bring_up::listen::Command,
    },
    /// The bus failed while the nodes were started.
    #[error("{file}: [bus] address = {address}: {source}")]
    Start {
        /// Cell description.
        file: String,
        /// Bus address.
        address: String,
        /// Why.
        source: crate::fieldbus::BusError,
    },
    /// The program cannot be run within the limits.
    #[error("{file}: {key}: {}", source.in_units(units))]
    Program {
        /// Cell description.
        file: String,
        /// `[program]`, and which axis the number in the reason stands for.
        key: String,
        /// Why.
        source: Box<TrajectoryError>,
        /// Units of the axes.
        units: Vec<AxisUnit>,
    },
    /// The file of the program cannot be read.
    #[error("{file}: cannot be read: {reason}; allowed: a text file of {what}")]
    ProgramFile {
        /// Part program or table.
        file: String,
        /// What the system said.
        reason: String,
        /// What it should hold.
        what: &'static str,
    },
    /// The table of set points is refused.
    #[error("{file}: {source}")]
    Table {
        /// Table.
        file: String,
        /// Line, what is there, and what is allowed.
        source: TableError,
    },
    /// The part program is refused.
    #[error("{file}: {source}")]
    PartProgram {
        /// Part program.
        file: String,
        /// Line, word, and what is allowed.
        source: GcodeError,
    },
    /// The path leaves the range of an axis.
    #[error(
        "{file}: [program]: axis {axis} goes to {reached_m} {unit}: it reaches {low_m} to {high_m} {unit}"
    )]
    Range {
        /// Cell description.
        file: String,
        /// Name of the axis.
        axis: String,
        /// What it is measured in.
        unit: &'static str,
        /// The farthest position beyond the range.
        reached_m: f64,
        /// Smallest allowed.
        low_m: f64,
        /// Largest allowed.
        high_m: f64,
    },
    /// The model of an axis is unusable.
    #[error("{file}: [axis.model]: {source}")]
    Model {
        /// Cell description.
        file: String,
        /// Why.
        source: ModelError,
    },
    /// An experiment that the axis must not be asked for, or that shows nothing.
    #[error("{file}: axis {axis}: {what} = {value}; {allowed}")]
    Experiment {
        /// Cell description.
        file: String,
        /// Name of the axis.
        axis: String,
        /// What is refused.
        what: String,
        /// Its value.
        value: String,
        /// What would be allowed.
        allowed: String,
    },
    /// The law refuses model or weights.
    #[error("{file}: [learning]: {source}")]
    Learning {
        /// Cell description.
        file: String,
        /// Why.
        source: LearningError,
    },
    /// The library.
    #[error("{0}")]
    Library(#[from] LibraryError),
    /// There is nothing to go on with.
    #[error("--resume: {0}")]
    Resume(String),
    /// `loopback:` was asked of a program that has no drives in it.
    #[error(
        "{place}: `loopback:` has no drives in this program; allowed: can:, udp:, zenoh: \
         (`ilc run` in Python runs loopback: with simulated drives)"
    )]
    Loopback {
        /// Where the address stands: file and key, or an option of the command line.
        place: String,
    },
    /// Simulated drives could not be made of the cell.
    #[error("{file}: [simulation]: {reason}")]
    Simulation {
        /// Cell description.
        file: String,
        /// Why.
        reason: String,
    },
    /// A thread could not be started.
    #[error("the {what} thread could not be started: {source}")]
    Thread {
        /// Which one.
        what: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
}
