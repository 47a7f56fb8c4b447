//! Tick of a path with exact stops: one jerk-limited move per segment, at rest at each corner.
//!
//! Moves are not rounded to ticks: each is evaluated at the time of the whole run, so no set point
//! waits for the grid, and the limits hold between set points as well as at them.

use super::MAX_AXES;
use super::element::{Element, Leg};
use super::error::MoveError;
use super::limits::AxisLimits;
use super::profile::JerkLimited;
use super::setpoint::Setpoint;

/// One segment: its element, its profile and its start time.
#[derive(Clone, Debug)]
struct Move {
    element: Element,
    profile: JerkLimited,
    start_s: f64,
    end_s: f64,
}

/// The segments of a run, and the current one.
#[derive(Clone, Debug)]
pub(crate) struct ExactStop {
    moves: Box<[Move]>,
    current: usize,
}

impl ExactStop {
    /// Plans one move per leg; the first begins at `start_s`. Cold.
    pub(crate) fn plan(
        legs: &[Leg],
        mut start_s: f64,
        limits: &[AxisLimits],
    ) -> Result<Self, MoveError> {
        let mut plan_move = |&Leg { element, feed_m_s, dwell_s }: &Leg| {
            let along = element.limits(limits, feed_m_s);
            let profile = JerkLimited::along(element.length_m(), &along)?;
            let end_s = start_s + profile.duration_s();
            let planned = Move { element, profile, start_s, end_s };
            start_s = end_s + dwell_s;
            Ok(planned)
        };
        let moves = legs.iter().map(&mut plan_move).collect::<Result<Box<[_]>, _>>()?;
        Ok(Self { moves, current: 0 })
    }

    /// Returns the end time of the last move.
    pub(crate) fn end_s(&self) -> f64 {
        self.moves.last().map_or(0.0, |last| last.end_s)
    }

    /// Restarts at the first move.
    pub(crate) fn restart(&mut self) {
        self.current = 0;
    }

    /// Returns the set point at a time not earlier than that of the previous call.
    pub(crate) fn at(&mut self, t_s: f64) -> Setpoint {
        while self.current + 1 < self.moves.len() && t_s >= self.moves[self.current].end_s {
            self.current += 1;
        }
        self.on_move(self.current, t_s)
    }

    /// Returns the set point at a time at most one tick before that of the last call of [`at`](Self::at).
    pub(crate) fn between(&self, t_s: f64) -> Setpoint {
        // The look-ahead may have entered the next moves.
        let mut place = self.current;
        while place > 0 && t_s < self.moves[place - 1].end_s {
            place -= 1;
        }
        self.on_move(place, t_s)
    }

    /// Returns the set point of a move; at rest after its end.
    fn on_move(&self, place: usize, t_s: f64) -> Setpoint {
        let Some(now) = self.moves.get(place) else {
            return Setpoint::at_rest([0.0; MAX_AXES]);
        };
        if t_s >= now.end_s {
            return Setpoint::at_rest(now.element.end_m());
        }
        let state = now.profile.at(t_s - now.start_s);
        Setpoint {
            position_m: now.element.point_m(state.s_m),
            velocity_m_s: now.element.along(state.s_m, state.v_m_s),
            done: false,
        }
    }
}
