//! `[[axis]]`: an axis, its limits, its model and its position loop.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::drive::Drive;
use super::homing::Homing;
use super::simulation::AxisSimulation;
use super::torque::{CascadeControl, Feedforward, Force};
pub use crate::fieldbus::cia402::{InputKind, Mode};
pub use crate::interpolate::AxisUnit;
use crate::schema::field_order;

/// `[[axis]]`: one drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Axis {
    /// Name, such as `"x"`: 1 to 64 characters without control characters, no leading or trailing
    /// spaces; unique, ignoring case and spaces.
    pub name: String,
    /// CANopen node of the drive, unique.
    #[schemars(range(min = 1, max = 127))]
    pub node: u8,
    /// Bus of the drive: 0 is `[bus]`, n the n-th `[[extra_bus]]`.
    #[serde(default)]
    #[schemars(range(min = 0, max = 7))]
    pub bus: u8,
    /// Command interface. `csp`: the drive closes the position loop, the learned input (m) is added to
    /// the set point. `csv`: the position loop is in the controller, the learned input (m/s) is added to
    /// the velocity command. `cst`: the whole cascade is in the controller, the learned input (N) is
    /// added to the torque.
    pub interface: Mode,
    /// Quantity that the learned input is added to. csp: `position`, or `velocity` (object 0x60B1) or
    /// `torque` (0x60B2); csv: `velocity` or `torque` (0x60B2); cst: `torque`. The first one is the
    /// default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<InputKind>,
    /// Unit of its coordinate; every quantity of a rotary axis whose name ends in `_m`,
    /// `_m_s`, … is in rad, rad/s, …
    #[serde(default)]
    pub unit: AxisUnit,
    /// Encoder counts of the drive per metre (or radian); the farthest position and the highest
    /// speed must fit 32 bits.
    #[schemars(range(min = 1.0, max = 1e10))]
    pub counts_per_m: f64,
    /// The positive direction of the axis is the negative one of the drive: positions, velocities and
    /// torques change their sign between the two.
    #[serde(default)]
    pub reversed: bool,
    /// `[axis.limits]`
    pub limits: Limits,
    /// `[axis.model]`: the model that learning uses; a law that predicts needs it.
    pub model: Option<AxisModel>,
    /// `[axis.position_loop]`: for `interface = "csv"` only.
    pub position_loop: Option<PositionLoop>,
    /// `[axis.force]`: needed by everything in torque.
    pub force: Option<Force>,
    /// `[axis.cascade]`: for `interface = "cst"` only.
    pub cascade: Option<CascadeControl>,
    /// `[axis.feedforward]`
    pub feedforward: Option<Feedforward>,
    /// `[axis.homing]`: reference of the position.
    #[serde(default)]
    pub homing: Homing,
    /// `[axis.drive]`: the drive itself, where it differs from what bring-up expects.
    #[serde(default)]
    pub drive: Drive,
    /// `[axis.simulation]`: physics, read by the simulated drives only.
    #[serde(default)]
    pub simulation: AxisSimulation,
}

impl Axis {
    /// Returns the quantity that the learned input is added to.
    pub fn input_kind(&self) -> InputKind {
        self.input.unwrap_or(self.interface.inputs()[0])
    }

    /// Returns whether the drive gets a velocity offset (object 0x60B1) in every cycle.
    pub fn has_velocity_offset(&self) -> bool {
        let forward = self.feedforward.is_some_and(|forward| forward.velocity > 0.0);
        self.interface.targets_position() && (self.input_kind() == InputKind::Velocity || forward)
    }

    /// Returns whether the drive gets a torque beside its target (object 0x60B2) in every cycle.
    pub fn has_torque_offset(&self) -> bool {
        self.has_torque() && !self.interface.targets_torque()
    }

    /// Returns whether the drive gets a torque (object 0x60B2, or 0x6071) in every cycle.
    pub fn has_torque(&self) -> bool {
        let forward = self
            .feedforward
            .is_some_and(|forward| forward.acceleration > 0.0 || forward.friction > 0.0);
        self.interface.targets_torque() || self.input_kind() == InputKind::Torque || forward
    }
}

/// `[axis.limits]`: limits that are never exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Limits {
    /// Lowest position.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub position_min_m: f64,
    /// Highest position.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub position_max_m: f64,
    /// Velocity limit.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub velocity_max_m_s: f64,
    /// Acceleration limit, also of a controlled stop.
    #[schemars(range(min = 0.0001, max = 1e4))]
    pub acceleration_max_m_s2: f64,
    /// Jerk limit.
    #[schemars(range(min = 0.001, max = 1e7))]
    pub jerk_max_m_s3: f64,
    /// Following error at which drive and controller fault.
    #[schemars(range(min = 1e-7, max = 1.0))]
    pub following_error_max_m: f64,
}

/// `[axis.model]`: second-order position loop (csp) or first-order velocity loop (csv), and delay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct AxisModel {
    /// Natural frequency of the drive's position loop, `w0^2 / (s^2 + 2 d w0 s + w0^2)`; csp only.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub natural_frequency_hz: Option<f64>,
    /// Damping ratio of the drive's position loop; csp only.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub damping: Option<f64>,
    /// Bandwidth of the drive's velocity loop, first order; csv only.
    #[schemars(range(min = 0.1, max = 1e4))]
    pub velocity_bandwidth_hz: Option<f64>,
    /// Dead time: servo cycles from a command to its first effect, in addition to that of the
    /// sampler. A drive that interpolates its set points adds one; a little more compensates
    /// unmodelled lags.
    #[serde(default)]
    #[schemars(range(min = 0, max = 20))]
    pub delay_samples: u32,
}

/// `[axis.position_loop]`: proportional position control in the controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PositionLoop {
    /// Position gain kv: velocity per position error.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub gain_per_s: f64,
    /// Velocity feed-forward, 0 to 1: share of the reference velocity.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub velocity_feedforward: f64,
}
