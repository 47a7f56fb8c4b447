//! The cell description (TOML): typed, validated, and refused in one clear line.
//!
//! Whoever starts a cell reads it through [`Cell::load`]: the supervisor, the binary, the simulator
//! and Python. It knows the numbers and their ranges, and nothing of how they are used.

mod cell;
mod error;
mod path;
mod program;
mod validate;

pub use cell::{
    Axis, AxisModel, AxisSimulation, AxisUnit, BusSection, Cell, CellSection, Interface, Limits,
    PositionLoop, Safety, Simulation, TcpEncoder, Telemetry,
};
pub use error::ConfigError;
pub use path::{ButterflySection, ModulatedSection, PathKind, RasterSection, SpiralSection};
pub use program::{
    Corner, LawName, Learning, Measure, NormOptimalSection, PdSection, Program, Segment,
};
pub use validate::check;
