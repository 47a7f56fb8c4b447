//! The state of a motion at one time, and a whole motion as tables.

use crate::interpolate::{AxisLimits, Interpolator, MAX_AXES};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{CYCLE_S, check_time, n_ticks_after};
use crate::trajectory::path::PathSpec;
use crate::trajectory::verify::Verification;

/// Position and its derivatives at one time; axes beyond the motion's own stay at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// Position.
    pub position_m: [f64; MAX_AXES],
    /// Velocity.
    pub velocity_m_s: [f64; MAX_AXES],
    /// Acceleration.
    pub acceleration_m_s2: [f64; MAX_AXES],
    /// Jerk; at a switching time, that of one of the two sides.
    pub jerk_m_s3: [f64; MAX_AXES],
}

impl MotionState {
    /// Returns a state at rest.
    pub fn at_rest(position_m: [f64; MAX_AXES]) -> Self {
        Self {
            position_m,
            velocity_m_s: [0.0; MAX_AXES],
            acceleration_m_s2: [0.0; MAX_AXES],
            jerk_m_s3: [0.0; MAX_AXES],
        }
    }
}

/// A motion as tables of equal length, time first, rows of `n_axes`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampledMotion {
    /// Time between two samples.
    pub dt_s: f64,
    /// Number of axes.
    pub n_axes: usize,
    /// Positions.
    pub position_m: Vec<f64>,
    /// Velocities.
    pub velocity_m_s: Vec<f64>,
    /// Accelerations.
    pub acceleration_m_s2: Vec<f64>,
    /// Position of the program at each sample, without limits.
    pub programmed_m: Vec<f64>,
}

impl SampledMotion {
    /// Samples a motion at 0, `dt_s`, … up to the first sample at or after `duration_s`.
    ///
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// [`TrajectoryError`] if `dt_s` is out of range or there would be too
    /// many samples.
    pub fn sample(
        duration_s: f64,
        dt_s: f64,
        n_axes: usize,
        mut at: impl FnMut(f64) -> (MotionState, [f64; MAX_AXES]),
    ) -> Result<Self, TrajectoryError> {
        check_time("sample time", dt_s, CYCLE_S)?;
        let n_samples = n_ticks_after(duration_s, dt_s)? + 1;
        let mut motion = Self { dt_s, n_axes, ..Self::default() };
        for k in 0..n_samples {
            let (state, programmed_m) = at(k as f64 * dt_s);
            motion.position_m.extend_from_slice(&state.position_m[..n_axes]);
            motion.velocity_m_s.extend_from_slice(&state.velocity_m_s[..n_axes]);
            motion.acceleration_m_s2.extend_from_slice(&state.acceleration_m_s2[..n_axes]);
            motion.programmed_m.extend_from_slice(&programmed_m[..n_axes]);
        }
        Ok(motion)
    }

    /// Plans a path, and samples it as the loop plays it.
    ///
    /// The accelerations are central differences of the velocities: at rest at both ends.
    ///
    /// # Shapes
    /// - `limits`: one entry for each coordinate of `spec.start_m`
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// Those of [`Interpolator::plan`].
    pub fn of_path(
        spec: &PathSpec,
        limits: &[AxisLimits],
        dt_s: f64,
    ) -> Result<Self, TrajectoryError> {
        let mut plan = Interpolator::plan(spec, limits, dt_s)?;
        let n_axes = plan.n_axes();
        let mut motion = Self { dt_s, n_axes, ..Self::default() };
        for _ in 0..plan.n_samples() {
            let setpoint = plan.next();
            motion.position_m.extend_from_slice(&setpoint.position_m[..n_axes]);
            motion.velocity_m_s.extend_from_slice(&setpoint.velocity_m_s[..n_axes]);
        }
        let v = &motion.velocity_m_s;
        let inside = |i: &usize| *i >= n_axes && *i + n_axes < v.len();
        let acceleration = |i: usize| (v[i + n_axes] - v[i - n_axes]) / (2.0 * dt_s);
        motion.acceleration_m_s2 =
            (0..v.len()).map(|i| Some(i).filter(inside).map_or(0.0, acceleration)).collect();
        motion.programmed_m.clone_from(&motion.position_m);
        Ok(motion)
    }

    /// Verifies the set points: their finite differences over the sample time, from rest to rest,
    /// are within the limits.
    ///
    /// # Shapes
    /// - `limits`: one entry per axis
    /// # Real Time
    /// Cold.
    /// # Errors
    /// [`TrajectoryError::SetPoint`] for the first set point that violates a limit.
    pub fn verified(self, limits: &[AxisLimits]) -> Result<Self, TrajectoryError> {
        if limits.len() != self.n_axes {
            let (found, expected) = (limits.len(), self.n_axes);
            return Err(TrajectoryError::LimitCount { found, expected });
        }
        Verification::of_motion(&self.position_m, limits, self.dt_s).accept(&self.position_m)?;
        Ok(self)
    }

    /// Appends a motion that begins where the first one rests.
    pub(in crate::trajectory) fn append(&mut self, next: &Self) {
        let skipped = if self.position_m.is_empty() { 0 } else { next.n_axes };
        self.position_m.extend_from_slice(&next.position_m[skipped..]);
        self.velocity_m_s.extend_from_slice(&next.velocity_m_s[skipped..]);
        self.acceleration_m_s2.extend_from_slice(&next.acceleration_m_s2[skipped..]);
        self.programmed_m.extend_from_slice(&next.programmed_m[skipped..]);
    }

    /// Returns the number of samples.
    pub fn n_samples(&self) -> usize {
        self.position_m.len() / self.n_axes.max(1)
    }
}
