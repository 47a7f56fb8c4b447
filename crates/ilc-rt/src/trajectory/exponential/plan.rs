//! An E/S move of several legs: the kind and α of each end, and the motion at any time.

use super::choice::{AlphaChoice, AlphaMax, MARGIN, choose};
use super::equations::blending_ratio;
use super::leg::{End, Leg, PlacedLeg};
use crate::interpolate::MAX_AXES;
use crate::interpolate::limits::is_positive;
use crate::interpolate::line::Line;
use crate::interpolate::{AxisLimits, MoveError, PathLimits, Quantity};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{CYCLE_S, n_ticks};
use crate::trajectory::motion::{MotionState, SampledMotion};
use crate::trajectory::path::{PathSegment, checked_lines};

/// Directions closer than this count as the same line.
const SAME_LINE: f64 = 1e-9;
/// Shares of each limit that an end reserves for later ends, tried in order. Zero, except for a leg
/// so short that its ends overlap.
const RESERVES: [f64; 3] = [MARGIN, 1e-3, 0.03];

/// A straight leg with an oscillation along it, as modulated tool paths have.
#[derive(Clone, Debug, PartialEq)]
pub struct ModulatedSegment {
    /// End point, one coordinate per axis.
    pub to_m: Vec<f64>,
    /// Feed of the line.
    pub feed_m_s: f64,
    /// Amplitude along the line; 0 for none.
    pub amplitude_m: f64,
    /// Frequency of the oscillation; ignored if the amplitude is 0.
    pub frequency_hz: f64,
}

/// A planned E/S move from rest to rest.
#[derive(Clone, Debug)]
pub struct ExponentialSigmoid {
    legs: Box<[PlacedLeg]>,
    choices: Box<[AlphaChoice]>,
    n_axes: usize,
    duration_s: f64,
}

impl ExponentialSigmoid {
    /// Plans a move in which every leg keeps its programmed time, `length / feed`.
    ///
    /// Each start, transition and end gets the largest α at which no axis exceeds a limit; all axes
    /// share one α, so that a leg stays straight. The oscillation is 0 near corners, so that it
    /// does not overshoot them. If a leg is so short that its ends overlap, they are checked
    /// together, the earlier one having the larger α.
    ///
    /// # Shapes
    /// - `limits`: one entry for each coordinate of `start_m`, 1 to [`MAX_AXES`]
    /// # Real Time
    /// Cold: allocates, and searches.
    /// # Errors
    /// [`TrajectoryError`] for values out of range; [`TrajectoryError::Programmed`] for an
    /// oscillation beyond the limits; [`TrajectoryError::Alpha`] if no α satisfies them (a start
    /// overshoots its feed by 79 %, and has to decay within its leg); [`TrajectoryError::Hurried`]
    /// for a leg that is too short for its ends.
    /// # Source
    /// - \[dimarco2016\], Section 2.1
    pub fn plan(
        start_m: &[f64],
        segments: &[ModulatedSegment],
        limits: &[AxisLimits],
    ) -> Result<Self, TrajectoryError> {
        Self::plan_below(start_m, segments, limits, &AlphaMax::default())
    }

    /// Plans like [`plan`](Self::plan), with upper bounds of α: a gentler move than the limits
    /// allow can have a lower cost (Fig. 2.15).
    ///
    /// # Shapes
    /// - as [`plan`](Self::plan)
    /// # Real Time
    /// Cold: allocates, and searches.
    /// # Errors
    /// As [`plan`](Self::plan); [`TrajectoryError::AlphaMax`] for a bound so small that an end does
    /// not fit its leg.
    /// # Source
    /// - \[dimarco2016\], Section 2.3.3
    pub fn plan_below(
        start_m: &[f64],
        segments: &[ModulatedSegment],
        limits: &[AxisLimits],
        alpha_max: &AlphaMax,
    ) -> Result<Self, TrajectoryError> {
        let straight: Vec<PathSegment> = segments
            .iter()
            .map(|segment| PathSegment::line(segment.to_m.clone(), segment.feed_m_s))
            .collect();
        let lines = checked_lines(start_m, &straight, limits)?;
        for (index, (segment, line)) in segments.iter().zip(&lines).enumerate() {
            check_oscillation(index, segment)?;
            let along = PathLimits::along(&line.direction, limits, f64::INFINITY);
            check_programmed(index, segment, &along)?;
        }
        let bare = placed(segments, &lines)?;
        let mut first_refusal = None;
        for reserve in RESERVES {
            let mut legs = bare.clone();
            match choose(&mut legs, limits, reserve, alpha_max) {
                Ok(choices) => {
                    let duration_s =
                        legs.last().map_or(0.0, |last| last.start_s + last.leg.duration_s);
                    return Ok(Self {
                        legs: legs.into_boxed_slice(),
                        choices: choices.into_boxed_slice(),
                        n_axes: start_m.len(),
                        duration_s,
                    });
                }
                Err(refusal @ TrajectoryError::Alpha { .. }) => {
                    first_refusal.get_or_insert(refusal);
                }
                Err(other) => return Err(other),
            }
        }
        Err(first_refusal.unwrap_or(TrajectoryError::Empty))
    }

    /// Returns every α with its admissible intervals.
    pub fn choices(&self) -> &[AlphaChoice] {
        &self.choices
    }

    /// Duration of the move: the sum of `length / feed`.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.n_axes
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

    /// Returns the state at a time from the start; at rest before it and after the end.
    ///
    /// # Real Time
    /// Hot: does not allocate; a few exponentials.
    pub fn at(&self, t_s: f64) -> MotionState {
        let Some((placed, local_s)) = self.find(t_s) else {
            return MotionState::at_rest(match (self.legs.first(), self.legs.last()) {
                (Some(_), Some(last)) if t_s >= self.duration_s => last.line.to_m,
                (Some(first), _) => first.line.from_m,
                _ => [0.0; MAX_AXES],
            });
        };
        let (motion, from_end) = placed.leg.at(local_s);
        let anchor_m = if from_end { placed.line.to_m } else { placed.line.from_m };
        let [s, v, a, j] = motion.0;
        let mut state = MotionState {
            position_m: placed.line.along(s),
            velocity_m_s: placed.line.along(v),
            acceleration_m_s2: placed.line.along(a),
            jerk_m_s3: placed.line.along(j),
        };
        for (position_m, anchor_m) in state.position_m.iter_mut().zip(anchor_m) {
            *position_m += anchor_m;
        }
        state
    }

    /// Position of the program at a time, without limits: the reference of the tracking error.
    pub fn programmed_m(&self, t_s: f64) -> [f64; MAX_AXES] {
        let Some((placed, local_s)) = self.find(t_s) else { return self.at(t_s).position_m };
        let mut position_m = placed.line.along(placed.leg.programmed_m(local_s));
        for (position_m, from_m) in position_m.iter_mut().zip(placed.line.from_m) {
            *position_m += from_m;
        }
        position_m
    }

    /// Returns the leg at a time within the move, and the time from its start.
    fn find(&self, t_s: f64) -> Option<(&PlacedLeg, f64)> {
        if !(0.0..self.duration_s).contains(&t_s) {
            return None;
        }
        let at = self.legs.partition_point(|placed| placed.start_s <= t_s).checked_sub(1)?;
        let placed = self.legs.get(at)?;
        Some((placed, (t_s - placed.start_s).min(placed.leg.duration_s)))
    }
}

/// Places each leg in time, with the kinds of its ends.
fn placed(
    segments: &[ModulatedSegment],
    lines: &[Line],
) -> Result<Vec<PlacedLeg>, TrajectoryError> {
    let mut legs: Vec<PlacedLeg> = Vec::with_capacity(lines.len());
    let mut start_s = 0.0;
    for (index, (line, segment)) in lines.iter().zip(segments).enumerate() {
        let duration_s = line.length_m / segment.feed_m_s;
        if !(duration_s.is_finite() && duration_s > 0.0) {
            return Err(MoveError::Duration { length: line.length_m, duration_s }.into());
        }
        // No run of any cycle lasts so long.
        n_ticks(duration_s, CYCLE_S.1)?;
        let mut leg = Leg {
            feed_m_s: segment.feed_m_s,
            amplitude_m: segment.amplitude_m,
            omega_rad_s: std::f64::consts::TAU
                * if segment.amplitude_m > 0.0 { segment.frequency_hz } else { 1.0 },
            duration_s,
            ends: [End::Rest; 2],
            alpha: [None; 2],
        };
        if let Some(before) = index.checked_sub(1).and_then(|at| legs.get_mut(at)) {
            let turn = (0..MAX_AXES).fold([0.0_f64; 2], |[on, back], axis| {
                let (a, b) = (before.line.direction[axis], line.direction[axis]);
                [on.max((a - b).abs()), back.max((a + b).abs())]
            });
            let sign = match turn {
                [on, _] if on < SAME_LINE => Some(1.0),
                [_, back] if back < SAME_LINE => Some(-1.0),
                _ => None,
            };
            if let Some(sign) = sign {
                let ratio = blending_ratio(before.leg.feed_m_s, sign * leg.feed_m_s);
                before.leg.ends[1] = End::Transition { neighbour_m_s: sign * leg.feed_m_s, ratio };
                leg.ends[0] = End::Transition { neighbour_m_s: sign * before.leg.feed_m_s, ratio };
            }
        }
        legs.push(PlacedLeg { leg, line: *line, start_s });
        start_s += duration_s;
    }
    Ok(legs)
}

fn check_oscillation(index: usize, segment: &ModulatedSegment) -> Result<(), TrajectoryError> {
    if !(segment.amplitude_m.is_finite() && segment.amplitude_m >= 0.0) {
        let amplitude = segment.amplitude_m;
        return Err(TrajectoryError::Amplitude { segment: index, amplitude });
    }
    if segment.amplitude_m > 0.0 && !is_positive(segment.frequency_hz) {
        let frequency_hz = segment.frequency_hz;
        return Err(TrajectoryError::Frequency { segment: index, frequency_hz });
    }
    Ok(())
}

/// Refuses an oscillation that is beyond the limits where it is fully open.
fn check_programmed(
    index: usize,
    segment: &ModulatedSegment,
    limits: &PathLimits,
) -> Result<(), TrajectoryError> {
    if segment.amplitude_m == 0.0 {
        return Ok(());
    }
    let omega = std::f64::consts::TAU * segment.frequency_hz;
    let speed_m_s = segment.amplitude_m * omega;
    for (quantity, reached, limit) in [
        (Quantity::Velocity, segment.feed_m_s + speed_m_s, limits.velocity_m_s),
        (Quantity::Acceleration, speed_m_s * omega, limits.acceleration_m_s2),
        (Quantity::Jerk, speed_m_s * omega * omega, limits.jerk_m_s3),
    ] {
        if reached > limit {
            return Err(TrajectoryError::Programmed { segment: index, quantity, reached, limit });
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests;
