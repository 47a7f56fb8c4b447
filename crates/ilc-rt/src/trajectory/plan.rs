//! From a path, a dwell or a sampled motion to an [`Interpolator`].
//!
//! `design` and the Python bindings plan here; the loop only plays. The set points of every kind of
//! plan are verified before they are played.

use super::error::TrajectoryError;
use super::grid::{CYCLE_S, DWELL_MAX_S, check_time, n_ticks, n_ticks_after};
use super::motion::SampledMotion;
use super::path::{BlendedPath, PathSpec, point};
use super::verify::Verification;
use crate::interpolate::exact_stop::ExactStop;
use crate::interpolate::interpolator::Motion;
use crate::interpolate::table::Table;
use crate::interpolate::{AxisLimits, Interpolator, MAX_AXES, MoveError, Setpoint};

impl Interpolator {
    /// Plans a run; every set point satisfies the limits of every axis.
    ///
    /// With exact stops each segment is a jerk-limited move, no faster than its feed. A blended
    /// path keeps its feed, through an average over the window and a second, shorter one that
    /// planning chooses for the jerk; its set points are generated once and their finite
    /// differences over the cycle compared with the limits.
    ///
    /// # Shapes
    /// - `limits`: one entry for each coordinate of `spec.start_m`, 1 to [`MAX_AXES`]
    /// # Real Time
    /// Cold: allocates, and traverses a blended run several times.
    /// # Errors
    /// [`TrajectoryError`] for values out of range, and [`TrajectoryError::Exceeds`] for a blended
    /// path that violates a limit: it is refused with the admissible feed, never slowed down.
    pub fn plan(
        spec: &PathSpec,
        limits: &[AxisLimits],
        cycle_s: f64,
    ) -> Result<Self, TrajectoryError> {
        let legs = spec.legs(limits, cycle_s)?;
        let (start_s, n_axes) = (spec.dwell_before_s, spec.start_m.len());
        let (motion, rest_tick) = match spec.blend_s {
            None => {
                let moves = ExactStop::plan(&legs, start_s, limits)?;
                let rest_tick = n_ticks_after(moves.end_s(), cycle_s)?;
                (Motion::ExactStop(moves), rest_tick)
            }
            Some(window_s) => {
                let path = BlendedPath { legs: &legs, start_s, limits, cycle_s };
                let (blend, rest_tick) = path.plan(window_s)?;
                (Motion::Blend(blend), rest_tick)
            }
        };
        let n_samples = rest_tick + n_ticks(spec.dwell_after_s, cycle_s)? + 1;
        let plan = Self::new(motion, n_axes, cycle_s, n_samples);
        // A blended path is verified already.
        if spec.blend_s.is_none() { plan.verified(limits) } else { Ok(plan) }
    }

    /// Holds a point for some samples, e.g. while an axis is identified.
    ///
    /// # Shapes
    /// - `at_m`: one coordinate per axis, 1 to [`MAX_AXES`]
    /// # Real Time
    /// Cold.
    /// # Errors
    /// [`TrajectoryError`] for another number of axes, a point or cycle out of range, or 0 samples.
    pub fn hold(at_m: &[f64], n_samples: usize, cycle_s: f64) -> Result<Self, TrajectoryError> {
        let n_axes = at_m.len();
        if !(1..=MAX_AXES).contains(&n_axes) {
            return Err(MoveError::Axes { n_axes }.into());
        }
        check_time("cycle", cycle_s, CYCLE_S)?;
        if n_samples == 0 {
            return Err(TrajectoryError::Empty);
        }
        let setpoint = Setpoint::at_rest(point(at_m)?);
        Ok(Self::new(Motion::Hold(setpoint), n_axes, cycle_s, n_samples))
    }

    /// Plays a precomputed motion, from rest to rest, with dwells around it.
    ///
    /// # Real Time
    /// Cold: copies the motion.
    /// # Errors
    /// [`TrajectoryError`] for a dwell out of range, or a motion with 0 or too many samples.
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
        let (cycle_s, n_axes) = (motion.dt_s, motion.n_axes);
        let rest_ticks = n_ticks(dwell_before_s, cycle_s)?;
        let table = Table::new(&motion.position_m, &motion.velocity_m_s, n_axes, rest_ticks);
        let n_samples = table.rest_tick() + n_ticks(dwell_after_s, cycle_s)? + 1;
        Ok(Self::new(Motion::Table(table), n_axes, cycle_s, n_samples))
    }

    /// Verifies the set points of the run, whatever its plan: their finite differences over the
    /// cycle, from rest to rest, are within the limits.
    ///
    /// # Shapes
    /// - `limits`: one entry per axis
    /// # Real Time
    /// Cold: allocates, and traverses the run.
    /// # Errors
    /// [`TrajectoryError::SetPoint`] for the first set point that violates a limit.
    pub fn verified(self, limits: &[AxisLimits]) -> Result<Self, TrajectoryError> {
        if limits.len() != self.n_axes() {
            let (found, expected) = (limits.len(), self.n_axes());
            return Err(TrajectoryError::LimitCount { found, expected });
        }
        let reference_m = self.reference();
        Verification::of_motion(&reference_m, limits, self.cycle_s()).accept(&reference_m)?;
        Ok(self)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests;
