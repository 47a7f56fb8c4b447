//! Configuration of the servo cycle: its nodes, their limits, and its time-outs.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::time::Duration;

use super::inputs::InputSpec;
use crate::control::{CascadeGains, Feedforward, PositionLoop};
use crate::fieldbus::canopen::NodeId;
use crate::fieldbus::cia402::units::per_mille;
use crate::fieldbus::cia402::{InputKind, Mode, Scale};
use crate::interpolate::AxisLimits;
use crate::rt::Nanos;

/// Multiple of the acceleration limit by which a measured velocity may change per cycle.
const VELOCITY_JUMP: f64 = 4.0;
/// Share of the velocity limit, and counts per cycle, that it may change beyond that.
const NOISE_SHARE: f64 = 0.05;
const NOISE_COUNTS: f64 = 3.0;

/// One axis.
#[derive(Clone, Copy, Debug)]
pub struct AxisSpec {
    /// Node of the drive.
    pub node: NodeId,
    /// Command interface.
    pub mode: Mode,
    /// Counts of the drive's encoder.
    pub scale: Scale,
    /// Limits of motion.
    pub limits: AxisLimits,
    /// Lowest position.
    pub position_min_m: f64,
    /// Highest position.
    pub position_max_m: f64,
    /// Largest following error.
    pub following_error_max_m: f64,
    /// Position loop of a velocity-commanded drive; ignored otherwise.
    pub position_loop: PositionLoop,
    /// Quantity that the learned input is added to.
    pub input: InputKind,
    /// Bound of the learned input, in the unit of that quantity.
    pub input_max: f64,
    /// Cascade of a torque-commanded drive; ignored otherwise.
    pub cascade: CascadeGains,
    /// Share of a new velocity in the filtered one of the cascade; 1 without a filter.
    pub velocity_share: f64,
    /// Motor and mass; needed by everything in torque.
    pub force: Option<ForceSpec>,
    /// Static feed-forward of the program.
    pub feedforward: Feedforward,
}

impl AxisSpec {
    /// Returns whether the drive gets a velocity or torque offset with its command.
    pub fn has_offset(&self) -> bool {
        let default = self.mode.inputs()[0];
        let moves = Feedforward { velocity: 0.0, lead_s: 0.0, ..self.feedforward }
            != Feedforward::default();
        !self.mode.targets_torque()
            && (self.input != default || self.has_velocity_offset() || moves)
    }

    /// Returns whether the drive gets a velocity offset, in a frame of its own.
    pub fn has_velocity_offset(&self) -> bool {
        self.mode.targets_position()
            && (self.input == InputKind::Velocity || self.feedforward.velocity > 0.0)
    }

    /// Returns the change of the measured velocity from one answer to the next that no motion within
    /// the limits explains, with a margin for noise and for the resolution of the encoder.
    pub(super) fn velocity_jump_m_s(&self, dt_s: f64) -> f64 {
        VELOCITY_JUMP * self.limits.acceleration_max_m_s2 * dt_s
            + NOISE_SHARE * self.limits.velocity_max_m_s
            + NOISE_COUNTS / (self.scale.counts_per_m() * dt_s)
    }

    /// Returns the increase of force that must move an axis: it would accelerate it at its limit.
    pub(super) fn moving_force_n(&self) -> f64 {
        self.force.map_or(f64::INFINITY, |force| {
            force.mass_kg * self.limits.acceleration_max_m_s2 + force.coulomb_n
        })
    }

    /// Returns a force in thousandths of the rated torque, in the direction of the drive.
    pub(super) fn per_mille(&self, force_n: f64) -> i16 {
        let rated_n = self.force.map_or(f64::INFINITY, |force| force.rated_n);
        per_mille(self.scale.sign() * force_n, rated_n)
    }

    /// Returns the bound of the change of that rate from cycle to cycle, by the jerk limit. A set point passes
    /// it in the gate, with the program; the rate of a force is bounded by the jerk limit itself.
    pub fn input_bend_max(&self, dt_s: f64) -> f64 {
        match self.input {
            InputKind::Position | InputKind::Torque => f64::INFINITY,
            InputKind::Velocity => LEARNED_JERK * self.limits.jerk_max_m_s3 * dt_s * dt_s,
        }
    }

    /// Returns the rate limit of the learned input per cycle.
    pub fn input_step_max(&self, dt_s: f64) -> f64 {
        match self.input {
            InputKind::Position => self.limits.velocity_max_m_s * dt_s,
            InputKind::Velocity => self.limits.acceleration_max_m_s2 * dt_s,
            InputKind::Torque => {
                self.force.map_or(0.0, |force| force.mass_kg) * self.limits.jerk_max_m_s3 * dt_s
            }
        }
    }
}

/// Multiple of the jerk limit up to which a learned input may bend the motion. The program respects the
/// limit; what is learned on top of it answers friction and lags, and begins with its own value and rate.
pub(super) const LEARNED_JERK: f64 = 8.0;

/// Motor and mass of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceSpec {
    /// Force at 1000 thousandths of torque.
    pub rated_n: f64,
    /// Largest force that is ever commanded.
    pub max_n: f64,
    /// Moving mass.
    pub mass_kg: f64,
    /// Coulomb friction.
    pub coulomb_n: f64,
    /// Integral time of the drive's velocity loop; 0 for none.
    pub integral_time_s: f64,
}

/// A node that measures the tool centre point.
#[derive(Clone, Copy, Debug)]
pub struct ToolSpec {
    /// Its node.
    pub node: NodeId,
    /// Its counts.
    pub scale: Scale,
}

/// Source of the pace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The clock; answers that have not arrived are late.
    Clock,
    /// The nodes' answers (lock-step); there is no clock, and a node that is silent for this long
    /// is lost.
    Answers(Duration),
}

/// The whole cycle.
#[derive(Clone, Debug)]
pub struct ServoSpec {
    /// Axes in the order of the coordinates.
    pub axes: Vec<AxisSpec>,
    /// Tool measurement, if there is one.
    pub tool: Option<ToolSpec>,
    /// Digital inputs; those beyond [`INPUTS_MAX`](super::INPUTS_MAX) are ignored.
    pub inputs: Vec<InputSpec>,
    /// True if a press of a start button releases the run that waits.
    pub starts_on_input: bool,
    /// Servo cycle.
    pub cycle: Nanos,
    /// Source of the pace.
    pub pace: Pace,
    /// Number of the first run, and of the run after the last one.
    pub runs: std::ops::Range<u32>,
    /// Start of each run.
    pub start_m: Vec<f64>,
    /// Velocity of the move to the start.
    pub return_feed_m_s: f64,
    /// Velocity of the first move to the start, from wherever the axes are when their drives are enabled.
    pub approach_feed_m_s: f64,
    /// True if faults that drives have when the loop begins are reset; otherwise they end it.
    pub resets_faults: bool,
    /// Settling time between the arrival at the start and the run.
    pub settle_ticks: u32,
    /// Time-out for a drive to switch on.
    pub enable_ticks: u32,
    /// Consecutive unanswered cycles at which a node is lost.
    pub silent_cycles_max: u32,
    /// Consecutive overrun cycles at which the axes stop.
    pub overrun_cycles_max: u32,
    /// Missed cycles that are made up for, one after the other; more of them are skipped.
    pub catch_up_cycles_max: u32,
    /// Cycles for which the loop pauses, sending nothing, when nodes stop answering; 0 for real
    /// nodes, which would move on.
    pub hold_cycles_max: u32,
}

impl ServoSpec {
    /// Forgives overruns of up to so many cycles, unless every one stops the axes. Cold.
    pub fn forgive_overruns(&mut self, n_cycles: u32) {
        if self.overrun_cycles_max > 0 {
            self.overrun_cycles_max = self.overrun_cycles_max.max(n_cycles);
        }
    }
}
