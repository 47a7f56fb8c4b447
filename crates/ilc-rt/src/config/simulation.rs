//! `[simulation]` and `[axis.simulation]`: the simulated drives; read by `ilc-sim` only.

use crate::schema::field_order;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[simulation]`: the plant as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Simulation {
    /// Orthogonality error of the first two axes: `x_tcp += orthogonality_rad * y`.
    #[schemars(range(min = -0.1, max = 0.1))]
    pub orthogonality_rad: f64,
    /// Step of the drives' own control loops and of the integration.
    pub step_us: u32,
    /// Standard deviation of white noise on the encoders; 0 for none.
    #[schemars(range(min = 0.0, max = 0.001))]
    pub encoder_noise_m: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Simulation {
    fn default() -> Self {
        Self { orthogonality_rad: 0.0, step_us: 125, encoder_noise_m: 0.0, seed: 1 }
    }
}

/// `[axis.simulation]`: a mass in a cascade (P position, PI velocity), friction, and one flexible
/// mode that only the tool centre point sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct AxisSimulation {
    /// Moving mass, including the mode's.
    #[schemars(range(min = 0.001, max = 1e5))]
    pub mass_kg: f64,
    /// Natural frequency that the cascade is tuned for.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub natural_frequency_hz: f64,
    /// Damping ratio that the cascade is tuned for.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub damping: f64,
    /// Integral time of the velocity controller.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub integral_time_s: f64,
    /// Largest force of the motor.
    #[schemars(range(min = 0.001, max = 1e7))]
    pub force_max_n: f64,
    /// Coulomb friction.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub coulomb_n: f64,
    /// Static friction.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub static_n: f64,
    /// Stribeck velocity.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub stribeck_m_s: f64,
    /// Share of the mass in the flexible mode; 0 for none.
    #[schemars(range(min = 0.0, max = 9e4))]
    pub mode_mass_kg: f64,
    /// Natural frequency of the mode.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub mode_frequency_hz: f64,
    /// Damping ratio of the mode.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub mode_damping: f64,
    /// Position at power-on.
    pub position_start_m: f64,
}

impl Default for AxisSimulation {
    fn default() -> Self {
        Self {
            mass_kg: 20.0,
            natural_frequency_hz: 15.0,
            damping: 1.0,
            integral_time_s: 0.1,
            force_max_n: 2000.0,
            coulomb_n: 0.0,
            static_n: 0.0,
            stribeck_m_s: 0.002,
            mode_mass_kg: 0.0,
            mode_frequency_hz: 20.0,
            mode_damping: 0.1,
            position_start_m: 0.0,
        }
    }
}
