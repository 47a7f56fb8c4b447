//! Modes of operation in the loop, one per file: target, rate limit of the learned input, start of
//! a stop.
//!
//! For the other files of `servo`, which ask [`of`] and never distinguish modes. The cold half,
//! from the unit of the input to the nominal model, is `config::mode`.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

mod csp;
mod csv;

use super::gate::{Bounds, Gate};
use super::phase::Phase;
use super::spec::AxisSpec;
use crate::fieldbus::cia402::{CommandRpdo1, Mode, Scale};
use crate::interpolate::AxisLimits;

/// An axis in a tick.
pub(super) struct Moment<'a> {
    pub(super) spec: &'a AxisSpec,
    pub(super) phase: &'a Phase,
    /// True if the drive follows its commands.
    pub(super) enabled: bool,
    pub(super) encoder_m: f64,
    pub(super) reference_m: f64,
    pub(super) reference_m_s: f64,
    /// Learned input.
    pub(super) input: f64,
    /// The last two commands, newest first.
    pub(super) last: [f64; 2],
    pub(super) bounds: Bounds,
}

/// The behaviour of a mode; commands are in its own unit.
pub(super) trait AxisMode: Sync {
    /// Returns the rate limit of the learned input per cycle.
    fn input_step_max(&self, limits: &AxisLimits, dt_s: f64) -> f64;

    /// Returns the command of an axis at rest.
    fn hold(&self, position_m: f64) -> f64;

    /// Returns the bounded command of a tick; NaN passes through.
    fn target(&self, now: &Moment<'_>, gate: &mut Gate) -> f64;

    /// Extrapolates the last three commands, newest first, for a tick without a finite one.
    fn extrapolate(&self, last: [f64; 3]) -> f64;

    /// Returns a command in counts; `None` for NaN.
    fn counts(&self, command: f64, scale: Scale) -> Option<i32>;

    /// Writes a command into the frame of the drive; NaN keeps the last one.
    fn write(&self, command: f64, scale: Scale, frame: &mut CommandRpdo1) {
        if let Some(counts) = self.counts(command, scale) {
            frame.target_counts = counts;
        }
    }

    /// Returns the position that an axis is commanded to.
    fn position_m(&self, command: f64, reference_m: f64) -> f64;

    /// Returns velocity and acceleration of the last three commands: the initial state of a stop.
    fn motion(&self, last: [f64; 3], dt_s: f64) -> [f64; 2];

    /// Returns whether the command is computed from the measured position.
    fn closes_position_loop(&self) -> bool;
}

/// Returns the behaviour of a mode.
pub(super) fn of(mode: Mode) -> &'static dyn AxisMode {
    match mode {
        Mode::Csp => &csp::Csp,
        Mode::Csv => &csv::Csv,
    }
}
