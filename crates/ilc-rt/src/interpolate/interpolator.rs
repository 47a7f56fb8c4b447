//! The set points of a run, one a tick.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::MAX_AXES;
use super::blend::Blend;
use crate::trajectory::error::TrajectoryError;
use super::exact_stop::ExactStop;
use super::limits::AxisLimits;
use crate::trajectory::motion::SampledMotion;
use crate::trajectory::path::{self, CornerRule, DWELL_MAX_S, PathSpec, check_time};
use crate::trajectory::path::blended::{self, Proof};
use super::setpoint::Setpoint;
use super::table::Table;
use crate::trajectory::verify::Verification;

/// How the corners of this run are taken.
#[derive(Clone, Debug)]
enum Motion {
    ExactStop(ExactStop),
    Blend(Blend),
    Hold(Setpoint),
    Table(Table),
}

/// A planned run: rest, path, rest.
#[derive(Clone, Debug)]
pub struct Interpolator {
    motion: Motion,
    n_axes: usize,
    cycle_s: f64,
    n_samples: usize,
    tick: usize,
}

impl Interpolator {
    /// Plans a run; every set point that it will give holds the limits of every axis.
    ///
    /// With exact stops each segment is a jerk-limited move, no faster than its feed. A blended path
    /// keeps its feed, through an average of the window and a second, shorter one that planning
    /// chooses for the jerk; its set points are generated here once and their finite differences
    /// over the cycle compared with the limits.
    ///
    /// # Shapes
    /// - `limits`: one entry for each coordinate of `spec.start_m`, 1 to [`MAX_AXES`]
    /// # Real Time
    /// Cold: allocates, and walks through a blended run several times.
    /// # Errors
    /// [`TrajectoryError`] for values out of range, and [`TrajectoryError::Exceeds`] for a blended
    /// path that breaks a limit: it is refused with the feed that would do, never slowed down.
    pub fn plan(
        spec: &PathSpec,
        limits: &[AxisLimits],
        cycle_s: f64,
    ) -> Result<Self, TrajectoryError> {
        let elements = spec.elements(limits, cycle_s)?;
        let (motion, rest_tick) = match spec.corner {
            CornerRule::ExactStop => {
                let moves = ExactStop::plan(spec, &elements, limits)?;
                let rest_tick = blended::n_ticks_after(moves.end_s(), cycle_s)?;
                (Motion::ExactStop(moves), rest_tick)
            }
            CornerRule::Blend { window_s } => {
                let (blend, rest_tick) =
                    Proof { spec, elements: &elements, limits, cycle_s }.plan(window_s)?;
                (Motion::Blend(blend), rest_tick)
            }
        };
        let n_samples = rest_tick + blended::n_ticks(spec.dwell_after_s, cycle_s)? + 1;
        let plan = Self { motion, n_axes: spec.start_m.len(), cycle_s, n_samples, tick: 0 };
        // A blended path has been through its proof already.
        if spec.corner == CornerRule::ExactStop { plan.verified(limits) } else { Ok(plan) }
    }

    /// Rests at a point for some samples, as while an axis is identified.
    ///
    /// # Shapes
    /// - `at_m`: one coordinate for each axis, 1 to [`MAX_AXES`]
    /// # Real Time
    /// Cold.
    /// # Errors
    /// [`TrajectoryError`] for another number of axes, a point or cycle out of range, or no samples.
    pub fn hold(at_m: &[f64], n_samples: usize, cycle_s: f64) -> Result<Self, TrajectoryError> {
        let n_axes = at_m.len();
        if !(1..=MAX_AXES).contains(&n_axes) {
            return Err(TrajectoryError::Axes { n_axes });
        }
        check_time("cycle", cycle_s, path::CYCLE_S)?;
        if n_samples == 0 {
            return Err(TrajectoryError::Empty);
        }
        let setpoint = Setpoint::at_rest(path::point(at_m)?);
        Ok(Self { motion: Motion::Hold(setpoint), n_axes, cycle_s, n_samples, tick: 0 })
    }

    /// Plays a motion that was worked out beforehand, from rest to rest, with rests around it.
    ///
    /// # Real Time
    /// Cold: copies the motion.
    /// # Errors
    /// [`TrajectoryError`] for a rest out of range, a motion of no samples, or too many.
    pub fn play(
        motion: &SampledMotion,
        dwell_before_s: f64,
        dwell_after_s: f64,
    ) -> Result<Self, TrajectoryError> {
        check_time("dwell before", dwell_before_s, (0.0, DWELL_MAX_S))?;
        check_time("dwell after", dwell_after_s, (0.0, DWELL_MAX_S))?;
        if motion.n_samples() == 0 {
            return Err(TrajectoryError::Empty);
        }
        let cycle_s = motion.dt_s;
        let table = Table::new(motion, blended::n_ticks(dwell_before_s, cycle_s)?);
        let n_samples = table.rest_tick() + blended::n_ticks(dwell_after_s, cycle_s)? + 1;
        let motion = Self {
            motion: Motion::Table(table),
            n_axes: motion.n_axes,
            cycle_s,
            n_samples,
            tick: 0,
        };
        Ok(motion)
    }

    /// Verifies the set points of the run, whatever it was planned by: their finite differences over
    /// the cycle, from rest to rest, are within the limits.
    ///
    /// # Shapes
    /// - `limits`: one entry an axis
    /// # Real Time
    /// Cold: allocates, and walks through the run.
    /// # Errors
    /// [`TrajectoryError::SetPoint`] for the first set point that breaks a limit.
    pub fn verified(self, limits: &[AxisLimits]) -> Result<Self, TrajectoryError> {
        if limits.len() != self.n_axes {
            let (found, expected) = (limits.len(), self.n_axes);
            return Err(TrajectoryError::LimitCount { found, expected });
        }
        let reference_m = self.reference();
        Verification::of_motion(&reference_m, limits, self.cycle_s).accept(&reference_m)?;
        Ok(self)
    }

    /// Goes back to the first set point.
    ///
    /// # Real Time
    /// Hot; a blended path refills its filters, in the order of the windows.
    pub fn restart(&mut self) {
        self.tick = 0;
        match &mut self.motion {
            Motion::ExactStop(moves) => moves.restart(),
            Motion::Blend(blend) => blend.restart(),
            Motion::Hold(_) | Motion::Table(_) => {}
        }
    }

    /// The set point of the next tick; the first call gives the start, and the last set point, which
    /// says `done`, is repeated for ever.
    ///
    /// # Real Time
    /// Hot, allocates nothing.
    #[expect(
        clippy::should_implement_trait,
        reason = "the set points do not end: the last one is held"
    )]
    pub fn next(&mut self) -> Setpoint {
        let done = self.tick + 1 >= self.n_samples;
        let setpoint = match &mut self.motion {
            Motion::ExactStop(moves) => moves.at(self.tick as f64 * self.cycle_s),
            Motion::Blend(blend) => blend.next(),
            Motion::Hold(setpoint) => *setpoint,
            Motion::Table(table) => table.at(self.tick),
        };
        if !done {
            self.tick += 1;
        }
        Setpoint { done, ..setpoint }
    }

    /// Number of samples of the run, the first and the last included.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Number of axes.
    pub fn n_axes(&self) -> usize {
        self.n_axes
    }

    /// The servo cycle for which the run was planned.
    pub fn cycle_s(&self) -> f64 {
        self.cycle_s
    }

    /// All set points of the run, by running a copy: the same numbers bit by bit as in the loop.
    ///
    /// # Shapes
    /// - returns `n_samples * n_axes`, time first, in metres
    /// # Real Time
    /// Cold: allocates.
    #[expect(clippy::disallowed_methods, reason = "cold: laid out once a campaign")]
    pub fn reference(&self) -> Vec<f64> {
        let mut copy = self.clone();
        copy.restart();
        let mut reference_m = Vec::with_capacity(self.n_samples * self.n_axes);
        for _ in 0..self.n_samples {
            let setpoint = copy.next();
            reference_m.extend_from_slice(&setpoint.position_m[..self.n_axes]);
        }
        reference_m
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests;
