//! The cell description (TOML): typed, validated, and refused in one clear line.
//!
//! All programs read a cell through [`Cell::load`]: design, the binary, the simulator and Python.
//! It knows the numbers and their ranges, not their use.
//!
//! Family: `axis`, `cell`, `homing`, `mode` and `validate`: a cell is checked where it is loaded, by what the mode of each axis
//! demands.

mod axis;
mod cell;
pub mod data_sheet;
mod drive;
mod error;
mod file;
mod homing;
mod input;
mod learning;
mod library;
pub mod mode;
mod realtime;
mod recording;
mod simulation;
mod torque;
mod validate;

pub use crate::trajectory::kind::{Corner, PathKind, Program, Segment};
pub use axis::{Axis, AxisModel, AxisUnit, InputKind, Limits, Mode, PositionLoop};
pub use cell::{BusSection, Cell, CellSection, Safety, TcpEncoder, Telemetry};
pub use drive::{Drive, DrivePdo, ObjectName, StartUp};
pub use error::ConfigError;
pub use file::{CELL_BYTES_MAX, read_beside, read_file};
pub use homing::{DriveHoming, HOMING_METHODS, Homing, HomingKind};
pub use input::{Direction, INPUTS_MAX, Input, InputUse, Level};
pub use learning::{Learning, Measure};
pub use library::{Keep, LibrarySection};
pub use realtime::{Overrun, Realtime};
pub use recording::Recording;
pub use simulation::{
    AxisSimulation, DeltaSimulation, NOMINAL_TEMPERATURE_K, Quirks, Simulation, SimulationChange,
};
pub use torque::{CascadeControl, Feedforward, Force};
pub use validate::check;

pub use crate::learning::law::LawName;
