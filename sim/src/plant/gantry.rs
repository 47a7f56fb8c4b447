//! The gantry of Haas et al. (2016): axes with cascades, stiction, a swinging crossbeam, and an
//! orthogonality error; on request also backlash, LuGre friction, cogging, heat and changing loads.

use std::f64::consts::TAU;

use ilc_rt::config::{AxisSimulation, Cell, Simulation};

use super::backlash::Backlash;
use super::bristles::Bristles;
use super::drive_loop::DriveLoop;
use super::environment::{Conditions, Environment};
use super::exact_step::{ExactStep, Mechanics, State};
use super::friction::Friction;
use super::noise::Noise;
use super::{Demand, Plant};

/// Step that the axes are prepared for; another one costs a preparation when it first occurs.
const STEP_S: f64 = 125e-6;

/// One axis: mechanics, friction, cogging, and the drive's own loops.
#[derive(Clone, Copy, Debug)]
pub struct GantryAxis {
    mechanics: Mechanics,
    friction: Friction,
    bristles: Option<Bristles>,
    backlash_m: f64,
    viscous_n_s_m: f64,
    cogging_n: f64,
    cogging_rad_m: f64,
    resistance_per_k: f64,
    expansion_per_k: f64,
    drive: DriveLoop,
    /// Largest force of the motor; the drive may allow less.
    force_max_n: f64,
    conditions: Conditions,
    step: ExactStep,
    backlash: Option<Backlash>,
    state: State,
    integral_n: f64,
    force_n: f64,
    /// Force added to that of the drive's loops.
    feedforward_n: f64,
    /// Error of the encoder in this step.
    noise_m: f64,
}

impl GantryAxis {
    /// Creates an axis at rest at its start position, under nominal conditions.
    pub fn new(simulation: &AxisSimulation) -> Self {
        let mechanics = Mechanics {
            carriage_kg: simulation.mass_kg - simulation.mode_mass_kg,
            mode_kg: simulation.mode_mass_kg,
            mode_rad_s: TAU * simulation.mode_frequency_hz,
            mode_damping: simulation.mode_damping,
        };
        let has_bristles = simulation.bristle_stiffness_n_m > 0.0;
        let mut axis = Self {
            mechanics,
            friction: Friction {
                coulomb_n: simulation.coulomb_n,
                static_n: simulation.static_n,
                stribeck_m_s: simulation.stribeck_m_s,
            },
            bristles: has_bristles.then(|| {
                let damping_n_s_m = simulation.bristle_damping_n_s_m;
                Bristles::new(simulation.bristle_stiffness_n_m, damping_n_s_m)
            }),
            backlash_m: simulation.backlash_m,
            viscous_n_s_m: simulation.viscous_n_s_m,
            cogging_n: simulation.cogging_n,
            cogging_rad_m: TAU / simulation.cogging_pitch_m,
            resistance_per_k: simulation.resistance_per_k,
            expansion_per_k: simulation.expansion_per_k,
            drive: DriveLoop::tuned(
                simulation.mass_kg,
                TAU * simulation.natural_frequency_hz,
                simulation.damping,
                simulation.integral_time_s,
                simulation.force_max_n,
            ),
            force_max_n: simulation.force_max_n,
            conditions: Conditions { payload_kg: 0.0, force_n: 0.0, warming_k: 0.0 },
            step: ExactStep::new(&mechanics, STEP_S),
            backlash: None,
            state: [simulation.position_start_m, 0.0, 0.0, 0.0],
            integral_n: 0.0,
            force_n: 0.0,
            feedforward_n: 0.0,
            noise_m: 0.0,
        };
        axis.prepare(STEP_S);
        axis
    }

    /// Prepares the exact steps for a step size and the present payload.
    fn prepare(&mut self, dt_s: f64) {
        let carriage_kg = self.mechanics.carriage_kg + self.conditions.payload_kg;
        let mechanics = Mechanics { carriage_kg, ..self.mechanics };
        self.step = ExactStep::new(&mechanics, dt_s);
        self.backlash =
            (self.backlash_m > 0.0).then(|| Backlash::new(self.backlash_m, &mechanics, dt_s));
    }

    /// Sets the conditions of the next steps.
    fn expose(&mut self, conditions: Conditions) {
        let payload_kg = std::mem::replace(&mut self.conditions, conditions).payload_kg;
        if payload_kg.to_bits() != conditions.payload_kg.to_bits() {
            self.prepare(self.step.dt_s);
        }
    }

    /// Returns the force on the carriage that is neither friction at rest nor the mode: motor,
    /// cogging, viscous friction and load.
    fn driving_n(&self) -> f64 {
        let [position_m, velocity_m_s, ..] = self.state;
        let motor_n = self.force_n / (1.0 + self.resistance_per_k * self.conditions.warming_k);
        let cogging_n = if self.cogging_n > 0.0 {
            self.cogging_n * (self.cogging_rad_m * position_m).sin()
        } else {
            0.0
        };
        motor_n + cogging_n - self.viscous_n_s_m * velocity_m_s + self.conditions.force_n
    }

    fn advance(&mut self, demand: Demand, dt_s: f64) {
        if self.step.dt_s.to_bits() != dt_s.to_bits() {
            self.prepare(dt_s);
        }
        self.force_n = self.drive.force_n(
            demand,
            self.state[0] + self.noise_m,
            self.state[1],
            self.feedforward_n,
            &mut self.integral_n,
            dt_s,
        );
        let driving_n = self.driving_n();
        // The brake holds as much as the motor's maximum force.
        let brake_n = if demand == Demand::Off { self.force_max_n } else { 0.0 };
        let (friction, bristles) = (self.friction, &mut self.bristles);
        let mut one_step = |step: &ExactStep, z: &State| match bristles {
            Some(bristles) if brake_n == 0.0 => bristles.step(&friction, step, z, driving_n),
            Some(bristles) => {
                bristles.relax();
                friction.step(step, z, driving_n, brake_n)
            }
            None => friction.step(step, z, driving_n, brake_n),
        };
        self.state = match &self.backlash {
            Some(backlash) => backlash.step(&self.step, &self.state, one_step),
            None => one_step(&self.step, &self.state),
        };
    }
}

/// Axes under one tool: only the tool sees the crossbeam's mode and the orthogonality error.
///
/// `tool_0 = x_0 (1 + α ΔT) + q_0 + orthogonality · x_1`, `tool_i = x_i (1 + α ΔT) + q_i`
///
/// The drives control the noisy position and the true velocity, as drives filter theirs.
///
/// # Real Time
/// [`Plant::step`] does not allocate.
/// # Source
/// - \[haas2016\], section 3.2: masses, bandwidth, the mode at 20 Hz, stiction, orthogonality.
#[derive(Clone, Debug)]
pub struct Gantry {
    axes: Vec<GantryAxis>,
    orthogonality_rad: f64,
    noise_m: f64,
    noise: Noise,
    environment: Environment,
}

impl Gantry {
    /// Creates the gantry of a cell description.
    pub fn from_cell(cell: &Cell) -> Self {
        let axes: Vec<AxisSimulation> = cell.axes.iter().map(|axis| axis.simulation).collect();
        let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
        Self::with_names(&axes, &cell.simulation, &names)
    }

    /// Creates a gantry of several axes; orthogonality couples the second into the first.
    pub fn new(axes: &[AxisSimulation], simulation: &Simulation) -> Self {
        Self::with_names(axes, simulation, &vec![""; axes.len()])
    }

    fn with_names(axes: &[AxisSimulation], simulation: &Simulation, names: &[&str]) -> Self {
        let mut gantry = Self {
            axes: axes.iter().map(GantryAxis::new).collect(),
            orthogonality_rad: simulation.orthogonality_rad,
            noise_m: simulation.encoder_noise_m,
            noise: Noise::new(simulation.seed),
            environment: Environment::new(simulation, names),
        };
        gantry.expose();
        gantry
    }

    /// Exposes every axis to the conditions of now.
    fn expose(&mut self) {
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.expose(self.environment.of(index));
        }
    }

    /// Returns the deflection of an axis' mode; 0 if the axis does not exist.
    pub fn deflection_m(&self, axis: usize) -> f64 {
        self.axes.get(axis).map_or(0.0, |axis| axis.state[2])
    }

    /// Sets the deflection of an axis' mode, as after a hammer blow, and its rate to 0.
    pub fn deflect(&mut self, axis: usize, deflection_m: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            (axis.state[2], axis.state[3]) = (deflection_m, 0.0);
        }
    }
}

impl Plant for Gantry {
    fn n_axes(&self) -> usize {
        self.axes.len()
    }

    fn step(&mut self, demand: &[Demand], dt_s: f64) {
        if self.environment.advance(dt_s) {
            self.expose();
        }
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.advance(demand.get(index).copied().unwrap_or(Demand::Off), dt_s);
            if self.noise_m > 0.0 {
                axis.noise_m = self.noise_m * self.noise.normal();
            }
        }
    }

    fn limit_force(&mut self, axis: usize, share: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.drive.force_max_n = axis.force_max_n * share;
        }
    }

    fn feed_force(&mut self, axis: usize, force_n: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.feedforward_n = force_n;
        }
    }

    fn encoder_m(&self, axis: usize) -> f64 {
        self.axes.get(axis).map_or(0.0, |axis| axis.state[0] + axis.noise_m)
    }

    fn encoder_velocity_m_s(&self, axis: usize) -> f64 {
        self.axes.get(axis).map_or(0.0, |axis| axis.state[1])
    }

    fn force_n(&self, axis: usize) -> f64 {
        self.axes.get(axis).map_or(0.0, |axis| axis.force_n)
    }

    fn tool_m(&self, axis: usize) -> f64 {
        let own_m = self.axes.get(axis).map_or(0.0, |axis| {
            let expansion = axis.expansion_per_k * axis.conditions.warming_k;
            axis.state[0] + axis.state[2] + expansion * axis.state[0]
        });
        match self.axes.get(1) {
            Some(second) if axis == 0 => own_m + self.orthogonality_rad * second.state[0],
            _ => own_m,
        }
    }
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small positive counts; what rests must rest to the last bit"
)]
mod tests;

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small positive counts; what is off must not change a bit"
)]
mod machine_tests;
