//! Plants of the simulated drives: mechanics with the drives' own control loops.
//!
//! A plant knows physics, not buses or counts; the simulator's drives own one and step it, and
//! tests connect one directly to a controller.

mod backlash;
mod bristles;
mod delta;
pub mod drive_loop;
mod environment;
pub mod exact_step;
pub mod friction;
mod gantry;
mod mechanisms;
mod noise;

pub use delta::Delta;
pub use gantry::{Gantry, GantryAxis};
pub use mechanisms::Mechanisms;

/// Demand of a drive on its motor during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// No force and the brake on: the axis holds still.
    Off,
    /// Follow a position; the velocity is a feed-forward, normally 0.
    Position {
        /// Target position.
        position_m: f64,
        /// Feed-forward added to the position controller's output.
        velocity_m_s: f64,
    },
    /// Follow a velocity.
    Velocity {
        /// Target velocity.
        velocity_m_s: f64,
    },
    /// Apply a force; the drive closes no loop.
    Force {
        /// Target force.
        force_n: f64,
    },
}

/// Measurements of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Measured {
    /// Position of the encoder.
    pub position_m: f64,
    /// Velocity of the encoder.
    pub velocity_m_s: f64,
    /// Force of the motor.
    pub force_n: f64,
}

/// Axes with encoders, motors and a tool.
pub trait Plant: Send {
    /// Returns the number of axes.
    fn n_axes(&self) -> usize;
    /// Advances by `dt_s`; axis `i` follows `demand[i]`, and is off without one.
    fn step(&mut self, demand: &[Demand], dt_s: f64);
    /// Limits the force of an axis' motor to this share from now on, 0 to 1; a plant without forces
    /// ignores it.
    fn limit_force(&mut self, _axis: usize, _share: f64) {}
    /// Adds this force to those of the drive's own loops from now on; a plant without forces ignores
    /// it.
    fn feed_force(&mut self, _axis: usize, _force_n: f64) {}
    /// Returns the position at the axis' own encoder.
    fn encoder_m(&self, axis: usize) -> f64;
    /// Returns the velocity at the axis' own encoder.
    fn encoder_velocity_m_s(&self, axis: usize) -> f64;
    /// Returns the force of the motor during the last step.
    fn force_n(&self, axis: usize) -> f64;
    /// Returns all that the drive of an axis measures.
    fn measured(&self, axis: usize) -> Measured {
        Measured {
            position_m: self.encoder_m(axis),
            velocity_m_s: self.encoder_velocity_m_s(axis),
            force_n: self.force_n(axis),
        }
    }
    /// Returns a coordinate of the tool centre point.
    fn tool_m(&self, axis: usize) -> f64;
}
