//! A curve from rest to rest, as fast as its limits allow.

use super::Curve;
use super::arc_length::ArcLength;
use super::frame::{Frame, norm};
use super::time_law::{Tick, TimeLaw};
use super::turn::{Piece, pieces};
use crate::interpolate::AxisLimits;
use crate::interpolate::MAX_AXES;
use crate::interpolate::Quantity;
use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{CYCLE_S, check_time, n_ticks};
use crate::trajectory::motion::{MotionState, SampledMotion};
use crate::trajectory::path::check_limits;
use crate::trajectory::verify::Verification;

/// Places on the curve at which the speed limit is computed.
const PLACES: usize = 4_000;
/// Most places, for long curves.
const PLACES_MAX: usize = 60_000;
/// Shares of acceleration for the bend and for speeding up, of jerk for each of its three parts.
const SHARE: f64 = 0.7;
const JERK_SHARE: f64 = 0.4;
/// What the search asks for, on frames between the places, and the proof, on exact ones; the rest is
/// for what lies between two ticks.
const SOUGHT: f64 = 1.0 - 2e-3;
const KEPT: f64 = 1.0 - 5e-4;
/// Share of the feed below which going round a bend takes longer than coming to rest in it.
const CREEP_SHARE: f64 = 0.05;
/// How near a turn, in steps between places, the direction is looked at.
const EDGE_SHARE: f64 = 1e-3;
/// Attempts that slow down only where a limit is broken, and attempts in all.
const LOCAL_ROUNDS: usize = 16;
const ROUNDS: usize = 40;

/// What a run along a curve may do.
#[derive(Clone, Debug, PartialEq)]
pub struct RunLimits {
    /// Programmed speed: never exceeded along the path.
    pub feed_m_s: f64,
    /// Highest acceleration across the path, `v² κ`; infinite for none but the axes' own.
    pub curvature_acceleration_m_s2: f64,
    /// Limits of the axes.
    pub axes: Vec<AxisLimits>,
}

/// A planned run: one row a tick.
#[derive(Clone, Debug)]
pub struct Run {
    motion: SampledMotion,
    length_m: f64,
}

/// A value beyond its limit: how much slower it has to be, and what it is.
#[derive(Clone, Copy, Debug)]
struct Worst {
    slower: f64,
    reached: f64,
    limit: f64,
    axis: usize,
    quantity: Quantity,
}

impl Run {
    /// Plans a run: `v` is at most the feed, `√(a_c/κ)`, and what every axis allows, rises and falls
    /// with limited acceleration and jerk, and the finished set points are verified: slower, first
    /// where a limit is broken and then everywhere, until each axis holds velocity, acceleration and
    /// jerk at every tick and over every cycle. Where the curve turns back, or bends more tightly than
    /// the plan can see, it comes to rest.
    ///
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// [`TrajectoryError`] for values out of range, a curve that stands still, or limits that no
    /// speed holds.
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
        let across = limits.curvature_acceleration_m_s2;
        if across.is_nan() || across <= 0.0 {
            return Err(TrajectoryError::Shape {
                name: "curvature_acceleration_m_s2",
                value: across,
                allowed: "above 0",
            });
        }
        let length_m = ArcLength::new(curve)?.total_m();
        let step_m = length_m / (places(length_m, limits.feed_m_s, dt_s) - 1) as f64;
        let creep_m = creep_radius_m(limits);
        let mut refused = None;
        for radius_m in [creep_m.max(0.01 * step_m), creep_m.max(3.0 * step_m)] {
            let mut motion =
                SampledMotion { dt_s, n_axes: curve.n_axes(), ..SampledMotion::default() };
            let mut planned = Ok(());
            let mut gone_m = 0.0;
            for piece in pieces(curve, radius_m) {
                match plan_piece(&piece, limits, dt_s, gone_m) {
                    Ok((next, length_m)) => {
                        append(&mut motion, &next);
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

    /// The set points.
    pub fn motion(&self) -> &SampledMotion {
        &self.motion
    }

    /// Length of the curve.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }
}

/// Plans one piece from rest to rest, `before_m` along the curve; gives its set points and its length.
fn plan_piece<C: Curve>(
    piece: &Piece<C>,
    limits: &RunLimits,
    dt_s: f64,
    before_m: f64,
) -> Result<(SampledMotion, f64), TrajectoryError> {
    let measured = ArcLength::new(piece)?;
    let length_m = measured.total_m();
    let n_places = places(length_m, limits.feed_m_s, dt_s);
    let step_m = length_m / (n_places - 1) as f64;
    // In a turn the curve has no direction: it has that of a place nearby.
    let frame = |s_m: f64, edge_m: f64| {
        let [low_m, high_m] = [edge_m, length_m - edge_m];
        let inside_m = match piece.turns {
            [true, _] if s_m < low_m => low_m,
            [_, true] if s_m > high_m => high_m,
            _ => s_m,
        };
        let here = curve_at(piece, &measured, inside_m);
        let mut frame = Frame::new(here);
        if (inside_m - s_m).abs() > 0.0 {
            frame.point_m = curve_at(piece, &measured, s_m)[0];
        }
        frame
    };
    let lowest =
        |of: fn(&AxisLimits) -> f64| limits.axes.iter().map(of).fold(f64::INFINITY, f64::min);
    let jerk = JERK_SHARE * lowest(|axis| axis.jerk_max_m_s3);
    // Not more than what the jerk lets a change of speed by the feed make use of.
    let mut acceleration =
        (SHARE * lowest(|axis| axis.acceleration_max_m_s2)).min((jerk * limits.feed_m_s).sqrt());
    let mut window = ticks_at_least(2.0 * acceleration / (jerk * dt_s));
    let frames: Vec<Frame> =
        (0..n_places).map(|i| frame(i as f64 * step_m, 0.5 * step_m)).collect();
    let mut speed: Vec<f64> = Vec::with_capacity(n_places);
    for (i, here) in frames.iter().enumerate() {
        let allowed = speed_limit(here, limits);
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
    let mut worst: Option<(Worst, f64)> = None;
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
        let near: Vec<Frame> = ticks.iter().map(|tick| between(&frames, tick.s / step_m)).collect();
        let mut found = judge(&ticks, &near, limits, SOUGHT);
        if found.iter().all(Option::is_none) {
            let exact: Vec<Frame> =
                ticks.iter().map(|tick| frame(tick.s, EDGE_SHARE * step_m)).collect();
            found = judge(&ticks, &exact, limits, KEPT);
            if found.iter().all(Option::is_none) {
                let motion = sampled(&ticks, &exact, piece.n_axes(), dt_s);
                found = sent(&motion, &limits.axes);
                if found.iter().all(Option::is_none) {
                    return Ok((motion, length_m));
                }
            }
        }
        worst = None;
        for (tick, next) in ticks.iter().zip(&found) {
            let Some(next) = next else { continue };
            if worst.is_none_or(|(most, _)| next.slower < most.slower) {
                worst = Some((*next, before_m + tick.s));
            }
        }
        let Some((most, _)) = worst else { continue };
        if round < LOCAL_ROUNDS {
            slow_down(&mut speed, &ticks, &found, step_m, window);
        } else {
            let factor = most.slower.min(0.98);
            for v in &mut speed {
                *v *= factor;
            }
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

/// The speed that a run reaches at each place from rest in a turn, or to rest: it is slow there by
/// itself, and the tightest bend, which is there, slows down nothing else.
fn launch_speeds(
    turns: [bool; 2],
    n_places: usize,
    step_m: f64,
    acceleration: f64,
    jerk: f64,
) -> Vec<f64> {
    (0..n_places)
        .map(|i| {
            let from = if turns[0] { i as f64 * step_m } else { f64::INFINITY };
            let to = if turns[1] { (n_places - 1 - i) as f64 * step_m } else { f64::INFINITY };
            let gone_m = from.min(to);
            let by_jerk = 0.5 * jerk.cbrt() * (6.0 * gone_m).powf(2.0 / 3.0);
            by_jerk.min((2.0 * acceleration * gone_m).sqrt())
        })
        .collect()
}

/// The radius of a bend that no axis goes round faster than at a small share of the feed.
fn creep_radius_m(limits: &RunLimits) -> f64 {
    let v = CREEP_SHARE * limits.feed_m_s;
    let tightest = |axis: &AxisLimits| {
        let by_jerk = (v.powi(3) / (JERK_SHARE * axis.jerk_max_m_s3)).sqrt();
        by_jerk.max(v * v / (SHARE * axis.acceleration_max_m_s2))
    };
    limits.axes.iter().map(tightest).fold(0.0, f64::max)
}

/// The derivatives at a distance from the start.
fn curve_at(curve: &impl Curve, measured: &ArcLength, s_m: f64) -> super::Derivatives {
    curve.at(measured.parameter(curve, s_m))
}

/// Adds a motion that begins where the other one rests.
fn append(motion: &mut SampledMotion, next: &SampledMotion) {
    let skipped = if motion.position_m.is_empty() { 0 } else { next.n_axes };
    motion.position_m.extend_from_slice(&next.position_m[skipped..]);
    motion.velocity_m_s.extend_from_slice(&next.velocity_m_s[skipped..]);
    motion.acceleration_m_s2.extend_from_slice(&next.acceleration_m_s2[skipped..]);
    motion.programmed_m.extend_from_slice(&next.programmed_m[skipped..]);
}

/// The worst excess of the set points at every tick, by their differences.
fn sent(motion: &SampledMotion, limits: &[AxisLimits]) -> Vec<Option<Worst>> {
    let mut found: Vec<Option<Worst>> = vec![None; motion.n_samples()];
    let last = motion.n_samples() - 1;
    let rows = &motion.position_m;
    Verification::of_motion(rows, limits, motion.dt_s).each_excess(rows, |excess| {
        let order = match excess.quantity {
            Quantity::Velocity => 1.0,
            Quantity::Acceleration => 2.0,
            Quantity::Jerk => 3.0,
        };
        let worst = Worst {
            slower: (KEPT * excess.limit / excess.reached.abs()).powf(1.0 / order),
            reached: excess.reached.abs(),
            limit: excess.limit,
            axis: excess.axis,
            quantity: excess.quantity,
        };
        let here = &mut found[excess.row.min(last)];
        if here.is_none_or(|here| worst.slower < here.slower) {
            *here = Some(worst);
        }
        true
    });
    found
}

/// A few places for each tick of the feed, but never too few nor too many.
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

/// The speed that one place allows.
fn speed_limit(here: &Frame, limits: &RunLimits) -> f64 {
    let mut speed = limits.feed_m_s;
    let mut lower = |bound: f64| {
        // Not `f64::min`, which would lose what is not a number, and with it the refusal.
        if bound < speed || bound.is_nan() {
            speed = bound;
        }
    };
    lower((limits.curvature_acceleration_m_s2 / norm(&here.bend)).sqrt());
    for (axis, limit) in limits.axes.iter().enumerate() {
        let jerk = JERK_SHARE * limit.jerk_max_m_s3;
        lower(limit.velocity_max_m_s / here.tangent[axis].abs());
        lower((SHARE * limit.acceleration_max_m_s2 / here.bend[axis].abs()).sqrt());
        lower((jerk / here.twist[axis].abs()).cbrt());
    }
    speed
}

/// The frame between two places, as far along as the fraction.
fn between(frames: &[Frame], at: f64) -> Frame {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places on the curve"
    )]
    let i = (at.max(0.0) as usize).min(frames.len().saturating_sub(2));
    let (a, b, share) = (&frames[i], &frames[i + 1], (at - i as f64).clamp(0.0, 1.0));
    let mix = |of: fn(&Frame) -> &[f64; MAX_AXES]| -> [f64; MAX_AXES] {
        std::array::from_fn(|axis| of(a)[axis] + share * (of(b)[axis] - of(a)[axis]))
    };
    Frame {
        point_m: mix(|frame| &frame.point_m),
        tangent: mix(|frame| &frame.tangent),
        bend: mix(|frame| &frame.bend),
        twist: mix(|frame| &frame.twist),
    }
}

/// The worst excess of every tick over its share of the limits.
fn judge(ticks: &[Tick], frames: &[Frame], limits: &RunLimits, kept: f64) -> Vec<Option<Worst>> {
    let mut before_j = 0.0;
    let quantities = [Quantity::Velocity, Quantity::Acceleration, Quantity::Jerk];
    ticks
        .iter()
        .zip(frames)
        .map(|(tick, frame)| {
            let mut worst: Option<Worst> = None;
            let mut note = |reached: f64, limit: f64, order: usize, axis: usize| {
                let ratio = reached / limit;
                let slower = (kept / ratio).powf(1.0 / (order + 1) as f64);
                if ratio > kept && worst.is_none_or(|worst| slower < worst.slower) {
                    let quantity = quantities[order];
                    worst = Some(Worst { slower, reached, limit, axis, quantity });
                }
            };
            for (axis, limit) in limits.axes.iter().enumerate() {
                for jerk in [before_j, tick.j] {
                    let values = frame.axis(axis, tick.v, tick.a, jerk);
                    for (order, (_, most)) in limit.named().into_iter().enumerate() {
                        note(values[order].abs(), most, order, axis);
                    }
                }
            }
            let across = tick.v * tick.v * norm(&frame.bend);
            note(across, limits.curvature_acceleration_m_s2, 1, 0);
            before_j = tick.j;
            worst
        })
        .collect()
}

/// Lowers the speed limit around every tick that is too fast.
fn slow_down(
    speed: &mut [f64],
    ticks: &[Tick],
    found: &[Option<Worst>],
    step_m: f64,
    window: usize,
) {
    let mut factor = vec![1.0_f64; speed.len()];
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places on the curve"
    )]
    let place = |s_m: f64| ((s_m / step_m).max(0.0) as usize).min(speed.len() - 1);
    for (k, worst) in found.iter().enumerate() {
        let Some(worst) = worst else { continue };
        let from = place(ticks[k.saturating_sub(window)].s);
        let to = place(ticks[(k + window).min(ticks.len() - 1)].s + step_m);
        for factor in &mut factor[from..=to] {
            *factor = factor.min(worst.slower);
        }
    }
    for (speed, factor) in speed.iter_mut().zip(factor) {
        // A little more than asked for, as a slower place also means a steeper way to it.
        *speed *= if factor < 1.0 { factor * 0.995 } else { 1.0 };
    }
}

fn sampled(ticks: &[Tick], frames: &[Frame], n_axes: usize, dt_s: f64) -> SampledMotion {
    let mut motion = SampledMotion { dt_s, n_axes, ..SampledMotion::default() };
    for (tick, frame) in ticks.iter().zip(frames) {
        let mut state = MotionState::at_rest(frame.point_m);
        for axis in 0..n_axes {
            [state.velocity_m_s[axis], state.acceleration_m_s2[axis], state.jerk_m_s3[axis]] =
                frame.axis(axis, tick.v, tick.a, tick.j);
        }
        motion.position_m.extend_from_slice(&state.position_m[..n_axes]);
        motion.velocity_m_s.extend_from_slice(&state.velocity_m_s[..n_axes]);
        motion.acceleration_m_s2.extend_from_slice(&state.acceleration_m_s2[..n_axes]);
    }
    motion.programmed_m = motion.position_m.clone();
    motion
}

/// Axes of a shape that lies in a plane.
pub(super) fn flat(values: [[f64; 2]; 4]) -> super::Derivatives {
    values.map(|[x, y]| {
        let mut point = [0.0; MAX_AXES];
        (point[0], point[1]) = (x, y);
        point
    })
}
