//! Sections of a cell description for the machine as a whole: cell, bus, tool, safety.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axis::{Axis, AxisUnit};
use super::error::ConfigError;
use super::file::{CELL_BYTES_MAX, read_file};
use super::input::Input;
use super::learning::Learning;
use super::library::LibrarySection;
use super::realtime::Realtime;
use super::recording::Recording;
use super::simulation::Simulation;
use crate::fieldbus::transport::{Format, format_of};
use crate::schema::field_order;
use crate::trajectory::kind::Program;

/// Highest CANopen node number.
const NODE_MAX: u8 = 127;
/// Default velocity of `jog` and `goto`, as a share of the limit of the axis.
const JOG_SHARE: f64 = 0.1;

/// A complete, validated cell description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Cell {
    /// File it was read from; empty for a text.
    #[serde(skip)]
    pub file: PathBuf,
    /// Content of the file of its program, where that is carried along; otherwise it is read from beside `file`.
    #[serde(skip)]
    pub program_text: Option<Vec<u8>>,
    /// `[cell]`
    pub cell: CellSection,
    /// `[bus]`
    pub bus: BusSection,
    /// `[[extra_bus]]`, further buses of the cell, in one SYNC with `[bus]`; `bus` of an axis names one.
    #[serde(rename = "extra_bus", default)]
    pub extra_buses: Vec<BusSection>,
    /// `[[axis]]`, in the order of the coordinates of the program.
    #[serde(rename = "axis")]
    pub axes: Vec<Axis>,
    /// `[[input]]`, digital inputs of the drives: guards, buttons, limit switches.
    #[serde(rename = "input", default)]
    pub inputs: Vec<Input>,
    /// `[tcp_encoder]`, a measurement of the tool centre point on the bus.
    pub tcp_encoder: Option<TcpEncoder>,
    /// `[program]`
    pub program: Program,
    /// `[learning]`
    #[serde(default)]
    pub learning: Learning,
    /// `[safety]`
    #[serde(default)]
    pub safety: Safety,
    /// `[realtime]`
    #[serde(default)]
    pub realtime: Realtime,
    /// `[library]`
    #[serde(default)]
    pub library: LibrarySection,
    /// `[recording]`
    #[serde(default)]
    pub recording: Recording,
    /// `[telemetry]`
    #[serde(default)]
    pub telemetry: Telemetry,
    /// `[simulation]`, read by the simulated drives only.
    #[serde(default)]
    pub simulation: Simulation,
}

/// `[cell]`: name and servo cycle.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct CellSection {
    /// Names the cell in the library and on Zenoh (`ilc/<name>/…`): 1 to 64 letters, digits, `-` and `_`.
    pub name: String,
    /// Servo cycle in microseconds, as both clocks count in integers.
    #[schemars(range(min = 100, max = 100_000))]
    pub cycle_us: u32,
}

/// `[bus]`: address and load limit of the bus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct BusSection {
    /// Bus, e.g. `can:vcan0` or `udp:239.74.163.2`; README.md has all kinds. `--bus` replaces it. With `?fd=1` it has
    /// CAN FD, if every node takes it; `data_bitrate=N` is the bit rate of its data phase.
    pub address: String,
    /// Bit rate of a CAN bus, for the load check; with CAN FD that of arbitration.
    #[serde(default = "default_bitrate_bit_s")]
    #[schemars(range(min = 10_000, max = 1_000_000))]
    pub bitrate_bit_s: u32,
    /// Largest share of a CAN bus that cyclic frames may take in the worst case.
    #[serde(default = "default_load_max")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub load_max: f64,
}

fn default_bitrate_bit_s() -> u32 {
    1_000_000
}

fn default_load_max() -> f64 {
    0.8
}

/// `[tcp_encoder]`: a node that measures the tool centre point, one coordinate per axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct TcpEncoder {
    /// CANopen node, 1 to 127.
    #[schemars(range(min = 1, max = 127))]
    pub node: u8,
    /// Counts per metre, both coordinates.
    #[schemars(range(min = 1.0, max = 1e10))]
    pub counts_per_m: f64,
}

/// `[safety]`: conditions of a controlled stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Safety {
    /// Cycles without any one PDO of a node before a controlled stop; drives stop after the same
    /// time without commands.
    #[schemars(range(min = 1, max = 1000))]
    pub silent_cycles_max: u32,
    /// Consecutive missed cycles before a controlled stop.
    #[schemars(range(min = 1, max = 10_000))]
    pub overrun_cycles_max: u32,
    /// Time-out for a node to boot and to answer.
    #[schemars(range(min = 0.01, max = 60.0))]
    pub answer_timeout_s: f64,
    /// Velocity of the first move of a run, to its start, and the highest one of `jog` and `goto`. If not given, the
    /// first move has the feed of the program, and `jog` and `goto` a tenth of the velocity limit of their axis.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub approach_velocity_m_s: Option<f64>,
    /// Node number of the controller, whose heartbeat is watched by drives without a time-out of their commands
    /// (object 0x1400:05); the highest free one if it is not given.
    #[schemars(range(min = 1, max = 127))]
    pub controller_node: Option<u8>,
    /// Reset faults that the drives have when a run starts. Otherwise they are named, and nothing moves.
    pub reset_faults: bool,
}

impl Default for Safety {
    fn default() -> Self {
        Self {
            silent_cycles_max: 20,
            overrun_cycles_max: 50,
            answer_timeout_s: 2.0,
            approach_velocity_m_s: None,
            controller_node: None,
            reset_faults: false,
        }
    }
}

/// `[telemetry]`: publication on Zenoh.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Telemetry {
    /// Publish on Zenoh.
    pub enabled: bool,
    /// Zenoh endpoints to listen on, e.g. `tcp/127.0.0.1:7447`.
    pub listen: Vec<String>,
    /// Zenoh endpoints to connect to.
    pub connect: Vec<String>,
    /// Discover other programs by multicast.
    pub scouting: bool,
}

impl Default for Telemetry {
    fn default() -> Self {
        Self { enabled: true, listen: Vec::new(), connect: Vec::new(), scouting: true }
    }
}

impl Cell {
    /// Reads and validates a cell description.
    ///
    /// # Errors
    /// [`ConfigError`] with file, key, value and what is allowed.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let file = path.display().to_string();
        let refused = |reason: String| ConfigError::Read { file: file.clone(), reason };
        let bytes = read_file(path, CELL_BYTES_MAX).map_err(refused)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = good.split(|&byte| byte == b'\n').count();
            refused(format!("line {line} is not UTF-8"))
        })?;
        Self::parse(&text, &file)
    }

    /// Reads and validates a cell description from its text; `file` names it in errors.
    ///
    /// # Errors
    /// [`ConfigError`] with file, key, value and what is allowed.
    pub fn parse(text: &str, file: &str) -> Result<Self, ConfigError> {
        let mut cell: Self =
            toml::from_str(text).map_err(|error| super::validate::syntax(text, file, &error))?;
        cell.file = PathBuf::from(file);
        super::validate::check(&cell)?;
        Ok(cell)
    }

    /// Returns the servo cycle in seconds.
    pub fn cycle_s(&self) -> f64 {
        f64::from(self.cell.cycle_us) * 1e-6
    }

    /// Returns the highest velocity of an axis in `jog` and `goto`.
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn jog_velocity_m_s(&self, axis: usize) -> f64 {
        let most_m_s = self.axes[axis].limits.velocity_max_m_s;
        self.safety.approach_velocity_m_s.map_or(JOG_SHARE * most_m_s, |set| set.min(most_m_s))
    }

    /// Returns the address of each bus: `[bus]`, then every `[[extra_bus]]`.
    pub fn addresses(&self) -> impl Iterator<Item = &str> {
        std::iter::once(&self.bus).chain(&self.extra_buses).map(|bus| bus.address.as_str())
    }

    /// Returns the node number of the controller.
    pub fn controller_node(&self) -> u8 {
        let is_free = |number: &u8| {
            self.axes.iter().all(|axis| axis.node != *number)
                && self.tcp_encoder.is_none_or(|tool| tool.node != *number)
        };
        let free = || (1..=NODE_MAX).rev().find(is_free).unwrap_or(NODE_MAX);
        self.safety.controller_node.unwrap_or_else(free)
    }

    /// Returns a bus by its number: 0 is `[bus]`, n the n-th `[[extra_bus]]`.
    pub fn bus(&self, number: u8) -> &BusSection {
        match number.checked_sub(1) {
            Some(extra) => self.extra_buses.get(usize::from(extra)).unwrap_or(&self.bus),
            None => &self.bus,
        }
    }

    /// Returns the format of the frames of a bus, by its number.
    pub fn format(&self, bus: u8) -> Format {
        format_of(&self.bus(bus).address)
    }

    /// Returns the unit of each axis, in order.
    pub fn units(&self) -> Vec<AxisUnit> {
        self.axes.iter().map(|axis| axis.unit).collect()
    }

    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.axes.len()
    }
}
