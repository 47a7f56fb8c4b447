//! `[simulation]` and `[axis.simulation]`: the simulated drives; read by `ilc-sim` only.

use crate::schema::field_order;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Temperature at which motors and scales of the simulation are nominal: 20 °C.
pub const NOMINAL_TEMPERATURE_K: f64 = 293.15;

/// `[simulation]`: the plant as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// Temperature of the machine at power-on; motors and scales are nominal at 293.15 K.
    #[schemars(range(min = 200.0, max = 500.0))]
    pub temperature_k: f64,
    /// `[simulation.delta]`: three axes move a delta mechanism together; without it each one moves its own mass.
    pub delta: Option<DeltaSimulation>,
    /// `[[simulation.change]]`: changes while the machine runs, each from its time on.
    #[serde(rename = "change")]
    pub changes: Vec<SimulationChange>,
}

/// `[simulation.delta]`: three rotary axes, the cranks of a delta mechanism, with one platform on their rods; of more
/// axes each three move a mechanism of their own. `mass_kg` of an axis is the inertia that its cascade is tuned for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct DeltaSimulation {
    /// Radius of the pivots of the cranks minus that of the joints on the platform.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub base_m: f64,
    /// Length of the cranks.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub crank_m: f64,
    /// Length of the rods.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub rod_m: f64,
    /// Inertia of a crank with its motor, in kg m².
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub crank_kg_m2: f64,
    /// Mass of the platform, with its share of the rods.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub platform_kg: f64,
    /// Acceleration of gravity from the platform towards the base; negative for a mechanism that hangs, 0 for none.
    #[serde(default)]
    #[schemars(range(min = -20.0, max = 20.0))]
    pub gravity_m_s2: f64,
}

/// `[[simulation.change]]`: a change of temperature, payload or load of the simulated machine, linear over
/// a time, or of the digital inputs and the safe torque off of its drives, at once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct SimulationChange {
    /// Start of the change, after power-on of the drives.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub after_s: f64,
    /// Duration of the change; 0: at once.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub over_s: f64,
    /// Axis of payload, force, inputs and torque; all axes without it.
    pub axis: Option<String>,
    /// New temperature of the machine.
    #[schemars(range(min = 200.0, max = 500.0))]
    pub temperature_k: Option<f64>,
    /// New additional mass on the carriage.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub payload_kg: Option<f64>,
    /// New constant force on the carriage, e.g. of a cable or of gravity.
    #[schemars(range(min = -1e7, max = 1e7))]
    pub force_n: Option<f64>,
    /// New digital inputs of the drive that are on beside its switches, as bits of object 0x60FD, from `after_s`
    /// on.
    pub digital_inputs: Option<u32>,
    /// Safe torque off of the drive, as by an emergency stop: `true` takes its power, `false` allows it again, from
    /// `after_s` on.
    pub torque_off: Option<bool>,
}

impl Default for Simulation {
    fn default() -> Self {
        Self {
            orthogonality_rad: 0.0,
            step_us: 125,
            encoder_noise_m: 0.0,
            seed: 1,
            temperature_k: NOMINAL_TEMPERATURE_K,
            delta: None,
            changes: Vec::new(),
        }
    }
}

/// `[axis.simulation]`: a mass in a cascade (P position, PI velocity), friction, cogging, and one flexible
/// mode, with backlash if wanted, that only the tool centre point sees.
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
    /// Play between the carriage, which the encoder measures, and the mode's mass, which the tool is on.
    #[schemars(range(min = 0.0, max = 0.01))]
    pub backlash_m: f64,
    /// Viscous friction.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub viscous_n_s_m: f64,
    /// Stiffness of the bristles of a LuGre friction with the same Coulomb and static friction, instead
    /// of true stiction; 0 for none.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub bristle_stiffness_n_m: f64,
    /// Damping of the bristles.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub bristle_damping_n_s_m: f64,
    /// Amplitude of the cogging force, a sine over position.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub cogging_n: f64,
    /// Period of the cogging force.
    #[schemars(range(min = 1e-5, max = 10.0))]
    pub cogging_pitch_m: f64,
    /// Relative rise of the motor's resistance per kelvin; its force falls by `R0/R`, as with a voltage
    /// amplifier.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub resistance_per_k: f64,
    /// Thermal expansion between encoder and tool, relative per kelvin.
    #[schemars(range(min = 0.0, max = 0.001))]
    pub expansion_per_k: f64,
    /// Position at power-on.
    pub position_start_m: f64,
    /// Place of the limit switch at the lower end of the axis (of a `reversed` axis the positive one of the drive); a
    /// twentieth of the travel below `position_min_m` if absent.
    pub switch_min_m: Option<f64>,
    /// Place of the limit switch at the upper end of the axis (of a `reversed` axis the negative one of the drive); a
    /// twentieth of the travel above `position_max_m` if absent.
    pub switch_max_m: Option<f64>,
    /// Place of the home switch, which is closed from there upwards; none if absent.
    pub switch_home_m: Option<f64>,
    /// Distance of the encoder's index pulses.
    #[schemars(range(min = 1e-6, max = 1000.0))]
    pub index_pitch_m: f64,
    /// Further digital inputs that are on, as bits of object 0x60FD: 3 interlock, 16 to 31 free.
    pub digital_inputs: u32,
    /// Deviations from the drive that the profile describes.
    pub quirks: Quirks,
}

/// `[axis.simulation.quirks]`: habits of real drives, to try a master against.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of its own")]
pub struct Quirks {
    /// Quick-stop option 0x605A at power-on: 0, 1, 2, 5 or 6.
    #[schemars(range(min = 0, max = 6))]
    pub quick_stop_option: i16,
    /// A change of mode is refused while the halt bit is set.
    pub keeps_mode_under_halt: bool,
    /// TPDO1, with the statusword, is sent on change instead of at SYNC.
    pub statusword_on_event: bool,
    /// Time until an SDO request is answered.
    #[schemars(range(min = 0, max = 10_000))]
    pub sdo_delay_ms: u32,
    /// One SYNC in so many is not heard; 0 for none.
    pub sync_lost_every: u32,
    /// No torque offset, 0x60B2: RPDO1 has 6 bytes at power-on.
    pub lacks_torque_offset: bool,
    /// No torque, 0x6077: TPDO1 has 6 bytes at power-on.
    pub lacks_torque: bool,
    /// No following error, 0x60F4: TPDO2 has 4 bytes at power-on.
    pub lacks_following_error: bool,
    /// No interpolation period, 0x60C2: the drive takes the cycle of the cell.
    pub lacks_interpolation_period: bool,
    /// No timeout of the following error, 0x6066.
    pub lacks_following_error_time: bool,
    /// No emergency messages, and no 0x1014.
    pub lacks_emergencies: bool,
    /// No time-out of commands, 0x1400:05: the drive watches the heartbeat of the controller.
    pub lacks_command_timeout: bool,
    /// No consumer heartbeat, 0x1016.
    pub lacks_consumer_heartbeat: bool,
    /// No inhibit time, event timer and SYNC start value of TPDOs, 0x1800:03, :05 and :06.
    pub lacks_status_times: bool,
}

impl Default for Quirks {
    fn default() -> Self {
        Self {
            quick_stop_option: 6,
            keeps_mode_under_halt: false,
            statusword_on_event: false,
            sdo_delay_ms: 0,
            sync_lost_every: 0,
            lacks_torque_offset: false,
            lacks_torque: false,
            lacks_following_error: false,
            lacks_interpolation_period: false,
            lacks_following_error_time: false,
            lacks_emergencies: false,
            lacks_command_timeout: false,
            lacks_consumer_heartbeat: false,
            lacks_status_times: false,
        }
    }
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
            backlash_m: 0.0,
            viscous_n_s_m: 0.0,
            bristle_stiffness_n_m: 0.0,
            bristle_damping_n_s_m: 0.0,
            cogging_n: 0.0,
            cogging_pitch_m: 0.03,
            resistance_per_k: 0.0,
            expansion_per_k: 0.0,
            position_start_m: 0.0,
            switch_min_m: None,
            switch_max_m: None,
            switch_home_m: None,
            index_pitch_m: 0.01,
            digital_inputs: 0,
            quirks: Quirks::default(),
        }
    }
}
