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
use crate::trajectory::motion::{MotionState, SampledMotion};
use crate::trajectory::path::{PathSegment, check_limits, checked_line, point};

mod approach;
mod axis_state;
mod to_rest;

use self::axis_state::AxisState;
use self::to_rest::ToRest;

/// Start of the next move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSetting {
    /// At the end of the one before it: amplitude is kept, frequency falls.
    CompleteEveryMove,
    /// At its programmed time: frequency is kept, amplitude falls.
    StartOnTime,
}

/// Execution of a move.
#[derive(Clone, Copy, Debug)]
enum Course {
    /// Along its line, from rest to rest.
    Straight(JerkLimited),
    /// Every axis from its current state; the first of them in the list of all.
    Axes(usize),
}

#[derive(Clone, Debug)]
struct Move {
    line: Line,
    course: Course,
    start_s: f64,
    programmed_s: f64,
}

/// A planned program of straight moves to rest.
#[derive(Clone, Debug)]
pub struct Linear {
    moves: Vec<Move>,
    /// Motions of all axes of the moves that do not begin at rest.
    axes: Vec<ToRest>,
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
    pub fn plan<'a>(
        start_m: &[f64],
        segments: &'a [PathSegment],
        limits: &[AxisLimits],
        setting: LinearSetting,
    ) -> Result<Self, TrajectoryError> {
        check_limits(start_m.len(), limits)?;
        let start = starting(start_m, &[], limits)?;
        let straight = |(segment, planned): (usize, &'a PathSegment)| match planned.arc {
            None => Ok((&planned.to_m[..], planned.feed_m_s)),
            Some(_) => Err(TrajectoryError::NotStraight { segment }),
        };
        Self::planned(&start, segments.iter().enumerate().map(straight), limits, setting)
    }

    /// Plans straight moves through points, beginning in motion; otherwise as [`Linear::plan`] does.
    ///
    /// The first move takes each axis from its velocity, without acceleration, to the target; an
    /// axis faster than the feed slows down to it.
    ///
    /// # Shapes
    /// - `points_m`: rows of one coordinate for each entry of `limits`; the first is the start
    /// - `feeds_m_s`: one for each further row
    /// - `start_velocity_m_s`: one for each entry of `limits`, or none for a start at rest
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// Those of [`Linear::plan`]; [`TrajectoryError::Shape`] for other numbers of them, and
    /// [`TrajectoryError::StartVelocity`] for one beyond its limit.
    /// # Source
    /// - \[dimarco2016\], Chapter 2: both settings
    pub fn through(
        points_m: &[f64],
        feeds_m_s: &[f64],
        start_velocity_m_s: &[f64],
        limits: &[AxisLimits],
        setting: LinearSetting,
    ) -> Result<Self, TrajectoryError> {
        let n_axes = limits.len();
        check_limits(n_axes, limits)?;
        if points_m.len() != (feeds_m_s.len() + 1) * n_axes {
            return Err(TrajectoryError::Shape {
                name: "number of coordinates",
                value: points_m.len() as f64,
                allowed: "one for each axis, of the start and of the end of each move",
            });
        }
        let (start_m, ends_m) = points_m.split_at(n_axes);
        let start = starting(start_m, start_velocity_m_s, limits)?;
        let moves = ends_m.chunks_exact(n_axes).zip(feeds_m_s);
        Self::planned(&start, moves.map(|(to_m, feed_m_s)| Ok((to_m, *feed_m_s))), limits, setting)
    }

    /// Plans moves, each given by its end and its feed, from a state.
    fn planned<'a>(
        start: &[AxisState; MAX_AXES],
        moves: impl ExactSizeIterator<Item = Result<(&'a [f64], f64), TrajectoryError>>,
        limits: &[AxisLimits],
        setting: LinearSetting,
    ) -> Result<Self, TrajectoryError> {
        if moves.len() == 0 {
            return Err(TrajectoryError::Empty);
        }
        let mut plan = Self {
            moves: Vec::with_capacity(moves.len()),
            axes: Vec::new(),
            n_axes: limits.len(),
            duration_s: 0.0,
            nominal_s: 0.0,
        };
        let (mut start_s, mut from_m) = (0.0, start.map(|axis| axis.p));
        for (index, planned) in moves.enumerate() {
            let (to_m, feed_m_s) = planned?;
            let line = checked_line(index, from_m, to_m, feed_m_s, plan.n_axes)?;
            from_m = line.to_m;
            let now = if index == 0 {
                Some(*start)
            } else if setting == LinearSetting::CompleteEveryMove {
                None
            } else {
                Some(plan.state(start_s))
            };
            let duration_s;
            let course = if let Some(now) = now.filter(|now| !rests(now, &line.from_m)) {
                let first = plan.axes.len();
                duration_s = plan.add_together(&now, &line, limits, feed_m_s);
                Course::Axes(first)
            } else {
                let along = PathLimits::along(&line.direction, limits, feed_m_s);
                let profile = JerkLimited::along(line.length_m, &along)?;
                duration_s = profile.duration_s();
                Course::Straight(profile)
            };
            plan.duration_s = start_s + duration_s;
            let length_m = line.length_m;
            if !plan.duration_s.is_finite() {
                let duration_s = plan.duration_s;
                return Err(MoveError::Duration { length: length_m, duration_s }.into());
            }
            plan.moves.push(Move { line, course, start_s, programmed_s: plan.nominal_s });
            plan.nominal_s += length_m / feed_m_s;
            start_s = match setting {
                LinearSetting::CompleteEveryMove => plan.duration_s,
                LinearSetting::StartOnTime => plan.nominal_s,
            };
        }
        Ok(plan)
    }

    /// Plans every axis to the end of a line, all arriving with the slowest if possible, and
    /// returns the duration.
    fn add_together(
        &mut self,
        now: &[AxisState; MAX_AXES],
        line: &Line,
        limits: &[AxisLimits],
        feed_m_s: f64,
    ) -> f64 {
        let first = self.axes.len();
        self.axes.extend(limits.iter().enumerate().map(|(axis, limits)| {
            let cruise_m_s = feed_m_s.min(limits.velocity_max_m_s);
            ToRest::fastest(now[axis], line.to_m[axis], limits, cruise_m_s)
        }));
        let latest_s = |axes: &[ToRest]| axes.iter().map(ToRest::duration_s).fold(0.0, f64::max);
        let slowest_s = latest_s(&self.axes[first..]);
        for motion in &mut self.axes[first..] {
            *motion = motion.slowed(slowest_s);
        }
        latest_s(&self.axes[first..])
    }

    /// Duration until every axis rests.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the times from the start at which the moves begin, one a move.
    pub fn starts_s(&self) -> impl ExactSizeIterator<Item = f64> {
        self.moves.iter().map(|planned| planned.start_s)
    }

    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.n_axes
    }

    /// Evaluates positions, velocities and accelerations at any times from the start.
    ///
    /// # Shapes
    /// - each `n_times` x `n_axes`, time first
    /// # Real Time
    /// Cold: allocates.
    pub fn tables_at(&self, times_s: &[f64]) -> [Vec<f64>; 3] {
        let n_axes = self.n_axes();
        let mut tables = [(); 3].map(|()| Vec::with_capacity(times_s.len() * n_axes));
        for t_s in times_s {
            let state = self.at(*t_s);
            let values = [state.position_m, state.velocity_m_s, state.acceleration_m_s2];
            for (table, values) in tables.iter_mut().zip(values) {
                table.extend_from_slice(&values[..n_axes]);
            }
        }
        tables
    }

    /// Samples the motion, see [`SampledMotion::sample`].
    ///
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// Those of [`SampledMotion::sample`].
    pub fn sampled(&self, dt_s: f64) -> Result<SampledMotion, TrajectoryError> {
        let at = |t_s| (self.at(t_s), self.programmed_m(t_s));
        SampledMotion::sample(self.duration_s(), dt_s, self.n_axes(), at)
    }

    /// Returns the state at a time from the start: that of the start before it and, at rest at the
    /// last target, after the end.
    ///
    /// # Real Time
    /// Hot: does not allocate.
    pub fn at(&self, t_s: f64) -> MotionState {
        let mut found = MotionState::at_rest([0.0; MAX_AXES]);
        for (axis, state) in self.state(t_s.max(0.0)).into_iter().enumerate() {
            found.position_m[axis] = state.p;
            found.velocity_m_s[axis] = state.v;
            found.acceleration_m_s2[axis] = state.a;
            found.jerk_m_s3[axis] = state.j;
        }
        found
    }

    /// Returns the state of every axis at a time from the start.
    fn state(&self, t_s: f64) -> [AxisState; MAX_AXES] {
        let mut state = [AxisState::default(); MAX_AXES];
        let at = self.moves.partition_point(|planned| planned.start_s <= t_s).max(1) - 1;
        let Some(planned) = self.moves.get(at) else { return state };
        let t_s = t_s - planned.start_s;
        match &planned.course {
            Course::Axes(first) => {
                for (axis, motion) in state.iter_mut().zip(&self.axes[*first..first + self.n_axes])
                {
                    *axis = motion.at(t_s);
                }
            }
            Course::Straight(profile) => {
                let along = profile.at(t_s);
                let point_m = planned.line.point_m(along.s_m);
                for (axis, state) in state.iter_mut().enumerate().take(self.n_axes) {
                    let share = planned.line.direction[axis];
                    *state = AxisState {
                        p: point_m[axis],
                        v: share * along.v_m_s,
                        a: share * along.a_m_s2,
                        j: share * along.j_m_s3,
                    };
                }
            }
        }
        state
    }

    /// Position of the program at a time, without limits.
    pub fn programmed_m(&self, t_s: f64) -> [f64; MAX_AXES] {
        let at = self.moves.partition_point(|planned| planned.programmed_s <= t_s).max(1) - 1;
        let Some(planned) = self.moves.get(at) else { return [0.0; MAX_AXES] };
        let end_s = self.moves.get(at + 1).map(|next| next.programmed_s);
        let duration_s = end_s.unwrap_or(self.nominal_s) - planned.programmed_s;
        let share = ((t_s - planned.programmed_s) / duration_s).clamp(0.0, 1.0);
        planned.line.point_m(share * planned.line.length_m)
    }

    /// Duration of the program without limits.
    pub fn nominal_s(&self) -> f64 {
        self.nominal_s
    }
}

/// Returns true for axes at rest at a point.
fn rests(state: &[AxisState; MAX_AXES], at_m: &[f64; MAX_AXES]) -> bool {
    state.iter().zip(at_m).all(|(state, p)| *state == AxisState { p: *p, ..AxisState::default() })
}

/// Checks the start of a program, and returns its state.
fn starting(
    start_m: &[f64],
    start_velocity_m_s: &[f64],
    limits: &[AxisLimits],
) -> Result<[AxisState; MAX_AXES], TrajectoryError> {
    let (found, expected) = (start_velocity_m_s.len(), start_m.len());
    if found != expected && found != 0 {
        return Err(TrajectoryError::Shape {
            name: "number of start velocities",
            value: found as f64,
            allowed: "one for each coordinate of the start, or none",
        });
    }
    let mut start = point(start_m)?.map(|p| AxisState { p, ..AxisState::default() });
    for (axis, state) in start.iter_mut().enumerate().take(expected) {
        let v = start_velocity_m_s.get(axis).copied().unwrap_or(0.0);
        let limit = limits[axis].velocity_max_m_s;
        if !(-limit..=limit).contains(&v) {
            return Err(TrajectoryError::StartVelocity { axis, velocity: v, limit });
        }
        state.v = v;
    }
    Ok(start)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests;
