//! The gantry of Haas et al. (2016): axes with cascades, stiction, a swinging crossbeam, and an
//! orthogonality error.

use std::f64::consts::TAU;

use ilc_rt::config::{AxisSimulation, Cell, Simulation};

use super::drive_loop::DriveLoop;
use super::exact_step::{ExactStep, Mechanics, State};
use super::friction::Friction;
use super::noise::Noise;
use super::{Demand, Plant};

/// Step that the axes are prepared for; another one costs a preparation when it first occurs.
const STEP_S: f64 = 125e-6;

/// One axis: mechanics, friction, and the drive's own loops.
#[derive(Clone, Copy, Debug)]
pub struct GantryAxis {
    mechanics: Mechanics,
    friction: Friction,
    drive: DriveLoop,
    /// Largest force of the motor; the drive may allow less.
    force_max_n: f64,
    step: ExactStep,
    state: State,
    integral_n: f64,
    force_n: f64,
    /// Error of the encoder in this step.
    noise_m: f64,
}

impl GantryAxis {
    /// Creates an axis at rest at its start position.
    pub fn new(simulation: &AxisSimulation) -> Self {
        let mechanics = Mechanics {
            carriage_kg: simulation.mass_kg - simulation.mode_mass_kg,
            mode_kg: simulation.mode_mass_kg,
            mode_rad_s: TAU * simulation.mode_frequency_hz,
            mode_damping: simulation.mode_damping,
        };
        Self {
            mechanics,
            friction: Friction {
                coulomb_n: simulation.coulomb_n,
                static_n: simulation.static_n,
                stribeck_m_s: simulation.stribeck_m_s,
            },
            drive: DriveLoop::tuned(
                simulation.mass_kg,
                TAU * simulation.natural_frequency_hz,
                simulation.damping,
                simulation.integral_time_s,
                simulation.force_max_n,
            ),
            force_max_n: simulation.force_max_n,
            step: ExactStep::new(&mechanics, STEP_S),
            state: [simulation.position_start_m, 0.0, 0.0, 0.0],
            integral_n: 0.0,
            force_n: 0.0,
            noise_m: 0.0,
        }
    }

    fn advance(&mut self, demand: Demand, dt_s: f64) {
        if self.step.dt_s.to_bits() != dt_s.to_bits() {
            self.step = ExactStep::new(&self.mechanics, dt_s);
        }
        self.force_n = self.drive.force_n(
            demand,
            self.state[0] + self.noise_m,
            self.state[1],
            &mut self.integral_n,
            dt_s,
        );
        // The brake holds as much as the motor's maximum force.
        let brake_n = if demand == Demand::Off { self.force_max_n } else { 0.0 };
        self.state = self.friction.step(&self.step, &self.state, self.force_n, brake_n);
    }
}

/// Axes under one tool: only the tool sees the crossbeam's mode and the orthogonality error.
///
/// `tool_0 = x_0 + q_0 + orthogonality · x_1`, `tool_i = x_i + q_i`
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
}

impl Gantry {
    /// Creates the gantry of a cell description.
    pub fn from_cell(cell: &Cell) -> Self {
        let axes: Vec<AxisSimulation> = cell.axes.iter().map(|axis| axis.simulation).collect();
        Self::new(&axes, &cell.simulation)
    }

    /// Creates a gantry of several axes; orthogonality couples the second into the first.
    pub fn new(axes: &[AxisSimulation], simulation: &Simulation) -> Self {
        Self {
            axes: axes.iter().map(GantryAxis::new).collect(),
            orthogonality_rad: simulation.orthogonality_rad,
            noise_m: simulation.encoder_noise_m,
            noise: Noise::new(simulation.seed),
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
        let own_m = self.axes.get(axis).map_or(0.0, |axis| axis.state[0] + axis.state[2]);
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
