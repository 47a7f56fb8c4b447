//! Jerk-limited linear interpolation of a program of moves, in the two settings of machine
//! controllers.
//!
//! A move takes longer than `length / feed`. Either every move is completed, and an oscillating
//! program loses frequency; or the next one starts on time, and it loses amplitude.

use crate::interpolate::JerkLimited;
use crate::interpolate::MAX_AXES;
use crate::interpolate::line::Line;
use crate::interpolate::{AxisLimits, MoveError, PathLimits};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::motion::MotionState;
use crate::trajectory::path::{PathSegment, checked_lines};
mod to_rest;

use self::to_rest::{AxisState, ToRest};

/// Start of the next move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSetting {
    /// At the end of the one before it: amplitude is kept, frequency falls.
    CompleteEveryMove,
    /// At its programmed time: frequency is kept, amplitude falls.
    StartOnTime,
}

/// Execution of a move.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a tick reads one of a table; boxes would scatter it"
)]
enum Course {
    /// Straight, from rest to rest.
    Straight(Line, JerkLimited),
    /// Every axis from its current state.
    Axes([ToRest; MAX_AXES]),
}

#[derive(Clone, Debug)]
struct Move {
    course: Course,
    start_s: f64,
}

/// A planned program of straight moves from rest to rest.
#[derive(Clone, Debug)]
pub struct Linear {
    moves: Box<[Move]>,
    lines: Box<[(Line, f64)]>,
    n_axes: usize,
    duration_s: f64,
    nominal_s: f64,
}

impl Linear {
    /// Plans a program.
    ///
    /// A move from rest has seven phases of jerk along its line, synchronised over the axes by a
    /// common profile. A move that begins while the axes are still moving takes each axis from its
    /// state to the target, all arriving together if possible.
    ///
    /// # Shapes
    /// - `limits`: one entry for each coordinate of `start_m`, 1 to [`MAX_AXES`](crate::interpolate::MAX_AXES)
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// [`TrajectoryError`] for values out of range.
    /// # Source
    /// - \[dimarco2016\], Chapter 2: both settings and their costs
    pub fn plan(
        start_m: &[f64],
        segments: &[PathSegment],
        limits: &[AxisLimits],
        setting: LinearSetting,
    ) -> Result<Self, TrajectoryError> {
        let lines = checked_lines(start_m, segments, limits)?;
        let all_limits = AxisLimits::padded(limits);
        let mut moves: Vec<Move> = Vec::with_capacity(lines.len());
        let mut program: Vec<(Line, f64)> = Vec::with_capacity(lines.len());
        let (mut start_s, mut nominal_s, mut end_s) = (0.0, 0.0, 0.0_f64);
        for (line, segment) in lines.iter().zip(segments) {
            let now = moves.last().map(|last: &Move| state(last, start_s));
            let resting = now.is_none_or(|axes| {
                axes.iter()
                    .zip(line.from_m)
                    .all(|(axis, from_m)| *axis == AxisState { p: from_m, ..AxisState::default() })
            });
            let course = match now {
                Some(axes) if !resting => {
                    Course::Axes(together(&axes, line, &all_limits, segment.feed_m_s))
                }
                _ => {
                    let along = PathLimits::along(&line.direction, limits, segment.feed_m_s);
                    Course::Straight(*line, JerkLimited::along(line.length_m, &along)?)
                }
            };
            end_s = start_s
                + match &course {
                    Course::Straight(_, profile) => profile.duration_s(),
                    Course::Axes(axes) => axes.iter().map(ToRest::duration_s).fold(0.0, f64::max),
                };
            if !end_s.is_finite() {
                return Err(MoveError::Duration { length: line.length_m, duration_s: end_s }.into());
            }
            moves.push(Move { course, start_s });
            program.push((*line, nominal_s));
            nominal_s += line.length_m / segment.feed_m_s;
            start_s = match setting {
                LinearSetting::CompleteEveryMove => end_s,
                LinearSetting::StartOnTime => nominal_s,
            };
        }
        Ok(Self {
            moves: moves.into_boxed_slice(),
            lines: program.into_boxed_slice(),
            n_axes: start_m.len(),
            duration_s: end_s,
            nominal_s,
        })
    }

    /// Duration until every axis rests.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.n_axes
    }

    /// Returns the state at a time from the start; at rest before it and, at the last target, after
    /// the end.
    ///
    /// # Real Time
    /// Hot: does not allocate.
    pub fn at(&self, t_s: f64) -> MotionState {
        let at = self.moves.partition_point(|planned| planned.start_s <= t_s).max(1) - 1;
        let mut found = MotionState::at_rest([0.0; MAX_AXES]);
        let Some(planned) = self.moves.get(at) else { return found };
        for (axis, state) in state(planned, t_s.max(0.0)).into_iter().enumerate() {
            found.position_m[axis] = state.p;
            found.velocity_m_s[axis] = state.v;
            found.acceleration_m_s2[axis] = state.a;
            found.jerk_m_s3[axis] = state.j;
        }
        found
    }

    /// Position of the program at a time, without limits.
    pub fn programmed_m(&self, t_s: f64) -> [f64; MAX_AXES] {
        let at = self.lines.partition_point(|(_, start_s)| *start_s <= t_s).max(1) - 1;
        let Some((line, start_s)) = self.lines.get(at) else { return [0.0; MAX_AXES] };
        let end_s = self.lines.get(at + 1).map(|(_, end_s)| *end_s);
        let duration_s = end_s.unwrap_or(self.nominal_s) - start_s;
        let share = ((t_s - start_s) / duration_s).clamp(0.0, 1.0);
        line.point_m(share * line.length_m)
    }

    /// Duration of the program without limits.
    pub fn nominal_s(&self) -> f64 {
        self.nominal_s
    }
}

/// Returns the state of every axis at a time of the run not before the move.
fn state(planned: &Move, t_s: f64) -> [AxisState; MAX_AXES] {
    let t_s = t_s - planned.start_s;
    match &planned.course {
        Course::Axes(axes) => std::array::from_fn(|axis| axes[axis].at(t_s)),
        Course::Straight(line, profile) => {
            let along = profile.at(t_s);
            let point_m = line.point_m(along.s_m);
            std::array::from_fn(|axis| {
                let share = line.direction[axis];
                AxisState {
                    p: point_m[axis],
                    v: share * along.v_m_s,
                    a: share * along.a_m_s2,
                    j: share * along.j_m_s3,
                }
            })
        }
    }
}

/// Moves every axis to the end of a line, all arriving with the slowest.
fn together(
    now: &[AxisState; MAX_AXES],
    line: &Line,
    limits: &[AxisLimits; MAX_AXES],
    feed_m_s: f64,
) -> [ToRest; MAX_AXES] {
    let plan = |axis: usize, duration_s: f64| {
        let cruise_m_s = feed_m_s.min(limits[axis].velocity_max_m_s);
        ToRest::plan(now[axis], line.to_m[axis], &limits[axis], cruise_m_s, duration_s)
    };
    let slowest_s = (0..MAX_AXES).map(|axis| plan(axis, 0.0).duration_s()).fold(0.0, f64::max);
    std::array::from_fn(|axis| plan(axis, slowest_s))
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests;
