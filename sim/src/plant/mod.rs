//! Plants of the simulated drives: mechanics with the drives' own control loops.
//!
//! A plant knows physics and nothing of buses or counts; the drives of the simulator own one and
//! step it, and tests put one directly under a controller.

pub mod drive_loop;
pub mod exact_step;
pub mod friction;
mod gantry;
mod noise;

pub use gantry::{Gantry, GantryAxis};

/// Demand of a drive on its motor during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// No force and the brake on: the axis holds still.
    Off,
    /// Follow a position; the velocity is a feed-forward, normally 0.
    Position {
        /// Target position.
        position_m: f64,
        /// Added to the velocity that the position controller asks for.
        velocity_m_s: f64,
    },
    /// Follow a velocity.
    Velocity {
        /// Target velocity.
        velocity_m_s: f64,
    },
}

/// Axes with encoders, motors and a tool.
pub trait Plant: Send {
    /// Number of axes.
    fn n_axes(&self) -> usize;
    /// Advances by `dt_s`; axis `i` follows `demand[i]`, and is off where there is none.
    fn step(&mut self, demand: &[Demand], dt_s: f64);
    /// Lets the motor of an axis use only this share of its force from now on, 0 to 1; a plant without
    /// forces has nothing to limit.
    fn limit_force(&mut self, _axis: usize, _share: f64) {}
    /// Position at the axis' own encoder.
    fn encoder_m(&self, axis: usize) -> f64;
    /// Velocity at the axis' own encoder.
    fn encoder_velocity_m_s(&self, axis: usize) -> f64;
    /// Force of the motor during the last step.
    fn force_n(&self, axis: usize) -> f64;
    /// Coordinate of the tool centre point.
    fn tool_m(&self, axis: usize) -> f64;
}
