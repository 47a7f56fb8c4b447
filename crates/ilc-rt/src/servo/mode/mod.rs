//! Modes of operation in the loop, one per file: target, offsets, and start of a stop.
//!
//! For the other files of `servo`, which ask [`of`] and never distinguish modes. The cold half,
//! from the keys of a mode to its nominal model, is `config::mode`.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

mod csp;
mod cst;
mod csv;

use super::gate::{Bounds, Gate};
use super::phase::Phase;
use super::spec::AxisSpec;
use crate::control::{Cascade, CascadeGains};
use crate::fieldbus::cia402::{CommandRpdo1, InputKind, Mode, Scale};

/// An axis in a tick.
pub(super) struct Moment<'a> {
    pub(super) spec: &'a AxisSpec,
    pub(super) phase: &'a Phase,
    /// True if the drive follows its commands.
    pub(super) enabled: bool,
    pub(super) encoder_m: f64,
    /// Filtered difference of the encoder.
    pub(super) encoder_m_s: f64,
    /// Cycles since then without an answer.
    pub(super) unanswered: f64,
    pub(super) reference_m: f64,
    pub(super) reference_m_s: f64,
    pub(super) reference_m_s2: f64,
    /// Learned input.
    pub(super) input: f64,
    /// The last three commands, newest first.
    pub(super) last: [f64; 3],
    pub(super) bounds: Bounds,
}

impl Moment<'_> {
    /// Returns the part of the learned input that is added to a quantity.
    pub(super) fn input_to(&self, quantity: InputKind) -> f64 {
        if self.spec.input == quantity { self.input } else { 0.0 }
    }

    /// Returns the set point of a moving axis, ahead of the program by its lead. A stop begins at the last
    /// command, which has it already.
    pub(super) fn ahead_m(&self) -> f64 {
        match self.phase {
            Phase::Returning(_) | Phase::Settling { .. } | Phase::Running { .. } => {
                self.reference_m + self.spec.feedforward.lead_s * self.reference_m_s
            }
            _ => self.reference_m,
        }
    }

    /// Returns whether a drive follows a reference, so that feed-forwards act.
    pub(super) fn is_moving(&self) -> bool {
        let follows = matches!(
            self.phase,
            Phase::Returning(_)
                | Phase::Settling { .. }
                | Phase::Running { .. }
                | Phase::Stopping { .. }
        );
        self.enabled && follows
    }
}

/// State of an axis that its command depends on, from tick to tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisLoops {
    pub(super) gate: Gate,
    pub(super) cascade: Cascade,
    /// Last velocity offset.
    pub(super) velocity_offset: f64,
    /// Last torque offset.
    pub(super) force_offset_n: f64,
}

impl Default for AxisLoops {
    fn default() -> Self {
        Self {
            gate: Gate::default(),
            cascade: Cascade::new(CascadeGains::default(), 1.0),
            velocity_offset: 0.0,
            force_offset_n: 0.0,
        }
    }
}

impl AxisLoops {
    pub(super) fn new(spec: &AxisSpec, dt_s: f64) -> Self {
        Self { cascade: Cascade::new(spec.cascade, dt_s), ..Self::default() }
    }

    /// Starts at the current command, at rest.
    pub(super) fn begin(&mut self, command: f64) {
        self.gate.begin(command);
        self.cascade.reset();
        (self.velocity_offset, self.force_offset_n) = (0.0, 0.0);
    }

    /// Advances both offsets, bounded and without a jump; one that is not finite keeps its last value.
    pub(super) fn offset(&mut self, mode: &dyn AxisMode, now: &Moment<'_>) {
        let [mut velocity, mut force_n] = [0.0; 2];
        if now.is_moving() {
            velocity = mode.velocity_offset(now);
            force_n = now.spec.feedforward.force_n(now.reference_m_s, now.reference_m_s2)
                + now.input_to(InputKind::Torque);
        }
        let velocity =
            Gate::velocity_m_s(velocity, self.velocity_offset, now.encoder_m, &now.bounds);
        if velocity.is_finite() {
            self.velocity_offset = velocity;
        }
        let Some(force) = &now.spec.force else { return };
        let motion = [now.encoder_m, now.encoder_m_s];
        let force_n = Gate::force_n(force_n, self.force_offset_n, motion, force, &now.bounds);
        if force_n.is_finite() {
            self.force_offset_n = force_n;
        }
    }
}

/// The behaviour of a mode; commands are in its own unit.
pub(super) trait AxisMode: Sync {
    /// Returns the command of an axis at rest.
    fn hold(&self, position_m: f64) -> f64;

    /// Returns the bounded command of a tick; NaN passes through.
    fn target(&self, now: &Moment<'_>, loops: &mut AxisLoops) -> f64;

    /// Returns the wanted velocity offset (object 0x60B1) of a moving axis.
    fn velocity_offset(&self, _now: &Moment<'_>) -> f64 {
        0.0
    }

    /// Extrapolates the last three commands, newest first, for a tick without a finite one.
    fn extrapolate(&self, last: [f64; 3]) -> f64;

    /// Returns a command in counts; `None` for NaN.
    fn counts(&self, command: f64, scale: Scale) -> Option<i32>;

    /// Writes a command into the frame of the drive; NaN keeps the last one.
    fn write(&self, command: f64, now: &Moment<'_>, frame: &mut CommandRpdo1) {
        if let Some(counts) = self.counts(command, now.spec.scale) {
            frame.target_counts = counts;
        }
    }

    /// Returns the position that an axis is commanded to.
    fn position_m(&self, command: f64, reference_m: f64) -> f64;

    /// Returns velocity and acceleration of the last three commands: the initial state of a stop.
    fn motion(&self, last: [f64; 3], reference_m_s: f64, dt_s: f64) -> [f64; 2];

    /// Returns whether the command is computed from the measured position.
    fn closes_position_loop(&self) -> bool;

    /// Returns whether the command is computed from the measured velocity: a stop is then the quick
    /// stop of the drive, and implausible motion a reason for one.
    fn closes_velocity_loop(&self) -> bool {
        false
    }
}

/// Returns the behaviour of a mode.
pub(super) fn of(mode: Mode) -> &'static dyn AxisMode {
    match mode {
        Mode::Csp => &csp::Csp,
        Mode::Csv => &csv::Csv,
        Mode::Cst => &cst::Cst,
    }
}
