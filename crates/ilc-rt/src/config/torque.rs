//! `[axis.force]`, `[axis.cascade]` and `[axis.feedforward]`: motor and mass, control in the
//! controller, and the static feed-forwards of every mode.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// `[axis.force]`: motor, mass and friction; for torque commands and feed-forwards.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Force {
    /// Force of the axis at the rated torque of the motor: 1000 in objects 0x6071, 0x6077 and 0x60B2.
    #[schemars(range(min = 0.001, max = 1e7))]
    pub rated_n: f64,
    /// Largest force that is ever commanded; the rated one if it is not given.
    #[schemars(range(min = 0.001, max = 1e7))]
    pub max_n: Option<f64>,
    /// Moving mass.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub mass_kg: f64,
    /// Viscous friction: force per velocity.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e7))]
    pub viscous_n_s_m: f64,
    /// Coulomb friction, for the feed-forward only: a linear model has none.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e7))]
    pub coulomb_n: f64,
    /// Velocity at which the feed-forward of Coulomb friction reaches its full value.
    #[serde(default = "default_coulomb_velocity_m_s")]
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub coulomb_velocity_m_s: f64,
    /// Integral time of the drive's velocity loop, which works against a learned torque at low
    /// frequencies; none for a proportional loop; csp and csv only.
    #[schemars(range(min = 0.0001, max = 1000.0))]
    pub integral_time_s: Option<f64>,
}

fn default_coulomb_velocity_m_s() -> f64 {
    0.002
}

impl Force {
    /// Returns the largest force that is ever commanded.
    pub fn max_n(&self) -> f64 {
        self.max_n.unwrap_or(self.rated_n)
    }
}

/// `[axis.cascade]`: position and velocity control in the controller, for `interface = "cst"` only.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct CascadeControl {
    /// Position gain kv: velocity per position error.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub position_gain_per_s: f64,
    /// Velocity gain: force per velocity error.
    #[schemars(range(min = 1e-6, max = 1e8))]
    pub velocity_gain_n_s_m: f64,
    /// Integral time of the velocity control; none switches the integral off.
    #[schemars(range(min = 0.0001, max = 1000.0))]
    pub integral_time_s: Option<f64>,
    /// Cut-off of the first-order low-pass of the measured velocity; none for no filter.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub velocity_filter_hz: Option<f64>,
}

impl CascadeControl {
    /// Returns the share of a new velocity in the filtered one, `1 - exp(-2 pi f T)`.
    pub fn velocity_share(&self, cycle_s: f64) -> f64 {
        let decay = |hz: f64| 1.0 - (-std::f64::consts::TAU * hz * cycle_s).exp();
        self.velocity_filter_hz.map_or(1.0, decay)
    }
}

/// `[axis.feedforward]`: shares of the program that are fed forward, in every mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Feedforward {
    /// Share of the reference velocity: in the drive's velocity offset 0x60B1 (csp) or in the cascade
    /// (cst); a csv axis has it in `[axis.position_loop]`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub velocity: f64,
    /// Time by which the set point is ahead of the program, to make up for the delay of bus and drive: a
    /// cycle if a csp drive interpolates its set points; minus a cycle where the position loop in the
    /// controller compares with the measurement before (csv, cst).
    #[schemars(range(min = -0.1, max = 0.1))]
    pub lead_s: f64,
    /// Share of mass times reference acceleration, as a torque; needs `[axis.force]`.
    #[schemars(range(min = 0.0, max = 1.5))]
    pub acceleration: f64,
    /// Share of viscous and Coulomb friction at the reference velocity, as a torque; needs
    /// `[axis.force]`.
    #[schemars(range(min = 0.0, max = 1.5))]
    pub friction: f64,
}
