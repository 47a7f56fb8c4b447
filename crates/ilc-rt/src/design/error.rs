//! Refusals of a cell description in design.

use crate::config::ConfigError;
use crate::fieldbus::load::LoadError;
use crate::learning::LearningError;
use crate::model::ModelError;
use crate::trajectory::program::{GcodeError, TableError};
use crate::trajectory::{AxisUnit, TrajectoryError};

/// A refusal, in one line.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// The cell description.
    #[error("{0}")]
    Config(#[from] ConfigError),
    /// The bus cannot carry the traffic.
    #[error("{file}: {key} load_max: {source}")]
    Load {
        /// Cell description.
        file: String,
        /// Table of the bus.
        key: String,
        /// Reason.
        source: LoadError,
    },
    /// The program cannot be run within the limits.
    #[error("{file}: {key}: {}", source.in_units(units))]
    Program {
        /// Cell description.
        file: String,
        /// `[program]`, with the name of the axis that the reason numbers.
        key: String,
        /// Reason.
        source: Box<TrajectoryError>,
        /// Units of the axes.
        units: Vec<AxisUnit>,
    },
    /// The file of the program cannot be read.
    #[error("{file}: cannot be read: {reason}; allowed: a text file of {what}")]
    ProgramFile {
        /// Part program or table.
        file: String,
        /// Reason given by the system.
        reason: String,
        /// Expected content.
        what: &'static str,
    },
    /// The table of set points is refused.
    #[error("{file}: {source}")]
    Table {
        /// Table.
        file: String,
        /// Line, content, and the allowed content.
        source: TableError,
    },
    /// The part program is refused.
    #[error("{file}: {source}")]
    PartProgram {
        /// Part program.
        file: String,
        /// Line, word, and the allowed values.
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
        /// Unit of the axis.
        unit: &'static str,
        /// The farthest position beyond the range.
        reached_m: f64,
        /// Smallest value allowed.
        low_m: f64,
        /// Largest value allowed.
        high_m: f64,
    },
    /// The model of an axis is unusable.
    #[error("{file}: [axis.model]: {source}")]
    Model {
        /// Cell description.
        file: String,
        /// Reason.
        source: ModelError,
    },
    /// The law refuses model or weights.
    #[error("{file}: [learning]: {source}")]
    Learning {
        /// Cell description.
        file: String,
        /// Reason.
        source: LearningError,
    },
}
