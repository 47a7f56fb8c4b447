//! A curve from rest to rest, as fast as its limits allow.

use super::Curve;
use super::arc_length::ArcLength;
use super::excess::{Excess, KEPT, SOUGHT, of_set_points, of_ticks, slow_down};
use super::frame::{Frame, norm};
use super::inverse::Inverse;
use super::speed::{RunLimits, launch_speeds};
use super::time_law::{Tick, TimeLaw};
use super::turn::{Piece, pieces};
use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{CYCLE_S, check_time, n_ticks};
use crate::trajectory::motion::{MotionState, SampledMotion};
use crate::trajectory::path::check_limits;

/// Number of points on the curve at which the speed limit is computed.
const PLACES: usize = 4_000;
/// Largest number of points, for long curves.
const PLACES_MAX: usize = 60_000;
/// Distance from a turn, in steps between places, at which its direction is taken.
const EDGE_SHARE: f64 = 1e-3;
/// Attempts that slow down only where a limit is violated, and attempts in all.
const LOCAL_ROUNDS: usize = 16;
const ROUNDS: usize = 40;

/// A planned run: one row per tick.
#[derive(Clone, Debug)]
pub struct Run {
    motion: SampledMotion,
    length_m: f64,
}

impl Run {
    /// Plans a run: `v` is at most the feed, `√(a_c/κ)`, and what every axis allows, with limited
    /// acceleration and jerk. The finished set points are verified, and slowed down, first where a
    /// limit is violated and then everywhere, until each axis keeps velocity, acceleration and jerk
    /// at every tick and over every cycle. Where the curve turns back, or bends too tightly for the
    /// plan, it comes to rest.
    ///
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// [`TrajectoryError`] for values out of range, a curve with a vanishing derivative, or limits
    /// that no speed satisfies.
    /// # Source
    /// - [filter-ilc]: curvature-limited speed
    pub fn plan(
        curve: &impl Curve,
        limits: &RunLimits,
        dt_s: f64,
    ) -> Result<Self, TrajectoryError> {
        check_limits(curve.n_axes(), &limits.axes)?;
        check_time("sample time", dt_s, CYCLE_S)?;
        let most = "finite numbers above 0";
        if !is_positive(limits.feed_m_s) {
            return Err(TrajectoryError::Shape {
                name: "feed_m_s",
                value: limits.feed_m_s,
                allowed: most,
            });
        }
        let across = limits.curvature_acceleration_max_m_s2;
        if across.is_nan() || across <= 0.0 {
            return Err(TrajectoryError::Shape {
                name: "curvature_acceleration_max_m_s2",
                value: across,
                allowed: "above 0",
            });
        }
        let length_m = ArcLength::new(curve)?.total_m();
        let step_m = length_m / (places(length_m, limits.feed_m_s, dt_s) - 1) as f64;
        let creep_m = limits.creep_radius_m();
        let mut refused = None;
        for radius_m in [creep_m.max(0.01 * step_m), creep_m.max(3.0 * step_m)] {
            let mut motion =
                SampledMotion { dt_s, n_axes: curve.n_axes(), ..SampledMotion::default() };
            let mut planned = Ok(());
            let mut gone_m = 0.0;
            for piece in pieces(curve, radius_m) {
                match plan_piece(&piece, limits, dt_s, gone_m) {
                    Ok((next, length_m)) => {
                        motion.append(&next);
                        gone_m += length_m;
                    }
                    Err(error) => {
                        planned = Err(error);
                        break;
                    }
                }
            }
            // The joints of the pieces are verified with the whole.
            match planned.and_then(|()| motion.verified(&limits.axes)) {
                Ok(motion) => return Ok(Self { motion, length_m }),
                Err(
                    error @ (TrajectoryError::Unproven { .. } | TrajectoryError::SetPoint { .. }),
                ) => {
                    refused = Some(error);
                }
                Err(error) => return Err(error),
            }
        }
        Err(refused.unwrap_or(TrajectoryError::Empty))
    }

    /// Returns the set points.
    pub fn motion(&self) -> &SampledMotion {
        &self.motion
    }

    /// Returns the length of the curve.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }
}

/// Plans one piece from rest to rest, `before_m` along the curve; returns its set points and its
/// length.
fn plan_piece<C: Curve>(
    piece: &Piece<C>,
    limits: &RunLimits,
    dt_s: f64,
    before_m: f64,
) -> Result<(SampledMotion, f64), TrajectoryError> {
    let measured = ArcLength::new(piece)?;
    let length_m = measured.total_m();
    let table = Inverse::new(piece, &measured);
    let n_places = places(length_m, limits.feed_m_s, dt_s);
    let step_m = length_m / (n_places - 1) as f64;
    // In a turn the direction of the curve is undefined: that of a nearby point is used.
    let frame = |s_m: f64, edge_m: f64| {
        let [low_m, high_m] = [edge_m, length_m - edge_m];
        let inside_m = match piece.turns {
            [true, _] if s_m < low_m => low_m,
            [_, true] if s_m > high_m => high_m,
            _ => s_m,
        };
        let here = piece.at(table.parameter(inside_m));
        let mut frame = Frame::new(here);
        if (inside_m - s_m).abs() > 0.0 {
            frame.point_m = piece.at(table.parameter(s_m))[0];
        }
        frame
    };
    let (mut acceleration, jerk) = limits.along();
    let mut window = ticks_at_least(2.0 * acceleration / (jerk * dt_s));
    let frames: Vec<Frame> =
        (0..n_places).map(|i| frame(i as f64 * step_m, 0.5 * step_m)).collect();
    let mut speed: Vec<f64> = Vec::with_capacity(n_places);
    for (i, here) in frames.iter().enumerate() {
        let allowed = limits.speed_m_s(here);
        if !is_positive(allowed) {
            return Err(TrajectoryError::Cusp { at: before_m + i as f64 * step_m });
        }
        speed.push(allowed);
    }
    let launch = launch_speeds(piece.turns, n_places, step_m, acceleration, jerk);
    for (speed, launch) in speed.iter_mut().zip(&launch) {
        if *launch < *speed {
            *speed = limits.feed_m_s;
        }
    }
    let mut worst: Option<(Excess, f64)> = None;
    for round in 0..ROUNDS {
        // Speeding up in a bend takes the jerk 3 K v a.
        let accelerations: Vec<f64> = frames
            .iter()
            .zip(speed.iter().zip(&launch))
            .map(|(frame, (v, launch))| {
                acceleration
                    .min(jerk / (3.0 * norm(&frame.bend) * v.min(*launch).max(f64::MIN_POSITIVE)))
            })
            .collect();
        let law = TimeLaw {
            length_m,
            speed_m_s: &speed,
            acceleration_m_s2: &accelerations,
            window,
            dt_s,
        };
        n_ticks(law.swept_s() + 2.0 * window as f64 * dt_s, dt_s)?;
        let ticks = law.ticks();
        // A frame is large: one at a time, as there may be millions of ticks.
        let near = ticks.iter().map(|tick| Frame::between(&frames, tick.s / step_m));
        let mut found = of_ticks(&ticks, near, limits, SOUGHT);
        if found.is_empty() {
            let mut motion = SampledMotion { dt_s, n_axes: piece.n_axes(), ..Default::default() };
            let exact = ticks.iter().map(|tick| {
                let frame = frame(tick.s, EDGE_SHARE * step_m);
                push(&mut motion, tick, &frame);
                frame
            });
            found = of_ticks(&ticks, exact, limits, KEPT);
            if found.is_empty() {
                motion.programmed_m.clone_from(&motion.position_m);
                found = of_set_points(&motion, &limits.axes);
                if found.is_empty() {
                    return Ok((motion, length_m));
                }
            }
        }
        worst = None;
        for (&row, next) in &found {
            if worst.is_none_or(|(most, _)| next.slower < most.slower) {
                worst = Some((*next, before_m + ticks[row].s));
            }
        }
        let Some((most, _)) = worst else { continue };
        if round < LOCAL_ROUNDS {
            slow_down(&mut speed, &ticks, &found, step_m, window);
        } else {
            let factor = most.slower.min(0.98);
            speed = speed.iter().map(|v| v * factor).collect();
            acceleration *= factor * factor;
            window = ticks_at_least(window as f64 / factor);
        }
    }
    Err(worst.map_or(TrajectoryError::Empty, |(worst, at_m)| TrajectoryError::Unproven {
        axis: worst.axis,
        at: at_m,
        quantity: worst.quantity,
        reached: worst.reached,
        limit: worst.limit,
        rounds: ROUNDS,
    }))
}

/// A few points per tick of the feed, within bounds.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a range of small positive numbers"
)]
fn places(length_m: f64, feed_m_s: f64, dt_s: f64) -> usize {
    (length_m / (feed_m_s * dt_s)).clamp(PLACES as f64, PLACES_MAX as f64) as usize
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a range of small positive numbers"
)]
fn ticks_at_least(ticks: f64) -> usize {
    ticks.ceil().clamp(1.0, 1e7) as usize
}

/// Appends the set point of a tick, without its programmed position.
fn push(motion: &mut SampledMotion, tick: &Tick, frame: &Frame) {
    let n_axes = motion.n_axes;
    let mut state = MotionState::at_rest(frame.point_m);
    for axis in 0..n_axes {
        [state.velocity_m_s[axis], state.acceleration_m_s2[axis], state.jerk_m_s3[axis]] =
            frame.axis(axis, tick.v, tick.a, tick.j);
    }
    motion.position_m.extend_from_slice(&state.position_m[..n_axes]);
    motion.velocity_m_s.extend_from_slice(&state.velocity_m_s[..n_axes]);
    motion.acceleration_m_s2.extend_from_slice(&state.acceleration_m_s2[..n_axes]);
}
