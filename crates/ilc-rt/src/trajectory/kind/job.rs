//! A program with everything needed to plan it, and the planning steps common to several kinds.

use super::program::{Program, Segment};
use crate::interpolate::{AxisLimits, AxisUnit, Interpolator};
use crate::trajectory::curve::{Curve, Run, RunLimits};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::motion::SampledMotion;
use crate::trajectory::path::{PathSegment, PathSpec};
use crate::trajectory::program::{GcodeError, TableError};

/// A refused program.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ProgramError {
    /// The plan.
    #[error(transparent)]
    Plan(#[from] TrajectoryError),
    /// A block of the part program.
    #[error(transparent)]
    Gcode(#[from] GcodeError),
    /// A row of the table.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// A program with its machine, and the content of its file.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// `[program]`
    pub program: &'a Program,
    /// Limits of each axis.
    pub limits: &'a [AxisLimits],
    /// Unit of each axis.
    pub units: &'a [AxisUnit],
    /// Name of each axis.
    pub axis_names: &'a [&'a str],
    /// Servo cycle.
    pub cycle_s: f64,
    /// Content of `file`; empty for kinds without a file.
    pub text: &'a [u8],
}

impl Job<'_> {
    /// Start in the plane of the first two axes.
    pub(super) fn start_m(&self) -> [f64; 2] {
        let start_m = &self.program.start_m;
        [start_m[0], start_m.get(1).copied().unwrap_or(0.0)]
    }

    /// Speed along a segment.
    pub(super) fn feed_m_s(&self, segment: &Segment) -> f64 {
        segment.feed_m_s.unwrap_or(self.program.feed_m_s)
    }

    /// Plans lines and arcs; `rapid` marks the segments that move as fast as the axes allow, up to
    /// their feed.
    pub(super) fn along_segments(
        &self,
        segments: Vec<PathSegment>,
        rapid: &[bool],
        dwell_s: f64,
    ) -> Result<Interpolator, ProgramError> {
        let spec = PathSpec {
            start_m: self.program.start_m.clone(),
            segments,
            blend_s: self.program.window_s(),
            dwell_before_s: self.program.dwell_before_s + dwell_s,
            dwell_after_s: self.program.dwell_after_s,
        };
        if spec.blend_s.is_none() {
            spec.check_feeds(self.limits, rapid)?;
        }
        Ok(Interpolator::plan(&spec, self.limits, self.cycle_s)?)
    }

    /// Plans a smooth curve.
    pub(super) fn along_curve(&self, curve: &impl Curve) -> Result<Interpolator, ProgramError> {
        let across = self.program.curvature_acceleration_max_m_s2;
        let limits = RunLimits {
            feed_m_s: self.program.feed_m_s,
            curvature_acceleration_max_m_s2: across.unwrap_or(f64::INFINITY),
            axes: self.limits.to_vec(),
        };
        self.play(Run::plan(curve, &limits, self.cycle_s)?.motion())
    }

    /// Plays a sampled motion between the rests of the program.
    pub(super) fn play(&self, motion: &SampledMotion) -> Result<Interpolator, ProgramError> {
        let (before_s, after_s) = (self.program.dwell_before_s, self.program.dwell_after_s);
        Ok(Interpolator::play(motion, before_s, after_s)?)
    }
}
